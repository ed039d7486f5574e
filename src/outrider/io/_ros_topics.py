"""One topic of a recording: its serialized messages, decoded a block at a time into growing streams."""

from array import array
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any, TypeAlias, final

import numpy as np

from outrider.data import Stream, stream
from outrider.io._ros_messages import MESSAGES, VARIABLE, Block, Part
from outrider.io._ros_wire import Layout, Leaf, decode, layout, nothing

Decode: TypeAlias = Callable[[bytes], Any]
BLOCK = 2048  # messages that are decoded together


@final
@dataclass(slots=True)
class _Batch:
    """Messages of one layout that wait to be decoded."""

    shape: Layout
    raw: bytearray = field(default_factory=bytearray)
    arrival: "array[int]" = field(default_factory=lambda: array("q"))


@final
class _Growing:
    """One stream as blocks of rows."""

    def __init__(self, part: Part) -> None:
        self.kind, self.frame, self.suffix, self.altitude = part.kind, part.frame, part.suffix, part.altitude
        self.t: list[Any] = []
        self.t_arrival: list[Any] = []
        self.z: list[Any] = []
        self.var: list[Any] = []
        self.extra: dict[str, list[Any]] = {name: [] for name in part.extra}

    def add(self, t: Any, arrival: Any, part: Part) -> None:
        keep = slice(None) if part.keep is None else part.keep
        self.t.append(t[keep])
        self.t_arrival.append(arrival[keep])
        self.z.append(part.z[keep])
        self.var.append(part.var[keep])
        for name, column in part.extra.items():
            self.extra[name].append(column[keep])

    def finish(self, name: str, robot: str) -> Stream:
        arrival = np.concatenate(self.t_arrival)
        order = np.argsort(arrival, kind="stable")
        return stream(
            name, self.kind, np.concatenate(self.t)[order], np.concatenate(self.z)[order],
            var=np.concatenate(self.var)[order], t_arrival=arrival[order], robot=robot, frame=self.frame,
            altitude=self.altitude, extra={k: np.concatenate(v)[order] for k, v in self.extra.items()},
        )  # fmt: skip


@final
class Topic:
    """Turns the messages of one topic into streams, a block at a time."""

    def __init__(self, topic: str, msgtype: str, fields: list[Leaf] | None, message_of: Decode, *, ros2: bool) -> None:
        """fields : the layout's, or None for a type of variable length, which `message_of` decodes one by one."""
        self.topic, self.msgtype, self.ros2 = topic, msgtype, ros2
        self.count = self.malformed = 0
        self._read = MESSAGES[msgtype]
        self._fields, self._decode = fields, message_of
        self._batches: dict[tuple[bytes, int, bytes], _Batch] = {}
        self._batch: _Batch | None = None
        self._rows: list[tuple[Any, ...]] = []
        self._growing: dict[tuple[str, str], _Growing] = {}

    def rehearse(self) -> None:
        """Fails with a KeyError if the message, as this log defines it, lacks a field that is read."""
        none = self._no_rows()
        self._read(Block(none, self.topic, ""))
        if "header.stamp.sec" not in none or "header.stamp.nanosec" not in none:
            raise KeyError("header.stamp")

    def _no_rows(self) -> dict[str, Any]:
        names = () if self._fields else VARIABLE[self.msgtype]
        return nothing(self._fields or [Leaf(n, "f8", 9 if n == "position_covariance" else 1) for n in names])

    def feed(self, arrival: int, raw: bytes) -> None:
        """One serialized message."""
        self.count += 1
        if self._fields is None:
            self._feed_variable(arrival, raw)
            return
        batch = self._batch
        if batch is None or not batch.shape.fits(raw):
            batch = self._batch = self._batch_of(raw)
            if batch is None:
                self.malformed += 1
                return
        batch.raw += raw
        batch.arrival.append(arrival)
        if len(batch.arrival) >= BLOCK:
            self._flush(batch)

    def _batch_of(self, raw: bytes) -> _Batch | None:
        try:
            shape = layout(self._fields or (), raw, self.ros2)
        except ValueError:
            return None
        return self._batches.setdefault((shape.text, len(raw), shape.head), _Batch(shape))

    def _flush(self, batch: _Batch) -> None:
        if batch.arrival:
            self._add(decode(batch.shape, bytes(batch.raw)), np.array(batch.arrival, np.int64), batch.shape.strings)
        batch.raw, batch.arrival = bytearray(), array("q")

    def _feed_variable(self, arrival: int, raw: bytes) -> None:
        try:
            message = self._decode(raw)
            self._rows.append((arrival, message.header.frame_id, *attrgetter(*VARIABLE[self.msgtype])(message)))
        except Exception:  # struct, unicode and serialization errors of rosbags alike: the message is what is wrong
            self.malformed += 1

    def _flush_variable(self) -> None:
        names = VARIABLE.get(self.msgtype, ())
        for frame in dict.fromkeys(row[1] for row in self._rows):
            rows = [row for row in self._rows if row[1] == frame]
            columns = {name: _column([row[i] for row in rows]) for i, name in enumerate(names, start=2)}
            self._add(columns, np.array([row[0] for row in rows], np.int64), {"header.frame_id": frame})

    def _add(self, columns: dict[str, Any], arrival: Any, strings: dict[str, str]) -> None:
        t = columns["header.stamp.sec"].astype(np.int64) * 10**9 + columns["header.stamp.nanosec"]
        frame, child = (strings.get(name, "").lstrip("/") for name in ("header.frame_id", "child_frame_id"))
        with np.errstate(all="ignore"):  # a record of absurd numbers becomes infinite or NaN, and is refused later
            parts = self._read(Block(columns, self.topic, frame, child))
        for part in parts:
            self._growing.setdefault((part.suffix, part.frame), _Growing(part)).add(t, arrival, part)

    def finish(self, robot: str) -> list[Stream]:
        """All streams of the topic; the first carries the count of malformed messages."""
        for batch in self._batches.values():
            self._flush(batch)
        self._flush_variable()
        if not self._growing and self.malformed:
            self._add(self._no_rows(), np.zeros(0, np.int64), {})
        taken: set[str] = set()
        made: list[Stream] = []
        for grown in self._growing.values():
            first = grown.suffix not in taken
            taken.add(grown.suffix)
            name = f"{self.topic}{'' if first else '@' + grown.frame}{grown.suffix}"
            made.append(grown.finish(name, robot))
        if made:
            made[0] = replace(made[0], malformed=self.malformed)
        return [s for s in made if len(s) or s.malformed]


def _column(values: list[Any]) -> Any:
    """One field of many messages; arrays of changing length stay objects."""
    try:
        return np.array(values)
    except ValueError:
        out = np.empty(len(values), np.object_)
        out[:] = values
        return out
