"""The engine: events in time order through `step`, by two drivers that share it.

`run_batch` takes a whole log through a compiled loop, in pieces, so that its memory does not grow with the log.
`OnlineFilter` takes one event at a time in any order of arrival: an event from the past is put in its place by going
back to the snapshot before it and replaying. Both end in the same bits.

Between two records of the input (the IMU of a strapdown filter) it runs on the straight line. The batch driver looks
ahead for the second one; the online driver holds the first until the second is there, then replays what lay between.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Final, NamedTuple, final

import numpy as np

from outrider._kernel import inlined, kernel
from outrider.core.linalg import copy
from outrider.data import Gaussian, StateLayout, Verdict
from outrider.errors import ConfigError
from outrider.filters import step as one
from outrider.filters.channels import Channel
from outrider.filters.health import gates
from outrider.filters.queue import Events, Queue, is_input, queue
from outrider.filters.step import (
    C_NOW,
    INPUT_SENSOR,
    OUT_SIZE,
    ROWS,
    Model,
    Scratch,
    Sources,
    State,
    announce,
    plausible,
    step,
)
from outrider.models.kinematics import K_P, K_V, T_P, T_TH, T_V
from outrider.models.motion import LAYOUTS, Motion, kinematic_view
from outrider.models.sensors.layout import THETA_SIZE
from outrider.typing import Floats, Ints

PIECE: Final = 65_536  # events per call of the compiled loop
POSE_SIZE: Final = 9  # position, velocity, attitude rows of the pose covariance
NOTHING: Final = np.empty(0)  # an outcome before it is there
_LATE, _WITHHELD = int(Verdict.LATE), int(Verdict.WITHHELD)

# Limits that every process model shares, see `Model.limits`.
LONGEST_STEP: Final = 0.1  # s
INPUT_HOLD: Final = 0.5  # s an inertial record is believed to go on
RESET_TIME: Final = 10.0  # s of steady disagreement before a reset is considered: a jump by reflections is shorter
RESET_RECORDS: Final = 5
TOP_SPEED: Final = 40.0  # m/s
RESET_MARGIN: Final = 50.0  # m


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Filter:
    """A process model with its parameters and channels: everything but the belief and the data."""

    motion: Motion
    theta: Floats
    coasting: Floats
    channels: tuple[Channel, ...]
    consider: tuple[str, ...] = ()
    history: float = 2.0  # s that an event may be late and still be put in its place

    @property
    def layout(self) -> StateLayout:
        """Names of the states."""
        return LAYOUTS[self.motion]

    def model(self) -> Model:
        """For the kernels."""
        keep = np.ones(self.layout.error_size)
        for name in self.consider:
            keep[self.layout.error(name)] = 0.0
        limits = np.array([LONGEST_STEP, INPUT_HOLD, RESET_TIME, RESET_RECORDS, TOP_SPEED, RESET_MARGIN])
        return Model(int(self.motion), self.theta, self.coasting, self.layout.table, limits, keep)

    def sources(self) -> Sources:
        """For the kernels, one row per channel."""
        if not self.channels:
            raise ConfigError("no channel to fuse", fix="check which sources the log has and which are switched off")
        return Sources(
            code=np.array([c.code for c in self.channels], np.int64),
            theta=np.array([c.theta for c in self.channels]).reshape(-1, THETA_SIZE),
            gate=np.array([gates(c.probability, ROWS) for c in self.channels]),
            reset=np.array([c.reset for c in self.channels], np.int64).reshape(-1, 2),
        )


class Track(NamedTuple):
    """Estimates of one piece: t (n,) s, x (n, size), sd (n, errors), P (n, 9, 9) of position, velocity, attitude, k."""

    t: Floats
    x: Floats
    sd: Floats
    P: Floats
    age: Floats  # (n, errors) s since each row was last observed


@kernel
def run_events(
    model: Model,
    sources: Sources,
    s: State,
    ev: Events,
    ws: Scratch,
    out: Floats,
    period: float,
    due: Floats,
    track: Track,
) -> int:
    """Process as many events as `out` has rows; write to `track` whenever an output is due. Returns the rows written.

    An output is due when all events of one instant are done and the last output is `period` old. Events beyond `out`
    are looked at for the next record of the input.
    """
    rows, n, ahead = 0, out.shape[0], 0
    for i in range(n):
        if sources.code[ev.src[i]] != INPUT_SENSOR:
            while ahead < ev.t.size and (
                ahead < i or sources.code[ev.src[ahead]] != INPUT_SENSOR or not is_input(ev, ahead)
            ):
                ahead += 1
            announce(s, ev.t[ahead] if ahead < ev.t.size else -np.inf, ev.z[min(ahead, ev.t.size - 1)])
        step(model, sources, s, ev.t[i], ev.src[i], ev.z[i], ev.r[i], ev.flag[i], ws, out[i])
        now = s.clock[C_NOW]
        if now >= due[0] and (i + 1 == n or ev.t[i + 1] > now):
            due[0] = max(due[0] + period, now + 0.5 * period)
            write(model, s, ws, track, rows)
            rows += 1
    return rows


@inlined
def own_variance(x: Floats, P: Floats, table: Ints, i: int) -> float:
    """Variance of error i by itself: that of a stretched vector's component with what its scale adds."""
    for b in range(table.shape[0]):
        if table[b, 0] == 3 and table[b, 1] <= i < table[b, 1] + table[b, 3]:
            k = table[b, 2]
            grown = 1.0 + x[k]
            a = x[i] / grown
            return float(grown * grown * P[i, i] + a * (2.0 * grown * P[i, k] + a * P[k, k]))
    return float(P[i, i])


@kernel
def write(model: Model, s: State, ws: Scratch, track: Track, row: int) -> None:
    """Copy the estimate into a row of `track`."""
    n = s.P.shape[0]
    track.t[row] = s.clock[C_NOW]
    copy(s.x, track.x[row])
    for i in range(n):
        track.sd[row, i] = np.sqrt(max(own_variance(s.x, s.P, model.table, i), 0.0))
        track.age[row, i] = s.clock[C_NOW] - s.age[i]
    kinematic_view(model.code, s.x, s.u, model.theta, ws.k, ws.K)
    # J P J' with J the rows of position, velocity and attitude in the kinematic view
    for a in range(9):
        ra = (T_P if a < 3 else (T_V - 3 if a < 6 else T_TH - 6)) + a
        for j in range(n):
            total = 0.0
            for i in range(n):
                jac = ws.K[ra, i]
                if jac != 0.0:
                    total += jac * s.P[i, j]
            ws.w.dx[j] = total
        for b in range(9):
            rb = (T_P if b < 3 else (T_V - 3 if b < 6 else T_TH - 6)) + b
            total = 0.0
            for j in range(n):
                total += ws.w.dx[j] * ws.K[rb, j]
            track.P[row, a, b] = total


def new_track(rows: int, layout: StateLayout) -> Track:
    """An empty track for at most `rows` estimates."""
    n = layout.error_size
    return Track(
        np.zeros(rows), np.zeros((rows, layout.size)), np.zeros((rows, n)), np.zeros((rows, 9, 9)), np.zeros((rows, n))
    )


Sink = Callable[[int, Events, Floats, Track], None]


def run_batch(
    f: Filter,
    prior: Gaussian,
    t_start: float,
    q: Queue,
    sink: Sink,
    *,
    period: float = 0.02,
    last: int | None = None,
    piece: int = PIECE,
) -> State:
    """Take a queue of events through the filter, piece by piece; returns the final state.

    sink : called per piece with (index of its first event, events, their outcomes (n, OUT_SIZE), estimates)
    """
    model, sources = f.model(), f.sources()
    inputs = np.flatnonzero(sources.code == INPUT_SENSOR)
    s = one.state(prior.x, prior.P, t_start, len(f.channels))
    ws = one.scratch(f.layout.size, f.layout.error_size)
    due = np.array([t_start])
    stop = len(q) if last is None else min(last, len(q))
    end = 0
    while end < stop:
        first, end = end, q.whole_instants(min(end + piece, stop), stop)
        ev = q.events(first, q.through_next_input(end, stop, inputs))
        out = np.zeros((end - first, OUT_SIZE))
        track = new_track(end - first, f.layout)
        rows = run_events(model, sources, s, ev, ws, out, period, due, track)
        sink(first, ev.until(end - first), out, Track(*(a[:rows] for a in track)))
    return s


@kernel
def replay(
    model: Model, sources: Sources, s: State, ev: Events, drives: Ints, known: bool, ws: Scratch, after: State,
    out: Floats,
) -> None:  # fmt: skip
    """Process events, with the state after each of them to the rows of `after` and its outcome to those of `out`.

    drives (n,) : records of the input that will be used; `known`: whether there is an input at all, of which the next
    record is announced to all others.
    """
    n = ev.t.size
    for i in range(n):
        if known and sources.code[ev.src[i]] != INPUT_SENSOR:
            ahead = i + 1
            while ahead < n and drives[ahead] == 0:
                ahead += 1
            announce(s, ev.t[ahead] if ahead < n else -np.inf, ev.z[min(ahead, n - 1)])
        step(model, sources, s, ev.t[i], ev.src[i], ev.z[i], ev.r[i], ev.flag[i], ws, out[i])
        copy(s.x, after.x[i])
        copy(s.P, after.P[i])
        copy(s.u, after.u[i])
        copy(s.fed, after.fed[i])
        copy(s.clock, after.clock[i])
        copy(s.health, after.health[i])
        copy(s.age, after.age[i])


@final
@dataclass(slots=True)
class _Past:
    """One processed event and the state after it: row `at` of the states `after` those processed with it."""

    key: tuple[float, int, int]
    z: Floats
    r: Floats
    flag: int
    drives: bool  # a record of the input that will be used
    after: State
    out: Floats
    at: int = 0

    @property
    def state(self) -> State:
        """A view of it."""
        return State(*(a[self.at] for a in self.after))


def _row(values: Floats, filler: float) -> Floats:
    """(ROWS,) a copy, filled up: the caller may use his array again."""
    out = np.full(ROWS, filler)
    out[: values.size] = values
    return out


@final
class OnlineFilter:
    """The filter for live data: events in any order of arrival, late ones put in their place while their history is
    kept.

    What lies between two records of the input is replayed when the second arrives: outcomes handed out before are those
    of the first one held.
    """

    def __init__(self, f: Filter, prior: Gaussian, t_start: float) -> None:
        self.filter = f
        self._model, self._sources = f.model(), f.sources()
        self._ws = one.scratch(f.layout.size, f.layout.error_size)
        self.state = one.state(prior.x, prior.P, t_start, len(f.channels))
        self._base = one.snapshot(self.state)
        self._past: list[_Past] = []
        self._inputs = frozenset(np.flatnonzero(self._sources.code == INPUT_SENSOR).tolist())
        self._newest = -np.inf
        self.late = 0
        self.rewinds = 0

    def process(self, t: float, src: int, z: Floats, r: Floats, *, flag: int = 0, order: int = 0) -> Floats:
        """Process one event; returns its outcome (OUT_SIZE,), see `filters.step`.

        t : s;  src : channel;  z, r : record and variances, at most ROWS numbers each;  order : the record's number
        within its stream, which breaks ties between equal stamps.
        """
        event = self._event((t, src, order), _row(z, 0.0), _row(r, np.inf), flag)
        self._take([event])
        return event.out

    def take(self, t: Floats, src: int, z: Floats, r: Floats, flag: Ints, order: int = 0) -> None:
        """Process the records (n, ROWS) of one channel, numbered from `order` on: the same as `process` on each, with
        one pass over what has to be replayed."""
        columns = zip(t.tolist(), z.copy(), r.copy(), flag.tolist(), strict=True)
        self._take([self._event((at, src, order + i), *rest) for i, (at, *rest) in enumerate(columns)])

    def _event(self, key: tuple[float, int, int], z: Floats, r: Floats, flag: int) -> _Past:
        """An event that has arrived: whether it is too late, and whether it drives the prediction."""
        t, src, _ = key
        if not isfinite(t):
            flag = int(Verdict.BAD_STAMP)
        if flag <= _WITHHELD:
            if t < self._newest - self.filter.history:
                self.late += 1
                flag = _LATE
            self._newest = max(self._newest, t)
        drives = src in self._inputs and flag <= _WITHHELD and bool(plausible(z))
        return _Past(key, z, r, flag, drives, self.state, NOTHING)

    def _take(self, events: list[_Past]) -> None:
        """Put events in their places, then process what is new and what comes after it."""
        first, known = len(self._past), len(self._past)
        for event in events:
            if event.flag > _WITHHELD:
                self._run([event])
                continue
            at = bisect_right(self._past, event.key, key=lambda p: p.key)
            self.rewinds += at < len(self._past)
            self._past.insert(at, event)
            first = min(first, self._since_input(at, event.key[0]) if event.drives else at)
        if first < known:
            one.restore(self.state, self._past[first - 1].state if first else self._base)
        if first < len(self._past):
            self._run(self._past[first:])
        self._forget()

    def _since_input(self, at: int, t: float) -> int:
        """Index of the first event before `at` that a record of the input at time t casts a new light on."""
        first = at
        for i in range(at - 1, -1, -1):
            p = self._past[i]
            if p.drives or t - p.key[0] > INPUT_HOLD:
                while first < at and self._past[first].key[0] == p.key[0]:  # at a record the line says what it does
                    first += 1
                return first
            first = i
        return first

    def _run(self, events: list[_Past]) -> None:
        """Process events, each with the next record of the input announced, and remember the state after each."""
        n = len(events)
        times, sources, _ = zip(*(p.key for p in events), strict=True)
        ev = Events(
            np.array(times), np.array(sources), np.array([p.z for p in events]), np.array([p.r for p in events]),
            np.array([p.flag for p in events]),
        )  # fmt: skip
        drives = np.array([p.drives for p in events], np.int64)
        after, out = State(*(np.empty((n, *a.shape)) for a in self.state)), np.empty((n, OUT_SIZE))
        replay(self._model, self._sources, self.state, ev, drives, bool(self._inputs), self._ws, after, out)
        for i, p in enumerate(events):
            p.after, p.at, p.out = after, i, out[i]

    def correct(self, y: Floats, H: Floats, R: Floats) -> float:
        """Fuse a measurement of the user's own making now; returns its NIS. Not replayed when the past changes."""
        from outrider.filters.ekf import update

        done = update(self.belief, y, H, R)
        self.state.x[:] = done.belief.x
        self.state.P[:] = done.belief.P
        return done.nis

    @property
    def belief(self) -> Gaussian:
        """The estimate at the time of the newest event."""
        return Gaussian(self.state.x.copy(), self.state.P.copy(), self.filter.layout)

    @property
    def time(self) -> float:
        """Time of the estimate [s]."""
        return float(self.state.clock[C_NOW])

    def _forget(self) -> None:
        horizon = self._newest - self.filter.history
        drop = bisect_left(self._past, horizon, key=lambda p: p.key[0])
        if self._inputs:  # what a record of the input at the horizon would need
            drop = self._since_input(drop, horizon)
        if drop:
            self._base = self._past[drop - 1].state
            del self._past[:drop]


__all__ = ["K_P", "K_V", "Events", "Filter", "OnlineFilter", "Queue", "Track", "new_track", "queue", "run_batch"]
