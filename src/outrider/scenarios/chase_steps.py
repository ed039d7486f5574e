"""The compiled closed loop of one follower behind one target: vehicles, late fixes, filters, guidance, safety.

The vehicles are `Multirotor`, the filters the steps of `outrider.filters.following`, each fix is fused at the moment
it was taken. Control at 10 Hz whatever the rate of the fixes, but for the laws of swarm2023, which act on raw fixes
when one arrives.
"""

from math import cos, inf, sin, sqrt
from typing import Final

from outrider._kernel import kernel
from outrider.filters.following.steps import predict, update
from outrider.guidance.los import line_of_sight, separation, zone_speed
from outrider.guidance.pursuit import hasten, pursue
from outrider.models.motion.following import lag_step
from outrider.models.vehicles.airborne import X_V
from outrider.models.vehicles.multirotor import run_multirotor
from outrider.safety.admissible import EASE, adapted, least_set_point
from outrider.safety.separation import FREE, keep_apart
from outrider.sim.targets import displaced, heard, target_velocity
from outrider.typing import Floats, Ints

PERIOD: Final = 0.1  # s, of the control
SUBSTEPS: Final = 5  # of the vehicles
HASTE: Final = 0.4  # of its lag, in which the follower answers
GATE: Final = 16.266  # NIS of three components, 99.9 %
PURSUE, UNGUARDED, ZONES = range(3)
FIX, NOW, TARGET, TRIED = range(4)  # beliefs: own at its last fix, own now, target at its last fix, scratch
W_OWN, W_TARGET, W_R = range(3)  # last raw fixes, scratch
M_OWN, M_TARGET, M_REFUSED = range(3)  # steps of the last fix that counts, of the first refused; -1 : none
# settings
(S_LAW, S_BEHAVIOUR, S_EVENT, S_SPEED, S_HEADING, S_EVERY, S_LATE, S_OWN_PHASE, S_PHASE, S_SET, S_ADAPT, S_HOLD,
 S_REACQUIRE, S_SIGMA, S_V_SIGMA, S_DANGER, S_ZONE, S_ZONE_SPEED, S_FAR_SPEED) = range(19)  # fmt: skip
SETTINGS: Final = 19
# columns of a trace
C_DISTANCE, C_LEAST, C_OWN, C_TARGET, C_OWN_V, C_TARGET_V, C_SET, C_CODE, C_AGE = 0, 1, 2, 5, 8, 11, 14, 15, 16
TRACE: Final = 17


@kernel
def fuse_fix(x: Floats, P: Floats, z: Floats, sigma: float, v_sigma: float, r: Floats) -> bool:
    """Fuse position z[:3] and, of finite `v_sigma`, velocity z[3:]; whether the position passed its gate."""
    r[0] = r[1] = r[2] = sigma * sigma
    nis, _ = update(x, P, 0, z[:3], r, GATE)
    if not nis <= GATE:
        return False
    if v_sigma < 1e6:
        r[0] = r[1] = r[2] = v_sigma * v_sigma
        update(x, P, 3, z[3:6], r, GATE)
    return True


@kernel
def begin(x: Floats, P: Floats, z: Floats, sigma: float, v_sigma: float) -> None:
    """The state of a filter at its first fix."""
    known = v_sigma < 1e6
    for i in range(6):
        x[i] = z[i] if i < 3 or known else 0.0
        for j in range(6):
            P[i, j] = 0.0
        P[i, i] = sigma * sigma if i < 3 else v_sigma * v_sigma if known else 4.0


@kernel
def taken(where: Floats, first: int, noise: Floats, ahead: float, heading: float, z: Floats) -> None:
    """z (6,) <- a fix of the truth `where`, from column `first` on."""
    for i in range(6):
        z[i] = where[first + i] + noise[i]
    z[0] += ahead * cos(heading)
    z[1] += ahead * sin(heading)


@kernel
def copied(x: Floats, P: Floats, to_x: Floats, to_P: Floats) -> None:
    """A belief, copied."""
    for i in range(6):
        to_x[i] = x[i]
        for j in range(6):
            to_P[i, j] = P[i, j]


@kernel
def hear_own(
    k: int, s: Floats, truth: Floats, noise: Floats, told: Floats, step: Floats, B: Floats, C: Floats, marks: Ints,
    w: Floats,
) -> None:  # fmt: skip
    """The follower's belief at step k: fixes where they were taken, the commands since replayed on top."""
    x, P = B[NOW], C[NOW]
    late, every = int(s[S_LATE]), int(s[S_EVERY])
    if marks[M_OWN] >= 0 and k > 0:
        predict(x, P, told[k - 1], step)
    at, since = k - late, k - late - int(s[S_OWN_PHASE])
    if since < 0 or since % every != 0:
        return
    z = w[W_OWN]
    taken(truth[at], 0, noise[since // every], 0.0, 0.0, z)
    if marks[M_OWN] < 0:
        begin(B[FIX], C[FIX], z, s[S_SIGMA], s[S_V_SIGMA])
    else:
        for i in range(int(marks[M_OWN]), at):
            predict(B[FIX], C[FIX], told[i], step)
        fuse_fix(B[FIX], C[FIX], z, s[S_SIGMA], s[S_V_SIGMA], w[W_R])
    marks[M_OWN] = at
    copied(B[FIX], C[FIX], x, P)
    for i in range(at, k):
        predict(x, P, told[i], step)


@kernel
def hear_target(
    k: int, s: Floats, truth: Floats, noise: Floats, model: Floats, B: Floats, C: Floats, marks: Ints, w: Floats,
    c: Floats,
) -> bool:  # fmt: skip
    """The target's belief as of its last fix that was believed; whether a fix came.

    Fixes that jump are refused; after `S_REACQUIRE` seconds of nothing else the target is believed to be there.
    """
    late, every, behaviour = int(s[S_LATE]), int(s[S_EVERY]), int(s[S_BEHAVIOUR])
    at, since = k - late, k - late - int(s[S_PHASE])
    if since < 0 or since % every != 0 or not heard(behaviour, at * PERIOD, s[S_EVENT]):
        return False
    z, sigma, v_sigma = w[W_TARGET], s[S_SIGMA], s[S_V_SIGMA]
    taken(truth[at], 6, noise[since // every], displaced(behaviour, at * PERIOD, s[S_EVENT]), s[S_HEADING], z)
    if marks[M_TARGET] >= 0:
        lag_step((at - marks[M_TARGET]) * PERIOD, model, c)
        copied(B[TARGET], C[TARGET], B[TRIED], C[TRIED])
        for i in range(3):
            w[W_R, i] = 0.0
        predict(B[TRIED], C[TRIED], w[W_R], c)
        if fuse_fix(B[TRIED], C[TRIED], z, sigma, v_sigma, w[W_R]):
            copied(B[TRIED], C[TRIED], B[TARGET], C[TARGET])
            marks[M_TARGET], marks[M_REFUSED] = at, -1
            return True
        if marks[M_REFUSED] < 0:
            marks[M_REFUSED] = at
        if (at - marks[M_REFUSED]) * PERIOD < s[S_REACQUIRE]:
            return True
    begin(B[TARGET], C[TARGET], z, sigma, v_sigma)
    marks[M_TARGET], marks[M_REFUSED] = at, -1
    return True


@kernel
def apart(B: Floats, C: Floats, R: Floats, age: float) -> tuple[float, float, float]:
    """(pp, pv, vv) along the line of sight;  R (6, 6) <- covariance of the relative position and velocity."""
    square = pp = pv = vv = 0.0
    for i in range(6):
        for j in range(6):
            R[i, j] = C[TARGET, i, j] + C[NOW, i, j]
    for i in range(3):
        a = B[TARGET, i] + age * B[TARGET, 3 + i] - B[NOW, i]
        square += a * a
        for j in range(3):
            share = a * (B[TARGET, j] + age * B[TARGET, 3 + j] - B[NOW, j])
            pp += share * R[i, j]
            pv += share * R[i, 3 + j]
            vv += share * R[3 + i, 3 + j]
    scale = 1.0 / max(square, 1e-12)
    return pp * scale, pv * scale, vv * scale


@kernel
def steer(k: int, s: Floats, law: Floats, guard: Floats, B: Floats, C: Floats, age: float, u: Floats) -> int:
    """u (3,) <- the default law and the filter below it, with a set-point that adapts to speed and delay; its code."""
    x, y, R = B[NOW], B[TARGET], C[TRIED]
    pp, pv, vv = apart(B, C, R, age)
    if s[S_ADAPT] > 0.0 and k % 10 == 0:
        speed = min(sqrt(y[3] * y[3] + y[4] * y[4] + y[5] * y[5]), law[0])
        least = least_set_point(speed, (s[S_EVERY] + s[S_LATE]) * PERIOD, pp, pv, vv, guard)
        s[S_SET] = adapted(s[S_SET], least + EASE, s[S_ADAPT] * 10.0 * PERIOD)
    u[0] = u[1] = u[2] = 0.0
    if age <= s[S_HOLD]:
        pursue(x, y, y[3:], age, s[S_SET], law, u)
        hasten(x[3:], HASTE, law[0], u)
    return keep_apart(u, x, x[3:], y, y[3:], R, age, guard, u) if s[S_LAW] == PURSUE else FREE


@kernel
def steer_by_zones(s: Floats, w: Floats, u: Floats) -> None:
    """u (3,) <- swarm2023: the line of sight between raw fixes, fast outside the rendezvous zone, eq. 38 inside.

    Outside, the end of the Bezier curve through the target's last fixes is the last one: the same line.
    """
    p, q = w[W_OWN], w[W_TARGET]
    far = sqrt((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2 + (q[2] - p[2]) ** 2)
    near = far <= s[S_ZONE]
    v = zone_speed(far, s[S_DANGER], s[S_SPEED], s[S_ZONE_SPEED]) if near else s[S_FAR_SPEED]
    line_of_sight(p, q, v, u)


@kernel
def fly_chase(
    s: Floats, own: Floats, target: Floats, own_theta: Floats, target_theta: Floats, air: Floats, ground: Floats,
    noise: Floats, own_step: Floats, target_model: Floats, law: Floats, guard: Floats, truth: Floats, told: Floats,
    commands: Floats, rows: Floats, B: Floats, C: Floats, marks: Ints, w: Floats, c: Floats, trace: Floats,
) -> None:  # fmt: skip
    """One run.  s (SETTINGS,);  own, target : states of two `Multirotor`;  noise (2, fixes, 6) of own and target fixes.

    truth (n, 12), told (n, 3), commands, rows (2, SUBSTEPS, .), B (4, 6), C (4, 6, 6), marks, w, c : scratch
    trace (n, TRACE) : written, a row per period
    """
    behaviour = int(s[S_BEHAVIOUR])
    for k in range(trace.shape[0]):
        for i in range(3):
            truth[k, i], truth[k, 3 + i] = own[i], own[X_V + i]
            truth[k, 6 + i], truth[k, 9 + i] = target[i], target[X_V + i]
        hear_own(k, s, truth, noise[0], told, own_step, B, C, marks, w)
        came = hear_target(k, s, truth, noise[1], target_model, B, C, marks, w, c)
        code, age, u = FREE, (k - marks[M_TARGET]) * PERIOD, told[k]
        if marks[M_OWN] < 0 or marks[M_TARGET] < 0:
            u[0] = u[1] = u[2] = 0.0
        elif s[S_LAW] != ZONES:
            code = steer(k, s, law, guard, B, C, age, u)
        elif came:
            steer_by_zones(s, w, u)
        else:
            u[0], u[1], u[2] = told[k - 1, 0], told[k - 1, 1], told[k - 1, 2]
        target_velocity(behaviour, k * PERIOD, s[S_EVENT], s[S_SPEED], s[S_HEADING], w[W_R])
        for i in range(SUBSTEPS):
            for j in range(3):
                commands[0, i, j], commands[1, i, j] = u[j], w[W_R, j]
        run_multirotor(own, commands[0], air, ground, own_theta, rows[0])
        run_multirotor(target, commands[1], air, ground, target_theta, rows[1])
        trace[k, C_LEAST] = inf
        for i in range(SUBSTEPS):
            trace[k, C_LEAST] = min(trace[k, C_LEAST], separation(rows[0, i], rows[1, i]))
        trace[k, C_DISTANCE] = separation(truth[k], truth[k, 6:])
        for i in range(3):
            trace[k, C_OWN + i], trace[k, C_OWN_V + i] = truth[k, i], truth[k, 3 + i]
            trace[k, C_TARGET + i], trace[k, C_TARGET_V + i] = truth[k, 6 + i], truth[k, 9 + i]
        trace[k, C_SET], trace[k, C_CODE], trace[k, C_AGE] = s[S_SET], code, age
