"""Messages into one MCAP file, in the order of their times; the file appears when it is complete, or not at all."""

import heapq
from collections.abc import Iterator, Mapping
from operator import itemgetter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

from outrider.errors import DataError
from outrider.io._ros_encode import Messages
from outrider.io.files import replacing

Source: TypeAlias = tuple[str, str, Iterator[tuple[int, bytes]]]
"""Topic, message type, and its messages in time order."""


def write_bag(
    path: Path, messages: Messages, sources: list[Source], about: Mapping[str, str], *, force: bool = False
) -> None:
    """Write one MCAP file; `about` is its metadata.

    Raises OutputExistsError if it is there already (unless `force`), UsageError if it cannot be written.
    """
    with replacing(path, force=force) as part, TemporaryDirectory(dir=path.parent, prefix=".mcap.") as room:
        bag = Path(room) / "bag"  # the writer makes a directory of this name; only its data file is wanted
        try:
            _write(bag, messages, sources, about)
            (bag / "bag.mcap").replace(part)
        except OSError as e:
            raise DataError(f"cannot be written: {(e.strerror or str(e)).lower()}", where=str(path)) from None


def _write(bag: Path, messages: Messages, sources: list[Source], about: Mapping[str, str]) -> None:
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    writer = Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    for key, value in about.items():
        writer.set_custom_data(key, value)
    with writer:
        connections = [
            writer.add_connection(
                topic, kind, typestore=messages.store, offered_qos_profiles=[_latched()] * topic.endswith("static")
            )
            for topic, kind in dict.fromkeys((topic, kind) for topic, kind, _ in sources)
        ]
        of = {c.topic: c for c in connections}
        tagged = [_tagged(of[topic], rows) for topic, _, rows in sources]
        for t, connection, raw in heapq.merge(*tagged, key=itemgetter(0)):
            writer.write(connection, max(t, 0), raw)  # a delay may date records back to before power-on


def _tagged(connection: Any, rows: Iterator[tuple[int, bytes]]) -> Iterator[tuple[int, Any, bytes]]:
    for t, raw in rows:
        yield t, connection, raw


def _latched() -> Any:
    """What subscribers of /tf_static expect: the last message is kept for those who come late."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    never = QosTime(0, 0)
    return Qos(
        QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, never, never,
        QosLiveliness.SYSTEM_DEFAULT, never, False,
    )  # fmt: skip
