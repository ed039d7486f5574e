"""Folders of text files of a team, as the UTIAS data sets of cooperative localisation: read, and written.

`RobotN_Odometry.dat` t v w; `RobotN_Measurement.dat` t barcode range bearing; `RobotN_Groundtruth.dat` t x y theta;
`Barcodes.dat` subject barcode; `Landmark_Groundtruth.dat` subject x y sx sy. Lines with # are comments; stamps are
Unix seconds. Source: Leung et al., The UTIAS multi-robot cooperative localization and mapping dataset, IJRR 2011.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from outrider.core.attitudes import rpy_to_quats
from outrider.data import EventLog, Kind, Stream, Trajectory, stream
from outrider.errors import DataError
from outrider.io.files import Progress, assemble, ensure_readable, replacing
from outrider.io.stamps import to_nanoseconds
from outrider.typing import Floats, Ints

ROBOT: Final = re.compile(r"Robot(\d+)_(Odometry|Measurement|Groundtruth)\.dat", re.IGNORECASE)
BARCODES: Final = "Barcodes.dat"
LANDMARKS: Final = "Landmark_Groundtruth.dat"
HEAD: Final = "# a team of robots: text files as in the UTIAS multi-robot data sets\n"
COLUMNS: Final = {"odometry": 2, "measurement": 3, "groundtruth": 3}  # after the stamp


class Table(NamedTuple):
    """Rows of one file. t : (n,) ns;  v : (n, columns);  broken : lines that could not be read."""

    t: Ints
    v: Floats
    broken: int


def mrclam_root(folder: Path) -> Path | None:
    """Where such files are: this folder or the only one inside it, as archives unpack; None if there are none."""
    inside = [p for p in folder.iterdir() if p.is_dir() and not p.name.startswith((".", "__"))]
    return next((f for f in (folder, *inside[: len(inside) == 1]) if _holds_odometry(f)), None)


def _holds_odometry(folder: Path) -> bool:
    return any((m := _robot_file(p.name)) is not None and m[1] == "odometry" for p in folder.iterdir())


def read_mrclam(
    path: Path,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Read such a folder; `robot` is not used: robots are robot1, robot2, ...

    Streams of each: `robot1/odometry` (TWIST), `robot1/measurement` (RANGE_BEARING, whose beacon is the *subject* that
    the barcode belongs to, or the negative barcode if it belongs to none) and `robot1/groundtruth`, an ESTIMATE, which
    is never fused. `EventLog.ids` tells which subject each robot is, `EventLog.beacons` where landmarks stand.

    Raises `DataError` for a folder without Barcodes.dat or odometry, and for two subjects with one barcode.
    """
    del robot
    path = mrclam_root(path) or path
    files = {p.name.lower(): p for p in sorted(path.iterdir())}
    notes: list[str] = []
    subject_of = _barcodes(_named(files, path, BARCODES))
    places = _landmarks(files.get(LANDMARKS.lower()), notes)
    found = sorted((m, p) for p in files.values() if (m := _robot_file(p.name)) is not None)
    streams: list[Stream] = []
    for done, ((number, kind), file) in enumerate(found):
        if progress is not None:
            progress(done, len(found))
        name = f"robot{number}"
        table = _rows(file, COLUMNS[kind])
        if table.broken:
            notes.append(f"{table.broken} lines of {file.name} could not be read and were left out")
        made = _STREAMS[kind](f"{name}/{kind}", table, subject_of)
        streams.append(replace(made, robot=name, malformed=table.broken))
    ids = {f"robot{n}": n for n in sorted({number for (number, _), _ in found})}
    lost = [n for n, i in ids.items() if i not in subject_of.values()]
    if lost:
        notes.append(f"{BARCODES} has no barcode of {', '.join(lost)}: nobody can recognise them")
    both = sorted(set(ids.values()) & set(places))
    if both:
        raise DataError(f"subject {both[0]} is a robot and a landmark", where=str(path / LANDMARKS))
    log = assemble(path, streams, notes=notes, topics=topics, start_s=start_s, end_s=end_s)
    return replace(log, ids=ids, beacons={float(k): v for k, v in places.items()})


def _robot_file(name: str) -> tuple[int, str] | None:
    m = ROBOT.fullmatch(name)
    return (int(m[1]), m[2].lower()) if m else None


def _named(files: Mapping[str, Path], folder: Path, name: str) -> Path:
    if name.lower() not in files:
        raise DataError(f"has no {name}", where=str(folder), fix="it tells which barcode is whose")
    return files[name.lower()]


def _barcodes(path: Path) -> dict[int, int]:
    """Subject of each barcode."""
    rows = _whole_rows(path, 2)
    codes = [int(r[1]) for r in rows]
    if not codes:
        raise DataError("holds no barcode", where=str(path), fix="a line is: subject barcode")
    twice = sorted({c for c in codes if codes.count(c) > 1})
    if twice:
        raise DataError(f"barcode {twice[0]} belongs to two subjects", where=str(path), fix="give each its own")
    return {int(r[1]): int(r[0]) for r in rows}


def _landmarks(path: Path | None, notes: list[str]) -> dict[int, tuple[float, float, float]]:
    if path is None:
        notes.append(f"no {LANDMARKS}: no landmark is known")
        return {}
    return {int(r[0]): (r[1], r[2], 0.0) for r in _whole_rows(path, 3)}


def _whole_rows(path: Path, columns: int) -> list[list[float]]:
    """Rows of a short table, each of which counts: a fault is an error."""
    out: list[list[float]] = []
    for number, line in enumerate(ensure_readable(path).read_text("utf-8", "replace").splitlines(), start=1):
        cells = line.split("#")[0].split()
        if not cells:
            continue
        try:
            row = [float(c) for c in cells]
        except ValueError:
            row = []
        if len(row) < columns or not np.isfinite(row).all():
            what = f"cannot be read: '{line.strip()[:40]}'"
            raise DataError(what, where=f"{path}, line {number}", fix=f"it needs {columns} numbers or more")
        out.append(row)
    return out


def _rows(path: Path, columns: int) -> Table:
    """A stamp and so many numbers a line; others are counted. Whole files at once, as long as nothing is wrong."""
    ensure_readable(path)
    try:
        v = np.loadtxt(path, comments="#", usecols=range(1 + columns), ndmin=2, encoding="utf-8")
    except (ValueError, UnicodeDecodeError):
        return _line_by_line(path, columns)
    if not (np.abs(v[:, 0]) < 4e9).all():  # s, the year 2096
        return _line_by_line(path, columns)
    return Table(np.round(v[:, 0] * 1e6).astype(np.int64) * 1000, v[:, 1:], 0)  # a float64 holds the microsecond


def _line_by_line(path: Path, columns: int) -> Table:
    stamps: list[str] = []
    values: list[list[float]] = []
    broken = 0
    for line in path.read_text("utf-8", "replace").splitlines():
        cells = line.split("#")[0].split()
        if not cells:
            continue
        try:
            row = [float(c) for c in cells[1 : 1 + columns]]
        except ValueError:
            row = []
        if len(row) == columns:
            stamps.append(cells[0])
            values.append(row)
        else:
            broken += 1
    t, good = to_nanoseconds(stamps, "s")
    v = np.array(values, np.float64).reshape(-1, columns)
    return Table(t[good], v[good], broken + int((~good).sum()))


def _odometry(name: str, table: Table, _: Mapping[int, int]) -> Stream:
    z = np.full((table.t.size, 6), np.nan)
    z[:, 0], z[:, 1], z[:, 5] = table.v[:, 0], 0.0, table.v[:, 1]
    return stream(name, Kind.TWIST, table.t, z)


def _measurement(name: str, table: Table, subject_of: Mapping[int, int]) -> Stream:
    z = table.v.copy()
    z[:, 0] = [subject_of.get(int(c), -int(c)) if np.isfinite(c) else np.nan for c in table.v[:, 0].tolist()]
    return stream(name, Kind.RANGE_BEARING, table.t, z)


def _groundtruth(name: str, table: Table, _: Mapping[int, int]) -> Stream:
    n = table.t.size
    flat, z = np.zeros(n), np.full((n, 10), np.nan)
    z[:, :2], z[:, 2] = table.v[:, :2], 0.0
    z[:, 3:7] = rpy_to_quats(np.column_stack([flat, flat, table.v[:, 2]]))
    return stream(name, Kind.ESTIMATE, table.t, z)


_STREAMS: Final = {"odometry": _odometry, "measurement": _measurement, "groundtruth": _groundtruth}


def write_mrclam(log: EventLog, truth: Mapping[str, Trajectory], folder: Path) -> None:
    """Write a team's log in these files, to the millimetre, milliradian and millisecond, as the originals are.

    log : streams as `read_mrclam` gives them;  truth : of each robot. Barcodes are 5, 9, 14, ... by subject; a negative
    beacon is written as the barcode of nobody.
    """
    folder.mkdir(parents=True, exist_ok=True)
    subjects = sorted([*log.ids.values(), *map(int, log.beacons)])
    code = {s: 5 + 4 * k + k % 2 for k, s in enumerate(subjects)}
    _write(folder / BARCODES, ["Subject #    Barcode #"], [f"{s:3d} \t {c:3d}" for s, c in code.items()])
    marks = [f"{int(s):3d} \t {x:.8f} \t {y:.8f} \t 0.00010000 \t 0.00010000" for s, (x, y, _) in log.beacons.items()]
    _write(folder / LANDMARKS, ["Subject #    x [m]    y [m]    x std-dev [m]    y std-dev [m]"], marks)
    for name, number in log.ids.items():
        file = f"Robot{number}"
        own = log.streams[f"{name}/odometry"]
        lines = [f"{_s(t)} \t {v:.3f} \t {w:.3f}" for t, v, w in zip(own.t.tolist(), *own.z[:, [0, 5]].T, strict=True)]
        _write(
            folder / f"{file}_Odometry.dat", ["Time [s]    forward velocity [m/s]    angular velocity[rad/s]"], lines
        )
        own = log.streams[f"{name}/measurement"]
        rows = zip(own.t.tolist(), *own.z.T, strict=True)
        lines = [f"{_s(t)} \t {code.get(int(s), int(abs(s))):3d} \t {r:.3f} \t {b: .3f}" for t, s, r, b in rows]
        _write(folder / f"{file}_Measurement.dat", ["Time [s]    Subject #    range [m]    bearing [rad]"], lines)
        rows = zip(truth[name].t.tolist(), *truth[name].p[:, :2].T, truth[name].yaw, strict=True)
        lines = [f"{_s(t)} \t {x:.8f} \t {y:.8f} \t {a:.8f}" for t, x, y, a in rows]
        _write(folder / f"{file}_Groundtruth.dat", ["Time [s]    x [m]    y [m]    orientation [rad]"], lines)


def _s(t: int) -> str:
    return f"{t / 1e9:.3f}"


def _write(path: Path, columns: list[str], lines: list[str]) -> None:
    with replacing(path, force=True) as part, part.open("w", encoding="ascii", newline="\n") as f:
        f.write(HEAD + "".join(f"# {c}\n" for c in columns))
        f.writelines(f"{line}\n" for line in lines)
