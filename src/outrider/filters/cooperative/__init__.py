"""Robots that correct one another: one estimate for each of a team, and what they may share without fooling themselves.

`fuse_team` takes everybody's records. A relative record (pose, range, bearing, range and bearing of another robot)
corrects both; how they treat what they already share is the `Method`. `agreements` and `unobserved` say of a result
which sensors and pairs contradict one another, and what nothing has measured.

Who lets robots meet in a way of their own takes `fusion.prepare` for the filters of everybody's own records and
`gossip.Teammate` for each: `close` at a meeting, `note` what was measured, `hear` the partner's `news`, `settle`.
"""

from outrider.filters.cooperative.fusion import RELATIVE, Method, Shared, TeamEstimate, fuse_team
from outrider.filters.cooperative.insight import Agreement, agreements, unobserved
from outrider.filters.cooperative.robot import FALSE_ALARM, Member, MotionModel, Source, pose_rows

__all__ = [
    "FALSE_ALARM", "RELATIVE", "Agreement", "Member", "Method", "MotionModel", "Shared", "Source", "TeamEstimate",
    "agreements", "fuse_team", "pose_rows", "unobserved",
]  # fmt: skip
