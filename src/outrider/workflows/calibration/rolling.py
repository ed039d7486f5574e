"""What wheels and IMU tell of each other without any filter: clock, turn rates, mount of the IMU."""

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from outrider.core.angles import wrap_all
from outrider.core.attitudes import matrices_to_quats, quats_to_rpy
from outrider.data import Kind, Stream
from outrider.typing import Floats
from outrider.workflows.calibration.fit import SURE, sandwich
from outrider.workflows.calibration.row import Row, row_of
from outrider.workflows.config import FuseConfig, SourceSection
from outrider.workflows.doctor.examine import Patient, told_mount, upright
from outrider.workflows.doctor.mounting import STEP, turned
from outrider.workflows.doctor.mounting import WINDOW as FORCES
from outrider.workflows.doctor.signals import (
    GRAVITY,
    Signal,
    instants,
    seconds,
    signal,
    speed,
    turn_rate_of_wheels,
)
from outrider.workflows.findings.records import mean_force
from outrider.workflows.parameters import WIDEST, What

WINDOW: Final = 0.4  # s over which turn rates are compared: longer than a period of most wheels
FEW: Final = 100  # comparisons
MOST: Final = 1.0  # s: clocks further apart are the doctor's
COARSE: Final = 0.05  # s between the lags tried
CLEAR: Final = 1.2  # how much worse any other lag must be
ROUNDS: Final = 6
TURNING: Final = 0.05  # rad/s: deviation of a turn rate that tells a scale
WIDEST_DEG: Final = 5.0  # half of the widest interval of an angle that still says something
AGAINST_GYRO: Final = "turn rate scale against the gyro"
LEVEL: Final = 0.03  # m/s^2: what a calibrated accelerometer is off by, one sigma; it tilts what gravity says


def rolling_rows(p: Patient, cfg: FuseConfig) -> list[Row]:
    """Rows of wheels against the first IMU, and of its mount."""
    imu = next(iter(p.usable(Kind.IMU)), None)
    gyro = upright(p, imu) if imu is not None else None
    if imu is None or gyro is None:
        return []
    out: list[Row] = []
    rolling: Signal | None = None
    for s in p.usable(Kind.TWIST, Kind.ACKERMANN):
        v, w = speed(p.log, s), turn_rate_of_wheels(p.log, s)
        lag = 0.0
        if w is not None:
            found = against(gyro, w)
            out += wheel_rows(cfg, s.name, found)
            lag = found.lag if SURE * found.sds[0] <= WIDEST[What.DELAY] else 0.0
        if rolling is None and v is not None:
            rolling = Signal(v.source, v.t - lag, v.y)
    return out + (mount_rows(p, cfg, imu, rolling) if rolling is not None else [])


def wheel_rows(cfg: FuseConfig, name: str, found: "Against") -> list[Row]:
    """Delay and turn rates of wheels."""
    told = cfg.sources.get(name, SourceSection())
    late, gain = told.delay_s + found.lag, told.rate_gain * found.gain
    half = SURE * found.sds[0], abs(told.rate_gain) * SURE * found.sds[1]
    clock = row_of(name, What.DELAY.value, "s", told.delay_s, late, half[0], WIDEST[What.DELAY])
    turns = row_of(name, AGAINST_GYRO, "", told.rate_gain, gain, half[1], WIDEST[What.RATE])
    rows = ((clock, "delay_s", late), (turns, "rate_gain", gain))
    return [replace(r, section={"sources": {name: {key: round(x, 5)}}}) if r.differs else r for r, key, x in rows]


def mount_rows(p: Patient, cfg: FuseConfig, imu: Stream, rolling: Signal) -> list[Row]:
    """Angles of the IMU's mount."""
    found = mount_angles(p, imu, rolling)
    if found is None:
        return []
    R, xyz = told_mount(p, imu), told_place(p, imu)
    told = quats_to_rpy(matrices_to_quats(R if R is not None else np.eye(3))).ravel()
    angles = told + wrap_all(found[0] - told)
    degrees = np.round(np.degrees([told, angles, found[1]]), 4) + 0.0
    rows = [
        row_of(imu.name, f"mount, {name}", "deg", float(a), float(b), float(half), WIDEST_DEG)
        for (a, b, half), name in zip(degrees.T, ("roll", "pitch", "yaw"), strict=True)
    ]
    best = [round(r.value if r.found else r.told, 2) + 0.0 for r in rows]
    section = {"sources": {imu.name: {"mount": {"xyz_m": xyz, "rpy_deg": best}}}}
    return [replace(r, section=section) if r.differs else r for r in rows]


def told_place(p: Patient, imu: Stream) -> list[float]:
    """Where the IMU sits, as far as anybody told."""
    own = p.given.sources[imu.name].mount if imu.name in p.given.sources else None
    own = own or p.given.mounts.get(imu.frame)
    if own is not None:
        return list(own.xyz_m)
    return p.log.mounts[imu.frame][:3, 3].tolist() if imu.frame in p.log.mounts else [0.0, 0.0, 0.0]


@final
@dataclass(frozen=True, slots=True)
class Against:
    """Wheels against a gyro. lag : s that their stamps are late;  gain : that makes their turn rates the gyro's;
    sds : of both, inf where the motion does not tell."""

    lag: float
    gain: float
    sds: tuple[float, float]


UNKNOWN: Final = Against(0.0, 1.0, (np.inf, np.inf))


def against(gyro: Signal, wheels: Signal) -> Against:
    """Clock and turn rate of wheels against a gyro, by means over windows.

    wheels(t + lag) = slope gyro(t) + offset + noise, by Gauss-Newton from the best lag of a search; the gyro is by far
    the better one, and so stands on the right; gain = 1/slope.
    """
    at = instants(gyro, wheels, 0.5 * WINDOW)
    at = at[(at > at.min() + MOST) & (at < at.max() - MOST)] if len(at) else at
    y = wheels.mean(at, WINDOW)
    tried = np.arange(-MOST, MOST + 0.5 * COARSE, COARSE)
    left = np.array([misfit(gyro.mean(at - lag, WINDOW), y) for lag in tried])
    if not np.isfinite(left).any():
        return UNKNOWN
    best = int(np.nanargmin(left))
    others = left[np.abs(tried - tried[best]) > 0.5]
    if best in (0, len(tried) - 1) or not others.min() > CLEAR * left[best]:
        return UNKNOWN
    return refined(gyro, y, at, float(tried[best]))


def misfit(x: Floats, y: Floats) -> float:
    """Mean square of what a line through x leaves of y; NaN where x does not turn."""
    good = np.isfinite(x) & np.isfinite(y)
    if good.sum() < FEW or np.std(x[good]) < TURNING:
        return float("nan")
    x, y = x[good] - x[good].mean(), y[good] - y[good].mean()
    return float(np.mean((y - (x @ y) / (x @ x) * x) ** 2))


def refined(gyro: Signal, y: Floats, at: Floats, lag: float) -> Against:
    """The search's end, and how sure it is."""
    beta, cov = np.ones(3), np.eye(3)
    for _ in range(ROUNDS):
        x, slope = gyro.mean(at - lag, WINDOW), gyro.slope(at - lag, WINDOW)
        good = np.isfinite(x) & np.isfinite(y) & np.isfinite(slope)
        M = np.column_stack([x[good], np.ones(good.sum()), -beta[0] * slope[good]])
        A = M.T @ M + 1e-12 * np.eye(3)
        beta = np.linalg.solve(A, M.T @ y[good])
        cov = sandwich(A, M * (y[good] - M @ beta)[:, None], at[good])
        lag += float(np.clip(beta[2], -COARSE, COARSE))
    if abs(beta[0]) < 0.1:
        return UNKNOWN
    return Against(
        lag, 1.0 / float(beta[0]), (float(np.sqrt(cov[2, 2])), float(np.sqrt(cov[0, 0])) / float(beta[0]) ** 2)
    )


def mount_angles(p: Patient, s: Stream, rolling: Signal | None) -> tuple[Floats, Floats] | None:
    """Roll, pitch, yaw (3,) [rad] of the IMU on the body, and half of their 95 % intervals; None without gravity.

    Gravity is what is left of the mean specific force when the accelerations that the wheels ask for are taken off.
    """
    up, turn = mean_force(s), upright(p, s)
    if up is None or abs(np.linalg.norm(up) - GRAVITY) > 0.2 * GRAVITY:
        return None
    t = seconds(p.log, s)
    axes = tuple(signal(s.name, t, s.z[:, 3 + i]) for i in range(3))
    if any(a is None for a in axes):
        return None
    R, sd = turned(axes, up, rolling, turn)  # type: ignore[arg-type]
    if rolling is not None and np.isfinite(sd):
        at = instants(rolling, axes[0], STEP)  # type: ignore[arg-type]
        f = np.column_stack([a.mean(at, FORCES) for a in axes if a is not None])
        asked = np.zeros((len(at), 3))
        asked[:, 0] = rolling.slope(at, FORCES)
        asked[:, 1] = rolling.mean(at, FORCES) * (turn.mean(at, FORCES) if turn is not None else 0.0)
        for _ in range(2):
            R, sd = turned(axes, np.nanmean(f - asked @ R, axis=0), rolling, turn)  # type: ignore[arg-type]
    tilt = LEVEL / GRAVITY
    return quats_to_rpy(matrices_to_quats(R)).ravel(), SURE * np.array([tilt, tilt, sd])
