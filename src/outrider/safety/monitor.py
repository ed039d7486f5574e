"""Collision monitor: raw points of a scan against zones around the body and against the way that is commanded.

Below every planner, knows no map. The models (stop, slow, approach by time to collision) and the debounce are those of
nav2_collision_monitor; what a scan cannot tell counts as a reason to stop.
"""

from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Final, final

import numpy as np

from outrider.core.flat import inside_polygon
from outrider.data.footprint import Footprint
from outrider.errors import ConfigError
from outrider.safety.clearance import STRIDE, UNMAPPED, Around, Body, body_of, clash
from outrider.safety.stopping import moved
from outrider.typing import Floats

HERE: Final = np.zeros(3)


class Action(Enum):
    """What the monitor does to a command, mildest first."""

    NONE = "nothing is near"
    SLOW = "something is in a zone where the robot slows down"
    APPROACH = "the commanded way meets something soon: slower, the sooner the more"
    STOP = "something is in a zone where the robot stops, or touches it"
    BLIND = "the scan is empty or mostly invalid: check the lidar"


@final
@dataclass(frozen=True, slots=True)
class Zone:
    """A convex or any other polygon (n, 2) m, body frame; at least `points` returns in it make the robot go at
    `share` of its command: 0 stops it. Raises ConfigError for an impossible zone.
    """

    name: str
    outline: Floats
    share: float = 0.0
    points: int = 3

    def __post_init__(self) -> None:
        p = self.outline
        if p.ndim != 2 or p.shape[1:] != (2,) or len(p) < 3 or not np.isfinite(p).all():
            raise ConfigError(f"outline of shape {p.shape}", where=f"zone {self.name}", fix="three corners or more")
        if not 0.0 <= self.share < 1.0 or self.points < 1:
            fix = "a share from 0 to below 1, one point or more"
            raise ConfigError(f"share {self.share:g}, {self.points} points", where=f"zone {self.name}", fix=fix)

    def count(self, points: Floats) -> int:
        """How many of the points (n, 2) lie inside."""
        outline = np.ascontiguousarray(self.outline, np.float64)
        low, high = outline.min(axis=0), outline.max(axis=0)
        near = points[((points >= low) & (points <= high)).all(axis=1)]
        return sum(inside_polygon(outline, 0, len(outline), float(x), float(y)) for x, y in near)


@final
@dataclass(frozen=True, slots=True)
class Watch:
    """How often in a row each zone was seen taken (positive) or free (negative), and which are in force."""

    seen: tuple[int, ...]
    on: tuple[bool, ...]


@final
@dataclass(frozen=True, slots=True)
class Ruling:
    """What is left of a command: `twist` (3,), why, in which zone, how many points, seconds to the first touch."""

    action: Action
    twist: Floats
    zone: str = ""
    points: int = 0
    time_to_collision: float = np.inf


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Monitor:
    """zones : checked all;  horizon, step : s over which a command is followed, and how finely;  trigger, release :
    scans in a row until a zone takes force, and until it loses it;  valid : share of beams that must say something.
    """

    footprint: Footprint
    zones: tuple[Zone, ...] = ()
    horizon: float = 2.0
    step: float = 0.1
    trigger: int = 2
    release: int = 5
    valid: float = 0.3
    _body: Body = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 0.0 < self.step <= self.horizon or self.trigger < 1 or self.release < 1 or not 0.0 < self.valid <= 1.0:
            raise ConfigError("impossible horizon, step, trigger, release or valid share", where="collision monitor")
        object.__setattr__(self, "_body", body_of(self.footprint))

    def start(self) -> Watch:
        """Every zone in force: a robot starts to move when its scans say that it may."""
        return Watch((0,) * len(self.zones), (True,) * len(self.zones))

    def rule(self, watch: Watch, ranges: Floats, points: Floats, twist: Floats) -> tuple[Watch, Ruling]:
        """One scan: ranges (n,), of which NaN are invalid and inf empty, and its returns (m, 2) m, body frame."""
        if not len(ranges) or np.mean(~np.isnan(ranges)) < self.valid or not np.isfinite(points).all():
            return replace(watch, seen=(0,) * len(self.zones)), Ruling(Action.BLIND, np.zeros(3))
        counts = [zone.count(points) for zone in self.zones]
        watch = self._debounced(watch, counts)
        ruling = Ruling(Action.NONE, twist)
        share = 1.0
        for zone, on, count in zip(self.zones, watch.on, counts, strict=True):
            if on and zone.share < share:
                share = zone.share
                action = Action.STOP if share == 0.0 else Action.SLOW
                ruling = Ruling(action, share * twist, zone.name, count)
        soon = self.time_to_collision(points, twist)
        if soon < self.horizon and soon / self.horizon < share:
            action = Action.APPROACH if soon > 0.0 else Action.STOP
            ruling = Ruling(action, soon / self.horizon * twist, "", len(points), soon)
        return watch, ruling

    def _debounced(self, watch: Watch, counts: list[int]) -> Watch:
        seen, on = list(watch.seen), list(watch.on)
        for k, zone in enumerate(self.zones):
            taken = counts[k] >= zone.points
            seen[k] = max(seen[k], 0) + 1 if taken else min(seen[k], 0) - 1
            on[k] = True if seen[k] >= self.trigger else False if -seen[k] >= self.release else on[k]
        return Watch(tuple(seen), tuple(on))

    def time_to_collision(self, points: Floats, twist: Floats) -> float:
        """Seconds until the footprint, moving at this twist, is a STRIDE from a point; inf beyond the horizon."""
        if not len(points) or not np.abs(twist).max() > 0.0:
            return np.inf
        t = np.arange(0.0, self.horizon + 0.5 * self.step, self.step)
        discs = np.zeros((len(points), 5))
        discs[:, :2] = points
        z = np.column_stack([moved(HERE, twist, t), t])
        hit = clash(z, self._body, Around(discs, UNMAPPED, 0.0, 0.0, 1.0, 0.0))
        if hit.free:
            return np.inf
        fastest = float(np.hypot(twist[0], twist[1])) + self._body.circumscribed * abs(float(twist[2]))
        return max(hit.time - STRIDE / fastest, 0.0)


def returns(ranges: Floats, angle_min: float, angle_step: float, reach: float, mount: Floats = HERE) -> Floats:
    """(m, 2) m, body frame: where beams met something; mount (3,) is the pose of the lidar on the body.

    Ranges that are NaN, infinite, not positive or beyond `reach` are no returns.
    """
    with np.errstate(invalid="ignore"):
        met = np.isfinite(ranges) & (ranges > 0.0) & (ranges <= reach)
    angles = mount[2] + angle_min + angle_step * np.flatnonzero(met)
    return mount[:2] + ranges[met, None] * np.column_stack([np.cos(angles), np.sin(angles)])
