"""What wheels say of turning against what the gyro says: their clock, and how one is made the other.

    y(t + lag) = slope w(t) + offset + zero u(t + lag) + noise,

w the gyro's yaw rate, by far the better one, and so on the right. By the source, y is the yaw rate of a base (slope:
its scale), the difference of right and left rim speeds (slope: the track), or v tan(steering) (slope: the wheel base;
u = v / cos^2(steering), so that `zero` is what the steering tells when the robot drives straight on).
"""

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from outrider.data import EventLog, Kind, Stream
from outrider.typing import Floats
from outrider.workflows.doctor.signals import Signal, instants, seconds, signal, turn_rate_of_wheels
from outrider.workflows.sandwich import sandwich

WINDOW: Final = 0.4  # s over which turn rates are compared: longer than a period of most wheels
OVERLAP: Final = 2.0  # windows that share a sample: so many times their scatter counts
FEW: Final = 100  # comparisons
MOST: Final = 1.0  # s: clocks further apart are the doctor's
COARSE: Final = 0.05  # s between the lags tried
CLEAR: Final = 1.2  # how much worse any other lag must be
ROUNDS: Final = 6
ZEROS: Final = 3  # rounds for the steering's zero, which enters by a tangent
TURNING: Final = 0.05  # rad/s: deviation of a turn rate that tells a scale
STEEPEST: Final = 1.3  # rad: no wheel is steered further


@final
@dataclass(frozen=True, slots=True)
class Against:
    """Wheels against a gyro. lag : s that their stamps are late;  slope : of what they tell over the gyro's yaw rate;
    zero : of the steering [rad];  sds : of the three, inf where the motion does not tell."""

    lag: float
    slope: float
    zero: float
    sds: tuple[float, float, float]


UNKNOWN: Final = Against(0.0, 1.0, 0.0, (np.inf, np.inf, np.inf))


def turning(log: EventLog, s: Stream, gyro: Signal) -> Against | None:
    """Wheels against the gyro; None for a source that does not tell how it turns."""
    if s.kind is Kind.TWIST:
        y = turn_rate_of_wheels(log, s)
        return against(gyro, y) if y is not None else None
    if s.kind is Kind.WHEELS and s.z.shape[1] == 2:
        y = signal(s.name, seconds(log, s), s.z[:, 1] - s.z[:, 0])
        return against(gyro, y) if y is not None else None
    return steered(log, s, gyro) if s.kind is Kind.ACKERMANN else None


def steered(log: EventLog, s: Stream, gyro: Signal) -> Against | None:
    """Steering angles against the gyro, by Gauss-Newton on the zero."""
    t, zero = seconds(log, s), 0.0
    found = UNKNOWN
    for _ in range(ZEROS):
        angle = np.where(np.abs(s.z[:, 1] - zero) < STEEPEST, s.z[:, 1] - zero, np.nan)
        y = signal(s.name, t, s.z[:, 0] * np.tan(angle))
        u = signal(s.name, t, s.z[:, 0] / np.cos(angle) ** 2)
        if y is None or u is None:
            return None
        found = against(gyro, y, u)
        zero += found.zero
    return replace(found, zero=zero)


def against(gyro: Signal, wheels: Signal, also: Signal | None = None) -> Against:
    """By means over windows: the best lag of a search, then Gauss-Newton. also : what the zero goes with."""
    at = instants(gyro, wheels, WINDOW / OVERLAP)
    at = at[(at > at.min() + MOST) & (at < at.max() - MOST)] if len(at) else at
    y = wheels.mean(at, WINDOW)
    u = np.zeros((len(at), 0)) if also is None else also.mean(at, WINDOW)[:, None]
    tried = np.arange(-MOST, MOST + 0.5 * COARSE, COARSE)
    left = np.array([misfit(gyro.mean(at - lag, WINDOW), y, u) for lag in tried])
    if not np.isfinite(left).any():
        return UNKNOWN
    best = int(np.nanargmin(left))
    others = left[np.abs(tried - tried[best]) > 0.5]
    if best in (0, len(tried) - 1) or not others.min() > CLEAR * left[best]:
        return UNKNOWN
    return refined(gyro, y, u, at, float(tried[best]))


def misfit(x: Floats, y: Floats, u: Floats) -> float:
    """Mean square of what x, u and a constant leave of y; NaN where x does not turn."""
    good = np.isfinite(x) & np.isfinite(y) & np.isfinite(u).all(axis=1)
    if good.sum() < FEW or np.std(x[good]) < TURNING:
        return float("nan")
    M = np.column_stack([x[good], np.ones(good.sum()), u[good]])
    return float(np.mean((y[good] - M @ np.linalg.lstsq(M, y[good], rcond=None)[0]) ** 2))


def refined(gyro: Signal, y: Floats, u: Floats, at: Floats, lag: float) -> Against:
    """The search's end, and how sure it is. beta : slope, offset, step of the lag, zero."""
    beta, cov = np.ones(3 + u.shape[1]), np.eye(3 + u.shape[1])
    for _ in range(ROUNDS):
        x, slope = gyro.mean(at - lag, WINDOW), gyro.slope(at - lag, WINDOW)
        good = np.isfinite(x) & np.isfinite(y) & np.isfinite(slope) & np.isfinite(u).all(axis=1)
        M = np.column_stack([x[good], np.ones(good.sum()), -beta[0] * slope[good], u[good]])
        A = M.T @ M + 1e-12 * np.eye(len(beta))
        beta = np.linalg.solve(A, M.T @ y[good])
        left = y[good] - M @ beta
        cov = sandwich(A, M * left[:, None], at[good], OVERLAP * float(np.mean(left**2)))
        lag += float(np.clip(beta[2], -COARSE, COARSE))
    if abs(beta[0]) < 0.1:
        return UNKNOWN
    sd = np.sqrt(np.diag(cov)).tolist()
    zero, sure = (float(beta[3]), sd[3]) if u.shape[1] else (0.0, np.inf)
    return Against(lag, float(beta[0]), zero, (sd[2], sd[0], sure))


__all__ = ["Against", "against", "turning"]
