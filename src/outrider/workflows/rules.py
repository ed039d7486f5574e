"""One rule per kind of record and vehicle: what a stream is used for, and why not.

Nothing here depends on one recording.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final, TypeAlias

import numpy as np

from outrider.core.magnetism import declination
from outrider.data import Fix, Kind, Stream
from outrider.errors import ConfigError
from outrider.filters.channels import gnss_variance
from outrider.models.motion import Motion
from outrider.models.sensors import Sensor, WheelsDifferential, WheelsMecanum
from outrider.workflows.draft import Draft

Rule: TypeAlias = Callable[[Draft, Stream], None]

PRECISE: Final = 0.15  # m: an untyped fix that claims less is taken as fixed
PLAIN_FIXES: Final = frozenset({Fix.UNKNOWN.value, Fix.SINGLE.value, Fix.SBAS.value, Fix.DGNSS.value, Fix.FLOAT.value})
NO_FIX: Final = frozenset({Fix.NONE.value})
RANGE_SIGMA: Final = 0.3  # m, of a radio range outdoors that states none: multipath, not the clock, sets it
DATED: Final = 1_000_000_000_000_000_000  # ns: an earlier stamp counts from power-on, not from 1970
UNDATED_YEAR: Final = 2025.5  # the middle of the bundled magnetic model


def unused(d: Draft, s: Stream) -> None:
    """Kinds without a rule."""
    reasons = {
        Kind.ESTIMATE: "another estimator's answer, drawn for comparison",
        Kind.STATUS: "another estimator's flags",
        Kind.ODOMETRY_POSE: "the base's own integrated pose: it drifts, its twist is fused instead",
        Kind.SCAN: "a lidar scan: it says where one is on a map only",
        Kind.RELATIVE_POSE: "sees another robot: needs a team configuration",
    }
    why = reasons.get(s.kind, f"{s.kind.value} has no use for a {d.motion.name.lower()} vehicle")
    if d.section(s).use == "fuse":
        raise ConfigError(f"it cannot be fused: {why}", where=f"sources.{s.name}.use", fix="leave it on `auto`")
    d.skip(s, why)


def gnss(d: Draft, s: Stream) -> None:
    """Fixed solutions are positions; all others also carry an error that stays for minutes."""
    rows = "110" if d.motion is Motion.PLANAR or other_altitude(d, s) else "111"
    precise, plain = frozenset({Fix.FIXED.value}), PLAIN_FIXES
    if d.section(s).sigma is None and untyped_but_precise(s):
        precise, plain = precise | {Fix.UNKNOWN.value}, plain - {Fix.UNKNOWN.value}
    passed = d.passed(s.name)
    fixes = set(np.unique(passed.extra["fix"]).tolist()) if "fix" in passed.extra else {Fix.UNKNOWN.value}
    reset = (d.error_row("position"), rows.count("1"))
    if fixes & plain:  # records without a fix are refused wherever they go: here, to be counted once
        d.add(s, Sensor.GNSS_POSITION, rows, fixes=plain | NO_FIX, reset=reset)
    if fixes & precise:
        name = f"{s.name} (fixed)" if fixes & plain else s.name
        d.add(s, Sensor.POSITION, rows, fixes=precise if fixes & plain else precise | NO_FIX, reset=reset, name=name)


def other_altitude(d: Draft, s: Stream) -> bool:
    """Whether a receiver counts its altitude from elsewhere than the datum does; then only its map position is used."""
    unknown = "UNKNOWN"
    if d.datum is None or unknown in (d.datum.altitude, s.altitude.name) or d.datum.altitude == s.altitude.name:
        return False
    if d.motion is not Motion.PLANAR:
        text = f"{s.name} states its {s.altitude.value}, the site frame counts otherwise: its altitude is not used"
        d.note("warning", "altitude-reference", text, s.name)
    return True


def untyped_but_precise(s: Stream) -> bool:
    """Whether a receiver that never states its fix type claims centimetres."""
    if "fix" in s.extra and (s.extra["fix"] != Fix.UNKNOWN.value).any():
        return False
    return bool(np.nanmedian(np.sqrt(gnss_variance(s)[:, 0])) < PRECISE)


def gyro_of_planar(d: Draft, s: Stream) -> None:
    """Only the yaw rate; further gyros are fused too, their white noise is independent."""
    if d.cfg.preset == "amr2025" and any(d.usable(o) for o in d.log.of(Kind.ATTITUDE)):
        d.skip(s, "the amr2025 preset takes the heading of an IMU instead of its rates")
        return
    d.add(s, Sensor.GYRO, "001", sigma=(0.01,) * 3, floor=(0.003,) * 3)


def twist_of_planar(d: Draft, s: Stream) -> None:
    """Speeds always; the wheels' yaw rate only at standstill if a gyro is there: turning wheels slip."""
    has_gyro = any(c.sensor is Sensor.GYRO for c in d.channels)
    floor, rest = (0.05, 0.1, 0.1, 0.1, 0.1, 0.05), (0.05, 0.1, 0.1, 0.1, 0.1, 0.003)
    d.add(s, Sensor.TWIST, "110000" if has_gyro or d.cfg.preset == "amr2025" else "110001", floor=floor)
    if has_gyro:
        d.add(s, Sensor.TWIST, "000001", name=f"{s.name} (at rest)", sigma=rest, trust_stated=False, still=True)


def wheels(d: Draft, s: Stream) -> None:
    """Rim speeds need the geometry of the base."""
    section, mount = d.section(s), d.mount(s)
    count = s.z.shape[1]
    if count == 2 and section.track_m is not None:
        theta = WheelsDifferential(track=section.track_m, mount=mount).theta()
        d.add(s, Sensor.WHEELS_DIFFERENTIAL, "11", theta=theta)
    elif count == 4 and section.mecanum_xy_m is not None:
        theta = replace(WheelsMecanum.rectangle(*section.mecanum_xy_m), mount=mount).theta()
        d.add(s, Sensor.WHEELS_MECANUM, "1111", theta=theta)
    else:
        key = "track_m" if count == 2 else "mecanum_xy_m"
        d.skip(s, f"the geometry of its {count} wheels is unknown: give sources.{s.name}.{key}")


def ackermann(d: Draft, s: Stream) -> None:
    """Speed always, steering with the wheel base."""
    base = d.section(s).wheel_base_m
    theta = d.mount(s).theta(base if base is not None else 1.0)
    d.add(s, Sensor.ACKERMANN, "11" if base is not None else "10", theta=theta, floor=(0.05, 0.02))
    if base is None:
        d.note("info", "steering-unused", "steering angles are not used", s.name, f"give sources.{s.name}.wheel_base_m")


def yaw_scored(d: Draft, s: Stream) -> None:
    """An attitude computed by the sensor: its yaw is compared, not believed (magnetic, or of unknown origin)."""
    fused = d.cfg.preset == "amr2025"
    role = "fused" if fused else "scored: the sensor's own heading is magnetic or of unknown origin"
    d.add(s, Sensor.YAW_OF_ATTITUDE, "1", role=role, floor=(0.03,), name=f"{s.name} (heading)")


def attitude_fused(d: Draft, s: Stream) -> None:
    """robot_localization's way: the IMU's attitude is trusted as it stands."""
    d.add(s, Sensor.ATTITUDE, "111", gated=False)


def mag(d: Draft, s: Stream) -> None:
    """Compass heading, turned to true north by the world magnetic model."""
    angle = 0.0
    if d.datum is not None:
        first = int(d.passed(s.name).t[0])
        when = first if first > DATED else UNDATED_YEAR
        angle = declination(d.datum.lat, d.datum.lon, d.datum.alt, when)
    ground = d.motion is Motion.PLANAR
    role = "scored: magnetic headings near the ground are not believed" if ground else "fused"
    d.add(s, Sensor.MAG_HEADING, "1", theta=d.mount(s).theta(angle), sigma=(0.2,), role=role)


def one(sensor: Sensor, rows: str, *, role: str = "fused", floor: tuple[float, ...] = ()) -> Rule:
    """A rule that uses a stream for one sensor."""

    def rule(d: Draft, s: Stream) -> None:
        d.add(s, sensor, rows, role=role, floor=floor)

    return rule


def positioned(sensor: Sensor, rows: str, count: int) -> Rule:
    """A rule for a source of position towards which a reset may go."""

    def rule(d: Draft, s: Stream) -> None:
        d.add(s, sensor, rows, reset=(d.error_row("position"), count))

    return rule


def imu_drives(d: Draft, s: Stream) -> None:
    """The fastest IMU drives the prediction."""

    def pace(o: Stream) -> float:
        return o.rate if np.isfinite(o.rate) else 0.0

    faster = any(pace(o) > pace(s) for o in d.log.of(Kind.IMU) if d.usable(o))
    if faster or any(c.sensor is None for c in d.channels):
        d.skip(s, "one IMU drives the prediction, and it is not the fastest")
        return
    d.add(s, None, "111111", role="fused: drives the prediction")


def imu_measures(d: Draft, s: Stream) -> None:
    """The IMU as a measurement of rates and accelerations."""
    d.add(s, Sensor.GYRO, "110" if d.cfg.preset == "robot_localization" else "111", gated=False)
    d.add(s, Sensor.SPECIFIC_FORCE, "111", name=f"{s.name} (acceleration)", gated=False)


def ranges(d: Draft, s: Stream) -> None:
    """One channel per known beacon."""
    known = {**d.log.beacons, **{float(b.id): b.xyz_m for b in d.cfg.beacons}}
    seen = set(np.unique(s.z[np.isfinite(s.z[:, 0]), 0]).tolist())
    for beacon in sorted(seen & set(known)):
        theta = d.mount(s).theta(*known[beacon])
        sensor = Sensor.RANGE if s.kind is Kind.RANGE else Sensor.RANGE_BEARING
        rows, sigma = ("1", (RANGE_SIGMA,)) if sensor is Sensor.RANGE else ("11", ())
        d.add(s, sensor, rows, theta=theta, sigma=sigma, beacon=float(beacon), name=f"{s.name} #{beacon:g}")
    if not seen & set(known):
        listed = ", ".join(f"{b:g}" for b in sorted(seen))
        d.skip(s, f"the places of its beacons ({listed}) are unknown: give `beacons`")


_COMMON: Final[Mapping[Kind, Rule]] = {
    Kind.GNSS: gnss,
    Kind.RANGE: ranges,
    Kind.RANGE_BEARING: ranges,
    Kind.HEADING: one(Sensor.HEADING, "1", floor=(0.005,)),
    Kind.MAG: mag,
}
RULES: Final[Mapping[Motion, Mapping[Kind, Rule]]] = {
    Motion.PLANAR: {
        **_COMMON,
        Kind.IMU: gyro_of_planar,
        Kind.TWIST: twist_of_planar,
        Kind.WHEELS: wheels,
        Kind.ACKERMANN: ackermann,
        Kind.ATTITUDE: yaw_scored,
        Kind.GNSS_VELOCITY: one(Sensor.GNSS_VELOCITY, "110", floor=(0.05, 0.05, 0.1)),
        Kind.POSITION: positioned(Sensor.POSITION, "110", 2),
        Kind.POSE: positioned(Sensor.POSE, "110001", 2),
        Kind.BODY_VELOCITY: one(Sensor.BODY_VELOCITY, "110"),
    },
    Motion.STRAPDOWN: {
        **_COMMON,
        Kind.IMU: imu_drives,
        Kind.TWIST: one(Sensor.TWIST, "111000"),
        Kind.ATTITUDE: yaw_scored,
        Kind.GNSS_VELOCITY: one(Sensor.GNSS_VELOCITY, "111", floor=(0.1, 0.1, 0.15)),
        Kind.POSITION: positioned(Sensor.POSITION, "111", 3),
        Kind.POSE: positioned(Sensor.POSE, "111111", 3),
        Kind.BODY_VELOCITY: one(Sensor.BODY_VELOCITY, "111"),
        Kind.BARO: one(Sensor.BARO, "1", floor=(0.5,)),
        Kind.RANGE_FINDER: one(Sensor.RANGE_FINDER, "1", role="scored: the ground is not known to be level"),
        Kind.FLOW: one(Sensor.FLOW, "11", role="scored: the ground is not known to be level"),
    },
    Motion.OMNIDIRECTIONAL: {
        **_COMMON,
        Kind.IMU: imu_measures,
        Kind.TWIST: one(Sensor.TWIST, "111000"),
        Kind.ATTITUDE: attitude_fused,
        Kind.GNSS_VELOCITY: one(Sensor.GNSS_VELOCITY, "111"),
        Kind.POSITION: positioned(Sensor.POSITION, "111", 3),
        Kind.POSE: positioned(Sensor.POSE, "111111", 3),
        Kind.BODY_VELOCITY: one(Sensor.BODY_VELOCITY, "111"),
    },
    Motion.FOLLOWER: {
        Kind.GNSS: gnss,
        Kind.GNSS_VELOCITY: one(Sensor.GNSS_VELOCITY, "111", floor=(0.05, 0.05, 0.1)),
        Kind.POSITION: positioned(Sensor.POSITION, "111", 3),
        Kind.POSE: positioned(Sensor.POSITION, "111", 3),
        Kind.RANGE: ranges,
    },
}
__all__ = ["RULES", "unused"]
