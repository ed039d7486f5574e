"""The ground that a robot covers."""

from dataclasses import dataclass, field
from typing import Self, final

import numpy as np

from outrider.errors import ConfigError
from outrider.typing import Floats


@final
@dataclass(frozen=True, slots=True)
class Footprint:
    """Everything within `radius` of a convex outline: a point, a disc, a capsule, a polygon, or one with round corners.

    outline : (n, 2) m, body frame (forward, left), counter-clockwise; one vertex is a disc, two are a capsule;
    radius : m.  `inscribed` and `circumscribed` [m] are the radii of the discs around the body's origin that lie inside
    the footprint, and that hold it.

    Raises ConfigError for an outline that is not convex, does not hold the origin, or covers nothing.
    """

    outline: Floats
    radius: float = 0.0
    inscribed: float = field(init=False)
    circumscribed: float = field(init=False)

    def __post_init__(self) -> None:
        p = self.outline
        if p.ndim != 2 or p.shape[1:] != (2,) or not len(p) or not np.isfinite(p).all():
            raise ConfigError(f"an outline of shape {p.shape}", where="footprint", fix="rows of forward, left [m]")
        if not 0.0 <= self.radius < np.inf:
            raise ConfigError(f"radius {self.radius:g} m", where="footprint", fix="zero or more")
        edges = np.roll(p, -1, axis=0) - p
        lengths = np.hypot(edges[:, 0], edges[:, 1])
        if len(p) > 1 and not (lengths > 0.0).all():
            raise ConfigError("an edge of no length", where="footprint", fix="name every vertex once")
        if len(p) > 2:
            after = np.roll(edges, -1, axis=0)
            if not (edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0] >= -1e-12).all():
                fix = "vertices counter-clockwise around a convex shape"
                raise ConfigError("the outline is not convex, or runs clockwise", where="footprint", fix=fix)
        object.__setattr__(self, "circumscribed", float(np.hypot(p[:, 0], p[:, 1]).max()) + self.radius)
        object.__setattr__(self, "inscribed", self._inner(edges, lengths))
        if not self.inscribed > 0.0:
            fix = "a radius, or an outline around the origin of the body"
            raise ConfigError("the footprint covers nothing, or not the body's origin", where="footprint", fix=fix)

    def _inner(self, edges: Floats, lengths: Floats) -> float:
        p = self.outline
        if len(p) > 2:  # distance of the origin inside each edge
            return float(((edges[:, 0] * -p[:, 1] + edges[:, 1] * p[:, 0]) / lengths).min()) + self.radius
        if len(p) == 2:
            s = float(np.clip(-(p[0] @ edges[0]) / lengths[0] ** 2, 0.0, 1.0))
            return self.radius - float(np.linalg.norm(p[0] + s * edges[0]))
        return self.radius - float(np.linalg.norm(p[0]))

    @classmethod
    def circle(cls, radius: float) -> Self:
        """A disc around the body's origin."""
        return cls(np.zeros((1, 2)), radius)

    @classmethod
    def rectangle(cls, length: float, width: float, ahead: float = 0.0) -> Self:
        """length and width [m];  ahead : how far in front of the body's origin its middle lies [m]."""
        x, y = 0.5 * length, 0.5 * width
        return cls(np.array([[ahead - x, -y], [ahead + x, -y], [ahead + x, y], [ahead - x, y]]))

    @classmethod
    def capsule(cls, front: float, rear: float, radius: float) -> Self:
        """All within `radius` of the line from `rear` behind the origin to `front` ahead of it: holds two discs."""
        return cls(np.array([[-rear, 0.0], [front, 0.0]]), radius)

    def at(self, pose: Floats) -> Floats:
        """(..., n, 2) m, site frame: the outline of a robot at poses (..., 3): east, north [m], heading [rad]."""
        c, s = np.cos(pose[..., 2:3]), np.sin(pose[..., 2:3])
        x, y = self.outline[:, 0], self.outline[:, 1]
        turned = np.stack([c * x - s * y, s * x + c * y], axis=-1)
        return turned + pose[..., None, :2]
