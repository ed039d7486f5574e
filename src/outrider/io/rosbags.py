"""Reads ROS 1 bags and ROS 2 bags (a directory, a bare .mcap or .db3) into an `EventLog`.

A topic becomes a stream of its own name; an Imu that claims an attitude also becomes `<topic>#attitude`, an Odometry
`<topic>` (twist) and `<topic>#pose`, a GPSFix `<topic>` and `<topic>#velocity`. A topic on which several
sensors speak (several frame names) becomes one stream per frame, `<topic>@<frame>` from the second on. Frame names lose
a leading "/".
`Stream.var` of a GNSS stream is (east, north, up) in m^2, although its columns are (lat, lon, alt).
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from outrider.data import EventLog, Kind, Stream
from outrider.errors import DataError
from outrider.io._ros_container import Bag, open_bags
from outrider.io._ros_messages import HECTOPASCALS, MESSAGES, ON_REQUEST
from outrider.io._ros_tf import Links
from outrider.io._ros_topics import Topic
from outrider.io._ros_wire import FieldDefs, leaves
from outrider.io.files import Progress, as_text, closest, sha256

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

Topics: TypeAlias = dict[tuple[str, str], Topic]

_TF = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_STEP = 4096  # records between two calls of the progress callback


def read_rosbag(
    path: Path,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Every record of a ROS recording that fusion can use.

    t is the header's stamp (a stamp of zero stays zero), t_arrival the time of recording. Rotation variances are turned
    from ROS's fixed axes to the body's. What is not used, damaged or dropped stands in the notes.

    topics : names to read, all if None;  start_s, end_s : seconds since the first record, by time of recording

    Raises DataError for what is no recording, cannot be opened, or holds nothing of use.
    """
    path = Path(path)
    notes: list[str] = []
    links = Links()
    with ExitStack() as stack:
        bags = open_bags(path, stack, notes)
        wanted = _wanted(path, bags, topics)
        begin = min(bag.start for bag in bags)
        start = None if start_s is None else begin + round(start_s * 1e9)
        stop = None if end_s is None else begin + round(end_s * 1e9) + 1
        sinks: Topics = {}
        done, total = 0, sum(bag.size for bag in bags)
        for bag in bags:
            _read_still_links(bag, links, notes)
            for share in _read_topics(bag, wanted, sinks, links, start, stop, notes):
                if progress:
                    progress(done + round(share * bag.size), total)
            done += bag.size
        notes = _unused(bags, wanted, sinks) + notes
    streams = _settle([s for sink in sinks.values() for s in sink.finish(robot)], notes)
    if not any(len(s) for s in streams.values()):
        raise _nothing_found(path, streams, notes, start_s is not None or end_s is not None)
    digest = sha256(path)
    if digest.startswith("head-tail"):
        notes.append("a large recording: its digest covers the head, the tail and the size of each file")
    return EventLog(streams=streams, path=as_text(path), sha256=digest, notes=tuple(notes), mounts=links.mounts())


def _wanted(path: Path, bags: Sequence[Bag], topics: Sequence[str] | None) -> frozenset[str]:
    """Names of the topics to read; DataError if one of those asked for is not there."""
    there = frozenset(c.topic for bag in bags for c in bag.connections)
    if topics is None:
        return frozenset(c.topic for bag in bags for c in bag.connections if c.msgtype not in ON_REQUEST)
    for name in topics:
        if name not in there:
            raise DataError(f"no topic '{name}'", where=str(path), fix=closest(name, there))
    return frozenset(topics)


def _read_still_links(bag: Bag, links: Links, notes: list[str]) -> None:
    """All of /tf_static, whatever time span was asked for: it is sent once, at the beginning."""
    still = [c for c in bag.connections if c.msgtype in _TF and "static" in c.topic]
    decoders = {c.id: _decoder(c, ros2=bag.ros2) for c in still}
    for connection, _, raw in bag.messages(still, None, None, notes):
        _add_links(links, decoders[connection.id], raw)


def _add_links(links: Links, decode: Callable[[bytes], Any], raw: bytes) -> None:
    try:
        links.add(decode(raw))
    except Exception:  # an undecodable transform only means that a mount stays unknown
        return


def _read_topics(
    bag: Bag,
    wanted: Collection[str],
    sinks: Topics,
    links: Links,
    start: int | None,
    stop: int | None,
    notes: list[str],
) -> Iterable[float]:
    """Feed all messages of one file to its topics; yields the share that is done."""
    feeds: dict[int, Callable[[int, bytes], None]] = {}
    used: list[Connection] = []
    for c in bag.connections:
        if c.msgtype in _TF and "static" not in c.topic:
            feeds[c.id] = _link_feed(links, _decoder(c, ros2=bag.ros2))
        elif c.topic in wanted and (topic := _topic_of(c, bag, sinks, notes)):
            feeds[c.id] = topic.feed
        if c.id in feeds:
            used.append(c)
    total = max(1, sum(c.msgcount for c in used))
    for count, (connection, arrival, raw) in enumerate(bag.messages(used, start, stop, notes)):
        feeds[connection.id](arrival, raw)
        if count % _STEP == 0:
            yield min(1.0, count / total)
    yield 1.0


def _link_feed(links: Links, decode: Callable[[bytes], Any]) -> Callable[[int, bytes], None]:
    def feed(_: int, raw: bytes) -> None:
        if links.wants_next():
            _add_links(links, decode, raw)

    return feed


def _topic_of(connection: "Connection", bag: Bag, sinks: Topics, notes: list[str]) -> Topic | None:
    """Where the messages of a connection go: None if they are of no use, or cannot be understood."""
    key = connection.topic, connection.msgtype
    if connection.msgtype not in MESSAGES or key in sinks:
        return sinks.get(key)
    try:
        fields = leaves(_definitions(connection), connection.msgtype)
        made = Topic(connection.topic, connection.msgtype, fields, _decoder(connection, ros2=bag.ros2), ros2=bag.ros2)
        made.rehearse()
    except Exception as e:  # the parser of definitions has many ways to fail
        notes.append(
            f"{_title(connection)}: not read, its definition is missing or not the usual one ({type(e).__name__})"
        )
        return None
    return sinks.setdefault(key, made)


def _definitions(connection: "Connection") -> FieldDefs:
    """Field definitions that the log holds; recorders before ROS 2 Iron left them out, then Humble's are meant."""
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    base = get_typestore(Stores.EMPTY).fielddefs
    form, text = connection.msgdef.format, connection.msgdef.data
    if form == MessageDefinitionFormat.NONE:
        return get_typestore(Stores.ROS2_HUMBLE).fielddefs
    if form == MessageDefinitionFormat.MSG:
        return {**base, **get_types_from_msg(text, connection.msgtype)}
    parts = [part.split("\n", 1)[1] for part in text.split("=" * 80 + "\n") if part.startswith("IDL: ")] or [text]
    return {**base, **{name: fields for part in parts for name, fields in get_types_from_idl(part).items()}}


def _decoder(connection: "Connection", *, ros2: bool) -> Callable[[bytes], Any]:
    """rosbags' own decoding of single messages, prepared on first use."""
    ready: list[Callable[[bytes, str], Any]] = []

    def decode(raw: bytes) -> Any:
        if not ready:
            from rosbags.typesys import Stores, get_typestore

            store = get_typestore(Stores.EMPTY)
            store.register(dict(_definitions(connection)))
            ready.append(store.deserialize_cdr if ros2 else store.deserialize_ros1)
        return ready[0](raw, connection.msgtype)

    return decode


def _title(connection: "Connection") -> str:
    return f"{connection.topic} {connection.msgtype.replace('/msg/', '/')}"


def _unused(bags: Sequence[Bag], wanted: Collection[str], sinks: Topics) -> list[str]:
    """One line for each topic that gives nothing: not a type that fusion uses, or without a message."""
    counts: dict[str, int] = {}
    for c in (c for bag in bags for c in bag.connections if c.topic in wanted and c.msgtype not in _TF):
        if c.msgtype not in MESSAGES or not c.msgcount:
            counts[_title(c)] = counts.get(_title(c), 0) + c.msgcount
    return [f"{title}: {f'not used by fusion, {n} messages' if n else 'no message'}" for title, n in counts.items()]


def _settle(streams: Iterable[Stream], notes: list[str]) -> dict[str, Stream]:
    """Streams by name, without the half of an odometry that its driver leaves at zero; oddities go into the notes."""
    named: dict[str, Stream] = {}
    for s in streams:
        named[s.name if s.name not in named else f"{s.name}~{s.kind.name.lower()}"] = s
    for pose in [s for s in named.values() if s.kind is Kind.ODOMETRY_POSE]:
        twist = named.get(pose.name.removesuffix("#pose"))
        moved = bool(np.any(pose.z[1:, :3] != pose.z[:-1, :3]))
        if twist is not None and moved and not twist.z.any():
            notes.append(f"{twist.name}: the twist is zero throughout while the pose moves, not taken as a measurement")
            del named[twist.name]
        elif twist is not None and not moved and not pose.z[:, :3].any() and twist.z.any():
            notes.append(f"{pose.name}: the pose stays zero while the twist does not, not taken as a measurement")
            del named[pose.name]
    for s in named.values():
        if s.malformed:
            notes.append(f"{s.name}: {s.malformed} messages could not be decoded")
        if s.kind is Kind.BARO and np.any((s.extra["pressure"] > 0) & (s.extra["pressure"] < HECTOPASCALS)):
            notes.append(f"{s.name}: pressures are in hPa, not in Pa as the message defines, and were converted")
        if "@" in s.name:
            notes.append(f"{s.name}: a second frame speaks on this topic and became a stream of its own")
    return named


def _nothing_found(path: Path, streams: Collection[str], notes: Sequence[str], windowed: bool) -> DataError:
    if windowed:
        return DataError("no usable record in this time span", where=str(path), fix="widen it")
    what = "no message could be decoded" if streams else "holds no record that fusion can use"
    why = f"; {notes[0]}" if notes else ""
    return DataError(f"{what}{why}", where=str(path), fix="used are Imu, NavSatFix, Odometry, Twist, Pose and the like")
