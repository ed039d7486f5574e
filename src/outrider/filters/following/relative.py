"""Where one aircraft is relative to another: errors that their receivers share do not count."""

from typing import final

from outrider.filters.following.online import Belief, FollowerFilter, Following
from outrider.models.motion.following import FollowerModel
from outrider.typing import Floats


def relative(own: Belief, target: Belief) -> Belief:
    """own - target at one time: p, v of the line from the target to us, P (6, 6) the sum of theirs.

    Two receivers near one another share most of their slow error (atmosphere, satellites). A filter whose r holds only
    what is *not* shared (centimetres to decimetres) follows its receiver, shared error included, and the difference of
    two such filters is free of it. With r of the whole error the difference is as good, but P is far too large.
    """
    P = own.P[:6, :6] + target.P[:6, :6]
    return Belief(own.t, own.p - target.p, own.v - target.v, own.w, P, min(own.fix_t, target.fix_t))


@final
class RelativeFilter:
    """A follower and its target, each filtered with the noise that the two receivers do not share.

    `own` takes our commands and fixes, `target` the fixes (and velocities) that the target sends, late as they come.
    """

    def __init__(
        self, model: FollowerModel, target: FollowerModel | None = None, settings: Following | None = None
    ) -> None:
        self.own = FollowerFilter(model, settings)
        self.target = FollowerFilter(target or FollowerModel.target(), Following())

    @property
    def started(self) -> bool:
        """Whether both have had a fix."""
        return self.own.started and self.target.started

    def belief(self, t: float) -> Belief:
        """own - target at t; raises UsageError before both have started."""
        return relative(self.own.belief(t), self.target.belief(t))

    def distance(self, t: float) -> tuple[float, float]:
        """Distance [m] at t and its standard deviation along the line of sight."""
        b = self.belief(t)
        return separation(b.p, b.P)


def separation(p: Floats, P: Floats) -> tuple[float, float]:
    """Length of p (3,) and its standard deviation, to first order; P (3 or more, same) its covariance."""
    d = float((p @ p) ** 0.5)
    if d < 1e-9:
        return 0.0, float(max(P[i, i] for i in range(3)) ** 0.5)
    e = p / d
    return d, float((e @ P[:3, :3] @ e) ** 0.5)
