"""A start in flight: velocity and attitude at the first record, by the motion of the first seconds as a whole.

Gravity alone levels nothing that accelerates, and one position tells no velocity. But turned by the gyro into the axes
of the first instant and integrated twice, the specific force f of the IMU is the way itself, but for what the start was
(after Wu & Pan, IEEE Trans. Aerospace and Electronic Systems 49(3), 2013, who solve for the attitude alone):

    p(t) + R(t) l = p_0 + v_0 t + g t^2 / 2 + R_0 (s(t) + C(t) l),    s(t) = int int C f dt dt,    C' = C [w]x
"""

from typing import Final, NamedTuple

import numpy as np

from outrider.core.attitudes import matrices_to_quats, quats_to_matrices
from outrider.core.rotations import so3_exp
from outrider.data import Verdict
from outrider.filters.channels import Records
from outrider.filters.engine import INPUT_HOLD, Filter, Queue
from outrider.models.sensors import Sensor
from outrider.models.sensors.layout import LEVER
from outrider.typing import Floats

FIXES: Final = (Sensor.GNSS_POSITION, Sensor.POSITION)
SPEEDS: Final = (Sensor.GNSS_VELOCITY, Sensor.BODY_VELOCITY, Sensor.TWIST)
GRAVITY: Final = 12  # of theta
SPAN: Final = 5.0  # s of records
ROUNDS: Final = 6  # of Gauss-Newton: a start that is 30 deg off takes three
DRIFT: Final = 0.3  # m/s^2: what the biases of gyro and accelerometer add to the way
LOOK: Final = 2.5  # s within which a vehicle under way is seen to be
UNDER_WAY: Final = 0.7  # m
CREEP: Final = 0.5  # m/s
CLEAR: Final = 4.0  # deviations
MISFIT: Final = 3.0  # root mean square of weighted residuals above which it is not this motion


class Way(NamedTuple):
    """t (n,) s since the start;  C (n, 3, 3) first axes from those of t;  s (n, 3) C f integrated twice [m]."""

    t: Floats
    C: Floats
    s: Floats


def set_out(f: Filter, q: Queue, t_start: float, x: Floats, sd: Floats) -> None:
    """Velocity and attitude at a start in motion with a known heading, by the fixes of the first seconds. In place.

    The deviations `sd` stay what they are: the same fixes are fused as well, and must not count twice. Where a source
    tells the velocity nothing is changed, nor where records are missing or do not fit.
    """
    channels = [c for c in f.channels if not c.scored]
    driving = next((k for k, c in enumerate(f.channels) if c.sensor is None), None)
    fixing = next((k for k, c in enumerate(f.channels) if c.sensor in FIXES and not c.scored), None)
    if driving is None or fixing is None or any(c.sensor in SPEEDS for c in channels):
        return
    (t, imu), (at, fix) = (first_seconds(q, k, t_start) for k in (driving, fixing))
    if len(t) < 2 or max(t[0], float(np.diff(t).max())) > INPUT_HOLD:
        return
    inside = at <= t[-1]
    if inside.sum() < 2:
        return
    v, a = f.layout.state("velocity"), f.layout.state("attitude")
    loose = np.concatenate([sd[f.layout.error("velocity")], sd[f.layout.error("attitude")]])
    found = start_of(
        way(t, imu.z[:, :3], imu.z[:, 3:6]), at[inside], fix.z[inside, :3], np.sqrt(fix.r[inside, :3]),
        f.channels[fixing].theta[LEVER : LEVER + 3], quats_to_matrices(x[a]), loose, float(f.theta[GRAVITY]),
    )  # fmt: skip
    if found is not None:
        x[v], x[a] = found[0], matrices_to_quats(found[1])


def under_way(f: Filter, q: Queue, t_start: float) -> bool:
    """Whether a receiver sees it move: an IMU feels no difference between rest and even flight, and would take a slow
    turn for its bias."""
    for k, c in enumerate(f.channels):
        t, part = first_seconds(q, k, t_start)
        if c.scored or c.sensor not in (*FIXES, Sensor.GNSS_VELOCITY) or (t <= LOOK).sum() < 2:
            continue
        z, sigma = part.z[t <= LOOK, :2], float(np.sqrt(np.median(part.r[t <= LOOK, :2])))
        speeds = c.sensor is Sensor.GNSS_VELOCITY
        far = np.median(z, axis=0) if speeds else (z[-1] - z[0]) / np.sqrt(2.0)
        if float(np.hypot(*far)) > max(CREEP if speeds else UNDER_WAY, CLEAR * sigma):
            return True
    return False


def first_seconds(q: Queue, channel: int, t_start: float) -> tuple[Floats, Records]:
    """Usable records of a channel within `SPAN` of the start, in order, and when they are since then [s]."""
    part = q.parts[channel]
    t = np.asarray((part.t - q.t0) * 1e-9 - t_start, np.float64)
    good = (part.flag == Verdict.USED) & (t >= 0.0) & (t <= SPAN) & np.isfinite(part.z[:, :3]).all(axis=1)
    order = np.flatnonzero(good)[np.argsort(t[good], kind="stable")]
    return t[order], part.select(order)


def way(t: Floats, gyro: Floats, accel: Floats) -> Way:
    """Of body-axis rates and specific forces (n, 3) at times (n,) [s], in order."""
    steps = np.diff(t, prepend=t[0])
    C, turned, R = np.empty((len(t), 3, 3)), np.eye(3), np.empty((3, 3))
    for k, dt in enumerate(steps.tolist()):
        so3_exp(0.5 * (gyro[k] + gyro[max(k - 1, 0)]) * dt, R)
        turned = turned @ R
        C[k] = turned
    f = np.einsum("nij,nj->ni", C, accel)
    for _ in range(2):
        f = np.cumsum(0.5 * (f + np.roll(f, 1, axis=0)) * steps[:, None], axis=0)
    return Way(t, C, f)


def start_of(
    w: Way, t: Floats, p: Floats, sigma: Floats, lever: Floats, R: Floats, loose: Floats, g: float
) -> tuple[Floats, Floats] | None:
    """Velocity (3,) and attitude (3, 3) at the start from fixes (m, 3) at t (m,) [s] after it; None if nothing fits.

    sigma : (m, 3) of the fixes [m];  lever : (3,) their place in the body [m];  R : the attitude to start from;
    loose : (6,) deviations of the velocity from none [m/s] and of that attitude [rad];  g : gravity [m/s^2].
    """
    at = np.searchsorted(w.t, t).clip(0, len(w.t) - 1)
    s = np.column_stack([np.interp(t, w.t, w.s[:, i]) for i in range(3)]) + w.C[at] @ lever
    weight = 1.0 / np.hypot(sigma, 0.5 * DRIFT * t[:, None] ** 2)
    fall = np.array([0.0, 0.0, -0.5 * g]) * t[:, None] ** 2
    prior = np.hstack([np.zeros((6, 3)), np.diag(1.0 / loose)])
    start, turned, E = np.zeros(9), R, np.empty((3, 3))  # position, velocity, turn of R in the site frame
    y: Floats = np.zeros_like(p)
    start[:3] = p[0] - R @ s[0]
    for _ in range(ROUNDS):
        reach = s @ turned.T
        y = weight * (p - (start[:3] + np.outer(t, start[3:6]) + fall + reach))
        J = np.zeros((len(t), 3, 9))
        J[:, :, :3], J[:, :, 3:6] = np.eye(3), np.eye(3) * t[:, None, None]
        J[:, :, 6:] = -np.cross(reach[:, None, :], np.eye(3)).transpose(0, 2, 1)  # -[reach]x
        A = np.vstack([(weight[:, :, None] * J).reshape(-1, 9), prior])
        rest = np.concatenate([y.ravel(), -start[3:] / loose])
        d = np.asarray(np.linalg.lstsq(A, rest, rcond=None)[0], np.float64)
        so3_exp(d[6:], E)
        start, turned = start + d, E @ turned
    fits = np.isfinite(start).all() and float(np.sqrt(np.mean(y**2))) < MISFIT
    return (start[3:6], turned) if fits else None


__all__ = ["Way", "set_out", "start_of", "under_way", "way"]
