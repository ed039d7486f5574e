"""PX4 flight logs (.ulg) through `pyulog`; only the topics that become streams are loaded.

Stamps are microseconds since boot. `timestamp_sample` (the measurement) is the stamp where a topic has it, `timestamp`
(the publication) is then the arrival. A GNSS receiver's stamp is the time of reception; the vehicle's own parameters
say how old its data are by then (EKF2_GPS_DELAY and the like), and the stamp is dated back by that. Vectors are
forward-right-down and north-east-down in the file, forward-left-up and east-north-up here. Field names changed between
PX4 versions; every reading below lists all known spellings.
"""

import io
from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, cast, final

import numpy as np

from outrider.core.frames import frd_to_flu, ned_to_enu, quat_ned_frd_to_enu_flu, wxyz_to_xyzw
from outrider.data import Altitude, EventLog, Kind, Stream, stream
from outrider.errors import DataError
from outrider.io._shared import FIX_OF_CODE, as_floats, fix_codes, nearest, pressure_altitude, site_positions
from outrider.io.files import Progress, assemble, ensure_readable
from outrider.typing import Floats, Ints

EARTH_RADIUS = 6371000.0  # m, of the sphere on which PX4 projects its local position
DOWNWARD = 25  # distance_sensor.orientation: ROTATION_PITCH_270
PATIENCE, RESERVE = 10, 1 << 27  # bytes read in search of the next record: times the file's size, and at least
REPORT_EVERY = 1 << 20  # bytes between two reports of progress
PAIRING = 200_000  # us: an attitude or acceleration further away in time is not paired

IMU_PAIRS = {"sensor_gyro": "sensor_accel", "vehicle_angular_velocity": "vehicle_acceleration"}
POSITIONS = ("vehicle_gps_position", "sensor_gps")
DELAYS = {
    Kind.GNSS: "EKF2_GPS_DELAY", Kind.GNSS_VELOCITY: "EKF2_GPS_DELAY", Kind.BARO: "EKF2_BARO_DELAY",
    Kind.MAG: "EKF2_MAG_DELAY", Kind.RANGE_FINDER: "EKF2_RNG_DELAY", Kind.FLOW: "EKF2_OF_DELAY",
}  # fmt: skip
TOPICS = (
    "sensor_combined", "vehicle_imu", *IMU_PAIRS, *IMU_PAIRS.values(), *POSITIONS, "vehicle_air_data", "sensor_baro",
    "vehicle_magnetometer", "sensor_mag", "vehicle_local_position", "vehicle_global_position", "vehicle_attitude",
    "distance_sensor", "vehicle_optical_flow", "optical_flow",
)  # fmt: skip


@final
class Topic:
    """One instance of one topic: its columns by name."""

    def __init__(self, name: str, data: dict[str, np.ndarray]) -> None:
        self.name, self.data = name, data
        self.stamp = data["timestamp"].astype(np.int64)

    def __len__(self) -> int:
        return int(self.stamp.size)

    @property
    def sample(self) -> Ints:
        """(n,) us, when it was measured."""
        sampled = self.data.get("timestamp_sample")
        return self.stamp if sampled is None else np.where(sampled > 0, sampled, self.stamp).astype(np.int64)

    def column(self, *spellings: str, scale: float = 1.0) -> Floats:
        """(n,) the first of the spellings that is there, else NaN."""
        for name in spellings:
            if name in self.data:
                return as_floats(self.data[name]) * scale
        return np.full(len(self), np.nan)

    def stated(self, *spellings: str, scale: float = 1.0) -> Floats:
        """(n,) the same for a quantity that drivers set to zero when they do not know it: NaN there."""
        value = self.column(*spellings, scale=scale)
        return np.where(value == 0, np.nan, value)

    def vector(self, *spellings: str) -> Floats:
        """(n, 3) the first of the spellings that is there, else NaN. `a[]` stands for a[0] a[1] a[2], `` for x y z."""
        for s in spellings:
            names = [s.replace("[]", f"[{i}]") for i in range(3)] if s else ["x", "y", "z"]
            if names[0] in self.data:
                return np.column_stack([self.column(n) for n in names])
        return np.full((len(self), 3), np.nan)

    def stream(self, kind: Kind, z: Floats, *, suffix: str = "", var: Floats | None = None, **rest: object) -> Stream:
        """A stream under the topic's name, stamped with it."""
        t, arrival = self.sample * 1000, self.stamp * 1000
        return stream(self.name + suffix, kind, t, z, var=var, t_arrival=arrival, **rest)


def read_ulog(
    path: Path,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Read a PX4 log.

    Streams carry the topic's name; GNSS velocity is `<topic>#velocity`, and EKF2's own answer is the ESTIMATE `ekf2`
    (site frame at EKF2's first origin; extra: lat, lon [rad], alt [m], valid). A truncated or damaged file gives what
    could be read, and a note.
    """
    found, delays, notes = _load(ensure_readable(path), progress)
    combined = found.get("sensor_combined", [])  # before 2018 it carried the magnetometer and the barometer too
    old_baro = [t for t in combined if "baro_alt_meter" in t.data]
    old_mag = [t for t in combined if "magnetometer_ga[0]" in t.data]
    streams = [_imu(t, found) for t in _best(found, "sensor_combined", "vehicle_imu", *IMU_PAIRS)]
    streams += [s for t in _best(found, *POSITIONS) for s in _gnss(t)]
    streams += [_baro(t) for t in _best(found, "vehicle_air_data", "sensor_baro") or old_baro]
    streams += [_mag(t) for t in _best(found, "vehicle_magnetometer", "sensor_mag") or old_mag]
    streams += [s for t in found.get("distance_sensor", []) if len(s := _range_finder(t))]
    streams += [_flow(t) for t in _best(found, "vehicle_optical_flow", "optical_flow")]
    streams += _estimate(found)
    notes += sorted(
        {
            f"{s.name.split('#')[0]} dated back by {delays[s.kind] * 1e-6:g} ms, as {DELAYS[s.kind]} states"
            for s in streams
            if s.kind in delays
        }
    )
    streams = [replace(s, robot=robot, t=s.t - delays.get(s.kind, 0)) for s in streams]
    return assemble(path, streams, notes=notes, topics=topics, start_s=start_s, end_s=end_s)


def _load(path: Path, progress: Progress | None) -> tuple[dict[str, list[Topic]], dict[Kind, int], list[str]]:
    """Topics by name, one per instance; delays [ns] that the parameters state; what is wrong with the file."""
    from pyulog import ULog

    with path.open("rb") as f, redirect_stdout(io.StringIO()):  # pyulog prints its complaints
        source = _Source(f, path.stat().st_size, progress)
        try:
            log = ULog(cast(Any, source), list(TOPICS))
        except Exception as e:  # any bit may be wrong, and pyulog raises whatever Python raises
            raise DataError(f"not a readable ULog: {e or type(e).__name__}", where=str(path)) from None
    found: dict[str, list[Topic]] = {}
    for d in log.data_list:
        if "timestamp" in d.data and d.data["timestamp"].size:
            found.setdefault(d.name, []).append(Topic(d.name if d.multi_id == 0 else f"{d.name}_{d.multi_id}", d.data))
    stated = {kind: log.initial_parameters.get(name) for kind, name in DELAYS.items()}  # ms
    delays = {k: round(ms * 1e6) for k, ms in stated.items() if isinstance(ms, (int, float)) and 0 < ms < 1000}
    notes: list[str] = []
    if source.cut:
        notes.append("the file is truncated: what had been written was read")
    if log.file_corruption:
        notes.append("the file is damaged: records were skipped")
    if log.dropouts:
        lost = sum(d.duration for d in log.dropouts)
        notes.append(f"the logger lost data {len(log.dropouts)} times, {lost * 1e-3:.1f} s in all")
    return found, delays, notes


@final
class _Source:
    """A file that reports progress, notices that its last record is incomplete, and ends a search that finds nothing.

    In damaged definitions pyulog steps back over the length that a record claims, not over what was there to read, and
    can come to the same place again and again.
    """

    def __init__(self, file: BinaryIO, size: int, progress: Progress | None) -> None:
        self.tell, self.close = file.tell, file.close
        self.cut = False
        self._file, self._size, self._progress, self._done, self._next = file, size, progress, 0, 0
        self._missing = 0

    def read(self, n: int = -1) -> bytes:
        if self._done > PATIENCE * self._size + RESERVE:
            return b""
        data = self._file.read(n)
        self._missing = max(n - len(data), 0)
        if self._missing and (data or n != 3):  # a clean end is an empty 3-byte header
            self.cut = True
        self._done += len(data)
        if self._progress is not None and self._done >= self._next:
            self._progress(min(self._file.tell(), self._size), self._size)
            self._next = self._done + REPORT_EVERY
        return data

    def seek(self, offset: int, whence: int = 0) -> int:
        back = offset + self._missing if whence == 1 else offset
        self._missing = 0
        return self._file.seek(back, whence)


def _best(found: dict[str, list[Topic]], *names: str) -> list[Topic]:
    """All instances of the topic with the most records, the first named winning a tie."""
    there = [found[n] for n in names if n in found]
    return max(there, key=lambda instances: len(instances[0]), default=[])


def _imu(gyro: Topic, found: dict[str, list[Topic]]) -> Stream:
    """Rates and specific force; separate gyroscope and accelerometer topics are joined at the gyroscope's stamps."""
    if "delta_angle[0]" in gyro.data:  # vehicle_imu: integrals over their intervals [us]
        w = gyro.vector("delta_angle[]") / (gyro.column("delta_angle_dt", scale=1e-6)[:, None])
        f = gyro.vector("delta_velocity[]") / (gyro.column("delta_velocity_dt", scale=1e-6)[:, None])
    elif (partner := IMU_PAIRS.get(gyro.name.rstrip("_123456789"))) is not None:
        w, f = gyro.vector("xyz[]", ""), np.full((len(gyro), 3), np.nan)
        for accel in found.get(partner, [])[:1]:
            index, near = nearest(accel.sample, gyro.sample, PAIRING)
            f[near] = accel.vector("xyz[]", "")[index[near]]
    else:
        w, f = gyro.vector("gyro_rad[]"), gyro.vector("accelerometer_m_s2[]")
    return gyro.stream(Kind.IMU, np.hstack([frd_to_flu(w), frd_to_flu(f)]))


def _gnss(t: Topic) -> list[Stream]:
    """Position and, where the receiver gives one, velocity."""
    degrees, raw = np.pi / 180, np.pi / 180e7
    lat = t.column("latitude_deg", scale=degrees) if "latitude_deg" in t.data else t.column("lat", scale=raw)
    lon = t.column("longitude_deg", scale=degrees) if "longitude_deg" in t.data else t.column("lon", scale=raw)
    msl = t.column("altitude_msl_m") if "altitude_msl_m" in t.data else t.column("alt", scale=1e-3)
    ellipsoid = "altitude_ellipsoid_m" if "altitude_ellipsoid_m" in t.data else "alt_ellipsoid"
    ellipsoidal = t.stated(ellipsoid, scale=1e-3 if ellipsoid == "alt_ellipsoid" else 1.0)
    fix = fix_codes(t.column("fix_type"), FIX_OF_CODE)  # PX4's 8 is extrapolated: no fix
    eph, epv = t.stated("eph"), t.stated("epv")
    extra = {"fix": fix, "satellites": t.column("satellites_used"), "hdop": t.stated("hdop"), "vdop": t.stated("vdop")}
    extra |= {"hacc": eph, "vacc": epv, "alt_ellipsoid": ellipsoidal, "utc": t.stated("time_utc_usec", scale=1e-6)}
    z, var = np.column_stack([lat, lon, msl]), np.column_stack([eph, eph, epv]) ** 2
    position = t.stream(Kind.GNSS, z, var=var, altitude=Altitude.MSL, extra=extra)
    v = np.column_stack([t.column(f"vel_{a}_m_s") for a in "ned"])
    if not np.isfinite(v).any():
        return [position]
    accuracy = t.stated("s_variance_m_s")[:, None]  # a standard deviation, whatever its name says
    rest = {k: extra[k] for k in ("fix", "satellites")} | {"valid": t.column("vel_ned_valid")}
    var = np.repeat(accuracy**2, 3, axis=1)
    return [position, t.stream(Kind.GNSS_VELOCITY, ned_to_enu(v), suffix="#velocity", var=var, extra=rest)]


def _baro(t: Topic) -> Stream:
    """Pressure altitude, computed from the pressure where the log has no altitude."""
    alt = t.column("baro_alt_meter", "altitude")
    if not np.isfinite(alt).any():
        pressure = t.column("pressure", "baro_pressure_pa")
        alt = pressure_altitude(np.where(pressure < 2000, pressure * 100.0, pressure))  # older: millibar
    return t.stream(Kind.BARO, alt[:, None], altitude=Altitude.PRESSURE)


def _mag(t: Topic) -> Stream:
    return t.stream(Kind.MAG, frd_to_flu(t.vector("magnetometer_ga[]", "")))


def _range_finder(t: Topic) -> Stream:
    """Records of a downward-looking range finder; extra: valid (inside its range, and not disowned by the driver)."""
    d, quality = t.column("current_distance"), t.column("signal_quality")
    inside = (d >= t.column("min_distance")) & (d <= t.column("max_distance")) & (quality != 0)
    var = t.stated("covariance")[:, None]
    s = t.stream(Kind.RANGE_FINDER, d[:, None], var=var, extra={"valid": inside.astype(float)})
    return s.select(t.column("orientation") == DOWNWARD) if "orientation" in t.data else s


def _flow(t: Topic) -> Stream:
    """Angular flow [rad/s], positive as a right-hand turn of the sensor about its axis, rotation included."""
    x, y = t.column("pixel_flow[0]", "pixel_flow_x_integral"), t.column("pixel_flow[1]", "pixel_flow_y_integral")
    seconds = t.column("integration_timespan_us", "integration_timespan", scale=1e-6)
    z = np.column_stack([x, -y]) / np.where(seconds > 0, seconds, np.nan)[:, None]
    return t.stream(Kind.FLOW, z, extra={"quality": t.column("quality")})


def _estimate(found: dict[str, list[Topic]]) -> list[Stream]:
    """EKF2's own answer, with the attitude nearest in time."""
    local = found.get("vehicle_local_position", [])[:1]
    for t in local or found.get("vehicle_global_position", [])[:1]:
        if local:
            lat, lon, alt = _unproject(t)
            v = np.column_stack([t.column(f"v{a}") for a in "xyz"])
            flags = ("xy_valid", "z_valid", "v_xy_valid")
        else:
            lat, lon, alt = t.column("lat", scale=np.pi / 180), t.column("lon", scale=np.pi / 180), t.column("alt")
            v = np.column_stack([t.column(f"vel_{a}") for a in "ned"])
            flags = ()
        p = site_positions(lat, lon, alt)
        if not np.isfinite(p).any() and local:
            p = ned_to_enu(t.vector(""))
        valid = np.all([t.column(f) > 0 for f in flags if f in t.data] or [np.ones(len(t), np.bool_)], axis=0)
        extra = {"lat": lat, "lon": lon, "alt": alt, "valid": valid.astype(float)}
        z = np.hstack([p, _attitude(t, found), ned_to_enu(v)])
        s = t.stream(Kind.ESTIMATE, z, altitude=Altitude.MSL, extra=extra)
        return [replace(s, name="ekf2")]
    return []


def _attitude(t: Topic, found: dict[str, list[Topic]]) -> Floats:
    """(n, 4) x y z w, R_world_body, at the stamps of another topic."""
    q = np.full((len(t), 4), np.nan)
    for a in found.get("vehicle_attitude", [])[:1]:
        index, near = nearest(a.sample, t.sample, PAIRING)
        wxyz = np.column_stack([a.column(f"q[{i}]") for i in range(4)])
        q[near] = quat_ned_frd_to_enu_flu(wxyz_to_xyzw(wxyz[index[near]]))
    return q


def _unproject(t: Topic) -> tuple[Floats, Floats, Floats]:
    """Latitude, longitude [rad] and altitude [m, MSL] of the local position.

    PX4 projects on a sphere (azimuthal equidistant about the origin), 0.3 % off the ellipsoid: at 1 km that is 3 m, so
    the projection is undone rather than taken for a tangent plane.
    """
    lat0, lon0 = t.column("ref_lat", scale=np.pi / 180), t.column("ref_lon", scale=np.pi / 180)
    stated = (t.column("ref_timestamp") > 0) & np.isfinite(lat0) & (np.abs(lat0) <= np.pi / 2)
    lat0, north, east = np.where(stated, lat0, np.nan), t.column("x"), t.column("y")
    c = np.hypot(north, east) / EARTH_RADIUS
    k = np.sinc(c / np.pi) / EARTH_RADIUS  # sin(c) / (c R)
    lat = np.arcsin(np.clip(np.cos(c) * np.sin(lat0) + north * k * np.cos(lat0), -1.0, 1.0))
    lon = lon0 + np.arctan2(east * k, np.cos(lat0) * np.cos(c) - north * k * np.sin(lat0))
    return lat, lon, t.column("ref_alt") - t.column("z")
