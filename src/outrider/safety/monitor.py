"""Collision monitor: raw points of a scan against zones around the body and against the way that is commanded.

Below every planner, knows no map. The models (stop, slow, approach by time to collision) and the debounce are those of
nav2_collision_monitor, but for two things: how slow is asked of the brakes, not of a fixed share, and what already
touches the robot holds no motion that leads away from it. What a scan cannot tell counts as a reason to stop.
"""

from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Final, final

import numpy as np

from outrider.core.flat import inside_polygon
from outrider.data.footprint import Footprint
from outrider.errors import ConfigError
from outrider.safety.clearance import STRIDE, UNMAPPED, Around, Body, body_of, clash, room
from outrider.safety.stopping import brakeable, moved
from outrider.typing import Bools, Floats

HERE: Final = np.zeros(3)
AWAY: Final = 0.3  # share of a command that leads away from what is too near
BIT: Final = 0.02  # s of a command, to see where it leads


class Action(Enum):
    """What the monitor does to a command, mildest first."""

    NONE = "nothing is near"
    SLOW = "something is in a zone where the robot slows down"
    APPROACH = "the commanded way meets something soon: slow enough to stop before it"
    LEAVE = "something is too near: slowly away from it"
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

    def within(self, points: Floats) -> Bools:
        """(n,) which of the points (n, 2) lie inside."""
        outline = np.ascontiguousarray(self.outline, np.float64)
        low, high = outline.min(axis=0), outline.max(axis=0)
        out = ((points >= low) & (points <= high)).all(axis=1)
        for k in np.flatnonzero(out):
            out[k] = inside_polygon(outline, 0, len(outline), float(points[k, 0]), float(points[k, 1]))
        return out


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
    """zones : checked all;  step : s, how finely a command is followed;  reaction : s that pass before the base obeys;
    trigger, release : scans in a row until a zone takes force, and until it loses it;  valid :
    share of beams that must say something.
    """

    footprint: Footprint
    zones: tuple[Zone, ...] = ()
    step: float = 0.1
    reaction: float = 0.2
    trigger: int = 2
    release: int = 5
    valid: float = 0.3
    _body: Body = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        good = 0.0 < self.step < np.inf and 0.0 <= self.reaction < np.inf and 0.0 < self.valid <= 1.0
        if not good or self.trigger < 1 or self.release < 1:
            what = "impossible step, reaction, trigger, release or valid share"
            raise ConfigError(what, where="collision monitor", fix="positive counts, step and share; a finite reaction")
        object.__setattr__(self, "_body", body_of(self.footprint))

    def start(self) -> Watch:
        """Every zone in force: a robot starts to move when its scans say that it may."""
        return Watch((0,) * len(self.zones), (True,) * len(self.zones))

    def rule(self, watch: Watch, ranges: Floats, points: Floats, twist: Floats, rest: float) -> tuple[Watch, Ruling]:
        """One scan: ranges (n,), of which NaN are invalid and inf empty, and its returns (m, 2) m, body frame.

        rest : s that the base takes to stop from the command `twist` (3,).
        """
        if not len(ranges) or np.mean(~np.isnan(ranges)) < self.valid or not np.isfinite(points).all():
            return replace(watch, seen=(0,) * len(self.zones)), Ruling(Action.BLIND, np.zeros(3))
        inside = [zone.within(points) for zone in self.zones]
        watch = self._debounced(watch, [int(x.sum()) for x in inside])
        ruling, share = Ruling(Action.NONE, twist), 1.0
        for zone, on, taken in zip(self.zones, watch.on, inside, strict=True):
            if on and zone.share < share:
                share, action = zone.share, Action.SLOW
                if share == 0.0:
                    away = self._leaves(points[taken], twist)
                    share, action = (AWAY, Action.LEAVE) if away else (0.0, Action.STOP)
                ruling = Ruling(action, share * twist, zone.name, int(taken.sum()))
        touching = self._touching(points)
        if touching.any() and share > 0.0:
            away = self._leaves(points[touching], twist)
            share, action = (min(AWAY, share), Action.LEAVE) if away else (0.0, Action.STOP)
            ruling = Ruling(action, share * twist, "", int(touching.sum()), 0.0)
        soon = self.time_to_collision(points[~touching], twist, self.reaction + 0.5 * rest)
        most = brakeable(soon, rest, self.reaction)
        if most < share:
            ruling = Ruling(Action.APPROACH if most > 0.0 else Action.STOP, most * twist, "", len(points), soon)
        return watch, ruling

    def _room(self, point: Floats, pose: Floats) -> float:
        disc = np.array([[point[0], point[1], 0.0, 0.0, 0.0]])
        return room(self._body, Around(disc, UNMAPPED, 0.0, 0.0, 1.0, 0.0), pose[0], pose[1], pose[2], 0.0)[0]

    def _touching(self, points: Floats) -> Bools:
        """(m,) which points are inside the footprint, or on its edge."""
        out = np.hypot(points[:, 0], points[:, 1]) <= self._body.circumscribed
        for k in np.flatnonzero(out):
            out[k] = self._room(points[k], HERE) <= 0.0
        return out

    def _leaves(self, points: Floats, twist: Floats) -> bool:
        """Whether a command leads away from the nearest of the points, and nearer to none."""
        if not len(points) or not np.abs(twist).max() > 0.0:
            return False
        soon = moved(HERE, twist, np.array([BIT]))[0]
        now, then = (np.array([self._room(p, pose) for p in points]) for pose in (HERE, soon))
        return bool((then >= now - 1e-9).all() and then[now.argmin()] > now.min() + 1e-9)

    def _debounced(self, watch: Watch, counts: list[int]) -> Watch:
        seen, on = list(watch.seen), list(watch.on)
        for k, zone in enumerate(self.zones):
            taken = counts[k] >= zone.points
            seen[k] = max(seen[k], 0) + 1 if taken else min(seen[k], 0) - 1
            on[k] = True if seen[k] >= self.trigger else False if -seen[k] >= self.release else on[k]
        return Watch(tuple(seen), tuple(on))

    def time_to_collision(self, points: Floats, twist: Floats, horizon: float) -> float:
        """Seconds until the footprint, moving at this twist, is a STRIDE from a point; inf beyond the horizon."""
        if not len(points) or not np.abs(twist).max() > 0.0:
            return np.inf
        t = np.linspace(0.0, horizon + self.step, max(int(np.ceil(horizon / self.step)), 1) + 1)
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
