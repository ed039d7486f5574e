"""EuRoC ASL sequences, also those of TUM-VI, as recordings: `mav0/<sensor>/data.csv` with a header line.

Stamps are ns, quaternions have w first. Source: Burri et al., The EuRoC micro aerial vehicle datasets, IJRR 2016.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from outrider.core.frames import wxyz_to_xyzw
from outrider.data import EventLog, Kind, Stream, Trajectory, stream
from outrider.errors import ConfigError, DataError
from outrider.io.config import read_yaml
from outrider.io.files import Progress, assemble, ensure_readable
from outrider.io.stamps import to_nanoseconds
from outrider.typing import Floats, Ints

GROUND_TRUTH: Final = re.compile(r"#\s*timestamp[^,\n]*,\s*p_\w+_x")  # how the header of a trajectory begins


def euroc_root(folder: Path) -> Path | None:
    """The folder of the sensors of an ASL sequence, if it is one."""
    roots = [folder / "mav0", folder]
    return next((r for r in roots if any(r.glob("imu*/data.csv"))), None)


def read_euroc(
    path: Path,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Read an ASL sequence (EuRoC, TUM-VI).

    Streams: `imu0` ...; `leica0` (POSITION), `vicon0` and `mocap0` (POSE): references, told as ESTIMATEs, which are
    never fused, as is `state_groundtruth_estimate0`. Mounts are those of `sensor.yaml`.
    """
    root = euroc_root(path)
    if root is None:
        raise DataError("holds no imu*/data.csv", where=str(path), fix="name the folder that holds mav0")
    streams: list[Stream] = []
    notes: list[str] = []
    mounts: dict[str, Floats] = {}
    files = sorted(f for f in root.glob("*/data.csv") if f.parent.name.rstrip("0123456789") in SENSORS)
    for k, file in enumerate(files):
        if progress is not None:
            progress(k, len(files))
        name = file.parent.name
        t, v, broken = _asl(file)
        if broken:
            notes.append(f"{broken} lines of {name} could not be read and were left out")
        build = SENSORS[name.rstrip("0123456789")]
        streams += [replace(build(name, t, v), robot=robot, frame=name, malformed=broken)] if t.size else []
        if name.startswith("imu") and (mount := _mount(file.with_name("sensor.yaml"), notes)) is not None:
            mounts[name] = mount
    out = assemble(path, streams, notes=notes, topics=topics, start_s=start_s, end_s=end_s)
    return replace(out, mounts=mounts)


def _asl(path: Path) -> tuple[Ints, Floats, int]:
    """Stamps [ns], numbers, and how many lines could not be read."""
    stamps: list[str] = []
    rows: list[list[float]] = []
    broken = 0
    for line in ensure_readable(path).read_text(encoding="utf-8", errors="replace").splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        cells = line.replace(" ", "").rstrip(",").split(",")
        try:
            row = [float(c) for c in cells[1:]]
        except ValueError:
            row = []
        if row and cells[0].isdecimal() and (not rows or len(row) == len(rows[0])):
            stamps.append(cells[0])
            rows.append(row)
        else:
            broken += 1
    t, good = to_nanoseconds(stamps, "ns")
    values = np.array(rows or np.zeros((0, 1)), np.float64)[good]
    return t[good], values, broken + int((~good).sum())


def _wide(name: str, v: Floats, width: int) -> Floats:
    if v.shape[1] < width:
        raise DataError(f"{name} has {v.shape[1]} numbers a line, needs {width}", where=name)
    return v[:, :width]


def _imu(name: str, t: Ints, v: Floats) -> Stream:
    return stream(name, Kind.IMU, t, _wide(name, v, 6))


def _place(name: str, t: Ints, v: Floats) -> Stream:
    unknown = np.full((t.size, 7), np.nan)
    return stream(name, Kind.ESTIMATE, t, np.hstack([_wide(name, v, 3), unknown]))


def _pose(name: str, t: Ints, v: Floats) -> Stream:
    """x y z, then the quaternion w first; ground truth goes on with the velocity."""
    v = _wide(name, v, 10 if v.shape[1] >= 10 else 7)
    velocity = v[:, 7:] if v.shape[1] == 10 else np.full((t.size, 3), np.nan)
    return stream(name, Kind.ESTIMATE, t, np.hstack([v[:, :3], wxyz_to_xyzw(v[:, 3:7]), velocity]))


SENSORS: Final[Mapping[str, Callable[[str, Ints, Floats], Stream]]] = {
    "imu": _imu, "leica": _place, "vicon": _pose, "mocap": _pose, "state_groundtruth_estimate": _pose,
}  # fmt: skip


def _mount(path: Path, notes: list[str]) -> Floats | None:
    """(4, 4) T_BS of a sensor.yaml."""
    if not path.is_file():
        return None
    try:
        told: Any = read_yaml(path)
        T = np.array(told["T_BS"]["data"], np.float64).reshape(4, 4)
    except (ConfigError, KeyError, TypeError, ValueError):
        notes.append(f"{path.parent.name}/sensor.yaml tells no mount")
        return None
    proper = np.isfinite(T).all() and np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-3)
    return T if proper else None


def read_euroc_truth(path: Path) -> Trajectory:
    """The trajectory of a `state_groundtruth_estimate0/data.csv`."""
    t, v, _ = _asl(path)
    v = _wide(path.parent.name, v, 7) if v.shape[1] < 10 else v[:, :10]
    t, first = np.unique(t, return_index=True)
    if not t.size:
        raise DataError("holds no pose", where=str(path), fix="a line is: ns x y z qw qx qy qz vx vy vz ...")
    q = wxyz_to_xyzw(v[first, 3:7])
    length = np.linalg.norm(q, axis=1, keepdims=True)
    if not (np.abs(length - 1.0) < 0.1).all():
        raise DataError("its quaternions are not of length 1", where=str(path), fix="w stands first, after x y z")
    return Trajectory(t=t, p=v[first, :3], q=q / length, v=v[first, 7:10] if v.shape[1] == 10 else np.zeros((0, 3)),
                      name=path.parent.name or path.stem)  # fmt: skip
