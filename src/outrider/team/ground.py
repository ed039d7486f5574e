"""What agents on the ground share: the estimate, what the lidar sees from it, and where the others say they are."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, sin
from typing import Final, final

import numpy as np

from outrider.data import Kind, Stream
from outrider.data.agents import Message
from outrider.data.footprint import Footprint
from outrider.data.scan import Scan
from outrider.mapping.layers import Other
from outrider.team.driver import Answer, Driver
from outrider.team.navigator import Fused, Navigator
from outrider.team.reaction import Reaction
from outrider.team.words import STATUS, Status
from outrider.typing import Floats

GONE_S: Final = 3.0  # s after which what another robot said of its place is too old


@final
@dataclass(slots=True, kw_only=True)
class Ground:
    """A robot that drives on its own estimate.

    lidar : (3,) pose of the lidar in the body: forward, left [m], turned by [rad];  blind : m, what it sees of its own
    robot;  others : the footprint that other robots are taken to have;
    reaction : how late the base does what it is told.
    """

    navigator: Navigator
    driver: Driver
    lidar: Floats = field(default_factory=lambda: np.zeros(3))
    blind: float = 0.05
    others: Footprint | None = None
    reaction: Reaction = field(default_factory=lambda: Reaction(seconds=0.0))
    _heard: dict[str, Status] = field(default_factory=dict[str, Status])

    def drive(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> tuple[Fused, Answer]:
        """Fuse what came in, and take the next step to the goal of the driver."""
        self.navigator.take([s for s in records if s.kind is not Kind.SCAN])
        here = self.navigator.now(t)
        for m in inbox:
            if m.topic == STATUS and m.sender != self.navigator.robot:
                self._heard[m.sender] = Status.of(m)
        scans = [scan for s in records if s.kind is Kind.SCAN for scan in self._scans(s, here)]
        answer = self.driver.step(t * 1e-9, self.reaction.ahead(here), scans, self._neighbours(t))
        self.reaction.told(t * 1e-9, answer.twist)
        return here, answer

    def _scans(self, s: Stream, here: Fused) -> list[Scan]:
        """Each turn of the lidar from where the robot was then."""
        x, y, turned = self.lidar.tolist()
        out: list[Scan] = []
        for row in range(len(s)):
            ago = (here.t - int(s.t[row])) * 1e-9
            heading = here.heading - here.w * ago
            p = here.p[:2] - here.v[:2] * ago
            c, k = cos(heading), sin(heading)
            pose = np.array([p[0] + c * x - k * y, p[1] + k * x + c * y, heading + turned])
            if not np.isfinite(pose).all():
                continue
            first, step, reach = (float(s.extra[name][row]) for name in ("angle_min", "angle_step", "range_max"))
            bearings = first + step * np.arange(s.z.shape[1])
            out.append(Scan(pose=pose, bearings=bearings, ranges=s.z[row], reach=reach, blind=self.blind))
        return out

    def _neighbours(self, t: int) -> list[Other]:
        """Where the others are by now."""
        if self.others is None:
            return []
        out: list[Other] = []
        for status in self._heard.values():
            ago = (t - status.t) * 1e-9
            if ago < GONE_S:
                moved = np.array([*(status.velocity * ago), 0.0])
                out.append((self.others, status.pose + moved))
        return out
