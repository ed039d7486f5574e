"""What agents on the ground share: the estimate, what the lidar sees from it, where the others say they are, and the
safety stage between what a driver wants and what the motors are told."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import cos, sin
from typing import Final, final

import numpy as np

from outrider.data import Kind, Stream
from outrider.data.agents import Message
from outrider.data.footprint import Footprint
from outrider.data.scan import Scan
from outrider.mapping.layers import Other
from outrider.safety.monitor import Monitor
from outrider.safety.stage import Held, Inputs, Reason, SafetyStage, Watchdog
from outrider.safety.stage import Scan as RawScan
from outrider.team.awareness import Awareness
from outrider.team.courtesy import gives_way, rank
from outrider.team.driver import Answer, Driver
from outrider.team.navigator import Fused, Navigator
from outrider.team.reaction import Reaction
from outrider.team.words import STATUS, Status
from outrider.typing import Floats

STANDS: Final = 0.15  # m/s, what is slower is taken to stand
GONE_S: Final = 3.0  # s after which what another robot said of its place is too old


@final
@dataclass(slots=True, kw_only=True)
class Ground:
    """A robot that drives on its own estimate.

    lidar : (3,) pose of the lidar in the body: forward, left [m], turned by [rad];  scan_s : s between its scans;
    blind : m, what it sees of its own robot;  others : the footprint that other robots are taken to have;  reaction :
    how late the base does what it is told;  period_s : s from command to command;  safety : what every command passes,
    by default the limits of the driver's base, its footprint, no zones, and a watchdog for scans at that rate;
    awareness : what others have seen in the way.
    """

    navigator: Navigator
    driver: Driver
    lidar: Floats = field(default_factory=lambda: np.zeros(3))
    scan_s: float = 0.1
    blind: float = 0.05
    others: Footprint | None = None
    reaction: Reaction = field(default_factory=lambda: Reaction(seconds=0.0))
    period_s: float = 0.1
    safety: SafetyStage | None = None
    awareness: Awareness | None = None
    _held: Held | None = None
    _scan: RawScan | None = None
    _heard: dict[str, Status] = field(default_factory=dict[str, Status])

    def __post_init__(self) -> None:
        if self.awareness is None:
            self.awareness = Awareness(radius=self.driver.footprint.circumscribed)
        if self.safety is None:
            late = max(0.2, self.reaction.seconds + self.period_s)
            monitor = Monitor(footprint=self.driver.footprint, reaction=late) if self.driver.sees else None
            self.safety = SafetyStage(
                limits=self.driver.limits, monitor=monitor, watchdog=Watchdog.at(self.scan_s), period=self.period_s
            )

    @property
    def interventions(self) -> dict[Reason, tuple[int, int]]:
        """Why commands were changed: how many times that began, and how many cycles it lasted altogether."""
        if self._held is None:
            return {}
        held = self._held
        return {r: (held.times(r), held.count(r)) for r in Reason if r is not Reason.NONE and held.count(r)}

    def drive(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> tuple[Fused, Answer]:
        """Fuse what came in, and take the next step to the goal of the driver: `aim`, then `give`."""
        here, answer = self.aim(t, records, inbox)
        return here, self.give(t, here, answer)

    def aim(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> tuple[Fused, Answer]:
        """Fuse what came in, and what the driver would do."""
        self.navigator.take([s for s in records if s.kind is not Kind.SCAN])
        here = self.navigator.now(t)
        for m in inbox:
            if m.topic == STATUS and m.sender != self.navigator.robot:
                self._heard[m.sender] = Status.of(m)
        assert self.awareness is not None
        told = self.awareness.hear(t, here.p[:2], inbox)
        scans = [scan for s in records if s.kind is Kind.SCAN for scan in self._scans(s, here)]
        answer = self.driver.step(t * 1e-9, self.reaction.ahead(here), scans, *self._neighbours(t))
        if told:
            answer = replace(answer, note="; ".join(n for n in (told, answer.note) if n))
        first = self.driver.sees and self._scan is None  # it waits for its first scan
        return here, answer.at_rest if first else answer

    def give(self, t: int, here: Fused, answer: Answer) -> Answer:
        """The answer with the twist that the safety stage gives, and with its reason where it stops the robot."""
        assert self.safety is not None
        now = t * 1e-9
        x = Inputs(
            time=now, command=answer.twist, command_time=now, pose=np.array([here.p[0], here.p[1], here.heading]),
            pose_time=min(self.navigator.newest * 1e-9, now), scan=self._scan,
        )  # fmt: skip
        before = self._held or self.safety.start(now)
        self._held, given = self.safety.step(before, x)
        self.reaction.told(now, given.twist)
        if not self._held.reason.stops:
            return replace(answer, twist=given.twist)
        new = self._held.reason is not before.reason
        why = f"safety: {given.reason.value}"
        reason = f"{why}; {answer.reason}" if answer.reason else why
        return replace(answer, twist=given.twist, reason=reason, note=why if new else answer.note)

    def _scans(self, s: Stream, here: Fused) -> list[Scan]:
        """Each turn of the lidar from where the robot was then."""
        x, y, turned = self.lidar.tolist()
        out: list[Scan] = []
        for row in range(len(s)):
            first, step, reach = (float(s.extra[name][row]) for name in ("angle_min", "angle_step", "range_max"))
            raw = np.where(s.z[row] >= self.blind, s.z[row], np.nan)
            self._scan = RawScan(
                time=int(s.t[row]) * 1e-9, ranges=raw, angle_min=first, angle_step=step, reach=reach,
                mount=(x, y, turned),
            )  # fmt: skip
            ago = (here.t - int(s.t[row])) * 1e-9
            heading = here.heading - here.w * ago
            p = here.p[:2] - here.v[:2] * ago
            if not (np.isfinite(p).all() and np.isfinite(heading)):
                continue
            c, k = cos(heading), sin(heading)
            pose = np.array([p[0] + c * x - k * y, p[1] + k * x + c * y, heading + turned])
            bearings = first + step * np.arange(s.z.shape[1])
            out.append(Scan(pose=pose, bearings=bearings, ranges=s.z[row], reach=reach, blind=self.blind, age=ago))
        return out

    def gives_way(self, t: int, here: Fused, order: int) -> str:
        """The robot for which this one stops, "" for none; order : that it follows, -1 for none."""
        if self.others is None:
            return ""
        wide = self.others.circumscribed + self.driver.footprint.circumscribed
        own, braking = rank(self.navigator.robot, order), self.driver.limits.acceleration
        return gives_way(t, here.p[:2], here.v[:2], own, self._heard.values(), wide=wide, braking=braking)

    def _neighbours(self, t: int) -> tuple[list[Other], Floats]:
        """Where the others stand, and (n, 5) discs of those that move, by what they have said of themselves."""
        assert self.awareness is not None
        standing, moving = self.awareness.standing(t), list[Floats]()
        for status in self._heard.values() if self.others is not None else ():
            ago = (t - status.t) * 1e-9
            if ago >= GONE_S or self.others is None:
                continue
            here = status.pose + np.array([*(status.velocity * ago), 0.0])
            if float(np.hypot(*status.velocity)) < STANDS:
                standing.append((self.others, here))
            else:
                moving.append(np.array([*here[:2], self.others.circumscribed, *status.velocity]))
        return standing, np.array(moving).reshape(-1, 5)
