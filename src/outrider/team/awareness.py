"""What other robots have seen in the way: believed, refused with a reason, forgotten in time."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum
from typing import Final, final

import numpy as np

from outrider.data.agents import Message
from outrider.data.footprint import Footprint
from outrider.mapping.layers import Other
from outrider.team.words import SIGHTING, Sighting
from outrider.typing import Floats

SURE: Final = 2.0  # standard deviations of its place by which a thing is taken to be larger
EARLY_S: Final = 0.1  # s by which clocks may differ


class Refusal(Enum):
    """Why a sighting is not believed; the value is the sentence a user reads."""

    BROKEN = "it is not made of finite numbers"
    FUTURE = "it was seen later than now: check the clock of its source"
    STALE = "it was seen too long ago"
    VAGUE = "its source hardly knows where it is"
    HUGE = "it is larger than what a robot can have seen"
    HERE = "it stands where this robot is, or was when it was seen first"


@final
@dataclass(slots=True, kw_only=True)
class Awareness:
    """`hear` messages, then ask what is `standing`.

    radius : m, of this robot;  last_s : s after it was seen for which a thing counts;  sigma : m, of its place, above
    which it is too vague;  longest : m;  refused : how many for which reason, by source
    """

    radius: float = 0.5
    last_s: float = 30.0
    sigma: float = 2.0
    longest: float = 60.0
    refused: Counter[tuple[str, Refusal]] = field(default_factory=Counter[tuple[str, Refusal]])
    _own: set[tuple[str, int]] = field(default_factory=set[tuple[str, int]])  # sightings of this robot itself
    _known: dict[tuple[str, int], Sighting] = field(default_factory=dict[tuple[str, int], Sighting])

    def hear(self, t: int, here: Floats, inbox: Iterable[Message]) -> str:
        """Take what came in up to t [ns], at here (2,) m; what is new and worth telling."""
        told: list[str] = []
        for m in inbox:
            if m.topic != SIGHTING:
                continue
            s = Sighting.of(m) if _readable(m) else None
            why = Refusal.BROKEN if s is None else self._refusal(t, here, s)
            if why is not None:
                first = not self.refused[m.sender, why]
                self.refused[m.sender, why] += 1
                told += [f"a sighting of {m.sender} is refused: {why.value}"] if first else []
                continue
            assert s is not None
            old = self._known.get((s.source, s.number))
            if old is None or s.t > old.t:  # the same one again, or an older one on a detour, changes nothing
                self._known[s.source, s.number] = s
            if old is None:
                east, north = s.ends.mean(axis=0).tolist()
                told.append(f"{s.source} has seen something in the way at ({east:.1f}, {north:.1f})")
        return "; ".join(told)

    def standing(self, t: int) -> list[Other]:
        """What stands, as shapes for a costmap; what was seen too long ago is forgotten."""
        self._known = {key: s for key, s in self._known.items() if (t - s.t) * 1e-9 < self.last_s}
        return [shape(s) for s in self._known.values()]

    def _refusal(self, t: int, here: Floats, s: Sighting) -> Refusal | None:
        ago = (t - s.t) * 1e-9
        if ago < -EARLY_S:
            return Refusal.FUTURE
        if ago >= self.last_s:
            return Refusal.STALE
        if float(np.sqrt(np.linalg.eigvalsh(s.P)[-1])) > self.sigma:
            return Refusal.VAGUE
        along = s.ends[1] - s.ends[0]
        if float(np.hypot(*along)) + 2.0 * s.radius > self.longest:
            return Refusal.HUGE
        share = float(np.clip((here - s.ends[0]) @ along / max(float(along @ along), 1e-12), 0.0, 1.0))
        gap = here - s.ends[0] - share * along
        if (s.source, s.number) not in self._known and float(np.hypot(*gap)) < s.radius + self.radius:
            self._own.add((s.source, s.number))
        return Refusal.HERE if (s.source, s.number) in self._own else None


def shape(s: Sighting) -> Other:
    """The ground that it may cover: as large as it was seen, and by so much larger as its place is uncertain."""
    wide = s.radius + SURE * float(np.sqrt(max(float(np.linalg.eigvalsh(s.P)[-1]), 0.0)))
    along = s.ends[1] - s.ends[0]
    half = 0.5 * float(np.hypot(*along))
    middle = s.ends.mean(axis=0)
    if half < 1e-3:
        return Footprint.circle(wide), np.array([*middle, 0.0])
    return Footprint.capsule(half, half, wide), np.array([*middle, np.arctan2(along[1], along[0])])


def _readable(m: Message) -> bool:
    shapes = {"which": (2,), "seen": (2,), "ends": (2, 2), "covariance": (2, 2)}
    if any(k not in m.data or m.data[k].shape != v or not np.isfinite(m.data[k]).all() for k, v in shapes.items()):
        return False
    P = m.data["covariance"]
    return bool(m.data["which"][1] > 0.0 and np.allclose(P, P.T) and np.linalg.eigvalsh(P)[0] > -1e-9)
