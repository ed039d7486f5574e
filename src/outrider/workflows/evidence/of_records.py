"""Evidence in the records themselves: units, mounts, clocks, silences."""

from typing import Final

import numpy as np

from outrider.data import Finding, Kind, Verdict
from outrider.data.evidence import BARS, POINTS, Curve, Evidence
from outrider.typing import Bools, Floats, Ints
from outrider.workflows.doctor.examine import paths, speed, upright, wheels_turn
from outrider.workflows.doctor.lags import MOST as LONGEST_LAG
from outrider.workflows.doctor.lags import correlation
from outrider.workflows.doctor.signals import GRAVITY, MANY, PIECE, Path, Signal, instants
from outrider.workflows.evidence.case import Case, curve, histogram, present
from outrider.workflows.findings.agreement import by_stream, fused_positions
from outrider.workflows.findings.records import FASTEST_TURN, mean_force

WINDOW: Final = 1.0  # s over which two sources are compared
FEW: Final = 3  # points that are worth a figure
TIME: Final = "time from start [s]"
KMH: Final = 3.6
CHORD: Final = 8.0  # s: long enough for the noise of fixes not to count as way


def forces(case: Case, f: Finding) -> Evidence | None:
    """How large accelerations are, beside one g."""
    s = case.stream(f, Kind.IMU)
    bars = histogram(np.hypot(np.hypot(s.z[:, 3], s.z[:, 4]), s.z[:, 5]), most=1.4 * GRAVITY) if s is not None else None
    if bars is None:
        return None
    text = "Lengths of the accelerations as recorded. At rest and on average an IMU tells 9.81 m/s²; in units of g, 1."
    return Evidence(
        x_label="length of the acceleration, as recorded", y_label="share", curves=(bars,), text=text,
        at=((1.0, "1 g in g"), (GRAVITY, "1 g in m/s²")),
    )  # fmt: skip


def rates(case: Case, f: Finding) -> Evidence | None:
    """How fast it says it turns: beside the wheels if they tell, else beside what vehicles do."""
    s = case.stream(f, Kind.IMU, Kind.TWIST)
    if s is None:
        return None
    both = turns(case, f) if s.kind is Kind.IMU else None
    if both is not None:
        return both
    bars = histogram(np.abs(s.z[:, :3] if s.kind is Kind.IMU else s.z[:, 5:6]).max(axis=1))
    text = "Rates of turn as recorded. Hardly any vehicle turns faster than the mark, in rad/s."
    at = ((FASTEST_TURN, f"{FASTEST_TURN:g} rad/s"),)
    return bars and Evidence(x_label="rate of turn, as recorded", y_label="share", curves=(bars,), text=text, at=at)


def beside(a: Signal, b: Signal, window: float) -> Curve | None:
    """One signal against the other at the same times, each averaged over a window [s]."""
    window = max(window, 2.0 * a.period, 2.0 * b.period)
    at = instants(a, b, 0.5 * window)
    return curve(a.mean(at, window), b.mean(at, window), "", POINTS)


def line(points: Curve, slope: float, name: str) -> Curve:
    """A line through zero as far as the points go."""
    x = np.array([min(float(points.x.min()), 0.0), max(float(points.x.max()), 0.0)])
    return Curve(x=x, y=slope * x, name=name)


def turns(case: Case, f: Finding) -> Evidence | None:
    """Turn rate by the gyro against that by the wheels, which should be one."""
    p = case.patient()
    imu = case.stream(f, Kind.IMU) or next(iter(case.log.of(Kind.IMU)), None)
    gyro, wheels = upright(p, imu) if imu is not None else None, wheels_turn(p)
    by = "by the gyro, as recorded"
    if gyro is None:
        gyro, by = next((x for way in paths(p) if (x := way.in_steps(1.0).turn_rate()) is not None), None), "by course"
    points = beside(wheels, gyro, WINDOW) if gyro is not None and wheels is not None else None
    if points is None or len(points.x) < FEW:
        return None
    return Evidence(
        x_label="turn rate by the wheels [rad/s]", y_label=by,
        curves=(points, line(points, 1.0, "the same")),
        text="Each dot is one second as both tell it. Were both right, the dots would lie along the line.",
    )  # fmt: skip


def speeds(case: Case, f: Finding) -> Evidence | None:
    """How far the wheels say it went in some seconds, against how far it got."""
    p = case.patient()
    kinds = (Kind.TWIST, Kind.ACKERMANN, Kind.WHEELS)
    found = case.stream(f, *kinds) or next(iter(p.usable(*kinds)), None)
    own = speed(p.log, found) if found is not None else None
    way = next(iter(paths(p)), None)
    points = chords(case, own, way) if own is not None and way is not None else None
    if points is None or way is None or len(points.x) < FEW:
        return None
    moving = points.x > 0.3 * float(points.x.max())
    ratio = float(np.median(points.y[moving] / points.x[moving])) if moving.any() else 1.0
    text = f"Mean speeds over {CHORD:g} s, as the crow flies; "
    if f.code == "wheel-scale":
        ratio = 1.0 - float(case.run.fused.x[-1, case.run.fused.layout.state("wheel_scale")][0])
        text += "the noise of fixes spreads the dots, the scale is estimated from all of the log."
    else:
        text += f"the wheels tell {ratio:.3g} times the speed over ground, km/h for m/s would be {KMH} times."
    lines = (line(points, 1.0, "the same"), line(points, ratio, f"{ratio:.3g} times"))
    return Evidence(
        x_label=f"over ground, by {way.source} [m/s]", y_label="by the wheels, as recorded", curves=(points, *lines),
        text=text,
    )  # fmt: skip


def chords(case: Case, own: Signal, way: Path) -> Curve | None:
    """Mean speeds as the crow flies: of the positions, and of the wheels with the heading that was estimated."""
    pose = case.run.fused.pose
    if len(pose) < FEW:
        return None
    begin = (case.log.span[0] - case.run.start) * 1e-9
    psi = np.interp(own.t + begin, case.since(pose.t), np.unwrap(pose.yaw))
    steps, mid = np.diff(own.t), 0.5 * (own.y[1:] + own.y[:-1]) * np.exp(0.5j * (psi[1:] + psi[:-1]))
    walked = np.concatenate([[0.0], np.cumsum(np.where(steps < 1.0, steps, 0.0) * mid)])
    at = np.arange(max(own.t[0], way.t[0]), min(own.t[-1], way.t[-1]) - CHORD, 0.5 * CHORD)[:MANY]
    at = at[known(way, at) & known(way, at + CHORD)]
    far = [np.interp(at + d, own.t, walked) for d in (0.0, CHORD)]
    got = [np.interp(at + d, way.t, way.p[:, 0]) + 1j * np.interp(at + d, way.t, way.p[:, 1]) for d in (0.0, CHORD)]
    return curve(np.abs(got[1] - got[0]) / CHORD, np.abs(far[1] - far[0]) / CHORD, "", POINTS)


def known(way: Path, at: Floats) -> Bools:
    """Whether the positions on both sides of each time are as near as they usually are: none within a gap of them."""
    after = np.clip(np.searchsorted(way.t, at), 1, len(way.t) - 1)
    steps = np.diff(way.t)
    return steps[after - 1] < PIECE * float(np.median(steps))


def gravity(case: Case, f: Finding) -> Evidence | None:
    """Along which of its axes an IMU feels gravity."""
    s = case.stream(f, Kind.IMU)
    up = mean_force(s) if s is not None else None
    if up is None or not np.isfinite(up).all():
        return None
    text = "Median acceleration along the three axes of the sensor. "
    text += "Mounted straight, all of it would be in z, upwards: +9.81 m/s²."
    if f.code == "mount-found":
        text += " Which way is forward was found from accelerations when the wheels speed up, brake and turn."
    bars = Curve(x=np.arange(3.0), y=up, drawn=BARS)
    return Evidence(
        x_label="axis of the sensor", y_label="acceleration [m/s²]", curves=(bars,), text=text,
        levels=((GRAVITY, "gravity"),), names=("x", "y", "z"),
    )  # fmt: skip


def lags(case: Case, f: Finding) -> Evidence | None:
    """How alike the turn rates are when one is shifted."""
    p = case.as_stamped()
    imu = next(iter(p.usable(Kind.IMU)), None)
    gyro, wheels = upright(p, imu) if imu is not None else None, wheels_turn(p)
    if gyro is None or wheels is None or wheels.source != f.source:
        return None
    window = max(2.0 * gyro.period, 2.0 * wheels.period, 0.2)
    at = instants(gyro, wheels, 0.5 * window)
    mine, shifts = gyro.mean(at, window), np.arange(-LONGEST_LAG, LONGEST_LAG + 0.01, 0.05)
    alike = np.array([correlation(mine, wheels.mean(at + k, window)) for k in shifts])
    drawn = curve(shifts, alike)
    if drawn is None:
        return None
    best = float(drawn.x[int(np.argmax(np.abs(drawn.y)))])
    return Evidence(
        x_label="the wheels taken as late by [s]", y_label="likeness (correlation)", curves=(drawn,),
        at=((0.0, "as stamped"), (best, "most alike")),
        text=f"The turn rates of {gyro.source} and {wheels.source}, the one shifted against the other: "
        f"they are most alike {abs(best):.2g} s apart.",
    )  # fmt: skip


def stamps(case: Case, f: Finding) -> Evidence | None:
    """Stamps in the order of the records: a good clock draws a rising line."""
    s = case.log.streams.get(f.source)
    if s is None or len(s) < FEW:
        return None
    drawn = curve(np.arange(float(len(s))), case.since(s.t), f.source, POINTS)
    text = "Stamps in the order in which the records stand in the log. A good clock gives one rising line."
    return drawn and Evidence(x_label="record", y_label="its stamp [s]", curves=(drawn,), text=text)


def latencies(case: Case, f: Finding) -> Evidence | None:
    """How long after its stamp each record arrived."""
    s = case.log.streams.get(f.source)
    if s is None:
        return None
    drawn = curve(case.since(s.t_arrival), np.asarray((s.t_arrival - s.t) * 1e-9, np.float64), f.source, POINTS)
    text = "Time between the stamp of each record and its arrival."
    return drawn and Evidence(x_label=TIME, y_label="arrival after stamp [s]", curves=(drawn,), text=text)


def pace(case: Case, f: Finding) -> Evidence | None:
    """Time from each usable record to the one before; gaps stand out."""
    named = sorted((s for s in case.log if f.source in (s.name, "")), key=len, reverse=True)[:3]
    usable = ((s.t[case.chosen.verdicts[s.name] <= Verdict.WITHHELD], s.name) for s in named)
    return gaps("usable records", *(intervals(case, t, name) for t, name in usable))


def outage(case: Case, f: Finding) -> Evidence | None:
    """Time from each fused position to the one before, and from the last to the end."""
    members = dict(by_stream(case.run, case.chosen)).get(f.source, [])
    return gaps("fused positions", intervals(case, fused_positions(case.run, members), f.source))


def gaps(what: str, *drawn: Curve | None) -> Evidence | None:
    """Intervals, gaps standing out."""
    text = f"Time between successive {what}; each dot far above the others is a gap, which it ends."
    curves = present(*drawn)
    return (
        Evidence(x_label=TIME, y_label="to the one before [s]", curves=curves, text=text, log_y=True)
        if curves
        else None
    )


def intervals(case: Case, t: Ints, name: str) -> Curve | None:
    """Seconds from each stamp to the one before."""
    t = np.sort(t)
    apart = np.fmax(np.diff(t) * 1e-9, 1e-4).astype(np.float64)
    return curve(case.since(t[1:]), apart, name, POINTS) if len(t) >= FEW else None


__all__ = ["forces", "gravity", "lags", "latencies", "outage", "pace", "rates", "speeds", "stamps", "turns"]
