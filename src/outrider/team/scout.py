"""A drone that looks ahead: it flies a tour, and tells what its lidar sees that is not on the map."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final, final

import numpy as np

from outrider.core.rotations import quats_to_matrices
from outrider.data import Kind, Stream
from outrider.data.agents import Action, Message
from outrider.data.grid import OCCUPIED, Grid
from outrider.team.navigator import Fused
from outrider.team.tour import Tour
from outrider.team.words import Sighting
from outrider.typing import Bools, Floats

LOW: Final = 0.25  # m: what is lower is the ground
GAP: Final = 0.8  # m between two ends of beams that are not on one thing
FEW: Final = 5  # ends of beams, fewer make no thing
BENT: Final = 0.3  # m off a line from where on a thing is taken for two
BEAM: Final = 0.05  # m, of a beam's end
LOOKS: Final = 3  # turns of the lidar that must show a thing
NEAR: Final = 1.5  # m between the middles of two sightings of one thing
DRAWN: Final = 0.4  # m from what is drawn that is taken for it
SAID_S: Final = 0.5  # s between two messages


@final
@dataclass(slots=True, kw_only=True)
class Scout:
    """An `Agent`. tour : how it flies;  drawn : the map that everybody has, None: nothing is drawn;  mount : (4, 4),
    of its lidar in the body;  reach : m, up to which its lidar is trusted."""

    tour: Tour
    drawn: Grid | None
    mount: Floats
    reach: float = 15.0
    seen: list[Sighting] = field(default_factory=list[Sighting])
    _looks: list[int] = field(default_factory=list[int])
    _said: int = -(10**18)

    @property
    def period_s(self) -> float:
        """Of its tour."""
        return self.tour.period_s

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        """Fly on, look, tell."""
        action = self.tour.act(t, [s for s in records if s.kind is not Kind.SCAN], inbox)
        here = self.tour.navigator.now(t)
        new = [note for s in records if s.kind is Kind.SCAN for note in self._look(s, here)]
        said: tuple[Message, ...] = ()
        if self.seen and t - self._said >= SAID_S * 1e9:
            self._said = t
            said = tuple(s.message(t) for s, n in zip(self.seen, self._looks, strict=True) if n >= LOOKS)
        note = "; ".join(n for n in (action.note, *new) if n)
        return replace(action, messages=said, note=note)

    def _look(self, s: Stream, here: Fused) -> list[str]:
        """Enter the newest turn of the lidar; what is new."""
        if not len(s):
            return []
        row = len(s) - 1
        t, first, step = int(s.t[row]), float(s.extra["angle_min"][row]), float(s.extra["angle_step"][row])
        angle = first + step * np.arange(s.z.shape[1])
        hit = np.isfinite(s.z[row]) & (s.z[row] < self.reach)
        own = s.z[row, hit, None] * np.column_stack([np.cos(angle[hit]), np.sin(angle[hit]), np.zeros(hit.sum())])
        R = quats_to_matrices(here.q[None])[0]
        p = here.p - here.v * (here.t - t) * 1e-9
        ends = p + (own @ self.mount[:3, :3].T + self.mount[:3, 3]) @ R.T
        ends = ends[ends[:, 2] > LOW][:, :2]
        ends = ends[~self._on_map(ends)]
        told: list[str] = []
        for line, radius in lines(ends):
            made = Sighting(
                source=self.tour.navigator.robot, number=len(self.seen), t=t, ends=line, radius=radius,
                P=here.P[:2, :2] + np.eye(2) * BEAM**2,
            )  # fmt: skip
            told += self._enter(made)
        return told

    def _enter(self, new: Sighting) -> list[str]:
        """A sighting: of something known, or of something new. The longest view of a thing is the one to tell."""
        for k, old in enumerate(self.seen):
            if float(np.hypot(*(_nearest(old.ends, new.ends.mean(axis=0))))) < NEAR:
                longer = float(np.ptp(new.ends, axis=0).max()) >= float(np.ptp(old.ends, axis=0).max())
                kept = new if longer else old
                self.seen[k] = replace(kept, number=old.number, t=new.t)
                self._looks[k] += 1
                return [self._news(k)] if self._looks[k] == LOOKS else []
        self.seen.append(new)
        self._looks.append(1)
        return []

    def _news(self, k: int) -> str:
        east, north = self.seen[k].ends.mean(axis=0).tolist()
        return f"it sees something that is not on the map at ({east:.1f}, {north:.1f})"

    def _on_map(self, p: Floats) -> Bools:
        """(n,) whether something is drawn near points (n, 2)."""
        out = np.zeros(len(p), np.bool_)
        if self.drawn is None:
            return out
        cells = self.drawn.cells >= OCCUPIED
        k = int(np.ceil(DRAWN / self.drawn.resolution))
        at = np.floor((p - self.drawn.origin) / self.drawn.resolution).astype(np.int64)[:, ::-1]
        for i, (r, c) in enumerate(at.tolist()):
            out[i] = bool(cells[max(r - k, 0) : max(r + k + 1, 0), max(c - k, 0) : max(c + k + 1, 0)].any())
        return out


def lines(p: Floats) -> list[tuple[Floats, float]]:
    """Ends of beams p (n, 2), in the order of their bearing, as straight things: ends (2, 2) and radius [m]."""
    if not len(p):
        return []
    jump = np.flatnonzero(np.hypot(*np.diff(p, axis=0).T) > GAP) + 1
    return [made for part in np.split(p, jump) for made in _straight(part)]


def _straight(p: Floats) -> list[tuple[Floats, float]]:
    """One thing, or its two halves where it is bent."""
    if len(p) < FEW:
        return []
    along = p[-1] - p[0]
    length = float(np.hypot(*along))
    aside = np.abs(along[0] * (p[:, 1] - p[0, 1]) - along[1] * (p[:, 0] - p[0, 0])) / max(length, 1e-9)
    k = int(aside.argmax())
    if length > GAP and aside[k] > BENT and 0 < k < len(p) - 1:
        return [*_straight(p[: k + 1]), *_straight(p[k:])]
    if length <= GAP:
        middle = p.mean(axis=0)
        return [(np.vstack([middle, middle]), float(np.hypot(*(p - middle).T).max()) + BEAM)]
    return [(np.vstack([p[0], p[-1]]), float(aside[k]) + BEAM)]


def _nearest(ends: Floats, p: Floats) -> Floats:
    """(2,) from a line to a point."""
    along = ends[1] - ends[0]
    share = float(np.clip((p - ends[0]) @ along / max(float(along @ along), 1e-12), 0.0, 1.0))
    return p - ends[0] - share * along
