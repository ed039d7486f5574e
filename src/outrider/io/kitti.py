"""KITTI: raw drives as recordings, and trajectories of its odometry benchmark.

A drive has `oxts/timestamps.txt` and one line of thirty numbers per file in `oxts/data`: an inertial unit with its own
filter. Source: Geiger et al., Vision meets robotics: the KITTI dataset, IJRR 2013, and the data format beside the data.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from outrider.core.attitudes import matrices_to_quats, rpy_to_quats
from outrider.data import EventLog, Fix, Kind, Stream, Trajectory, stream
from outrider.errors import DataError
from outrider.io._shared import fix_codes, site_positions
from outrider.io.files import Progress, assemble, ensure_readable, is_directory
from outrider.io.stamps import to_nanoseconds
from outrider.io.tum import FARTHEST
from outrider.typing import Bools, Floats, Ints

NUMBERS: Final = 30  # in a line
MODES: Final = {3: Fix.SINGLE, 4: Fix.DGNSS, 5: Fix.FLOAT, 6: Fix.FIXED, 7: Fix.SBAS, 8: Fix.DGNSS, 9: Fix.DGNSS}
CAMERA: Final = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # right-down-forward in our axes


def is_kitti(folder: Path) -> bool:
    """Whether this is a drive of KITTI's raw data."""
    return is_directory(folder / "oxts" / "data")


def read_kitti(
    path: Path,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Read a raw drive of KITTI.

    Streams: `oxts/imu`; `oxts/fix` and `oxts/velocity`, which the unit's own filter has smoothed; and all it says as
    the ESTIMATE `oxts`. Numbers of the body are forward-left-up in this data set, yaw counts from east.
    """
    files = sorted(f for f in (path / "oxts" / "data").glob("*.txt") if f.stem.isdecimal())
    t, stamped = _oxts_stamps(path / "oxts" / "timestamps.txt")
    stamps, rows = list[int](), list[list[float]]()
    for k, file in enumerate(files):
        if progress is not None:
            progress(k, len(files))
        number, line = int(file.stem), _oxts_line(file)
        if line is not None and number < t.size and stamped[number]:
            stamps.append(int(t[number]))
            rows.append(line)
    broken = len(files) - len(rows)
    notes = [f"{broken} of {len(files)} OXTS lines are damaged or have no stamp and were left out"] if broken else []
    if rows:
        notes.append("positions and velocities are those of the OXTS unit's own filter: no independent measurements")
    streams = _oxts(np.array(stamps, np.int64), np.array(rows)) if rows else []
    own = [replace(s, robot=robot) for s in streams]
    return assemble(path, own, notes=notes, topics=topics, start_s=start_s, end_s=end_s)


def _oxts_stamps(path: Path) -> tuple[Ints, Bools]:
    """UTC of each line; seconds have nine decimals, which is finer than Python's datetime."""
    texts = ensure_readable(path).read_text(encoding="ascii", errors="replace").split("\n")
    lines = [x.strip() for x in texts]
    parts = [re.fullmatch(r"(\d{4}-\d\d-\d\d) (\d\d:\d\d:\d\d)(\.\d{1,9})?", x) for x in lines]
    whole, known = to_nanoseconds([f"{m[1]}T{m[2]}" if m else "" for m in parts], "iso")
    rest, _ = to_nanoseconds([f"0{m[3]}" if m and m[3] else "0" for m in parts], "s")
    return whole + rest, known


def _oxts_line(path: Path) -> list[float] | None:
    try:
        line = [float(c) for c in path.read_text(encoding="ascii", errors="replace").split()]
    except (OSError, ValueError):
        return None
    return line if len(line) == NUMBERS and np.isfinite(line).all() else None


def _oxts(t: Ints, v: Floats) -> list[Stream]:
    lat, lon = np.radians(v[:, 0]), np.radians(v[:, 1])
    sigma, speed = v[:, 23:24], v[:, 24:25]
    mode = np.where(np.isin(v[:, 27], (*MODES, 0, 1, 2)), v[:, 27], np.nan)  # further codes do not say how good it is
    fix = {"fix": fix_codes(mode, MODES), "satellites": v[:, 26]}
    velocity = np.column_stack([v[:, 7], v[:, 6], v[:, 10]])
    place = np.column_stack([lat, lon, v[:, 2]])
    told = {"lat": lat, "lon": lon, "alt": v[:, 2]}
    answer = np.hstack([site_positions(lat, lon, v[:, 2]), rpy_to_quats(v[:, 3:6]), velocity])
    return [
        stream("oxts/imu", Kind.IMU, t, np.hstack([v[:, 17:20], v[:, 11:14]])),
        stream("oxts/fix", Kind.GNSS, t, place, var=np.repeat(sigma**2, 3, axis=1), extra=fix),
        stream("oxts/velocity", Kind.GNSS_VELOCITY, t, velocity, var=np.repeat(speed**2, 3, axis=1), extra=fix),
        stream("oxts", Kind.ESTIMATE, t, answer, extra=told),
    ]


def are_kitti_poses(text: str) -> bool:
    """Whether the first line of a text is twelve numbers."""
    try:
        return len([float(c) for c in text.split("\n")[0].split()]) == 12
    except ValueError:
        return False


def read_kitti_poses(path: Path) -> Trajectory:
    """KITTI odometry poses (3x4 matrices a line) with the stamps of `times.txt` beside them, or one folder up.

    They are those of the left camera: x right, y down, z forward from where it began. Here x is forward, y left, z up.
    Raises `DataError` where there are no stamps, or not one a pose.
    """
    rows = [r for r in _rows(ensure_readable(path)) if len(r) == 12 and np.isfinite(r).all()]
    poses = np.array(rows or np.zeros((0, 12)), np.float64).reshape(-1, 3, 4)
    near = (path.with_name("times.txt"), path.with_name(f"{path.stem}_times.txt"),
            path.parent.parent / "sequences" / path.stem / "times.txt")  # fmt: skip
    times = next((p for p in near if p.is_file()), None)
    if times is None:
        raise DataError("is KITTI poses, which have no stamps", where=str(path), fix="put its times.txt beside it")
    t, good = to_nanoseconds(times.read_text(encoding="ascii", errors="replace").split(), "s")
    if t.size != len(poses) or not good.all():
        text = f"has {len(poses)} poses, {times.name} {t.size} stamps"
        raise DataError(text, where=str(path), fix="give the times.txt of this sequence")
    far = np.flatnonzero(~(np.abs(poses) < FARTHEST).all(axis=(1, 2)))
    if far.size:
        raise DataError(
            f"pose {far[0] + 1} is nowhere", where=str(path), fix="is it a number with a slip? leave it out"
        )
    R = CAMERA @ poses[:, :, :3] @ CAMERA.T
    if not np.allclose(R @ np.swapaxes(R, 1, 2), np.eye(3), atol=0.01):
        raise DataError("is no KITTI poses: its matrices are no rotations", where=str(path), fix="give TUM or CSV")
    t, first = np.unique(t, return_index=True)
    return Trajectory(t=t, p=(poses[:, :, 3] @ CAMERA.T)[first], q=matrices_to_quats(R)[first], name=path.stem)


def _rows(path: Path) -> list[list[float]]:
    out: list[list[float]] = []
    for line in path.read_text(encoding="ascii", errors="replace").splitlines():
        try:
            out.append([float(c) for c in line.split()])
        except ValueError:
            continue
    return out
