"""All that evidence is drawn from, and series fit to be drawn small."""

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from outrider.data import EventLog, Finding, Innovations, Kind, Run, Stream, Verdict
from outrider.data.evidence import BARS, LINE, Curve
from outrider.filters.channels import Channel
from outrider.typing import Floats, Ints
from outrider.workflows.config import FuseConfig
from outrider.workflows.doctor.examine import Patient
from outrider.workflows.draft import Plan

MOST: Final = 300  # points of a series
WILD: Final = 1e9  # of any unit: nothing to be drawn
BINS: Final = 40


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """log : as it was read;  chosen : the plan, with the log as it was fused;  run : what came of it."""

    log: EventLog
    chosen: Plan
    run: Run

    def patient(self) -> Patient:
        """The log as it was read, with what screening left of it, for the doctor's instruments."""
        return Patient(self.log, FuseConfig(), self.chosen.verdicts, self.chosen.datum)

    def as_stamped(self) -> Patient:
        """The same with its units and senses mended, and its stamps as they were."""
        fused = self.chosen.log.streams
        streams = {s.name: replace(fused[s.name], t=s.t, t_arrival=s.t_arrival) for s in self.log}
        return replace(self.patient(), log=replace(self.log, streams=streams))

    def stream(self, f: Finding, *kinds: Kind) -> Stream | None:
        """The records that a finding is about, if they are of one of these kinds; as read, without those refused."""
        s = self.log.streams.get(f.source)
        if s is None or (kinds and s.kind not in kinds):
            return None
        return s.select(self.chosen.verdicts[s.name] == Verdict.USED)

    def innovations(self, f: Finding) -> tuple[Channel, Innovations] | None:
        """Of the first channel of a finding's source that has any; of the one named in its text, if one is."""
        own = [
            c for c in self.chosen.whole.channels if f.source in (c.stream, c.name) and c.name in self.run.innovations
        ]
        named = [c for c in own if f.text.startswith((f"{c.name} ", f"{c.name}:")) or f" {c.name} " in f.text]
        longest = sorted(named or own, key=lambda c: -len(c.name) if named else 0)
        return (longest[0], self.run.innovations[longest[0].name]) if longest else None

    def since(self, t: Ints) -> Floats:
        """Stamps [ns] as seconds since the run's start."""
        return np.asarray((t - self.run.start) * 1e-9, np.float64)


def curve(x: Floats, y: Floats, name: str = "", drawn: str = LINE) -> Curve | None:
    """A series without what is not finite or wild, with no more points than can be seen; None if nothing is left."""
    good = np.isfinite(x) & np.isfinite(y) & (np.abs(x) < WILD) & (np.abs(y) < WILD)
    x, y = x[good], y[good]
    rows = telling(y) if len(y) > MOST else np.arange(len(y))
    return Curve(x=x[rows].copy(), y=y[rows].copy(), name=name, drawn=drawn) if len(rows) else None


def telling(y: Floats) -> Ints:
    """Rows of the least and the greatest of each of some equal slices."""
    parts = np.array_split(np.arange(len(y)), MOST // 2)
    return np.unique(np.array([k for p in parts for k in (p[np.argmin(y[p])], p[np.argmax(y[p])])], np.int64))


def present(*curves: Curve | None) -> tuple[Curve, ...]:
    """Those that there are."""
    return tuple(c for c in curves if c is not None)


def histogram(y: Floats, name: str = "", most: float | None = None) -> Curve | None:
    """How often which value, from 0 to `most`, or over all but a hundredth; the outermost bars hold the rest."""
    y = y[np.isfinite(y) & (np.abs(y) < WILD)]
    if not len(y):
        return None
    low, high = (0.0, most) if most is not None else np.percentile(y, [0.5, 99.5]).tolist()
    if not high > low:
        low, high = low - 0.5, high + 0.5
    count, edges = np.histogram(np.clip(y, low, high), BINS, (low, high))
    return Curve(x=0.5 * (edges[1:] + edges[:-1]), y=count / len(y), name=name, drawn=BARS)


__all__ = ["Case", "curve", "histogram", "present"]
