"""Initial alignment: position, attitude, heading and biases from the first seconds of the data.

Nothing is typed in. The heading comes from a heading source if one is fused; otherwise from a bank of hypotheses: the
filter is run over a growing prefix of the log from headings all round, each votes by how likely its innovations are,
and their mean is taken once the votes point one way. It works from standstill and in motion.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from outrider.core.rotations import quat_from_rpy
from outrider.data import Gaussian, Verdict
from outrider.filters import step as one
from outrider.filters.channels import Channel
from outrider.filters.engine import Events, Filter, Queue, Track, run_batch
from outrider.filters.moving_start import set_out, under_way
from outrider.filters.ranged import position_by_ranges
from outrider.filters.step import OUT_DOF, OUT_NIS, OUT_S, ROWS
from outrider.models.motion import Motion
from outrider.models.sensors import Sensor
from outrider.typing import Bools, Floats

ABSOLUTE: Final = frozenset({Sensor.GNSS_POSITION, Sensor.POSITION, Sensor.POSE, Sensor.RANGE, Sensor.RANGE_BEARING})
HEADINGS: Final = frozenset(
    {Sensor.HEADING, Sensor.MAG_HEADING, Sensor.YAW_OF_ATTITUDE, Sensor.ATTITUDE, Sensor.POSE, Sensor.MAG_VECTOR}
)
HYPOTHESES: Final = 16
SPREAD: Final = 0.2  # rad, standard deviation of one hypothesis
FINE: Final = 9  # hypotheses of the second round, across +- one step of the first
FINE_SPREAD: Final = 0.12  # rad
AGREED: Final = 0.5  # rad: circular deviation of the votes at which they agree on one direction
TEMPER: Final = 2.0  # log-likelihoods are divided by this, for no model is quite true
PREFIXES: Final = (5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0)  # s
CHECKED: Final = 40.0  # s: how long motion may take to contradict a heading source
HOPELESS: Final = 60.0  # log-likelihood behind the best at which a hypothesis is dropped
CLIP: Final = 25.0  # NIS per degree of freedom at which one record's vote stops growing
WINDOW: Final = 1.0  # s of inertial data for levelling
MOST_BIAS: Final = 0.1  # rad/s: a gyro that says more is turning
MOVING: Final = "levelled by gravity in motion"
ANYWHERE: Final = 1000.0  # m: standard deviation of the position before the first fix
UNKNOWN_HEADING: Final = 1.8  # rad: uniform over the circle


@final
@dataclass(frozen=True, slots=True)
class Alignment:
    """prior at t_start [s]; how: one sentence on each of position, heading and level; heading_known."""

    prior: Gaussian
    t_start: float
    how: tuple[str, ...]
    heading_known: bool


def align(f: Filter, q: Queue, spread: Mapping[str, float]) -> Alignment | None:
    """The prior for a filter from its own data; None when no usable record exists.

    spread : initial standard deviations of blocks that the first records do not tell, by block name
    """
    start = first_position(f, q) or position_by_ranges(f, q)
    local = start is None
    if start is None:
        start = first_record(q)
    if start is None:
        return None
    t_start, p, var, place = start
    x, sd = f.layout.zeros(), np.ones(f.layout.error_size)
    for name, value in spread.items():
        if name in f.layout:
            sd[f.layout.error(name)] = value
    width = f.layout.error("position").stop - f.layout.error("position").start
    x[f.layout.state("position")] = p[:width]
    sd[f.layout.error("position")] = np.sqrt(var[:width])
    level = level_by_gravity(f, q, t_start, x, sd)
    if "heading" not in f.layout and "attitude" not in f.layout:
        return Alignment(Gaussian(x, np.diag(sd**2), f.layout), t_start, (place, level), heading_known=False)
    yaw, yaw_sd, heading = find_heading(f, q, t_start, x, sd, local)
    turn(f, x, yaw)
    sd[heading_row(f)] = yaw_sd
    known = yaw_sd < UNKNOWN_HEADING / 2
    if known and level == MOVING:
        set_out(f, q, t_start, x, sd)
    return Alignment(Gaussian(x, np.diag(sd**2), f.layout), t_start, (place, heading, level), known)


def first_position(f: Filter, q: Queue) -> tuple[float, Floats, Floats, str] | None:
    """Time and position of the first usable fix, with the variance of knowing nothing.

    The fix is fused as well: it alone then says how far it can be wrong, and how that goes with its slow error and with
    a heading that is not known yet.
    """
    found: list[tuple[float, Floats, Floats, str]] = []
    for channel, part in zip(f.channels, q.parts, strict=True):
        if channel.sensor not in (Sensor.GNSS_POSITION, Sensor.POSITION, Sensor.POSE) or channel.scored:
            continue
        good = np.flatnonzero(part.flag == Verdict.USED)
        if good.size:
            i = int(good[np.argmin(part.t[good])])
            z = np.where(np.isfinite(part.z[i, :3]), part.z[i, :3], 0.0)
            wide = np.full(3, ANYWHERE**2)
            found.append((float(part.t[i] - q.t0) * 1e-9, z, wide, f"position from the first record of {channel.name}"))
    return min(found, key=lambda e: e[0]) if found else None


def first_record(q: Queue) -> tuple[float, Floats, Floats, str] | None:
    """Time of the first usable record, with the origin as position: a local frame."""
    times = [(p.t[p.flag == Verdict.USED].min() - q.t0) * 1e-9 for p in q.parts if (p.flag == Verdict.USED).any()]
    if not times:
        return None
    return float(min(times)), np.zeros(3), np.full(3, 1e-6), "no absolute position: the start is the origin"


def level_by_gravity(f: Filter, q: Queue, t_start: float, x: Floats, sd: Floats) -> str:
    """Roll and pitch from the mean specific force after t_start, gyro bias too if the robot is at rest. In place."""
    if "attitude" not in f.layout:
        return "planar: no levelling"
    rows = inertial_window(f, q, t_start)
    a = f.layout.error("attitude")
    if rows is None:
        sd[a] = 0.3
        return "no inertial records to level by: level within 17 degrees"
    gyro, accel = rows
    mean = accel.mean(axis=0)
    calm = gyro.std(axis=0).max() < 0.02 and accel.std(axis=0).max() < 0.5
    calm = calm and not under_way(f, q, t_start)
    still = bool(calm and abs(np.linalg.norm(mean) - 9.81) < 0.5 and np.abs(gyro.mean(axis=0)).max() < MOST_BIAS)
    roll, pitch = np.arctan2(mean[1], mean[2]), np.arctan2(-mean[0], np.hypot(mean[1], mean[2]))
    q0 = np.zeros(4)
    quat_from_rpy(float(roll), float(pitch), 0.0, q0)
    x[f.layout.state("attitude")] = q0
    sd[a] = 0.03 if still else 0.2
    if still and "gyro_bias" in f.layout:
        x[f.layout.state("gyro_bias")] = gyro.mean(axis=0)
        sd[f.layout.error("gyro_bias")] = 0.003
    return "levelled by gravity at rest" if still else MOVING


def inertial_window(f: Filter, q: Queue, t_start: float) -> tuple[Floats, Floats] | None:
    """Body-axis gyro and accelerometer records of the first second."""
    for channel, part in zip(f.channels, q.parts, strict=True):
        t = (part.t - q.t0) * 1e-9
        rows = (part.flag <= Verdict.WITHHELD) & (t >= t_start) & (t <= t_start + WINDOW)
        if not rows.any():
            rows = part.flag <= Verdict.WITHHELD
            rows[np.flatnonzero(rows)[10:]] = False
        if rows.any() and channel.sensor is None:
            return part.z[rows, :3], part.z[rows, 3:6]
        if rows.any() and channel.sensor is Sensor.SPECIFIC_FORCE:
            return np.zeros((int(rows.sum()), 3)), part.z[rows, :3]
    return None


def heading_row(f: Filter) -> int:
    """Error row of the heading (of an attitude: about the body's vertical axis, right for a level start)."""
    return f.layout.error("heading").start if "heading" in f.layout else f.layout.error("attitude").start + 2


def turn(f: Filter, x: Floats, yaw: float) -> None:
    """Give a levelled state the heading `yaw`. In place."""
    if "heading" in f.layout:
        x[f.layout.state("heading")] = yaw
        return
    s = f.layout.state("attitude")
    ax, ay, az, aw = x[s]
    c, n = np.cos(0.5 * yaw), np.sin(0.5 * yaw)  # Rz(yaw) on the left
    x[s] = c * ax - n * ay, c * ay + n * ax, c * az + n * aw, c * aw - n * az


def find_heading(f: Filter, q: Queue, t_start: float, x: Floats, sd: Floats, local: bool) -> tuple[float, float, str]:
    """Heading [rad], its standard deviation, and where it comes from."""
    direct = heading_by_source(f, q, t_start, x)
    if local:
        if direct is not None:
            return direct
        return 0.0, 1e-3, "no absolute heading: the start looks along x by definition"
    banked = heading_by_bank(f, q, t_start, x, sd, CHECKED if direct is not None else PREFIXES[-1])
    if direct is None:
        return banked if banked is not None else (0.0, UNKNOWN_HEADING, "heading not observable from this data yet")
    if banked is None:
        return direct
    apart = abs((direct[0] - banked[0] + np.pi) % (2 * np.pi) - np.pi)
    return direct if apart < 3 * (direct[1] + banked[1]) else banked


def heading_by_source(f: Filter, q: Queue, t_start: float, x: Floats) -> tuple[float, float, str] | None:
    """From the first records of a fused heading source, by its innovation against a heading of zero."""
    ws = one.scratch(f.layout.size, f.layout.error_size)
    s = one.state(x, np.eye(f.layout.error_size), t_start, len(f.channels))
    for c, (channel, part) in enumerate(zip(f.channels, q.parts, strict=True)):
        sensor = channel.sensor
        if sensor is None or sensor not in HEADINGS or channel.scored or sensor is Sensor.MAG_VECTOR:
            continue
        t = (part.t - q.t0) * 1e-9
        rows = np.flatnonzero((part.flag == Verdict.USED) & (t >= t_start - 1.0))[:10]
        row = {Sensor.ATTITUDE: 2, Sensor.POSE: 5}.get(sensor, 0)
        yaws, sigma = list[float](), 0.0
        for i in rows:
            m = one.measure(f.model(), f.sources(), s, c, part.z[i], part.r[i], ws)
            for k in np.flatnonzero(ws.row[:m] == row):
                yaws.append(float(ws.y[k]))
                sigma = float(np.sqrt(ws.r[k]))
        if yaws:
            yaw = float(np.angle(np.exp(1j * np.array(yaws)).mean()))
            return yaw, max(2.0 * sigma, 0.05), f"heading from {channel.name}"
    return None


def heading_by_bank(
    f: Filter, q: Queue, t_start: float, x: Floats, sd: Floats, longest: float
) -> tuple[float, float, str] | None:
    """From the likelihood of the innovations under headings all round; None while nothing decides."""
    blind, mute = without_headings(f), muted(f)
    end = (q.t[-1] - q.t0) * 1e-9 if len(q) else t_start
    step = 2 * np.pi / HYPOTHESES
    yaws = np.arange(0.0, HYPOTHESES, dtype=np.float64) * step
    alive = np.ones(HYPOTHESES, np.bool_)
    for prefix in (p for p in PREFIXES if p <= longest):
        part = window(q, t_start, prefix, mute)
        scores = np.full(HYPOTHESES, -np.inf)
        for i in np.flatnonzero(alive):
            scores[i] = likelihood(blind, part, t_start, x, sd, yaws[i], SPREAD)
        yaw, apart = consensus(yaws, scores)
        if apart < AGREED:
            fine = yaw + np.linspace(-step, step, FINE)
            second = np.array([likelihood(blind, part, t_start, x, sd, float(y), FINE_SPREAD) for y in fine])
            yaw, apart = consensus(fine, second)
            how = f"heading from motion against position in the first {prefix:.0f} s"
            return yaw, float(np.hypot(FINE_SPREAD, apart)), how
        alive = scores > scores.max() - HOPELESS
        if t_start + prefix > end:
            break
    return None


def consensus(yaws: Floats, scores: Floats) -> tuple[float, float]:
    """Circular mean and deviation [rad] of headings (n,) that have log-likelihoods (n,)."""
    votes = np.exp((scores - scores.max()) / TEMPER)
    mean = np.sum(votes * np.exp(1j * yaws)) / votes.sum()
    return float(np.angle(mean)), float(np.sqrt(-2.0 * np.log(np.clip(np.abs(mean), 1e-12, 1.0))))


def muted(f: Filter) -> Bools:
    """(channels,) those that tell the heading directly, and so have no vote on it."""
    return np.array([c.sensor in HEADINGS and c.sensor is not Sensor.POSE for c in f.channels])


def without_headings(f: Filter) -> Filter:
    """The same filter with heading sources only scored and no gates: every record votes."""
    blind: list[Channel] = []
    for c in f.channels:
        mute = c.sensor in HEADINGS and c.sensor not in (Sensor.POSE,)
        blind.append(replace(c, role="scored" if mute else c.role, probability=1.0, reset=(0, 0)))
    return replace(f, channels=tuple(blind))


def likelihood(f: Filter, q: Queue, t_start: float, x: Floats, sd: Floats, yaw: float, spread: float) -> float:
    """Log-likelihood (to a constant) of the queue's records if the heading at t_start is `yaw`."""
    x, sd = x.copy(), sd.copy()
    turn(f, x, yaw)
    sd[heading_row(f)] = spread
    total = 0.0

    def vote(_: int, ev: Events, out: Floats, __: Track) -> None:
        nonlocal total
        fused = (out[:, OUT_DOF] > 0) & (ev.flag == Verdict.USED)
        nis = np.fmin(out[fused, OUT_NIS], CLIP * out[fused, OUT_DOF])  # a refused record votes with the most
        s = out[fused, OUT_S : OUT_S + ROWS]
        log_det = 2.0 * np.log(np.where(s > 0.0, s, 1.0)).sum(axis=1)
        total -= 0.5 * float(np.sum(nis + log_det))

    run_batch(f, Gaussian(x, np.diag(sd**2), f.layout), t_start, q, vote, period=1e9)
    return total


def window(q: Queue, t_start: float, seconds: float, mute: Bools) -> Queue:
    """The events of the first `seconds` after t_start, without muted channels."""
    first, last = np.searchsorted(q.t, [q.t0 + int(t_start * 1e9), q.t0 + int((t_start + seconds) * 1e9)])
    rows = first + np.flatnonzero(~mute[q.src[first:last]])
    return Queue(q.t[rows], q.src[rows], q.index[rows], q.late[rows], q.parts, q.t0)


__all__ = ["ABSOLUTE", "HEADINGS", "Alignment", "Motion", "align"]
