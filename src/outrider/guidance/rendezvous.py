"""Following another aircraft as a pure transition: localisation, rendezvous and danger zone, and what if it is lost.

swarm2023, algorithms 1 to 3, with what they leave out: hysteresis between the zones, a target that falls silent or is
somewhere else all of a sudden, clocks that disagree, and an end. Distances are in space, heights included.
"""

from dataclasses import dataclass, replace
from enum import Enum
from math import inf, isfinite
from typing import Final, final

from outrider.errors import ConfigError


class Stage(Enum):
    """What the follower is about; the value is the sentence a user reads."""

    WAIT = "it hovers: nothing has been heard of the target yet"
    LOCALISE = "outside the rendezvous zone: it comes up with the target"
    RENDEZVOUS = "in the rendezvous zone: it goes to its distance and holds it"
    DANGER = "in the danger zone: it gives way"
    PREDICT = "without a fix of the target to go by: it slows down and keeps clear of wherever the target may be"
    SEARCH = "the target is lost: it looks for it from above, along the way that it may have flown"
    HOLD = "it hovers"
    RETURN = "it returns to where it started"
    HOME = "it is back where it started"


class Why(Enum):
    """Why a stage was entered."""

    START = "it has just started"
    FIRST = "the target was heard for the first time"
    FAR = "the target is farther away than the rendezvous zone"
    NEAR = "the target is within the rendezvous zone"
    CLOSE = "the target is within the danger zone"
    CLEAR = "the target is out of the danger zone again"
    SILENT = "no fix of the target came"
    JUMPED = "the target's fixes jump and are refused"
    LOST = "nothing of the target for too long"
    FOUND = "the target is heard again"
    GIVEN_UP = "the search found nothing"
    UNSEEN = "the target stayed away"
    ARRIVED = "it came home"
    CLOCKS = "the clocks of the two aircraft disagree"
    BLIND = "it does not know well enough where it is"
    UNSURE = "it does not know how far the target is"
    UNFIT = "this target cannot be followed at a safe distance"


class Signal(Enum):
    """The follower's own satellite signal."""

    FIXED = "its own fixes come"
    BLOCKED = "no fix of its own comes: it flies on its model"


AFTER: Final = {Stage.LOCALISE: Why.FAR, Stage.RENDEZVOUS: Why.NEAR}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Rendezvous:
    """stage, since t_s, for a reason;  signal, since signal_s."""

    stage: Stage = Stage.WAIT
    since_s: float = 0.0
    why: Why = Why.START
    signal: Signal = Signal.FIXED
    signal_s: float = 0.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Senses:
    """What it knows now.

    distance : m, to where the target should be, in space;  heard_s : age of the newest fix of the target that was
    believed, infinite if there was none;  jumps : fixes of the target refused since;  fix_s : age of its own newest
    fix;  sigma : m, standard deviation of its own place;  clocks_s : s by which the other clock is ahead, NaN if not
    known;  unfit : whether the target is such that no safe distance can be kept;  home : m, to where it started.
    """

    t_s: float
    distance: float
    heard_s: float = inf
    jumps: int = 0
    fix_s: float = 0.0
    sigma: float = 0.0
    clocks_s: float = float("nan")
    unfit: bool = False
    home: float = inf


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Zones:
    """Where the zones end, and how long it is patient.

    danger : m, radius R_d that the follower stays out of;  zone : m, radius of the rendezvous zone;  band, outer : m,
    by which the danger and the rendezvous zone must be left to count as left;  silent_s : age of the target's newest
    fix from where on it is silent;  lost_s : from where on it is lost;  search_s, hold_s : how long it then looks for
    it, and waits;  blocked_s : age of its own newest fix from where on its signal is blocked;  blind : m, how wrong it
    may be before it stops;  clocks_s : how far the clocks may disagree;  reach : m, how near counts as home.
    """

    danger: float = 3.0
    zone: float = 6.0
    band: float = 0.3
    outer: float = 1.0
    silent_s: float = 2.5
    lost_s: float = 6.0
    search_s: float = 20.0
    hold_s: float = 20.0
    blocked_s: float = 1.8
    blind: float = 1.5
    clocks_s: float = 0.25
    reach: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 < self.danger < self.zone < inf:
            where, fix = f"danger {self.danger:g} m, zone {self.zone:g} m", "0 < danger < zone"
            raise ConfigError(where, where="zones", fix=fix)
        if not 0.0 < self.band < self.zone - self.danger:
            raise ConfigError(f"band {self.band:g} m", where="zones", fix="above 0, less than between danger and zone")
        if not 0.0 < self.silent_s < self.lost_s:
            said = f"silent_s {self.silent_s:g}, lost_s {self.lost_s:g}"
            raise ConfigError(said, where="zones", fix="0 < silent_s < lost_s")
        named = {"search_s": self.search_s, "hold_s": self.hold_s, "blocked_s": self.blocked_s, "blind": self.blind}
        for name, value in {**named, "outer": self.outer, "clocks_s": self.clocks_s, "reach": self.reach}.items():
            if not value > 0.0:
                raise ConfigError(f"{name} is {value:g}", where="zones", fix="a number above 0")


def advance(m: Rendezvous, s: Senses, zones: Zones) -> Rendezvous:
    """The mission after a period."""
    signal = Signal.FIXED if s.fix_s <= zones.blocked_s else Signal.BLOCKED
    if signal is not m.signal:
        m = replace(m, signal=signal, signal_s=s.t_s)
    stage, why = _next(m, s, zones)
    if stage is m.stage and (stage is not Stage.HOLD or why is m.why):
        return m
    return replace(m, stage=stage, since_s=s.t_s, why=why)


def _next(m: Rendezvous, s: Senses, zones: Zones) -> tuple[Stage, Why]:
    """Stage and why it is entered; what stops it stands over everything, then what keeps it out of danger."""
    if m.stage is Stage.HOME:
        return m.stage, m.why
    stop = _stop(m, s, zones)
    if stop is not None:
        return Stage.HOLD, stop
    if not s.heard_s < inf:
        return Stage.WAIT, Why.START
    if not isfinite(s.distance):
        return Stage.HOLD, Why.UNSURE
    stage = _zone(m, s.distance, zones)
    if s.heard_s > zones.silent_s and (stage is not Stage.DANGER or s.heard_s > zones.lost_s):
        return _alone(m, s, zones)
    if m.stage is stage:
        return stage, m.why
    if stage is Stage.DANGER:
        return stage, Why.CLOSE
    if m.stage is Stage.DANGER:
        return stage, Why.CLEAR
    if m.stage is Stage.WAIT:
        return stage, Why.FIRST
    missed = m.stage in (Stage.PREDICT, Stage.SEARCH, Stage.RETURN) or m.why is Why.GIVEN_UP
    return stage, Why.FOUND if missed else AFTER[stage]


def _zone(m: Rendezvous, distance: float, zones: Zones) -> Stage:
    """The zone of a distance; one is left only by more than the band."""
    if distance < zones.danger + (zones.band if m.stage is Stage.DANGER else 0.0):
        return Stage.DANGER
    inside = m.stage in (Stage.RENDEZVOUS, Stage.DANGER)
    return Stage.RENDEZVOUS if distance <= zones.zone + (zones.outer if inside else 0.0) else Stage.LOCALISE


def _alone(m: Rendezvous, s: Senses, zones: Zones) -> tuple[Stage, Why]:
    """Without the target: on its prediction, to where it should be, hovering, home; by the age of its last fix."""
    if s.heard_s <= zones.lost_s:
        return Stage.PREDICT, Why.JUMPED if s.jumps else Why.SILENT
    if s.heard_s <= zones.lost_s + zones.search_s:
        return Stage.SEARCH, Why.JUMPED if s.jumps else Why.LOST
    if s.heard_s <= zones.lost_s + zones.search_s + zones.hold_s:
        return Stage.HOLD, Why.GIVEN_UP
    return (Stage.HOME, Why.ARRIVED) if s.home < zones.reach else (Stage.RETURN, Why.UNSEEN)


def _stop(m: Rendezvous, s: Senses, zones: Zones) -> Why | None:
    """What it must hover for; a hover ends only once things are better by half."""

    def over(value: float, limit: float, why: Why) -> bool:
        return not value <= (0.5 * limit if m.stage is Stage.HOLD and m.why is why else limit)

    if isfinite(s.clocks_s) and over(abs(s.clocks_s), zones.clocks_s, Why.CLOCKS):
        return Why.CLOCKS
    if over(s.sigma, zones.blind, Why.BLIND):
        return Why.BLIND
    return Why.UNFIT if s.unfit else None
