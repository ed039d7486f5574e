"""The flight of a drone that lives on a pad: when it takes off, inspects, comes back, and how it lands. Pure functions.

It leaves the thing that it inspects straight up, where nothing is above it, crosses above everything, and comes down
where its carrier waits in the open. It descends only by what its camera sees of the pad, and climbs again without.
"""

from dataclasses import dataclass, replace
from enum import Enum
from typing import final


class Phase(Enum):
    """What the drone is about; the value is the sentence a user reads."""

    DOCKED = "it stands on the pad"
    CLIMB = "it takes off"
    GO = "it crosses to where it goes on"
    SINK = "it sinks to where it goes on"
    INSPECT = "it inspects"
    LEAVE = "it goes on to where nothing is above it"
    RISE = "it rises above everything"
    RETURN = "it crosses to the pad"
    LOWER = "it comes down above the pad"
    ALIGN = "it lines up above the pad, by its camera"
    DESCEND = "it lands"
    ABORT = "it climbs away from the pad"
    LOST = "it could not land: it hovers"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """phase, since t_s, for a reason;  tries : landings that were broken off;  charges : times that it has charged."""

    phase: Phase = Phase.DOCKED
    since_s: float = 0.0
    reason: str = ""
    tries: int = 0
    charges: int = 0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Senses:
    """What it knows now. battery : share;  left : whether there is something to inspect;  ready : whether the carrier
    waits in the open;  near : m, horizontally, to where the phase goes, and `up`: m, of the height that is missing;
    free : whether nothing is above;  unseen_s : s since the camera saw the pad;  aside : m, off the pad's middle, by
    the camera;  slow : m/s, over the pad;  landed : whether it sinks no further though it is told to."""

    t_s: float
    battery: float
    left: bool
    ready: bool
    near: float
    up: float
    free: bool
    unseen_s: float
    aside: float
    slow: float
    landed: bool


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FlightRules:
    """low : share of the battery at which it returns;  full : at which it leaves the pad;  wait_s : on the pad before
    it may leave;  reach : m, how near counts as there;  aside : m, off the middle, within which it descends, and twice
    which it does not go on;  unseen_s : s without the pad after which it breaks off;  search_s : s that it looks for
    the pad before it climbs to see more;  settle_s : s that it lines up;  tries : landings before it gives up."""

    low: float = 0.2
    full: float = 0.9
    wait_s: float = 3.0
    reach: float = 0.6
    aside: float = 0.15
    unseen_s: float = 1.0
    search_s: float = 6.0
    settle_s: float = 1.5
    tries: int = 3


def advance(f: Flight, x: Senses, rules: FlightRules) -> Flight:
    """The flight after a period."""
    phase, reason = _next(f, x, rules)
    if phase is f.phase:
        return f
    tries = f.tries + 1 if phase is Phase.ABORT else 0 if phase in (Phase.DOCKED, Phase.CLIMB) else f.tries
    charges = f.charges + int(phase is Phase.DOCKED)
    return replace(f, phase=phase, since_s=x.t_s, reason=reason, tries=tries, charges=charges)


def _next(f: Flight, x: Senses, rules: FlightRules) -> tuple[Phase, str]:
    there = x.near < rules.reach
    if f.phase is Phase.DOCKED:
        waited = x.t_s - f.since_s >= rules.wait_s
        go = x.left and waited and x.ready and x.battery >= rules.full
        return (Phase.CLIMB, "charged, and the carrier stands in the open") if go else (f.phase, "")
    if f.phase is Phase.CLIMB and x.up < rules.reach:
        return (Phase.SINK, "the path begins here") if there else (Phase.GO, "high enough")
    if f.phase is Phase.GO and there:
        return Phase.SINK, "above the place"
    if f.phase is Phase.SINK and abs(x.up) < rules.reach and there:
        return Phase.INSPECT, "there"
    if f.phase is Phase.INSPECT and (x.battery < rules.low or not x.left):
        return Phase.LEAVE, f"battery at {100.0 * x.battery:.0f} %" if x.left else "the path is over"
    if f.phase is Phase.LEAVE and x.free:
        return Phase.RISE, "nothing is above"
    if f.phase is Phase.RISE and x.up < rules.reach:
        return Phase.RETURN, "high enough"
    if f.phase is Phase.RETURN and there and x.ready:
        return Phase.LOWER, "above the pad, and the carrier stands"
    if f.phase is Phase.LOWER and x.up > -rules.reach:
        return Phase.ALIGN, "low enough to line up"
    if f.phase in (Phase.ALIGN, Phase.DESCEND, Phase.ABORT):
        return _landing(f, x, rules)
    return f.phase, ""


def _landing(f: Flight, x: Senses, rules: FlightRules) -> tuple[Phase, str]:
    """Lines up, descends, breaks off, tries again."""
    ago, seen = x.t_s - f.since_s, x.unseen_s < rules.unseen_s
    if f.phase is Phase.ABORT:
        if f.tries >= rules.tries:
            return Phase.LOST, f"{f.tries} landings broken off"
        return (Phase.ALIGN, "it tries again") if x.up < rules.reach else (f.phase, "")
    if f.phase is Phase.ALIGN:
        if not seen and ago > rules.search_s:
            return Phase.ABORT, f"the pad is out of sight for {x.unseen_s:.1f} s"
        steady = seen and x.ready and x.aside < rules.aside and x.slow < rules.aside
        return (Phase.DESCEND, "lined up") if steady and ago >= rules.settle_s else (f.phase, "")
    if x.landed:
        return Phase.DOCKED, "it touched the pad"
    if not seen:
        return Phase.ABORT, f"the pad is out of sight for {x.unseen_s:.1f} s"
    if x.aside > 2.0 * rules.aside:
        return Phase.ABORT, f"{x.aside:.2f} m beside the pad's middle"
    return (f.phase, "") if x.ready else (Phase.ABORT, "the carrier moves")
