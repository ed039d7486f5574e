"""`examine`: what a log shows before anything is fused, and what would mend it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, final

import numpy as np

from outrider.core.attitudes import matrices_to_quats, quats_to_rpy
from outrider.data import Datum, EventLog, Finding, Kind, Stream, Verdict
from outrider.io.config import merged
from outrider.typing import Floats, Ints
from outrider.workflows.config import FuseConfig
from outrider.workflows.discover import delayed, find_datum, scaled, screened
from outrider.workflows.doctor.lags import Lag, alike, correlation, lag_between
from outrider.workflows.doctor.mounting import Turned, angle_between, mount_of
from outrider.workflows.doctor.ranges import range_scale, told
from outrider.workflows.doctor.signals import (
    ABSURD,
    GRAVITY,
    Path,
    Signal,
    instants,
    path,
    seconds,
    signal,
    speed,
    turn_rate_of_wheels,
)
from outrider.workflows.doctor.wander import Whole, scale_by_path, wanders
from outrider.workflows.doctor.wander import told as scale_told
from outrider.workflows.draft import mount_of as mounted
from outrider.workflows.findings.records import ENOUGH, FASTEST_TURN, G_BAND, TILT, mean_force
from outrider.workflows.findings.say import error, warning

DEGREE: Final = np.pi / 180.0
KMH: Final = 1.0 / 3.6
LATE: Final = 0.06  # s: clocks this near do no harm
SURE: Final = 5.0  # deviations that a lag must be from none
MISMOUNTED: Final = np.radians(20.0)  # from the mount that is told, or from straight
ALIKE: Final = 0.7  # correlation of two turn rates that decides about a sense of rotation
LIKE_UNIT: Final = 0.15  # relative departure from a factor between units
RANGE_OFF: Final = 0.01  # departure of a range scale from one
COURSES: Final = 30  # of them that decide
COURSE_WINDOW: Final = 2.0  # s over which a course says how fast it turns
COURSE_STEPS: Final = (1.0, 2.0)  # s over which its positions are averaged, where one by one they are too noisy


@final
@dataclass(slots=True)
class Patient:
    """A log while it is examined, corrected by what is prescribed so far. given : what the configuration says."""

    log: EventLog
    given: FuseConfig
    verdicts: Mapping[str, Ints]
    datum: Datum | None
    findings: list[Finding] = field(default_factory=list[Finding])
    prescribed: dict[str, Any] = field(default_factory=dict[str, Any])

    def note(self, finding: Finding) -> None:
        """Something found."""
        self.findings.append(finding)

    def prescribe(self, source: str, **keys: object) -> bool:
        """Set keys of a source that the configuration leaves alone; whether all were free."""
        section = self.given.sources.get(source)
        if section is not None and section.model_fields_set & set(keys):
            return False
        self.prescribed = merged(self.prescribed, {"sources": {source: keys}})
        cfg = FuseConfig.model_validate({"sources": {source: keys}})
        self.log = self.log.with_streams(scaled(self.log.streams[source], cfg))
        return True

    def usable(self, *kinds: Kind) -> Iterator[Stream]:
        """Streams of these kinds, switched on, without the records that screening refuses."""
        for s in self.log.of(*kinds):
            section = self.given.sources.get(s.name)
            good = self.verdicts[s.name] == Verdict.USED
            if good.sum() > ENOUGH and (section is None or section.use != "ignore"):
                yield s.select(good)


@final
@dataclass(frozen=True, slots=True)
class Examination:
    """findings : what was found, in the order of looking;  prescribed : the configuration that mends it."""

    findings: tuple[Finding, ...]
    prescribed: Mapping[str, Any]


def examine(log: EventLog, cfg: FuseConfig) -> Examination:
    """Look at units, mounts, senses of rotation and clocks of a log; truth and estimates play no part.

    Prescribes only what `cfg` leaves open, and only what two sources, or gravity, bear out.
    """
    verdicts = screened(log)
    log = replace(log, streams={s.name: scaled(s, cfg) for s in log})
    p = Patient(log, cfg, verdicts, find_datum(log, cfg, verdicts))
    for imu in list(p.usable(Kind.IMU)):
        units(p, imu)
    wheel_units(p)
    for imu in list(p.usable(Kind.IMU)):
        senses(p, imu)
    if all(upright(p, imu) is None for imu in p.usable(Kind.IMU)):
        sense_of_wheels(p)
    for imu in list(p.usable(Kind.IMU)):  # with their senses mended
        mounts(p, imu)
    clocks(p)
    range_scales(p)
    wheel_scales(p)
    return Examination(tuple(p.findings), p.prescribed)


def units(p: Patient, s: Stream) -> None:
    """Accelerations in g, rates in degrees."""
    f = mean_force(s)
    if f is not None and G_BAND[0] < np.linalg.norm(f) < G_BAND[1] and p.prescribe(s.name, force_gain=9.80665):
        text = f"{s.name} reports accelerations in g (median {np.linalg.norm(f):.2f}): taken times 9.80665"
        p.note(warning("unit-g", text, s.name, f"sources: {{{s.name}: {{force_gain: 9.80665}}}}"))
    rates = np.abs(s.z[np.isfinite(s.z[:, :3]).all(axis=1), :3])
    wheels = strongest_turn(p)
    top = float(np.percentile(rates, 95)) if len(rates) > ENOUGH else 0.0
    by_wheels = wheels is not None and top > 0.3 * np.degrees(wheels) > 3.0
    if (top > FASTEST_TURN or by_wheels) and p.prescribe(s.name, rate_gain=round(DEGREE, 9)):
        text = f"the rates of {s.name} are degrees per second (95 % below {top:.0f}): taken times pi/180"
        p.note(warning("unit-deg", text, s.name, f"sources: {{{s.name}: {{rate_gain: 0.0174533}}}}"))


def strongest_turn(p: Patient) -> float | None:
    """The yaw rate that 95 % of the wheels' are below [rad/s], None without wheels or if theirs are degrees."""
    tops = [float(np.percentile(np.abs(s.z[:, 5]), 95)) for s in p.usable(Kind.TWIST) if s.z[:, 5].any()]
    return min((t for t in tops if 0.0 < t < FASTEST_TURN), default=None)


def wheel_units(p: Patient) -> None:
    """Turn rates of wheels in degrees, speeds in km/h."""
    for s in list(p.usable(Kind.TWIST)):
        top = float(np.percentile(np.abs(s.z[:, 5]), 95))
        if top > FASTEST_TURN and p.prescribe(s.name, rate_gain=round(DEGREE, 9)):
            text = f"the turn rates of {s.name} are degrees per second (95 % below {top:.0f}): taken times pi/180"
            p.note(warning("unit-deg", text, s.name, f"sources: {{{s.name}: {{rate_gain: 0.0174533}}}}"))
    ground = next((x for way in paths(p) if (x := way.speed()) is not None), None)
    for s in list(p.usable(Kind.TWIST, Kind.ACKERMANN, Kind.WHEELS)):
        own = speed(p.log, s)
        ratio = speed_ratio(own, ground) if own is not None and ground is not None else None
        if ratio is not None and abs(ratio / KMH - 1.0) < LIKE_UNIT and p.prescribe(s.name, speed_gain=round(KMH, 9)):
            text = f"{s.name} tells {1 / ratio:.2f} times the speed of {ground.source if ground else ''}: km/h"
            p.note(warning("unit-kmh", text, s.name, f"sources: {{{s.name}: {{speed_gain: 0.277778}}}}"))


def speed_ratio(wheels: Signal, ground: Signal) -> float | None:
    """How far it went over ground for each metre that the wheels tell, where they turn; None if hardly ever."""
    window = max(5.0, 2.0 * ground.period)
    at = instants(wheels, ground, window)
    a, b = np.abs(wheels.mean(at, window)), ground.mean(at, window)
    good = np.isfinite(a) & np.isfinite(b) & (b > 0.5)
    return float(np.median(b[good] / np.maximum(a[good], 1e-6))) if good.sum() >= ENOUGH else None


def paths(p: Patient) -> list[Path]:
    """What tells where the vehicle was."""
    found = (path(p.log, s, np.ones(len(s), np.bool_), p.datum) for s in p.usable(Kind.GNSS, Kind.POSITION, Kind.POSE))
    return [w for w in found if w is not None]


def upright(p: Patient, s: Stream) -> Signal | None:
    """Turn rate about the direction that gravity calls up."""
    up = mean_force(s)
    if up is None or np.linalg.norm(up) < 0.5 * GRAVITY:
        return None
    rates = np.where(np.abs(s.z[:, :3]) < ABSURD, s.z[:, :3], np.nan)
    return signal(s.name, seconds(p.log, s), np.sum(rates * up / np.linalg.norm(up), axis=1))


def wheels_turn(p: Patient) -> Signal | None:
    """Turn rate by the first wheels that tell one."""
    return next((w for s in p.usable(Kind.TWIST) if (w := turn_rate_of_wheels(p.log, s)) is not None), None)


def senses(p: Patient, s: Stream) -> None:
    """Who turns the wrong way round: gyro, accelerometer or wheels; the path over ground decides."""
    gyro, wheels = upright(p, s), wheels_turn(p)
    r = alike(gyro, wheels) if gyro is not None and wheels is not None else 0.0
    if r >= 0.0 or gyro is None or wheels is None:
        return
    text = f"{s.name} and {wheels.source} turn opposite ways (correlation {r:.2f}): "
    side = next((x for way in paths(p) if (x := course_side(way, wheels)) != 0.0), 0.0)
    if side == 0.0:
        fix = f"find out which is wrong, and set its `rate_gain: -1` (or `force_gain: -1` of {s.name})"
        p.note(error("turn-sense", text + "one of them is mirrored", s.name, fix))
    elif side < 0.0 and p.prescribe(wheels.source, rate_gain=-1.0):
        fix = f"sources: {{{wheels.source}: {{rate_gain: -1}}}}"
        p.note(warning("turn-sense", text + "the course over ground goes with the IMU", wheels.source, fix))
    elif side > 0.0:
        f = mean_force(s)
        key = "force_gain" if f is not None and f[2] < -0.5 * GRAVITY else "rate_gain"
        if p.prescribe(s.name, **{key: -1.0}):
            why = "it tells gravity's pull, not the specific force" if key == "force_gain" else "its gyro is mirrored"
            p.note(warning("turn-sense", text + why, s.name, f"sources: {{{s.name}: {{{key}: -1}}}}"))


def sense_of_wheels(p: Patient) -> None:
    """Wheels that turn the wrong way round, where no gyro is there to be compared with: the course says so alone."""
    wheels = wheels_turn(p)
    if wheels is None:
        return
    against = next((way.source for way in paths(p) if course_side(way, wheels) < 0.0), None)
    if against is not None and p.prescribe(wheels.source, rate_gain=-1.0):
        text = f"{wheels.source} turns opposite to the course over ground of {against}: its turn rate is mirrored"
        p.note(warning("turn-sense", text, wheels.source, f"sources: {{{wheels.source}: {{rate_gain: -1}}}}"))


def course_side(whole: Path, turn: Signal) -> float:
    """+1 if the course turns as the signal says, -1 if the other way, 0 if that cannot be told."""
    for way in (whole, *(whole.in_steps(step) for step in COURSE_STEPS)):
        course = way.turn_rate()
        if course is None:
            continue
        at = instants(turn, course, 0.5 * COURSE_WINDOW)
        r = correlation(turn.mean(at, COURSE_WINDOW), course.mean(at, COURSE_WINDOW), COURSES)
        if abs(r) > ALIKE:
            return float(np.sign(r))
    return 0.0


def mounts(p: Patient, s: Stream) -> None:
    """The mount that gravity and the wheels ask for, against the one that is told."""
    up = mean_force(s)
    if up is None or abs(np.linalg.norm(up) - GRAVITY) > 0.2 * GRAVITY:
        return
    t = seconds(p.log, s)
    axes = tuple(signal(s.name, t, s.z[:, 3 + i]) for i in range(3))
    if any(a is None for a in axes):
        return
    rolling = next((v for w in p.usable(Kind.TWIST, Kind.ACKERMANN) if (v := speed(p.log, w)) is not None), None)
    found = mount_of(axes, up, rolling, upright(p, s))  # type: ignore[arg-type]
    told = told_mount(p, s)
    off = (angle_between if found.whole else tilt_of)(found.R, told if told is not None else np.eye(3))
    if off > MISMOUNTED:
        say_mount(p, s, found, told, off)


def tilt_of(A: Floats, B: Floats) -> float:
    """The angle between the directions that two mounts call up [rad]."""
    return float(np.arccos(np.clip(A[2] @ B[2], -1.0, 1.0)))


def told_mount(p: Patient, s: Stream) -> Floats | None:
    """(3, 3) body from sensor as configuration or log tell it."""
    own = p.given.sources[s.name].mount if s.name in p.given.sources else None
    own = own or p.given.mounts.get(s.frame)
    if own is not None:
        return np.reshape(mounted(own).rotation, (3, 3))
    return p.log.mounts[s.frame][:3, :3] if s.frame in p.log.mounts else None


def say_mount(p: Patient, s: Stream, found: Turned, told: Floats | None, off: float) -> None:
    """Name a wrong mount; give the right one unless somebody told another."""
    rpy = [round(float(a), 1) + 0.0 for a in np.degrees(quats_to_rpy(matrices_to_quats(found.R)).ravel())]
    where = {"mounts": {s.frame: {"rpy_deg": rpy}}} if s.frame else {"sources": {s.name: {"mount": {"rpy_deg": rpy}}}}
    line = (
        f"mounts: {{{s.frame}: {{rpy_deg: {rpy}}}}}"
        if s.frame
        else f"sources: {{{s.name}: {{mount: {{rpy_deg: {rpy}}}}}}}"
    )
    how = "gravity and the wheels ask for" if found.whole else "gravity asks for"
    rest = "" if found.whole else "; its yaw cannot be told from this log"
    if told is not None:
        if tilt_of(found.R, told) > np.radians(TILT):
            return  # the findings of a run name what gravity contradicts
        text = f"the mount told for {s.frame or s.name} is {np.degrees(off):.0f} deg off what {how}"
        p.note(error("mount-conflict", text, s.name, line))
        return
    p.prescribed = merged(p.prescribed, where)
    text = f"{s.frame or s.name} is turned on the body by roll, pitch, yaw {rpy} deg, as {how}{rest}"
    p.note(warning("mount-found", text, s.name, line))


def clocks(p: Patient) -> None:
    """Wheels whose stamps lag behind the IMU's, or run ahead."""
    for imu in p.usable(Kind.IMU):
        gyro = upright(p, imu)
        for s in list(p.usable(Kind.TWIST)):
            wheels = turn_rate_of_wheels(p.log, s)
            both = lag_between(gyro, wheels) if gyro is not None and wheels is not None else None
            if both is not None and abs(both.lag) > max(LATE, SURE * both.sd):
                say_lag(p, both)
        break


def range_scales(p: Patient) -> None:
    """Ranges that are too long in proportion, by the places of their beacons."""
    known = {**p.log.beacons, **{float(b.id): b.xyz_m for b in p.given.beacons}}
    rolling = next((v for w in p.usable(Kind.TWIST) if (v := speed(p.log, w)) is not None), None)
    turning = next((g for s in p.usable(Kind.IMU) if (g := upright(p, s)) is not None), wheels_turn(p))
    if rolling is None or turning is None:
        return
    for s in list(p.usable(Kind.RANGE)):
        s = s.select(np.argsort(s.t, kind="stable"))
        s = s.select(np.isin(s.z[:, 0], list(known)))
        if len(set(s.z[:, 0].tolist())) < 3:
            continue
        places = np.array([known[float(b)] for b in s.z[:, 0]], np.float64)
        found = range_scale(seconds(p.log, s), s.z[:, 1], places, rolling, turning)
        if found is None or abs(found.scale - 1.0) < max(RANGE_OFF, SURE * found.sd):
            continue
        if p.prescribe(s.name, range_gain=round(1.0 / found.scale, 4)):
            p.note(told(found, s.name))


def wheel_scales(p: Patient) -> None:
    """Wheels that do not measure metres, where a receiver's error wanders: elsewhere the estimate knows it better."""
    cfg = FuseConfig.model_validate(merged(p.prescribed, p.given.model_dump(exclude_unset=True)))
    timed = Patient(p.log.with_streams(*(delayed(s, cfg) for s in p.log)), p.given, p.verdicts, p.datum)
    for name, receiver, found in whole_paths(timed):
        if (said := scale_told(found, name, receiver)) is not None:
            p.note(said)


def whole_paths(p: Patient) -> Iterator[tuple[str, str, Whole]]:
    """Wheels, a receiver whose error wanders, and what the first measure by the path of the second."""
    receiver = next((w for w in paths(p) if wanders(w, np.sqrt(np.abs(p.log.streams[w.source].var[:, 0])))), None)
    gyro = next((g for s in p.usable(Kind.IMU) if (g := upright(p, s)) is not None), None)
    if receiver is None or gyro is None:
        return
    for s in p.usable(Kind.TWIST, Kind.ACKERMANN, Kind.WHEELS):
        own = speed(p.log, s)
        found = scale_by_path(receiver, own, gyro) if own is not None else None
        if found is not None:
            yield s.name, receiver.source, found


def say_lag(p: Patient, found: Lag) -> None:
    """Name a lag, and take it off."""
    delay = round(found.lag, 3)
    if p.prescribe(found.b, delay_s=delay):
        late = "late" if delay > 0 else "early"
        text = f"{found.b} is stamped {abs(delay):.2f} s (+-{2 * found.sd:.2f}) too {late} against {found.a}: taken off"
        p.note(warning("clock-offset", text, found.b, f"sources: {{{found.b}: {{delay_s: {delay}}}}}"))


__all__ = ["Examination", "examine"]
