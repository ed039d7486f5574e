"""What a camera on a gimbal sees of a surface, and where it should look along a path."""

from dataclasses import dataclass
from math import cos, sqrt
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.core.solids import cast
from outrider.errors import ConfigError
from outrider.planning.inspection.surface import Surface
from outrider.typing import Bools, Floats

TOUCH: Final = 1e-3  # m short of a point at which its line of sight may end
GAZES: Final = 200  # directions that a camera chooses among


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """A cone of sight. A point counts as seen between `near` and `far` [m], at most `incidence` [rad] off its normal.

    height : m above the body's origin;  half_angle : rad of the cone;  every_s : s between pictures;  turn : rad/s of
    its gimbal;  low, high : rad, elevations that the gimbal reaches
    """

    height: float = 0.0
    near: float = 0.5
    far: float = 5.0
    half_angle: float = 0.6
    incidence: float = 1.1
    every_s: float = 0.5
    turn: float = 1.5
    low: float = -1.6
    high: float = 1.6

    def __post_init__(self) -> None:
        if not (0.0 <= self.near < self.far and self.half_angle > 0.0 and self.incidence > 0.0 and self.every_s > 0.0):
            fix = "0 <= near < far, and half_angle, incidence and every_s above zero"
            raise ConfigError("a camera that sees nothing", where="camera", fix=fix)

    @property
    def eye(self) -> Floats:
        """(3,) m, from the body's origin."""
        return np.array([0.0, 0.0, self.height])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Picturing:
    """Pictures of a path. t : (k,) s;  gaze : (k, 3) unit, site frame;  seen : (points,) in any of them."""

    t: Floats
    gaze: Floats
    seen: Bools


@kernel
def sights(
    table: Floats, eye: Floats, p: Floats, normal: Floats, near: float, far: float, least: float, out: Bools
) -> None:
    """out (n, m): whether eyes (n, 3) see points (m, 3) with their normals; least : cosine of the incidence."""
    for i in range(eye.shape[0]):
        for j in range(p.shape[0]):
            x, y, z = p[j, 0] - eye[i, 0], p[j, 1] - eye[i, 1], p[j, 2] - eye[i, 2]
            r = x * x + y * y + z * z
            out[i, j] = near * near <= r <= far * far
            if not out[i, j]:
                continue
            r = sqrt(r)
            out[i, j] = -(x * normal[j, 0] + y * normal[j, 1] + z * normal[j, 2]) >= least * r
            if out[i, j]:
                t = cast(table, eye[i, 0], eye[i, 1], eye[i, 2], x / r, y / r, z / r, r - TOUCH)
                out[i, j] = t > r - TOUCH


def seen(table: Floats, camera: Camera, p: Floats, gaze: Floats | None, on: Surface) -> Bools:
    """(k, n) whether bodies at p (k, 3) see each point of a surface; gaze (k, 3) unit, None: all around."""
    out = np.zeros((len(p), len(on)), np.bool_)
    eye = np.ascontiguousarray(p + camera.eye)
    sights(table, eye, on.p, on.normal, camera.near, camera.far, cos(camera.incidence), out)
    if gaze is not None:
        for i in np.flatnonzero(out.any(axis=1)).tolist():
            out[i] &= _in_cone(eye[i], gaze[i : i + 1], on.p, camera.half_angle)[:, 0]
    return out


def picture(table: Floats, camera: Camera, t: Floats, p: Floats, on: Surface) -> Picturing:
    """Choose where to look from p (k, 3) at t (k,) [s]: greedily, what shows most that no earlier picture has shown.

    The gimbal turns no faster than it can; where nothing new is in reach the gaze goes to what there is to see.
    """
    gazes = _spread(GAZES)
    elevation = np.arcsin(gazes[:, 2])
    gazes = gazes[(elevation >= camera.low) & (elevation <= camera.high)]
    around, eye = seen(table, camera, p, None, on), p + camera.eye
    done, chosen = np.zeros(len(on), np.bool_), np.zeros((len(p), 3))
    now: Floats | None = None
    for i in range(len(p)):
        free = gazes if now is None else gazes[gazes @ now >= cos(min(camera.turn * (t[i] - t[i - 1]), np.pi))]
        if now is not None:
            free = np.vstack([now, free])
        rows = np.flatnonzero(around[i])
        inside = _in_cone(eye[i], free, on.p[rows], camera.half_angle)
        worth = inside[~done[rows]].sum(axis=0) + 1e-3 * inside.sum(axis=0)
        k = int(np.argmax(worth))
        now = free[k]
        chosen[i] = now
        done[rows[inside[:, k]]] = True
    return Picturing(t=t, gaze=chosen, seen=done)


def _in_cone(eye: Floats, gaze: Floats, p: Floats, half_angle: float) -> Bools:
    """(n, g) whether points p (n, 3) are in the cones about gazes (g, 3)."""
    d = p - eye
    return d @ gaze.T >= cos(half_angle) * np.linalg.norm(d, axis=1)[:, None]


def _spread(n: int) -> Floats:
    """(n, 3) unit vectors spread evenly over the sphere, along a spiral."""
    k = np.arange(n) + 0.5
    z, turn = 1.0 - 2.0 * k / n, np.pi * (1.0 + np.sqrt(5.0)) * k
    r = np.sqrt(1.0 - z * z)
    return np.column_stack([r * np.cos(turn), r * np.sin(turn), z])
