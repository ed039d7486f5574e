"""CARMEN logs (.clf, also as .gz and .bz2): odometry and planar lasers, one message a line.

A line ends in the time of the message, the computer's name and the time of logging, which counts from another zero:
its delay against the quickest line is the latency. Old laser lines do not say their geometry, but their number of
readings does.
"""

import bz2
import gzip
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import BinaryIO, Final, cast, final

import numpy as np

from outrider.core.attitudes import rpy_to_quats
from outrider.data import EventLog, Kind, Stream, stream
from outrider.io.files import Progress, assemble, ensure_readable
from outrider.io.stamps import to_nanoseconds
from outrider.typing import Floats, Ints

DEGREE: Final = np.pi / 180
OPENERS: Final[Mapping[bytes, Callable[[BinaryIO], BinaryIO]]] = {
    b"BZh": lambda f: cast("BinaryIO", bz2.BZ2File(f)),
    b"\x1f\x8b": lambda f: cast("BinaryIO", gzip.GzipFile(fileobj=f)),
}  # fmt: skip
OLD_LASERS: Final = {"FLASER": "front_laser", "RLASER": "rear_laser"}
NEW_LASERS: Final = tuple(f"{kind}LASER{k}" for kind in ("RAW", "ROBOT") for k in range(1, 6))
OFFSETS: Final = {"robot_frontlaser_offset": ("front_laser", 0.0), "robot_rearlaser_offset": ("rear_laser", np.pi)}
REACH: Final = "robot_front_laser_max"
SICK_REACH: Final = 81.0  # m: larger values of these lasers are codes for "nothing seen"
REPORT_EVERY: Final = 1 << 10  # lines


@final
@dataclass(slots=True)
class Lines:
    """Numbers of the lines of one kind, with their stamps as text."""

    stamps: list[str] = field(default_factory=list[str])
    logged: list[str] = field(default_factory=list[str])
    rows: list[Floats] = field(default_factory=list[Floats])


@final
@dataclass(slots=True)
class Log:
    """What a file holds. broken : lines that could not be read, by kind."""

    kinds: dict[str, Lines] = field(default_factory=dict[str, Lines])
    parameters: dict[str, str] = field(default_factory=dict[str, str])
    broken: dict[str, int] = field(default_factory=dict[str, int])
    cut: bool = False


def opened(file: BinaryIO) -> BinaryIO:
    """A file as it is, or unpacked; at its beginning."""
    head = file.read(3)
    file.seek(0)
    opener = next((o for magic, o in OPENERS.items() if head.startswith(magic)), None)
    return file if opener is None else opener(file)


def read_carmen(
    path: Path,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Read a CARMEN log.

    Streams: `ODOM` (the base's pose), `ODOM#twist` (its speeds), and a SCAN for each laser under its message's name;
    where there are no ODOM lines, the poses beside the scans stand in, as `FLASER#odom` and `FLASER#twist`. Lasers'
    offsets become mounts. TRUEPOS is truth and never read.
    """
    log = _read(ensure_readable(path), progress)
    broken = sum(log.broken.values())
    notes = [f"{broken} lines could not be read and were left out"] if broken else []
    streams = [replace(s, robot=robot) for s in _streams(log, notes)]
    if log.cut:
        notes.append("the file is truncated or damaged: what could be unpacked was read")
    out = assemble(path, streams, notes=notes, topics=topics, start_s=start_s, end_s=end_s)
    return replace(out, mounts=_mounts(log))


def _read(path: Path, progress: Progress | None) -> Log:
    out, size = Log(), path.stat().st_size
    with path.open("rb") as packed, opened(packed) as f:
        for number, line in enumerate(up_to_damage(f, out)):
            if progress is not None and number % REPORT_EVERY == 0:
                progress(packed.tell(), size)
            _take(line.decode("ascii", "replace").split(), out)
    return out


def up_to_damage(f: BinaryIO, out: Log | None = None) -> Iterator[bytes]:
    """The lines of a file, as far as it can be unpacked; `out.cut` tells whether that was all."""
    try:
        yield from f
    except (OSError, EOFError, zlib.error):
        if out is not None:
            out.cut = True


def _take(cells: list[str], out: Log) -> None:
    if len(cells) < 3 or cells[0].startswith("#"):
        return
    kind = cells[0]
    if kind == "PARAM":
        out.parameters[cells[1]] = cells[2]
    elif kind == "ODOM" or kind in OLD_LASERS or kind in NEW_LASERS:
        try:
            row = np.array(cells[1:-3], np.float64)
            dated = np.isfinite(float(cells[-3]))
        except ValueError:
            row, dated = np.zeros(0), False
        if not (dated and _complete(kind, row)):
            out.broken[kind] = out.broken.get(kind, 0) + 1
            return
        lines = out.kinds.setdefault(kind, Lines())
        lines.stamps.append(cells[-3])
        lines.logged.append(cells[-1])
        lines.rows.append(row)


def _complete(kind: str, row: Floats) -> bool:
    """Whether a line has as many numbers as it says."""
    if not np.isfinite(row).all():
        return False  # overwritten
    if kind == "ODOM":
        return row.size == 6
    if kind in OLD_LASERS:
        return row.size > 7 and row.size == 1 + row[0] + 6
    return row.size > 8 and row[7] >= 1 and row.size >= 9 + row[7]


def _streams(log: Log, notes: list[str]) -> list[Stream]:
    out: list[Stream] = []
    if "ODOM" in log.kinds:
        lines = log.kinds["ODOM"]
        (t, arrival), rows = _times(lines), np.array(lines.rows)
        out.append(replace(_poses("ODOM", t, arrival, rows[:, :3]), malformed=log.broken.get("ODOM", 0)))
        if rows[:, 3:5].any() or not np.ptp(rows[:, :3], axis=0).any():
            out.append(_twists("ODOM#twist", t, arrival, rows[:, 3], rows[:, 4]))
        else:
            notes.append("ODOM moves and says speed 0 throughout: its speeds are the differences of its poses")
            out += _differences("ODOM#twist", t, arrival, rows[:, :3])
    for kind in (*OLD_LASERS, *NEW_LASERS):
        if kind in log.kinds:
            out.append(_old_scans(kind, log) if kind in OLD_LASERS else _new_scans(kind, log))
            if kind in OLD_LASERS and "ODOM" not in log.kinds and len(out) == 1:
                lines = log.kinds[kind]
                (t, arrival), p = _times(lines), np.array([r[-3:] for r in lines.rows])
                out += [_poses(f"{kind}#odom", t, arrival, p), *_differences(f"{kind}#twist", t, arrival, p)]
    return out


def _times(lines: Lines) -> tuple[Ints, Ints]:
    """(n,) stamps and arrivals [ns]."""
    t, _ = to_nanoseconds(lines.stamps, "s")
    logged, known = to_nanoseconds(lines.logged, "s")
    late = logged - t
    return t, t + (np.where(known, late - late[known].min(), 0) if known.any() else 0)


def _poses(name: str, t: Ints, arrival: Ints, p: Floats) -> Stream:
    flat = np.zeros((t.size, 1))
    q = rpy_to_quats(np.column_stack([flat, flat, p[:, 2]]))
    return stream(name, Kind.ODOMETRY_POSE, t, np.hstack([p[:, :2], flat, q]), t_arrival=arrival)


def _twists(name: str, t: Ints, arrival: Ints, v: Floats, w: Floats) -> Stream:
    z = np.full((t.size, 6), np.nan)
    z[:, 0], z[:, 1], z[:, 5] = v, 0.0, w  # the base cannot move sideways
    return stream(name, Kind.TWIST, t, z, t_arrival=arrival)


def _differences(name: str, t: Ints, arrival: Ints, p: Floats) -> list[Stream]:
    """Speeds by the differences of poses, stamped in the middle."""
    later = np.flatnonzero(np.diff(t) > 0)
    if not later.size:
        return []
    dt, d = np.diff(t)[later], np.diff(p, axis=0)[later]
    turn = np.arctan2(np.sin(d[:, 2]), np.cos(d[:, 2]))
    middle = p[later, 2] + 0.5 * turn
    forward = d[:, 0] * np.cos(middle) + d[:, 1] * np.sin(middle)
    seconds = dt * 1e-9
    return [_twists(name, t[later] + dt // 2, arrival[later + 1], forward / seconds, turn / seconds)]


def _old_scans(kind: str, log: Log) -> Stream:
    """Half a circle ahead, or 100 degrees for 400 readings; an even number leaves the last one out."""
    lines = log.kinds[kind]
    reach = min(SICK_REACH, _number(log.parameters.get(REACH, "")))
    count = _usual([float(r[0]) for r in lines.rows])
    begin, whole = (-50.0, 100.0) if count in (400, 401) else (-90.0, 180.0)
    step = whole / (count if count % 2 == 0 else max(count - 1, 1))
    geometry = (begin * DEGREE, step * DEGREE, reach)
    ranges = [(r[1 : 1 + count] if r[0] == count else None, geometry) for r in lines.rows]
    return _scans(kind, OLD_LASERS[kind], lines, ranges, log.broken.get(kind, 0))


def _new_scans(kind: str, log: Log) -> Stream:
    """These say first angle, field of view, step, and reach."""
    lines = log.kinds[kind]
    count = _usual([float(r[7]) for r in lines.rows])
    ranges = [
        (r[8 : 8 + count] if r[7] == count else None, (float(r[1]), float(r[3]), float(r[4]))) for r in lines.rows
    ]
    return _scans(kind, kind.lower(), lines, ranges, log.broken.get(kind, 0))


Ranges = Sequence[tuple[Floats | None, tuple[float, float, float]]]


def _scans(name: str, frame: str, lines: Lines, ranges: Ranges, broken: int) -> Stream:
    """Scans of the usual number of readings; others are malformed."""
    t, arrival = _times(lines)
    whole = np.array([i for i, (r, _) in enumerate(ranges) if r is not None], np.int64)
    z = np.array([ranges[i][0] for i in whole], np.float64)
    geometry = np.array([ranges[i][1] for i in whole], np.float64)
    seen = np.where(z >= geometry[:, 2:], np.inf, z)
    extra = dict(zip(("angle_min", "angle_step", "range_max"), geometry.T, strict=True))
    bad = broken + len(ranges) - whole.size
    return stream(name, Kind.SCAN, t[whole], seen, t_arrival=arrival[whole], frame=frame, extra=extra, malformed=bad)


def _usual(counts: Sequence[float]) -> int:
    return int(Counter(counts).most_common(1)[0][0])


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        return SICK_REACH
    return value if value > 0 else SICK_REACH


def _mounts(log: Log) -> dict[str, Floats]:
    """(4, 4) body-from-laser transforms that the parameters tell."""
    out: dict[str, Floats] = {}
    for key, (frame, yaw) in OFFSETS.items():
        if key in log.parameters:
            c, s = np.cos(yaw), np.sin(yaw)
            forward = _signed(log.parameters[key])
            out[frame] = np.array([[c, -s, 0, forward], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    return out


def _signed(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        return 0.0
    return value if np.isfinite(value) else 0.0
