"""PX4 EKF2's replay files: recorded sensors in, states and variances at 10 Hz out (change indication).

Input rows are `time_us,sensor,values...`, in any order of sensors within a stamp:

=========  =======================================================================================================
imu        ax ay az [m/s^2] gx gy gz [rad/s], forward-right-down, specific force and rates (not increments)
gps        altitude [mm, MSL], **longitude, latitude** [1e-7 deg], velocity north east down [m/s]
baro       altitude [m]
mag        x y z [gauss], forward-right-down
airspeed   true, equivalent [m/s] (no such stream)
range      distance [m], quality
flow       x y [rad/s about the forward and right axes], then the sensor's own gyro and quality
landed     1 on the ground (no such stream)
=========  =======================================================================================================

The longitude stands before the latitude: read the other way round, motion east becomes motion north. Rows are stamped
when EKF2 gets them; EKF2 then dates GNSS back by its default delay, and so does this reader (the arrival stays). What
that would put before the clock's zero is left out, with a note: nothing could be laid beside it.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from outrider.core.frames import frd_to_flu, ned_to_enu, quat_ned_frd_to_enu_flu, wxyz_to_xyzw
from outrider.data import Altitude, EventLog, Kind, Stream, Trajectory, stream
from outrider.errors import DataError
from outrider.io.files import Progress, assemble, ensure_readable
from outrider.typing import Floats, Ints

E7 = 1e-7 * np.pi / 180
GPS_DELAY = 110_000_000  # ns, EKF2's default EKF2_GPS_DELAY, with which the reference outputs were made
WIDTHS = {"imu": 6, "gps": 6, "baro": 1, "mag": 3, "airspeed": 2, "range": 2, "flow": 2, "landed": 1}
STATES = 24
WILD = 1e12  # of any column: beyond it nothing is meant
REPORT_EVERY = 1 << 14  # lines


def read_replay(
    path: Path,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Read an EKF2 replay input. Streams: imu, gps, gps#velocity, baro, mag, range, flow."""
    tables, malformed, notes = _tables(ensure_readable(path), progress)
    built = [s for name, build in BUILDERS.items() if name in tables for s in build(*tables[name])]
    streams = [replace(_begun(s, notes), robot=robot, malformed=malformed.get(s.name, 0)) for s in built]
    return assemble(path, streams, notes=notes, topics=topics, start_s=start_s, end_s=end_s)


def _tables(path: Path, progress: Progress | None) -> tuple[dict[str, tuple[Ints, Floats]], dict[str, int], list[str]]:
    """Stamps [ns] and values by sensor, rows that could not be decoded by sensor, and notes about them."""
    t: dict[str, list[int]] = {name: [] for name in WIDTHS}
    z: dict[str, list[list[float]]] = {name: [] for name in WIDTHS}
    bad: dict[str, int] = {}
    size, done = path.stat().st_size, 0
    with path.open("rb") as f:
        for number, line in enumerate(f):
            done += len(line)
            if progress is not None and number % REPORT_EVERY == 0:
                progress(done, size)
            if not line.strip():
                continue
            fields = line.decode("ascii", "replace").split(",")
            name = fields[1].strip() if len(fields) > 1 else ""
            width = WIDTHS.get(name, 0)
            try:
                values = [float(v) for v in fields[2 : 2 + width]]
                stamp = int(fields[0]) * 1000
            except ValueError:
                values, stamp = [], 0
            if not width or len(values) < width or not 0 <= stamp < 2**63:
                bad[name if name in WIDTHS else ""] = bad.get(name if name in WIDTHS else "", 0) + 1
                continue
            t[name].append(stamp)
            z[name].append(values)
    notes = [f"{bad['']} rows name no known sensor and were left out"] if "" in bad else []
    return {n: (np.array(t[n], np.int64), np.array(z[n])) for n in WIDTHS if t[n]}, bad, notes


def _begun(s: Stream, notes: list[str]) -> Stream:
    """A stream without what is dated to before the clock begins, and a note of it."""
    before = (s.t <= 0) & (s.t_arrival > 0)
    if before.any():
        notes.append(f"{int(before.sum())} of {len(s)} records of {s.name} date from before the clock begins: left out")
    return s.select(~before) if before.any() else s


def _imu(t: Ints, z: Floats) -> list[Stream]:
    return [stream("imu", Kind.IMU, t, np.hstack([frd_to_flu(z[:, 3:6]), frd_to_flu(z[:, :3])]))]


def _gps(t: Ints, z: Floats) -> list[Stream]:
    position = np.column_stack([z[:, 2] * E7, z[:, 1] * E7, z[:, 0] * 1e-3])
    return [
        stream("gps", Kind.GNSS, t - GPS_DELAY, position, t_arrival=t, altitude=Altitude.MSL),
        stream("gps#velocity", Kind.GNSS_VELOCITY, t - GPS_DELAY, ned_to_enu(z[:, 3:6]), t_arrival=t),
    ]


def _baro(t: Ints, z: Floats) -> list[Stream]:
    return [stream("baro", Kind.BARO, t, z, altitude=Altitude.PRESSURE)]


def _mag(t: Ints, z: Floats) -> list[Stream]:
    return [stream("mag", Kind.MAG, t, frd_to_flu(z))]


def _range(t: Ints, z: Floats) -> list[Stream]:
    return [stream("range", Kind.RANGE_FINDER, t, z[:, :1], extra={"quality": z[:, 1]})]


def _flow(t: Ints, z: Floats) -> list[Stream]:
    return [stream("flow", Kind.FLOW, t, z * [1.0, -1.0])]


BUILDERS: Mapping[str, Callable[[Ints, Floats], list[Stream]]] = {
    "imu": _imu, "gps": _gps, "baro": _baro, "mag": _mag, "range": _range, "flow": _flow,
}  # fmt: skip


def read_change_indication(path: Path) -> Trajectory:
    """EKF2's states as a trajectory: `Timestamp` [us], 24 states, 24 variances.

    States: attitude w x y z (body to north-east-down), velocity [m/s] and position [m] north east down from EKF2's
    origin, then increments of gyro bias (3) and accelerometer bias (3) per filter step, earth field (3) and body field
    bias (3) [gauss], wind (2) [m/s]. The variances of the attitude are those of the quaternion's components, so only
    velocity and position variances are meaningful by themselves. `valid` is false while the filter has not started
    (all variances zero). There is no datum: the file does not say where the origin is.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of an empty one
            table = np.loadtxt(ensure_readable(path), delimiter=",", skiprows=1, ndmin=2)
    except ValueError:
        table = np.zeros((0, 0))
    table = table[(np.abs(table) < WILD).all(axis=1)]
    if table.shape[0] == 0 or table.shape[1] != 1 + 2 * STATES:
        raise DataError(f"not EKF2 states: needs a stamp, {STATES} states, {STATES} variances a row", where=str(path))
    t = np.round(table[:, 0] * 1000).astype(np.int64)
    t, rows = np.unique(t, return_index=True)
    x, variances = table[rows, 1 : 1 + STATES], table[rows, 1 + STATES :]
    return Trajectory(
        t=t,
        p=ned_to_enu(x[:, 7:10]),
        q=quat_ned_frd_to_enu_flu(wxyz_to_xyzw(x[:, :4])),
        v=ned_to_enu(x[:, 4:7]),
        valid=np.asarray(variances.any(axis=1)),
        name="ekf2",
    )
