"""Quantities that several sources tell of one motion, turn rates and speeds, each as a signal.

A signal is averaged over windows of any length exactly, as the difference of its integral, so that sources of any rate
can be laid side by side.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from outrider.data import Datum, EventLog, Kind, Stream
from outrider.filters.channels import site_position
from outrider.typing import Bools, Floats

GRAVITY: Final = 9.81  # m/s^2
MOVING: Final = 0.5  # m/s: above it a course means something
ABSURD: Final = 1e6  # of any quantity here, SI
MANY: Final = 20_000  # instants that two signals are compared at
PIECE: Final = 3.0  # usual periods: a longer gap is not bridged


@final
@dataclass(frozen=True, slots=True)
class Signal:
    """One quantity of one source. t : (n,) s, increasing, since the log's first event;  y : (n,);  source : whose."""

    source: str
    t: Floats
    y: Floats

    @property
    def period(self) -> float:
        """Median time between samples [s]."""
        return float(np.median(np.diff(self.t)))

    def mean(self, at: Floats, window: float) -> Floats:
        """(m,) means over windows [s] centred at times [s]; NaN where a gap, or the signal's end, cuts one."""
        window = max(window, self.period)
        steps = np.diff(self.t)
        whole = np.concatenate([[0.0], np.cumsum(0.5 * (self.y[1:] + self.y[:-1]) * steps)])
        a, b = at - 0.5 * window, at + 0.5 * window
        out = (np.interp(b, self.t, whole) - np.interp(a, self.t, whole)) / window
        gap = np.concatenate([[0.0], np.cumsum(steps > max(PIECE * self.period, window))])
        first, last = np.searchsorted(self.t, a), np.minimum(np.searchsorted(self.t, b), len(self.t) - 1)
        cut = (a < self.t[0]) | (b > self.t[-1]) | (gap[last] > gap[np.maximum(first - 1, 0)])
        return np.where(cut, np.nan, out)

    def slope(self, at: Floats, window: float) -> Floats:
        """(m,) mean rate of change over windows [s] centred at times [s], by its least-squares line."""
        half = self.mean(at + 0.25 * window, 0.5 * window) - self.mean(at - 0.25 * window, 0.5 * window)
        return np.asarray(half / (0.5 * window), np.float64)


def instants(a: Signal, b: Signal, step: float) -> Floats:
    """(m,) s, every step [s] where the first signal has samples and the second has begun and not ended; `MANY` at most.

    A log may be silent for years between two samples: time alone says nothing about how much there is to compare.
    """
    own = np.unique(np.round(a.t / step)) * step
    own = own[(own >= max(a.t[0], b.t[0])) & (own <= min(a.t[-1], b.t[-1]))]
    return np.asarray(own[:: len(own) // MANY + 1], np.float64)


def signal(source: str, t: Floats, y: Floats) -> Signal | None:
    """A signal in order of time without what is not finite or absurd, None if hardly anything is left."""
    good = np.isfinite(t) & (np.abs(y) < ABSURD)
    t, first = np.unique(t[good], return_index=True)
    return Signal(source, t, y[good][first]) if len(t) > 10 else None


def seconds(log: EventLog, s: Stream) -> Floats:
    """(n,) s of a stream's stamps since the log's first event."""
    return np.asarray((s.t - log.span[0]) * 1e-9, np.float64)


def turn_rate_of_wheels(log: EventLog, s: Stream) -> Signal | None:
    """Yaw rate [rad/s] as wheels tell it."""
    return signal(s.name, seconds(log, s), s.z[:, 5]) if s.kind is Kind.TWIST and s.z[:, 5].any() else None


def speed(log: EventLog, s: Stream) -> Signal | None:
    """Forward speed [m/s] of wheels, or speed over ground of a receiver's velocities."""
    if s.kind is Kind.TWIST:
        return signal(s.name, seconds(log, s), s.z[:, 0])
    if s.kind is Kind.ACKERMANN:
        return signal(s.name, seconds(log, s), s.z[:, 0])
    if s.kind is Kind.WHEELS:
        return signal(s.name, seconds(log, s), s.z.mean(axis=1))
    if s.kind is Kind.GNSS_VELOCITY:
        return signal(s.name, seconds(log, s), np.hypot(s.z[:, 0], s.z[:, 1]))
    return None


@final
@dataclass(frozen=True, slots=True)
class Path:
    """Where a source says that the vehicle was. t : (n,) s, increasing;  p : (n, 3) site frame [m]."""

    source: str
    t: Floats
    p: Floats

    def speed(self) -> Signal | None:
        """Speed over ground [m/s] between successive positions, at the middle between them."""
        steps = np.diff(self.t)
        far = np.hypot(*np.diff(self.p[:, :2], axis=0).T)
        usual = steps < PIECE * float(np.median(steps))
        y = np.where(usual, far / steps, np.nan)
        return signal(self.source, 0.5 * (self.t[1:] + self.t[:-1]), y)

    def in_steps(self, step: float) -> "Path":
        """The means over successive steps [s]: white noise in it bends the course less."""
        _, of = np.unique(np.floor(self.t / step), return_inverse=True)
        n = np.bincount(of)
        p = np.column_stack([np.bincount(of, weights=self.p[:, i]) / n for i in range(3)])
        return Path(self.source, np.bincount(of, weights=self.t) / n, p)

    def turn_rate(self) -> Signal | None:
        """Rate [rad/s] at which the course turns, where it moves."""
        d, steps = np.diff(self.p[:, :2], axis=0), np.diff(self.t)
        course = np.arctan2(d[:, 1], d[:, 0])
        moving = np.hypot(d[:, 0], d[:, 1]) > MOVING * steps
        middle = 0.5 * (self.t[1:] + self.t[:-1])
        both = moving[1:] & moving[:-1]
        y = np.where(both, np.angle(np.exp(1j * np.diff(course))) / np.diff(middle), np.nan)
        return signal(self.source, self.t[1:-1], y)


def path(log: EventLog, s: Stream, good: Bools, datum: Datum | None) -> Path | None:
    """Positions of a source, from its good records."""
    if s.kind is Kind.GNSS and datum is not None:
        p = site_position(s, datum)
    elif s.kind in (Kind.POSITION, Kind.POSE):
        p = s.z[:, :3]
    else:
        return None
    p = np.column_stack([p[:, :2], np.where(np.isfinite(p[:, 2]), p[:, 2], 0.0)])
    t = seconds(log, s)
    rows = np.flatnonzero(good & np.isfinite(p).all(axis=1))
    t, first = np.unique(t[rows], return_index=True)
    return Path(s.name, t, p[rows][first]) if len(t) > 10 else None
