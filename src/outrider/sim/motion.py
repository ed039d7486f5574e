"""Motion of a wheeled robot and of a drone, smooth or drawn from a filter's model, with what an IMU would feel."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator

from outrider.core.rotations import matrices_to_quats, rpy_to_quats
from outrider.errors import ConfigError
from outrider.models.motion.planar import PlanarRobot
from outrider.sim.noise import gauss_markov, random_walk
from outrider.sim.truth import Biases, Place, Truth
from outrider.typing import Floats

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

Pose2 = tuple[float, float, float]
STILL_S = 5.0  # a robot stands for so long before it moves, for the alignment


GENTLE = PlanarRobot(acceleration=0.3, lateral=0.05, yaw_acceleration=0.1)
"""A process model calm enough to stay near its linearization; give a filter the same when NEES is at stake."""


def drive(
    rng: Generator,
    duration_s: float,
    rate_hz: float = 100.0,
    *,
    speed: float = 1.8,
    turn: float = 0.35,
    stops: bool = True,
    exact: bool = False,
    model: PlanarRobot = GENTLE,
    start: Pose2 = (0.0, 0.0, 0.0),
    place: Place = Place(),
) -> Truth:
    """A wheeled robot on flat ground, from rest at `start` (x, y [m], yaw [rad]).

    Either smooth: straights and curves at up to `speed` [m/s] with yaw rates of deviation `turn` [rad/s] and `stops`;
    or `exact`: drawn from `model`, the filter's own, so that NEES has its distribution. The model's walks of heading
    and position are motion that no gyro and no wheel feels: only without them is an exact truth a strapdown integral.
    """
    if not exact:
        return follow(
            _commands(rng, duration_s, speed, turn, stops), 1.0, duration_s, rate_hz, start=start, place=place
        )
    t, dt = np.arange(_count(duration_s, rate_hz)) / rate_hz, 1.0 / rate_hz
    control = _walk(rng, t.size, dt, model)
    travelled = np.sqrt(np.hypot(control[:, 0], control[:, 1]) * dt)[:, None]
    yaw_walk, x_walk, y_walk = np.cumsum(rng.standard_normal((t.size, 3)) * travelled, axis=0).T
    walked = np.column_stack([x_walk, y_walk]) * model.position_walk
    return _planar(_spline(control, dt, 1, duration_s), t, start, place, model.heading_walk * yaw_walk, walked)


def follow(
    control: Floats,
    spacing: float,
    duration_s: float,
    rate_hz: float,
    *,
    start: Pose2 = (0.0, 0.0, 0.0),
    place: Place = Place(),
) -> Truth:
    """The planar path of a cubic B-spline of (v_x, v_y, w): control (m, 3), `spacing` [s] apart, the last one held."""
    t = np.arange(_count(duration_s, rate_hz)) / rate_hz
    return _planar(_spline(control, spacing, 3, duration_s), t, start, place, np.zeros(t.size), np.zeros((t.size, 2)))


def _planar(twist: "BSpline", t: Floats, start: Pose2, place: Place, yaw_walk: Floats, walked: Floats) -> Truth:
    """Yaw is the exact integral of w, position that of R(yaw) v by Gauss-Legendre quadrature, exact to rounding."""
    turned = twist.antiderivative()
    origin = np.array(turned(0.0))

    def heading(at: Floats) -> Floats:
        return start[2] + turned(at)[..., 2] - origin[2] + np.interp(at, t, yaw_walk)

    def velocity(at: Floats) -> Floats:
        yaw, (vx, vy, _) = heading(at), np.moveaxis(twist(at), -1, 0)
        c, s = np.cos(yaw), np.sin(yaw)
        return np.stack([c * vx - s * vy, s * vx + c * vy, np.zeros_like(vx)], axis=-1)

    u, a, zero = twist(t), twist.derivative()(t), np.zeros(t.size)
    p = np.array([start[0], start[1], 0.0]) + _integral(velocity, t)
    p[:, :2] += walked
    return _truth(
        t,
        place,
        p=p,
        q=rpy_to_quats(np.column_stack([zero, zero, heading(t)])),
        v=velocity(t),
        w=np.column_stack([zero, zero, u[:, 2]]),
        f=np.column_stack([a[:, 0] - u[:, 2] * u[:, 1], a[:, 1] + u[:, 2] * u[:, 0], zero + place.gravity]),
    )


def fly(
    rng: Generator,
    duration_s: float,
    rate_hz: float = 200.0,
    *,
    speed: float = 4.0,
    box: tuple[float, float, float] = (40.0, 40.0, 15.0),
    wobble: float | None = None,
    place: Place = Place(),
) -> Truth:
    """A drone that stands, takes off, wanders through `box` [m] above its start and lands where it began.

    Position and heading are quintic B-splines, so rates and specific force are their exact derivatives. The body's z
    axis points along the thrust, a + g; with `wobble` (rough tilt, rad) it is free of the motion instead.
    """
    path = _spline(_waypoints(rng, duration_s, speed, box), 2.0, 5, duration_s)
    yaw = _spline(_headings(rng, duration_s), 3.0, 5, duration_s)
    t = np.arange(_count(duration_s, rate_hz)) / rate_hz
    if wobble is None:
        return _carried(path, yaw, t, place, leans=True)
    lean = _spline(rng.normal(0.0, wobble * place.gravity, (int(duration_s) + 6, 3)), 1.0, 5, duration_s)
    thrust, thrust_dot = lean(t) * [1.0, 1.0, 0.0] + [0.0, 0.0, place.gravity], lean.derivative()(t) * [1.0, 1.0, 0.0]
    return _carried(path, yaw, t, place, thrust=(thrust, thrust_dot))


def glide(
    control: Floats, spacing: float, duration_s: float, rate_hz: float, *, leans: bool = False, place: Place = Place()
) -> Truth:
    """Quintic B-spline of (x, y, z, heading): control (m, 4), `spacing` [s] apart, the last one held.

    The body is upright or, if it `leans`, its z axis points along the thrust, a + g, as a multirotor's does.
    """
    t = np.arange(_count(duration_s, rate_hz)) / rate_hz
    path, yaw = (_spline(control[:, part], spacing, 5, duration_s) for part in (slice(0, 3), slice(3, 4)))
    return _carried(path, yaw, t, place, leans=leans)


def _carried(
    path: "BSpline",
    yaw: "BSpline",
    t: Floats,
    place: Place,
    *,
    leans: bool = False,
    thrust: tuple[Floats, Floats] | None = None,
) -> Truth:
    """Position and heading of splines; the body's z axis along the thrust (and its derivative), if any, else up."""
    a = path.derivative(2)(t)
    up = np.broadcast_to([0.0, 0.0, place.gravity], a.shape)
    if thrust is None:
        thrust = (a + up, path.derivative(3)(t)) if leans else (up, np.zeros_like(up))
    R, w = _attitude(*thrust, yaw(t)[:, 0], yaw.derivative()(t)[:, 0])
    f = np.einsum("nji,nj->ni", R, a + up)
    return _truth(t, place, p=path(t), q=matrices_to_quats(R), v=path.derivative()(t), w=w, f=f)


def _truth(seconds: Floats, place: Place, *, p: Floats, q: Floats, v: Floats, w: Floats, f: Floats) -> Truth:
    t = place.t0 + np.rint(seconds * 1e9).astype(np.int64)
    return Truth(
        t=t, p=p, q=q, v=v, w=w, f=f, bias=Biases.none(t.size), actuators=np.zeros((t.size, 0)), start=place.t0,
        gravity=place.gravity, datum=place.datum, robot=place.robot,
    )  # fmt: skip


def _count(duration_s: float, rate_hz: float) -> int:
    if not duration_s * rate_hz >= 2.0:
        raise ConfigError("a truth needs three samples at least", fix="a longer duration or a higher rate")
    return round(duration_s * rate_hz) + 1


def _spline(control: Floats, spacing: float, degree: int, duration_s: float) -> "BSpline":
    """Uniform B-spline over [0, duration]; the last control point is held. Repeated points make an exact standstill."""
    from scipy.interpolate import BSpline  # slow to import, and needed by the simulator only

    n = int(np.ceil(duration_s / spacing)) + degree + 1
    held = control[np.minimum(np.arange(n), control.shape[0] - 1)]
    return BSpline((np.arange(n + degree + 1) - degree) * spacing, held, degree)


def _integral(velocity: Callable[[Floats], Floats], t: Floats) -> Floats:
    """(n, 3) integral of velocity from t[0] to each t."""
    nodes, weights = np.polynomial.legendre.leggauss(4)
    half = 0.5 * np.diff(t)[:, None]
    steps = half * np.einsum("nkj,k->nj", velocity(t[:-1, None] + half * (1.0 + nodes)), weights)
    return np.vstack([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def _walk(rng: Generator, n: int, dt: float, model: PlanarRobot) -> Floats:
    """(n, 3) body velocity and yaw rate from rest: random walks, and the sideways slip in its steady state."""
    steps = random_walk(rng, n, 2, dt, 1.0) * [model.acceleration, model.yaw_acceleration]
    slip = gauss_markov(rng, n, 1, dt, model.lateral, model.lateral_time)
    return np.column_stack([steps[:, 0], slip, steps[:, 1]])


def _commands(rng: Generator, duration_s: float, speed: float, turn: float, stops: bool) -> Floats:
    """One (v_x, 0, w) per second: stand, then straights and curves of 4 to 12 s, now and then a stop of 3 to 6 s."""
    rows = [[0.0, 0.0, 0.0]] * round(STILL_S + 3)
    while len(rows) < duration_s + 4:
        if stops and rng.random() < 0.2:
            rows += [[0.0, 0.0, 0.0]] * int(rng.integers(3, 7))
        else:
            rows += [[speed * rng.uniform(0.4, 1.0), 0.0, rng.normal(0.0, turn)]] * int(rng.integers(4, 13))
    return np.array(rows)


def _waypoints(rng: Generator, duration_s: float, speed: float, box: tuple[float, float, float]) -> Floats:
    """Control points of `fly`, one every 2 s: ground, then steps of at most 2 s at `speed` within the box, ground."""
    n, ground = int(np.ceil(duration_s / 2.0)) + 6, np.zeros(3)
    lo, hi = np.array([-box[0], -box[1], 0.4 * box[2]]) / 2, np.array([box[0], box[1], 2.0 * box[2]]) / 2
    points = [ground] * 8  # three spans of standstill
    goal = rng.uniform(lo, hi)
    while len(points) < n:
        home = 2.0 * (n - 8 - len(points)) * speed < 2.0 * float(np.linalg.norm(points[-1]))
        if home:
            goal = ground
        elif np.linalg.norm(goal - points[-1]) < speed:
            goal = rng.uniform(lo, hi)
        step = goal - points[-1]
        points.append(points[-1] + step * min(1.0, 2.0 * speed / max(float(np.linalg.norm(step)), 1e-9)))
    return np.array(points)


def _headings(rng: Generator, duration_s: float) -> Floats:
    """Control points of the heading (n, 1), one every 3 s; it rests on the ground at both ends."""
    n = int(np.ceil(duration_s / 3.0)) + 6
    turns = rng.normal(0.0, 0.8, (n, 1))
    turns[1:7] = 0.0
    turns[max(n - 6, 1) :] = 0.0
    return np.cumsum(turns, axis=0)


def _attitude(thrust: Floats, thrust_dot: Floats, yaw: Floats, yaw_dot: Floats) -> tuple[Floats, Floats]:
    """R_site_body (n, 3, 3) with z along the thrust and x towards the heading, and its body rate (n, 3)."""

    def unit(x: Floats, x_dot: Floats) -> tuple[Floats, Floats]:
        norm = np.linalg.norm(x, axis=1, keepdims=True)
        e = x / norm
        return e, (x_dot - e * np.sum(e * x_dot, axis=1, keepdims=True)) / norm

    zero = np.zeros(yaw.size)
    nose = np.column_stack([np.cos(yaw), np.sin(yaw), zero])
    nose_dot = yaw_dot[:, None] * np.column_stack([-np.sin(yaw), np.cos(yaw), zero])
    z, z_dot = unit(thrust, thrust_dot)
    y, y_dot = unit(np.cross(z, nose), np.cross(z_dot, nose) + np.cross(z, nose_dot))
    x, x_dot = np.cross(y, z), np.cross(y_dot, z) + np.cross(y, z_dot)
    R, R_dot = np.stack([x, y, z], axis=2), np.stack([x_dot, y_dot, z_dot], axis=2)
    S = np.einsum("nji,njk->nik", R, R_dot)  # R' dR/dt = [w]x
    return R, np.column_stack([S[:, 2, 1], S[:, 0, 2], S[:, 1, 0]])
