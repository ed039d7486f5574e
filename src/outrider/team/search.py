"""Looking for a target that has fallen silent: over where it should be by now, as long as that is worth anything.

Since its last fix it may have stopped at once, flown on as it did, or anything between: it is somewhere on a straight
piece, its credible track. From above that is overlooked, and whoever keeps clear of its nearest point keeps clear of
all of them, also if it turns at its height. No faster than `speed`, for no follower could stay with it.
"""

from dataclasses import dataclass
from math import sqrt
from typing import Final, final

import numpy as np

from outrider.filters.following import Belief
from outrider.safety.separation import Separation
from outrider.team.follow import within
from outrider.typing import Floats

GROWS_S: Final = 4.5  # s for which the spread of a silent target grows; from then on it is looked for, not avoided
MOVES: Final = 0.3  # m/s, from where on it has a course
SPARE: Final = 1.0  # m, by which it is passed higher than must be


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class CredibleTrack:
    """From `first` (3,) m, where it stands if it stopped when it was heard last, to `now` (3,) m, at v (3,) m/s, `age`
    s later; P (6, 6) when it was heard, and `grows` (3, 3) m^2/s^3 by which it spreads aside."""

    first: Floats
    now: Floats
    v: Floats
    age: float
    P: Floats
    grows: Floats

    def nearest(self, p: Floats) -> tuple[Floats, Floats]:
        """(6,) the point of the track that is nearest to p (3,) m, with its velocity, and its covariance (6, 6)."""
        way = self.now - self.first
        length = float(way @ way)
        share = min(max(float((p - self.first) @ way) / length, 0.0), 1.0) if length > 0.0 else 1.0
        x = np.concatenate([self.first + share * way, self.v if share == 1.0 else np.zeros(3)])
        return x, self._spread(share)

    def _spread(self, share: float) -> Floats:
        """Covariance of where it is if it flew on for that share of the time."""
        P = self.P.copy()
        P[:3, :3] += self.grows * min(share * self.age, GROWS_S) ** 3
        return P

    def above(self, separation: Separation | None, goal: float, own: Floats) -> float:
        """m over the track from where the distance is kept; own : (6, 6) covariance of the follower."""
        if separation is None:
            return goal
        return separation.distance + separation.sigmas * sqrt(float(self._spread(1.0)[2, 2] + own[2, 2])) + SPARE

    def over(self, p: Floats, above: float, gain: float, speed: float) -> Floats:
        """(3,) m/s from p (3,) m to so many metres above where it is now, and on with it."""
        return within(self.v + gain * (self.now + np.array([0.0, 0.0, above]) - p), speed)


def credible_track(last: Belief, later: Belief, t_s: float, speed: float, stops_s: float) -> CredibleTrack:
    """What may be believed at t_s [s] of a target that was heard before: no faster than `speed` [m/s], and no quicker
    to stop than with a lag of stops_s [s]. last : as it was heard;  later : what that is worth `GROWS_S` later."""
    v, age = within(last.v, speed), t_s - last.t
    aside = np.eye(3)  # along its course it is anywhere on the track already
    if (pace := float(np.linalg.norm(v))) > MOVES:
        aside -= np.outer(v, v) / pace**2
    return CredibleTrack(
        first=_over_ground(last.p + v * min(stops_s, age)), now=_over_ground(last.p + v * age), v=v, age=age,
        P=last.P[:6, :6], grows=aside @ (later.P[:3, :3] - last.P[:3, :3]) @ aside / GROWS_S**3,
    )  # fmt: skip


def _over_ground(p: Floats) -> Floats:
    """No target flies on below where it all began, however it was sinking."""
    return np.array([p[0], p[1], max(p[2], 0.0)])
