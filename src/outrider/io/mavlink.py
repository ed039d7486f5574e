"""MAVLink telemetry logs (.tlog): an autopilot's sensors, its own estimate, and a simulator's truth kept apart.

Clock: time since boot; arrivals of the ground station's clock are moved onto it (`outrider.io._tlog.Clock`). Units on
the wire are milli-g, mrad/s, mm, cm/s, hundredths of degrees and 1e-7 degrees, in forward-right-down and
north-east-down; here SI, radians, forward-left-up and east-north-up.
"""

import mmap
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from outrider.core.attitudes import rpy_to_quats
from outrider.core.frames import frd_to_flu, ned_to_enu, quat_ned_frd_to_enu_flu, wxyz_to_xyzw
from outrider.core.geodesy import geodetic_to_enu
from outrider.data import Altitude, Datum, EventLog, Fix, Kind, Stream, Trajectory, stream
from outrider.errors import DataError
from outrider.io._shared import FIX_OF_CODE, fix_codes, last_before, nearest, pressure_altitude, site_positions
from outrider.io._tlog import Clock, Scan, Table, scan
from outrider.io.files import Progress, assemble, ensure_readable
from outrider.typing import Bools, Floats

GRAVITY = 9.80665  # m/s^2 in one g
DEGREE = np.pi / 180
E7 = 1e-7 * DEGREE  # latitude and longitude on the wire
DOWNWARD = 25  # DISTANCE_SENSOR.orientation: MAV_SENSOR_ROTATION_PITCH_270
PAIRING = 200_000_000  # ns: an attitude further away in time is not paired with a position
POS_HORIZ_ABS, CONST_POS_MODE, UNINITIALIZED = 16, 128, 1024  # EKF_STATUS_REPORT.flags

IMUS = ("HIGHRES_IMU", "RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3")
RECEIVERS = ("GPS_RAW_INT", "GPS2_RAW")
PRESSURES = ("SCALED_PRESSURE", "SCALED_PRESSURE2", "SCALED_PRESSURE3")
STATUSES = {"EKF_STATUS_REPORT": "ekf_status", "ESTIMATOR_STATUS": "estimator_status"}
MESSAGES = (
    *IMUS, *RECEIVERS, *PRESSURES, *STATUSES, "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "ATTITUDE",
    "ATTITUDE_QUATERNION", "DISTANCE_SENSOR", "RANGEFINDER", "OPTICAL_FLOW_RAD",
)  # fmt: skip


def read_tlog(
    path: Path,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Read a telemetry log.

    Streams carry the message's name; GNSS velocity is `<message>#velocity`, a magnetometer `<message>#mag`, the
    autopilot's own answer the ESTIMATE `autopilot` (extra: lat, lon [rad], alt [m], valid), and its estimator flags the
    STATUS `ekf_status`. Several vehicles in one log: the lowest system id is `robot`, others are `<robot>_<id>` with
    streams `sys<id>/...`. SIM_STATE is truth and never part of the log: see `read_sim_truth`.
    """
    seen = _scan(path, MESSAGES, progress)
    streams: list[Stream] = []
    notes = _notes(seen)
    for k, (system, tables) in enumerate(seen.vehicles.items()):
        clock = Clock(tables)
        if clock.lives.size > 1:
            notes.append(f"system {system} rebooted {clock.lives.size - 1} times; its clock was continued")
        own = [s for build in BUILDERS for s in build(tables, clock, notes)]
        own = [replace(s, malformed=seen.malformed.get(s.name, 0)) for s in own]
        if k:
            own = [replace(s, name=f"sys{system}/{s.name}", robot=f"{robot}_{system}") for s in own]
        streams += own if k else [replace(s, robot=robot) for s in own]
    return assemble(path, streams, notes=notes, topics=topics, start_s=start_s, end_s=end_s)


def read_sim_truth(path: Path) -> Trajectory:
    """What the simulator recorded as true (SIM_STATE), in the tangent plane at its first position.

    SIM_STATE has no stamp: its time is its arrival on the log's clock, so it is late by the link's latency. Heights are
    above mean sea level. Never part of an `EventLog`: an estimator must not see it.
    """
    for tables in _scan(path, ("SIM_STATE", *MESSAGES), None).vehicles.values():
        truth = tables.get("SIM_STATE")
        if truth is None:
            continue
        arrived, _ = Clock({n: m for n, m in tables.items() if n != "SIM_STATE"}).stamps(truth)
        lat, lon, alt = (truth.column(n, scale=s) for n, s in (("lat_int", E7), ("lon_int", E7), ("alt", 1.0)))
        if not lat.any():  # simulators of before 2022 had no integers
            lat, lon = truth.column("lat", scale=DEGREE), truth.column("lon", scale=DEGREE)
        t, rows = np.unique(arrived, return_index=True)
        datum = Datum(lat=float(lat[rows[0]]), lon=float(lon[rows[0]]), alt=float(alt[rows[0]]), altitude="MSL")
        p = geodetic_to_enu(lat[rows], lon[rows], alt[rows], datum.lat, datum.lon, datum.alt)
        q = quat_ned_frd_to_enu_flu(wxyz_to_xyzw(truth.vector("q1", "q2", "q3", "q4")[rows]))
        v = ned_to_enu(truth.vector("vn", "ve", "vd")[rows])
        return Trajectory(t=t, p=p, q=q, v=v, datum=datum, name="truth")
    raise DataError("holds no SIM_STATE", where=str(path), fix="only logs of a simulated vehicle have a truth")


def _scan(path: Path, names: tuple[str, ...], progress: Progress | None) -> Scan:
    with ensure_readable(path).open("rb") as f, mmap.mmap(f.fileno(), 0, access=mmap.ACCESS_READ) as data:
        return scan(cast(bytes, data), names, progress)


def _notes(seen: Scan) -> list[str]:
    notes = [f"{n} damaged {name} messages were left out" for name, n in sorted(seen.malformed.items())]
    if seen.skipped:
        notes.append(f"{seen.skipped} bytes belong to no message and were skipped")
    if seen.cut:
        notes.append("the file is truncated: what had been written was read")
    return notes


def _stream(
    table: Table, clock: Clock, kind: Kind, z: Floats, *, suffix: str = "", var: Floats | None = None, **rest: object
) -> Stream:
    t, arrival = clock.stamps(table)
    return stream(table.name + suffix, kind, t, z, var=var, t_arrival=arrival, **rest)


def _imus(tables: Mapping[str, Table], clock: Clock, notes: list[str]) -> list[Stream]:
    """Rates, specific force and magnetic field. RAW_IMU and SCALED_IMU are the same sensor: the finer stamps win."""
    out: list[Stream] = []
    for table in (tables[n] for n in IMUS if n in tables and not (n == "SCALED_IMU" and "RAW_IMU" in tables)):
        si = table.name == "HIGHRES_IMU"
        f = table.vector("xacc", "yacc", "zacc", scale=1.0 if si else GRAVITY * 1e-3)
        w = table.vector("xgyro", "ygyro", "zgyro", scale=1.0 if si else 1e-3)
        m = table.vector("xmag", "ymag", "zmag")
        force = float(np.median(np.linalg.norm(f, axis=1)))
        if 0.3 * GRAVITY < force < 3 * GRAVITY:
            out.append(_stream(table, clock, Kind.IMU, np.hstack([frd_to_flu(w), frd_to_flu(f)])))
        else:
            notes.append(
                f"{table.name} is not in milli-g (median {force:.3g} m/s^2): its rates and forces are not used"
            )
        measured = np.abs(m).max(axis=1) > 0  # all zero: no magnetometer, or none yet
        if measured.any():
            out.append(_stream(table, clock, Kind.MAG, frd_to_flu(m), suffix="#mag").select(measured))
    return out


def _gnss(tables: Mapping[str, Table], clock: Clock, _: list[str]) -> list[Stream]:
    """Position and horizontal velocity (the message has no vertical one: NaN)."""
    out: list[Stream] = []
    for table in (tables[n] for n in RECEIVERS if n in tables):
        hacc, vacc = (table.column(n, scale=1e-3, unknown=0) for n in ("h_acc", "v_acc"))
        fix = fix_codes(table.column("fix_type"), FIX_OF_CODE | {8: Fix.FIXED})  # 8: precise point positioning
        satellites = table.column("satellites_visible", unknown=255)
        extra = {"fix": fix, "satellites": satellites, "hdop": table.column("eph", scale=1e-2, unknown=65535)}
        extra |= {"vdop": table.column("epv", scale=1e-2, unknown=65535), "hacc": hacc, "vacc": vacc}
        extra |= {"alt_ellipsoid": table.column("alt_ellipsoid", scale=1e-3, unknown=0), "utc": table.arrival * 1e-6}
        z = np.column_stack(
            [table.column("lat", scale=E7), table.column("lon", scale=E7), table.column("alt", scale=1e-3)]
        )
        var = np.column_stack([hacc, hacc, vacc]) ** 2
        out.append(_stream(table, clock, Kind.GNSS, z, var=var, altitude=Altitude.MSL, extra=extra))
        speed = table.column("vel", scale=1e-2, unknown=65535)
        course = table.column("cog", scale=1e-2 * DEGREE, unknown=65535)  # clockwise from north
        v = np.column_stack([speed * np.sin(course), speed * np.cos(course), np.full(len(table), np.nan)])
        var = np.repeat(table.column("vel_acc", scale=1e-3, unknown=0)[:, None] ** 2, 3, axis=1)
        rest = {"fix": fix, "satellites": satellites}
        velocity = _stream(table, clock, Kind.GNSS_VELOCITY, v, suffix="#velocity", var=var, extra=rest)
        out.append(velocity.select(np.isfinite(speed + course)))
    return out


def _baros(tables: Mapping[str, Table], clock: Clock, _: list[str]) -> list[Stream]:
    present = [tables[n] for n in PRESSURES if n in tables]
    heights = [pressure_altitude(t.column("press_abs", scale=100.0))[:, None] for t in present]  # hPa
    return [_stream(t, clock, Kind.BARO, z, altitude=Altitude.PRESSURE) for t, z in zip(present, heights, strict=True)]


def _ranges(tables: Mapping[str, Table], clock: Clock, _: list[str]) -> list[Stream]:
    """Downward range finders; extra: valid (inside the sensor's range)."""
    if "DISTANCE_SENSOR" in tables:
        table = tables["DISTANCE_SENSOR"]
        d, low, high = (table.column(f"{n}_distance", scale=1e-2) for n in ("current", "min", "max"))
        var = table.column("covariance", scale=1e-4, unknown=255)[:, None]
        extra = {"valid": ((d >= low) & (d <= high)).astype(float)}
        s = _stream(table, clock, Kind.RANGE_FINDER, d[:, None], var=np.where(var > 0, var, np.nan), extra=extra)
        return [s.select(table.column("orientation") == DOWNWARD)]
    if "RANGEFINDER" in tables:
        table = tables["RANGEFINDER"]
        return [_stream(table, clock, Kind.RANGE_FINDER, table.vector("distance"))]
    return []


def _flow(tables: Mapping[str, Table], clock: Clock, _: list[str]) -> list[Stream]:
    """Angular flow, positive as a right-hand turn of the sensor about its axis, rotation included."""
    if "OPTICAL_FLOW_RAD" not in tables:
        return []
    table = tables["OPTICAL_FLOW_RAD"]
    seconds = table.column("integration_time_us", scale=1e-6, unknown=0)[:, None]
    z = table.vector("integrated_x", "integrated_y") * [1.0, -1.0] / seconds
    return [_stream(table, clock, Kind.FLOW, z, extra={"quality": table.column("quality")})]


def _estimate(tables: Mapping[str, Table], clock: Clock, _: list[str]) -> list[Stream]:
    """The autopilot's own answer.

    ArduPilot goes on sending GLOBAL_POSITION_INT with fresh stamps and a frozen position when its filter has lost it:
    only the flags of EKF_STATUS_REPORT tell, so `valid` is what they say.
    """
    if "GLOBAL_POSITION_INT" in tables:
        table = tables["GLOBAL_POSITION_INT"]
        lat, lon, alt = (table.column(n, scale=s) for n, s in (("lat", E7), ("lon", E7), ("alt", 1e-3)))
        lat[(lat == 0) & (lon == 0)] = np.nan  # no position yet
        p, v = site_positions(lat, lon, alt), ned_to_enu(table.vector("vx", "vy", "vz", scale=1e-2))
        extra = {"lat": lat, "lon": lon, "alt": alt}
    elif "LOCAL_POSITION_NED" in tables:
        table = tables["LOCAL_POSITION_NED"]
        p, v = ned_to_enu(table.vector("x", "y", "z")), ned_to_enu(table.vector("vx", "vy", "vz"))
        extra = {}
    else:
        return []
    valid = np.isfinite(p[:, 0]) & _stands_by_position(table, tables, clock)
    z = np.hstack([p, _attitude(table, tables, clock), v])
    s = _stream(table, clock, Kind.ESTIMATE, z, altitude=Altitude.MSL, extra={**extra, "valid": valid.astype(float)})
    return [replace(s, name="autopilot")]


def _stands_by_position(table: Table, tables: Mapping[str, Table], clock: Clock) -> Bools:
    """(n,) whether the last estimator status before each record claims an absolute horizontal position."""
    for name in STATUSES:
        if name not in tables:
            continue
        flags = tables[name].column("flags").astype(np.int64)
        denied = CONST_POS_MODE | (UNINITIALIZED if name == "EKF_STATUS_REPORT" else 0)
        good = ((flags & POS_HORIZ_ABS) > 0) & ((flags & denied) == 0)
        index, known = last_before(tables[name].arrival, table.arrival)
        return good[index] & known
    return np.ones(len(table), np.bool_)


def _attitude(table: Table, tables: Mapping[str, Table], clock: Clock) -> Floats:
    """(n, 4) x y z w, R_world_body, of the attitude message nearest in time."""
    out = np.full((len(table), 4), np.nan)
    if "ATTITUDE_QUATERNION" in tables:
        source = tables["ATTITUDE_QUATERNION"]
        q = wxyz_to_xyzw(source.vector("q1", "q2", "q3", "q4"))
    elif "ATTITUDE" in tables:
        source = tables["ATTITUDE"]
        q = rpy_to_quats(source.vector("roll", "pitch", "yaw"))
    else:
        return out
    index, near = nearest(clock.stamps(source)[0], clock.stamps(table)[0], PAIRING)
    out[near] = quat_ned_frd_to_enu_flu(q[index[near]])
    return out


def _status(tables: Mapping[str, Table], clock: Clock, _: list[str]) -> list[Stream]:
    """Estimator flags as sent, with the test ratios that come with them."""
    out: list[Stream] = []
    for name, public in STATUSES.items():
        if name in tables:
            table = tables[name]
            ratios = [n for n in table.cells.dtype.names or () if n.endswith(("_variance", "_ratio", "_accuracy"))]
            extra = {n: table.column(n) for n in ratios}
            out.append(replace(_stream(table, clock, Kind.STATUS, table.vector("flags"), extra=extra), name=public))
    return out


BUILDERS = (_imus, _gnss, _baros, _ranges, _flow, _estimate, _status)
