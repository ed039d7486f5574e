"""Tables of numbers to serialized ROS 2 messages, thousands at a time: the reverse of `outrider.io._ros_wire.decode`.

rosbags serializes one blank message per topic; numpy fills in the numbers of all the others.
"""

from collections.abc import Iterator, Mapping
from typing import Any, final

import numpy as np

from outrider.io._ros_wire import Leaf, encode, layout, leaves
from outrider.typing import Ints

BLOCK = 2048  # messages that are encoded together
_LINK = "geometry_msgs/msg/TransformStamped"


@final
class Messages:
    """The message types of one ROS distribution."""

    def __init__(self) -> None:
        from rosbags.typesys import Stores, get_typestore

        self.store = get_typestore(Stores.ROS2_JAZZY)

    def make(self, msgtype: str, given: Mapping[str, Any] | None = None, prefix: str = "") -> Any:
        """A message that is zero except for what is given by dotted name, e.g. {"header.frame_id": "map"}."""
        from rosbags.interfaces import Nodetype

        given = given or {}
        values: dict[str, Any] = {}
        definition: list[Any] = list(self.store.fielddefs[msgtype][1])
        for name, (node, what) in definition:
            path = prefix + name
            if path in given:
                values[name] = given[path]
            elif node == Nodetype.NAME:
                values[name] = self.make(what, given, f"{path}.")
            elif node == Nodetype.BASE:
                values[name] = "" if what[0] == "string" else 0
            else:
                values[name] = np.zeros(what[1] if node == Nodetype.ARRAY else 0)
        return self.store.types[msgtype](**values)

    def pack(self, message: Any) -> bytes:
        """One message serialized."""
        return bytes(self.store.serialize_cdr(message, message.__msgtype__))

    def stream(
        self, msgtype: str, strings: Mapping[str, str], t: Ints, columns: Mapping[str, Any]
    ) -> Iterator[tuple[int, bytes]]:
        """(t, message) for every stamp t [ns]; columns by dotted name, (n,) or (n, k)."""
        fields = leaves(self.store.fielddefs, msgtype)
        return fill(self.pack(self.make(msgtype, strings)), fields or [], t, columns)

    def links(self, parent: str, child: str, t: Ints, p: Any, q: Any) -> Iterator[tuple[int, bytes]]:
        """A /tf message with one transform parent <- child for every stamp; p (n, 3), q (n, 4)."""
        link = self.make(_LINK, {"header.frame_id": parent, "child_frame_id": child})
        template = self.pack(self.store.types["tf2_msgs/msg/TFMessage"](transforms=[link]))
        fields = [Leaf("length", "u4"), *(leaves(self.store.fielddefs, _LINK) or [])]
        columns = {**vector("transform.translation", p), **vector("transform.rotation", q)}
        return fill(template, fields, t, columns)


def vector(name: str, values: Any) -> dict[str, Any]:
    """(n, k) values as the columns name.x, name.y ..."""
    return {f"{name}.{axis}": values[:, i] for i, axis in enumerate("xyzw"[: values.shape[1]])}


def fill(template: bytes, fields: list[Leaf], t: Ints, columns: Mapping[str, Any]) -> Iterator[tuple[int, bytes]]:
    """(t, message) for every stamp t [ns]: a serialized message with the named columns replaced, see `stream`."""
    shape = layout(fields, template, ros2=True)
    for i in range(0, t.size, BLOCK):
        part = slice(i, i + BLOCK)
        stamps = t[part]
        values = {name: column[part] for name, column in columns.items()}
        values |= {"header.stamp.sec": stamps // 10**9, "header.stamp.nanosec": stamps % 10**9}
        yield from zip(stamps.tolist(), encode(shape, template, values, stamps.size), strict=True)
