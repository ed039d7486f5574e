"""Estimating a drone that follows, and what it follows, by position and velocity (and wind).

`FollowerFilter` estimates one aircraft online, whatever comes late; `RelativeFilter` the one as seen from the other.
`steps` are the compiled steps below them, also for a thousand robots at a time.
"""

from outrider.filters.following.online import Belief, FollowerFilter, Following, Fused, Outcome
from outrider.filters.following.relative import RelativeFilter, relative, separation

__all__ = [
    "Belief", "FollowerFilter", "Following", "Fused", "Outcome", "RelativeFilter", "relative", "separation",
]  # fmt: skip
