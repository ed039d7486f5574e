"""Robots that correct one another: one estimate for each of a team, and what they may share without fooling themselves.

`fuse_team` takes everybody's records. A relative record (pose, range, bearing, range and bearing of another robot)
corrects both; how they treat what they already share is the `Method`.
"""

from outrider.filters.cooperative.fusion import RELATIVE, Method, Shared, TeamEstimate, fuse_team
from outrider.filters.cooperative.robot import FALSE_ALARM, Member, MotionModel, Source, pose_rows

__all__ = [
    "FALSE_ALARM", "RELATIVE", "Member", "Method", "MotionModel", "Shared", "Source", "TeamEstimate", "fuse_team",
    "pose_rows",
]  # fmt: skip
