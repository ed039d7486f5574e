"""The engine on a test bench: innovations of a log as a function of a few parameters of its sensors.

One run of the log per set of values, always from the same start and without gates, so that differences of innovations
are due to the parameters alone.
"""

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from outrider.data import EventLog, Verdict
from outrider.errors import DataError
from outrider.filters.align import Alignment, align
from outrider.filters.channels import Channel, Records, records
from outrider.filters.engine import Events, Filter, Track, queue, run_batch
from outrider.filters.step import OUT_DOF, OUT_NIS, OUT_S, OUT_Y, ROWS
from outrider.models.motion import Motion
from outrider.models.sensors import Sensor
from outrider.models.sensors.layout import LEVER, OWN
from outrider.typing import Floats, Ints
from outrider.workflows.config import FuseConfig
from outrider.workflows.discover import plan
from outrider.workflows.draft import first_stamp
from outrider.workflows.parameters import Noise, Parameter, What

PLACES: Final = frozenset({Sensor.GNSS_POSITION, Sensor.POSITION})
SPREAD: Final = frozenset({Sensor.ACKERMANN, Sensor.WHEELS_DIFFERENTIAL})
"""Whose turn rate is their speed over a length, the first of their own parameters."""
FIXED: Final = 1e-6  # deviation of a state that a parameter stands for
SCALE_WALK: Final = 7  # of theta of a planar robot
TRUSTING: Final = {"lateral": (1, 0.02), "heading_walk": (4, 2e-3), "position_walk": (5, 2e-3)}
"""Of a planar robot, row of theta and value: what corrects itself at every fix has the noise of fixes in its
slopes, and that shifts delays by some ten milliseconds."""


@final
@dataclass(frozen=True, slots=True)
class Innovations:
    """Of every record of one run, by channel. y, s : (n, ROWS) innovations and their predicted deviations, NaN where
    there is none;  nis, dof : (n,)."""

    y: Floats
    s: Floats
    nis: Floats
    dof: Ints


@final
class Bench:
    """A log, planned once and started once.

    frozen : whether the wheel scale is a parameter and not a state.  Raises DataError when nothing in the log can be
    fused.
    """

    def __init__(self, log: EventLog, cfg: FuseConfig, *, frozen: bool = False) -> None:
        chosen = plan(log, cfg.model_copy(update={"local": False}))
        self.motion = chosen.whole.motion
        self.start, verdicts = first_stamp(chosen), chosen.verdicts
        self.log, self._history = chosen.log, cfg.history_s
        self.filter = ungated(chosen.whole, cfg, frozen=frozen)
        self.parts = [records(c, self.log.streams[c.stream], verdicts[c.stream], chosen.datum) for c in self.channels]
        self._spread = {**chosen.spread, **({"wheel_scale": FIXED} if frozen else {})}
        self.aligned = self.align({})

    def noisy(self, factors: Mapping[Noise, float]) -> "Bench":
        """The same log and start with standard deviations multiplied."""
        theta, streams = self.filter.theta.copy(), {n.name: f for n, f in factors.items() if n.row is None}
        for n, factor in factors.items():
            if n.row is not None:
                theta[n.row] *= factor
        coasting = theta if self.motion is Motion.PLANAR else self.filter.coasting
        out = copy(self)
        out.filter = replace(self.filter, theta=theta, coasting=coasting)
        squares = [streams.get(c.stream, 1.0) ** 2 for c in self.channels]
        out.parts = [replace(p, r=k * p.r) if k != 1.0 else p for p, k in zip(self.parts, squares, strict=True)]
        return out

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Of the filter."""
        return self.filter.channels

    def receivers(self) -> list[tuple[str, ...]]:
        """Streams of each fused source of positions, with the velocities that come from the same receiver: of the same
        frame, or the only ones beside the only position."""
        used = [c for c in self.channels if not c.scored]
        places = dict.fromkeys(c.stream for c in used if c.sensor in PLACES)
        moving = dict.fromkeys(c.stream for c in used if c.sensor is Sensor.GNSS_VELOCITY)
        frames = {name: self.log.streams[name].frame for name in (*places, *moving)}
        return [(p, *(v for v in moving if len(places) == 1 or (frames[v] and frames[v] == frames[p]))) for p in places]

    def align(self, values: Mapping[Parameter, float]) -> Alignment:
        """The start that the log tells with these values."""
        f, parts = self.set(values)
        found = align(f, queue(parts, self.start, self._history), self._spread)
        if found is None:
            raise DataError("no usable record", where=self.log.path)
        return found

    def set(self, values: Mapping[Parameter, float]) -> tuple[Filter, list[Records]]:
        """Filter and records with the parameters off by `values` (a gain: from 1) from what was planned."""
        channels = [moved(c, values) for c in self.channels]
        parts = [changed(p, c, values) for p, c in zip(self.parts, self.channels, strict=True)]
        return replace(self.filter, channels=tuple(channels)), parts

    def run(
        self, values: Mapping[Parameter, float], *, start: Alignment | None = None, until: float | None = None
    ) -> list[Innovations]:
        """Innovations with these values. until : s since the first event, the whole log by default."""
        f, parts = self.set(values)
        a = start or self.aligned
        q = queue(parts, self.start, self._history)
        first = self.start + int(a.t_start * 1e9)
        out = [blank(p.t.size) for p in parts]
        last = None if until is None else int(np.searchsorted(q.t, self.start + int(until * 1e9)))
        early = [p.t < first for p in parts]
        for p, e in zip(parts, early, strict=True):
            p.flag[e & (p.flag <= Verdict.WITHHELD)] = Verdict.NOT_ALIGNED

        def take(at: int, ev: Events, rows: Floats, _: Track) -> None:
            index = q.index[at : at + ev.t.size]
            for c, one in enumerate(out):
                here = ev.src == c
                k = index[here]
                one.y[k], one.s[k] = rows[here, OUT_Y:OUT_S], rows[here, OUT_S : OUT_S + ROWS]
                one.nis[k], one.dof[k] = rows[here, OUT_NIS], rows[here, OUT_DOF].astype(np.int64)

        run_batch(f, a.prior, a.t_start, q, take, period=1e9, last=last)
        return out


def blank(n: int) -> Innovations:
    """Of n records that were not looked at."""
    return Innovations(
        np.full((n, ROWS), np.nan), np.full((n, ROWS), np.nan), np.full(n, np.nan), np.zeros(n, np.int64)
    )


def ungated(f: Filter, cfg: FuseConfig, *, frozen: bool) -> Filter:
    """No gates and no resets; a frozen planar robot believes its wheels and gyro, and holds its wheel scale."""
    channels = tuple(replace(c, probability=1.0, reset=(0, 0)) for c in f.channels)
    theta = f.theta.copy()
    if frozen and f.motion is Motion.PLANAR:
        theta[SCALE_WALK] = 0.0
        for name, (row, value) in TRUSTING.items():
            theta[row] = value if getattr(cfg.planar, name) is None else theta[row]
    return replace(f, channels=channels, theta=theta, coasting=theta if f.motion is Motion.PLANAR else f.coasting)


def moved(c: Channel, values: Mapping[Parameter, float]) -> Channel:
    """The channel with its lever arm shifted, and its wheels apart so that they turn as before at another speed, or as
    the gyro at another turn rate."""
    theta = c.theta
    for p, v in values.items():
        if c.stream not in p.streams:
            continue
        if p.moves:
            theta = theta.copy()
            theta[LEVER + p.axis] += v
        elif p.what in (What.SPEED, What.RATE) and c.sensor in SPREAD:
            theta = theta.copy()
            theta[OWN] *= 1.0 + v if p.what is What.SPEED else 1.0 / (1.0 + v)
    return replace(c, theta=theta) if theta is not c.theta else c


def changed(r: Records, c: Channel, values: Mapping[Parameter, float]) -> Records:
    """The channel's records with other gains and delays. Flags are always a copy: a run marks what is early."""
    t, z, var = r.t, r.z, r.r
    for p, v in values.items():
        if c.stream not in p.streams or p.moves:
            continue
        if p.what is What.DELAY:
            t = t - round(v * 1e9)
            continue
        columns = gained(p.what, c)
        if columns is not None:
            z, var = z.copy(), var.copy()
            z[:, columns] *= 1.0 + v
            var[:, columns] *= (1.0 + v) ** 2
    return replace(r, t=t, z=z, r=var, flag=r.flag.copy())


def gained(what: What, c: Channel) -> slice | None:
    """Columns of a channel's records that a gain multiplies."""
    if what is What.SPEED:
        return {Sensor.TWIST: slice(0, 3), Sensor.ACKERMANN: slice(0, 1), Sensor.WHEELS_DIFFERENTIAL: slice(0, 2)}.get(
            c.sensor or Sensor.GYRO
        )
    if what is What.RATE and c.sensor is Sensor.TWIST:
        return slice(3, 6)
    return slice(0, 3) if what is What.RATE and c.sensor is Sensor.GYRO else None


__all__ = ["Bench", "Innovations", "gained"]
