"""From a log and a configuration to filters: which stream is used for what, and why the rest is not.

One rule per kind of record and vehicle, in tables; nothing here depends on one recording.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, final

import numpy as np

from outrider.core.geodesy import gravity
from outrider.core.magnetism import declination
from outrider.data import Datum, EventLog, Finding, Fix, Kind, Stream, Verdict
from outrider.errors import ConfigError, DataError
from outrider.filters.align import ABSOLUTE
from outrider.filters.channels import ABSURD, Channel, default_sigma, gnss_variance
from outrider.filters.engine import Filter
from outrider.filters.screen import motion_stamps, screen
from outrider.models.motion import LaggedFollower, Motion, OmnidirectionalBody, PlanarRobot, StrapdownIns
from outrider.models.sensors import Mount, Sensor, WheelsDifferential, WheelsMecanum
from outrider.models.sensors.layout import MOUNT, OWN
from outrider.typing import Floats, Ints
from outrider.workflows.config import FuseConfig, MountSection, SourceSection

WHEELED: Final = (Kind.TWIST, Kind.WHEELS, Kind.ACKERMANN)
# The part of a receiver's error that stays for minutes: so many times what it states, by fix type [m] if it is silent.
SLOW_FACTOR: Final = 2.0
SLOW_ERROR: Final = {Fix.FIXED: 0.0, Fix.FLOAT: 0.4, Fix.DGNSS: 1.0, Fix.SBAS: 1.5, Fix.SINGLE: 2.0, Fix.UNKNOWN: 1.5}
PRECISE: Final = 0.15  # m: an untyped fix that claims less is taken as fixed
PLAIN_FIXES: Final = frozenset({Fix.UNKNOWN.value, Fix.SINGLE.value, Fix.SBAS.value, Fix.DGNSS.value, Fix.FLOAT.value})


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What will be done: the filters, the verdicts of screening, and the roles of all streams."""

    whole: Filter
    local: Filter | None
    datum: Datum | None
    verdicts: Mapping[str, Ints]
    roles: Mapping[str, str]
    spread: Mapping[str, float]
    findings: tuple[Finding, ...]
    log: EventLog


@final
@dataclass(slots=True)
class _Draft:
    """What is known while the plan is being made."""

    log: EventLog
    cfg: FuseConfig
    motion: Motion
    datum: Datum | None
    verdicts: dict[str, Ints]
    channels: list[Channel] = field(default_factory=list[Channel])
    roles: dict[str, str] = field(default_factory=dict[str, str])
    findings: list[Finding] = field(default_factory=list[Finding])

    def section(self, s: Stream) -> SourceSection:
        return self.cfg.sources.get(s.name, SourceSection())

    def mount(self, s: Stream) -> Mount:
        """Mount of a source: its own, its frame's in the configuration, its frame's in the log, else straight."""
        own = self.section(s).mount or self.cfg.mounts.get(s.frame)
        if own is not None:
            return mount_of(own)
        if s.frame in self.log.mounts:
            return Mount.from_matrix(self.log.mounts[s.frame])
        return Mount()

    def add(self, s: Stream, sensor: Sensor | None, rows: str, *, theta: Floats | None = None, **rest: object) -> None:
        """Add a channel for a stream; `rows` has 1 for each row that is used."""
        section = self.section(s)
        used = np.array([c == "1" for c in rows])
        sigma = default_sigma(sensor)[: used.size] if sensor is not None else np.ones(6)
        stated = section.sigma is None
        if section.sigma is not None:
            given = np.atleast_1d(np.array(section.sigma, np.float64))
            if given.size not in (1, sigma.size):
                raise ConfigError(
                    f"{given.size} standard deviations for {sigma.size} rows", where=f"sources.{s.name}.sigma"
                )
            sigma = np.broadcast_to(given, sigma.shape).copy()
        options: dict[str, object] = {
            "floor": np.zeros(sigma.size),
            "trust_stated": stated,
            "role": "fused",
            "probability": section.gate,
            "name": s.name,
            **rest,
        }
        if section.use == "score":
            options["role"] = "scored: on request"
        if section.use == "fuse" and str(options["role"]).startswith("scored"):
            options["role"] = "fused"
        if "sigma" in options:
            given_sigma = options.pop("sigma")
            sigma = sigma if not stated else np.array(given_sigma, np.float64)
        options["floor"] = np.asarray(options["floor"], np.float64) * section.scale
        self.channels.append(
            Channel(
                stream=s.name,
                sensor=sensor,
                theta=self.mount(s).theta() if theta is None else theta,
                sigma=sigma * section.scale,
                rows=used,
                **options,  # type: ignore[arg-type]
            )
        )
        self.roles.setdefault(s.name, str(options["role"]))

    def skip(self, s: Stream, why: str) -> None:
        """Not used, with the reason that the user reads."""
        self.roles[s.name] = f"not used: {why}"

    def note(self, severity: str, code: str, text: str, source: str = "", fix: str = "") -> None:
        self.findings.append(Finding(severity=severity, code=code, text=text, source=source, fix=fix))


def mount_of(section: MountSection) -> Mount:
    """A mount from its configuration (degrees to radians)."""
    roll, pitch, yaw = np.radians(section.rpy_deg)
    return Mount.from_rpy(section.xyz_m, float(roll), float(pitch), float(yaw))


def plan(log: EventLog, cfg: FuseConfig) -> Plan:
    """Decide what every stream is used for.

    Raises `DataError` when nothing can be fused and `ConfigError` for a configuration that names unknown sources.
    """
    check_names(log, cfg)
    log = replace(log, streams={s.name: delayed(s, cfg) for s in log})
    moving = motion_stamps(log)
    verdicts = {s.name: screen(s, motion=moving) for s in log}
    motion = choose_motion(log, cfg)
    d = _Draft(log, cfg, motion, find_datum(log, cfg, verdicts), verdicts)
    for s in sorted(log, key=lambda s: (s.kind is not Kind.IMU, s.name)):
        if d.section(s).use == "ignore":
            d.skip(s, "switched off in the configuration")
        elif not len(s):
            d.skip(s, "no record")
        elif not (verdicts[s.name] == Verdict.USED).any():
            d.skip(s, "no usable record")
        else:
            RULES[motion].get(s.kind, unused)(d, s)
    if not any(not c.scored for c in d.channels):
        raise DataError(
            "nothing in this log can be fused",
            where=log.path,
            fix="it needs wheel odometry, an IMU, GNSS or another position; `outrider sources` lists what was found",
        )
    needs_driver(d)
    return assemble(d)


def check_names(log: EventLog, cfg: FuseConfig) -> None:
    """Every source named in the configuration must exist."""
    for section, names in (("sources", cfg.sources), ("withhold", cfg.withhold), ("outages_s", cfg.outages_s)):
        for name in names:
            if name not in log.streams:
                known = ", ".join(sorted(log.streams)) or "none"
                raise ConfigError(f"no source '{name}' in the log", where=section, fix=f"it has {known}")


def delayed(s: Stream, cfg: FuseConfig) -> Stream:
    """The stream with its stamps set back by the configured delay."""
    delay = cfg.sources[s.name].delay_s if s.name in cfg.sources else 0.0
    return replace(s, t=s.t - round(delay * 1e9)) if delay else s


def choose_motion(log: EventLog, cfg: FuseConfig) -> Motion:
    """Process model by what the vehicle carries."""
    if cfg.preset == "robot_localization":
        return Motion.OMNIDIRECTIONAL
    if cfg.motion != "auto":
        return Motion[cfg.motion.upper()]
    live = [s for s in log if len(s) and (s.name not in cfg.sources or cfg.sources[s.name].use != "ignore")]
    kinds = {s.kind for s in live}
    if kinds & set(WHEELED):
        return Motion.PLANAR
    if Kind.IMU in kinds:
        return Motion.STRAPDOWN
    return Motion.FOLLOWER


def find_datum(log: EventLog, cfg: FuseConfig, verdicts: Mapping[str, Ints]) -> Datum | None:
    """The configured origin, else the first usable fix of the receiver with the best fixes."""
    if cfg.datum is not None:
        lat, lon = np.radians([cfg.datum.lat_deg, cfg.datum.lon_deg])
        return Datum(lat=float(lat), lon=float(lon), alt=cfg.datum.alt_m)
    for s in log.of(Kind.GNSS):
        good = np.flatnonzero(verdicts[s.name] == Verdict.USED)
        if good.size:
            i = good[np.argmin(s.t[good])]
            lat, lon, alt = s.z[i]
            height = float(alt) if np.isfinite(alt) else 0.0
            return Datum(lat=float(lat), lon=float(lon), alt=height, altitude=s.altitude.name)
    return None


# ---------------------------------------------------------------------------------------------------------- rules


def unused(d: _Draft, s: Stream) -> None:
    """Kinds without a rule."""
    reasons = {
        Kind.ESTIMATE: "another estimator's answer, drawn for comparison",
        Kind.STATUS: "another estimator's flags",
        Kind.ODOMETRY_POSE: "the base's own integrated pose: it drifts, its twist is fused instead",
        Kind.RELATIVE_POSE: "sees another robot: needs a team configuration",
    }
    d.skip(s, reasons.get(s.kind, f"{s.kind.value} has no use for a {d.motion.name.lower()} vehicle"))


def gnss(d: _Draft, s: Stream) -> None:
    """Fixed solutions are positions; all others also carry an error that stays for minutes."""
    rows = "111" if d.motion is not Motion.PLANAR else "110"
    precise = frozenset({Fix.FIXED.value})
    plain = PLAIN_FIXES
    if d.section(s).sigma is None and untyped_but_precise(s):
        precise, plain = precise | {Fix.UNKNOWN.value}, plain - {Fix.UNKNOWN.value}
    fixes = set(np.unique(s.extra["fix"]).astype(int)) if "fix" in s.extra else {Fix.UNKNOWN.value}
    reset = (d_layout_start(d, "position"), 3 if rows == "111" else 2)
    if fixes & precise or not fixes & plain:
        d.add(
            s, Sensor.POSITION, rows, fixes=precise, reset=reset, name=f"{s.name} (fixed)" if fixes & plain else s.name
        )
    if fixes & plain:
        d.add(s, Sensor.GNSS_POSITION, rows, fixes=plain, reset=reset)


def d_layout_start(d: _Draft, block: str) -> int:
    """First error row of a block for the plan's process model."""
    from outrider.models.motion import LAYOUTS

    return LAYOUTS[d.motion].error(block).start


def untyped_but_precise(s: Stream) -> bool:
    """Whether a receiver that never states its fix type claims centimetres."""
    if "fix" in s.extra and (s.extra["fix"] != Fix.UNKNOWN.value).any():
        return False
    return bool(np.nanmedian(np.sqrt(gnss_variance(s)[:, 0])) < PRECISE)


def gyro_of_planar(d: _Draft, s: Stream) -> None:
    """Only the yaw rate; further gyros are fused too, their white noise is independent."""
    d.add(s, Sensor.GYRO, "001", sigma=(0.01,) * 3, floor=(0.003,) * 3)


def twist_of_planar(d: _Draft, s: Stream) -> None:
    """Speeds always; the wheels' yaw rate only at standstill if a gyro is there: turning wheels slip."""
    has_gyro = any(c.sensor is Sensor.GYRO for c in d.channels)
    floor, rest = (0.05, 0.1, 0.1, 0.1, 0.1, 0.05), (0.05, 0.1, 0.1, 0.1, 0.1, 0.003)
    d.add(s, Sensor.TWIST, "110000" if has_gyro else "110001", floor=floor)
    if has_gyro:
        d.add(s, Sensor.TWIST, "000001", name=f"{s.name} (at rest)", sigma=rest, trust_stated=False, still=True)


def wheels(d: _Draft, s: Stream) -> None:
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


def ackermann(d: _Draft, s: Stream) -> None:
    """Speed always, steering with the wheel base."""
    base = d.section(s).wheel_base_m
    theta = d.mount(s).theta(base if base is not None else 1.0)
    d.add(s, Sensor.ACKERMANN, "11" if base is not None else "10", theta=theta, floor=(0.05, 0.02))
    if base is None:
        d.note("info", "steering-unused", "steering angles are not used", s.name, f"give sources.{s.name}.wheel_base_m")


def yaw_scored(d: _Draft, s: Stream) -> None:
    """An attitude computed by the sensor: its yaw is compared, not believed (magnetic, or of unknown origin)."""
    fused = d.cfg.preset == "amr2025"
    role = "fused" if fused else "scored: the sensor's own heading is magnetic or of unknown origin"
    d.add(s, Sensor.YAW_OF_ATTITUDE, "1", role=role, floor=(0.03,), name=f"{s.name} (heading)")


def attitude_fused(d: _Draft, s: Stream) -> None:
    """robot_localization's way: the IMU's attitude is trusted as it stands."""
    d.add(s, Sensor.ATTITUDE, "111", probability=1.0)


def mag(d: _Draft, s: Stream) -> None:
    """Compass heading, turned to true north by the world magnetic model."""
    angle = 0.0
    if d.datum is not None:
        angle = declination(d.datum.lat, d.datum.lon, d.datum.alt, max(int(s.t[0]), 0) if s.t[0] > 1e18 else 2025.5)
    theta = d.mount(s).theta(angle)
    ground = d.motion is Motion.PLANAR
    role = "scored: magnetic headings near the ground are not believed" if ground else "fused"
    d.add(s, Sensor.MAG_HEADING, "1", theta=theta, sigma=(0.2,), role=role)


def one(
    sensor: Sensor, rows: str, *, role: str = "fused", floor: tuple[float, ...] = ()
) -> Callable[[_Draft, Stream], None]:
    """A rule that uses a stream for one sensor."""

    def rule(d: _Draft, s: Stream) -> None:
        d.add(s, sensor, rows, role=role, floor=floor or (0.0,) * len(rows))

    return rule


def positioned(sensor: Sensor, rows: str, count: int) -> Callable[[_Draft, Stream], None]:
    """A rule for a source of position towards which a reset may go."""

    def rule(d: _Draft, s: Stream) -> None:
        d.add(s, sensor, rows, reset=(d_layout_start(d, "position"), count))

    return rule


def imu_drives(d: _Draft, s: Stream) -> None:
    """The fastest IMU drives the prediction."""
    rival = max(
        (o for o in d.log.of(Kind.IMU)), key=lambda o: (o.rate if np.isfinite(o.rate) else 0.0, o.name == s.name)
    )
    if rival.name != s.name or any(c.sensor is None for c in d.channels):
        d.skip(s, "one IMU drives the prediction, this one is slower")
        return
    d.add(s, None, "111111", role="fused: drives the prediction")


def imu_measures(d: _Draft, s: Stream) -> None:
    """The IMU as a measurement of rates and accelerations."""
    d.add(s, Sensor.GYRO, "110" if d.cfg.preset == "robot_localization" else "111", probability=1.0)
    d.add(s, Sensor.SPECIFIC_FORCE, "111", name=f"{s.name} (acceleration)", probability=1.0)


def ranges(d: _Draft, s: Stream) -> None:
    """One channel per known beacon."""
    known = {b.id: b.xyz_m for b in d.cfg.beacons}
    seen = set(np.unique(s.z[:, 0]))
    for beacon in sorted(seen & set(known)):
        theta = d.mount(s).theta(*known[beacon])
        sensor = Sensor.RANGE if s.kind is Kind.RANGE else Sensor.RANGE_BEARING
        d.add(s, sensor, "1" if sensor is Sensor.RANGE else "11", theta=theta, beacon=float(beacon),
              name=f"{s.name} #{beacon:g}")  # fmt: skip
    if not seen & set(known):
        d.skip(s, f"no place is known of its beacons {sorted(seen)}: give `beacons`")


_COMMON: Final = {
    Kind.GNSS: gnss,
    Kind.RANGE: ranges,
    Kind.RANGE_BEARING: ranges,
    Kind.HEADING: one(Sensor.HEADING, "1", floor=(0.005,)),
    Kind.MAG: mag,
}
RULES: Final[Mapping[Motion, Mapping[Kind, Callable[[_Draft, Stream], None]]]] = {
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


def needs_driver(d: _Draft) -> None:
    """Say when a process model lacks the source it lives on."""
    if d.motion is Motion.STRAPDOWN and not any(c.sensor is None for c in d.channels):
        raise ConfigError("a strapdown vehicle needs an IMU", where="motion", fix="choose another motion model")


# ---------------------------------------------------------------------------------------------------------- assembly


def assemble(d: _Draft) -> Plan:
    """Filters from the draft's channels."""
    slow = slow_gnss_error(d)
    spread = {"velocity": 2.0, "yaw_rate": 0.5, "rate": 0.5, "acceleration": 1.0, "wind": 1e-3}
    if d.motion is Motion.PLANAR:
        given = {k: v for k, v in d.cfg.planar.model_dump().items() if v is not None}
        ranged = any(c.sensor in (Sensor.RANGE, Sensor.RANGE_BEARING) for c in d.channels)
        planar = PlanarRobot(gnss_bias=slow, range_bias=1.0 if ranged else 0.0, **given)
        theta = coasting = planar.theta()
        spread |= {"gyro_bias": planar.initial_gyro_bias, "wheel_scale": planar.initial_scale}
        spread |= {"range_bias": max(planar.range_bias, 1e-3)}
    elif d.motion is Motion.STRAPDOWN:
        g = gravity(d.datum.lat, d.datum.alt) if d.datum else 9.80665
        usual = StrapdownIns()
        driver = next(d.log.streams[c.stream] for c in d.channels if c.sensor is None)
        gyro, accel = sampling_noise(driver)
        ins = replace(
            usual,
            gyro_noise=max(usual.gyro_noise, gyro),
            accel_noise=max(usual.accel_noise, accel),
            gnss_bias=slow,
            gnss_bias_up=1.5 * slow,
            gravity=g,
        )
        theta, coasting = ins.theta(), replace(ins, gyro_noise=0.3, accel_noise=2.0).theta()
        spread |= {"gyro_bias": ins.initial_gyro_bias, "accel_bias": ins.initial_accel_bias, "baro_bias": 1000.0}
    elif d.motion is Motion.OMNIDIRECTIONAL:
        theta = coasting = OmnidirectionalBody().theta()
    else:
        theta = coasting = LaggedFollower(acceleration=2.0).theta()
    spread["gnss_bias"] = max(slow, 1e-3)
    upstream = d.cfg.preset == "robot_localization"
    chosen = [c for c in d.channels if not (upstream and c.sensor in ABSOLUTE)]
    for c in d.channels:
        if c not in chosen:
            d.roles[c.stream] = "not used: the upstream profile has no GNSS"
    chosen = [in_body_axes(c) if d.log.streams[c.stream].kind is Kind.IMU else c for c in chosen]
    whole = Filter(motion=d.motion, theta=theta, coasting=coasting, channels=tuple(chosen), history=d.cfg.history_s)
    return Plan(
        whole=whole,
        local=local_filter(whole, d) if d.cfg.local else None,
        datum=d.datum,
        verdicts=d.verdicts,
        roles=d.roles,
        spread=spread,
        findings=tuple(d.findings),
        log=d.log,
    )


def sampling_noise(s: Stream) -> tuple[float, float]:
    """White densities [rad/s, m/s^2 per sqrt(Hz)] of a sampled IMU: what one sample says little about the next.

    Half the variance of successive differences holds noise, aliased vibration and motion between samples alike; over
    one period it acts as a density of that deviation times sqrt(dt). A fast unit gets less than our default from it, a
    log that keeps only every tenth sample far more.
    """
    dt = np.diff(s.t) * 1e-9
    usual = (dt > 0) & (dt < 3 * np.median(dt)) & np.isfinite(s.z[1:]).all(axis=1) & np.isfinite(s.z[:-1]).all(axis=1)
    if usual.sum() < 10:
        return 0.0, 0.0
    jump = np.diff(s.z, axis=0)[usual]
    density = np.sqrt(0.5 * np.mean(jump**2, axis=0) * np.median(dt[usual]))
    return float(density[:3].max()), float(density[3:].max())


def slow_gnss_error(d: _Draft) -> float:
    """Standard deviation [m] of the slowly varying error, by the worst fix type that is more than a few records."""
    worst = 0.0
    for c in d.channels:
        if c.sensor is not Sensor.GNSS_POSITION or c.scored:
            continue
        s = d.log.streams[c.stream]
        fix = s.extra.get("fix", np.full(len(s), float(Fix.UNKNOWN.value)))
        claims = claimed_sigma(s)
        for kind, silent in SLOW_ERROR.items():
            here = fix == kind.value
            if here.mean() > 0.02 and kind is not Fix.FIXED:
                stated = claims[here & np.isfinite(claims)]
                worst = max(worst, SLOW_FACTOR * float(np.median(stated)) if stated.size else silent)
    return worst


def claimed_sigma(s: Stream) -> Floats:
    """(n,) horizontal standard deviation [m] by the receiver itself, NaN where it states none."""
    var = np.where((s.var[:, :2] > 0.0) & (s.var[:, :2] < ABSURD), s.var[:, :2], np.nan).mean(axis=1)
    stated = np.where(s.extra["hacc"] > 0.0, s.extra["hacc"], np.nan) if "hacc" in s.extra else np.nan
    return np.where(np.isfinite(var), np.sqrt(var), stated)


def in_body_axes(c: Channel) -> Channel:
    """A channel of an IMU: its records arrive turned into body axes, so the kernel must not turn them again."""
    return replace(c, mount=c.theta[MOUNT:OWN].copy(), theta=straightened(c.theta))


def straightened(theta: Floats) -> Floats:
    """The same lever arm, no rotation."""
    out = theta.copy()
    out[MOUNT:OWN] = np.eye(3).ravel()
    return out


def local_filter(whole: Filter, d: _Draft) -> Filter | None:
    """The same vehicle without anything absolute: wheels and IMU only (REP-105's odom frame)."""
    if whole.motion is not Motion.PLANAR:
        return None
    relative = {Sensor.GYRO, Sensor.TWIST, Sensor.WHEELS_DIFFERENTIAL, Sensor.WHEELS_MECANUM, Sensor.ACKERMANN,
                Sensor.BODY_VELOCITY}  # fmt: skip
    channels = tuple(c for c in whole.channels if c.sensor in relative and not c.scored)
    return replace(whole, channels=channels) if channels else None


__all__ = ["Plan", "plan"]
