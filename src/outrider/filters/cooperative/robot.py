"""One robot, or a group of them under one filter: everything that it keeps of itself, and its records so far."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Protocol, final

import numpy as np
from scipy.special import chdtri

from outrider.core.manifold import retract
from outrider.data import Gaussian, Manifold
from outrider.filters.cooperative import group
from outrider.filters.cooperative.group import I_E, I_N, Belief, Group
from outrider.filters.ekf import kept, transport
from outrider.filters.state import ROWS
from outrider.models.motion import Motion
from outrider.models.sensors import SensorModel
from outrider.models.sensors.layout import THETA_SIZE
from outrider.typing import Floats, Ints

FALSE_ALARM = 1e-6  # share of good records that gates refuse
POSE_BLOCKS = ("position", "heading", "yaw")


class MotionModel(Protocol):
    """The parameters of a process model."""

    def theta(self) -> Floats:
        """As its kernel reads them."""
        ...


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """One robot. belief : at the start, in the layout of its motion;  consider : states whose value stays as it is.

    start : s, when the belief holds, if that is after the team's start: what comes before is not fused
    """

    name: str
    motion: Motion
    model: MotionModel
    belief: Gaussian
    consider: tuple[str, ...] = ()
    start: float = -inf


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """The records of one sensor of one robot.

    t : (n,) s, not decreasing;  z : (n, columns) as the sensor's kernel reads them;  sensor : None for an IMU that
    drives the prediction;  sigmas : (m,) of each row, instead of the sensor's own; infinite: not in use
    partner : who is seen, for a relative sensor;  navigation : whether `Method.NONE` has it too
    """

    robot: str
    sensor: SensorModel | None
    t: Floats
    z: Floats
    sigmas: Floats | None = None
    partner: str = ""
    navigation: bool = True


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Records:
    """Records of several sources in time order. source : index;  r : (n, ROWS) variances, infinite: not in use."""

    t: Floats
    source: Ints
    z: Floats
    r: Floats


def gates(false_alarm: float) -> Floats:
    """(ROWS + 1,) thresholds of the NIS by degrees of freedom, which this share of good records exceeds; 0: no gate."""
    gate = np.full(ROWS + 1, np.inf)
    if false_alarm > 0.0:
        gate[1:] = chdtri(np.arange(1.0, ROWS + 1), false_alarm)
    return gate


def pose_rows(member: Member) -> Ints:
    """Error rows of position and heading; of an attitude, its rotation about the body's z."""
    layout = member.belief.layout
    rows = [np.arange(layout.error(b).start, layout.error(b).stop) for b in POSE_BLOCKS if b in layout]
    if "attitude" in layout:
        rows.append(np.array([layout.error("attitude").stop - 1]))
    return np.concatenate(rows).astype(np.int64)


@final
class Filter:
    """The filter of a group of members (most often of one) over its own records, kept between calls.

    x, P : state and covariance of all members;  Psi, told, heard : see `group`, if it `carries` them
    factors : partner -> s_ij with P_ij = s_ij s_ji';  mixed : whether there are correlations that it does not know
    before : covariance after the last exchange
    blows : what no record tells, by time: s, rows of the error, variance that it adds to each
    """

    def __init__(
        self, members: Sequence[Member], sources: Sequence[Source], records: Records, at: Floats, start: float, *,
        gate: Floats, carries: bool = False,
    ) -> None:  # fmt: skip
        self.members, self.records = members, records
        self.group = _group(members, sources, gate)
        n, N = self.group.keep.size, len(members)
        P = np.zeros((n, n))
        for m, row in zip(members, self.group.rows.tolist(), strict=True):
            P[row[I_E] : row[I_E] + row[I_N], row[I_E] : row[I_E] + row[I_N]] = m.belief.P
        own = n if carries else 0
        self.belief = Belief(
            x=np.concatenate([m.belief.x for m in members]), P=P, clock=np.array([start]), u=np.zeros((N, 6)),
            fed=np.zeros((N, 6)), carried=np.eye(own), told=np.zeros((own, own)), heard=np.zeros(own),
        )  # fmt: skip
        self.work = group.scratch(self.group, np.arange(n), carries)
        self._grows, self._feeds = group.stirred(self.group, self.work)
        self._inner = self.belief, self.work
        self._inside = np.ix_(self.work.full, self.work.full)
        self.factors: dict[int, Floats] = {}
        self.mixed = False
        self.before = np.zeros((n, n))
        self.sample(at)
        self.out = np.full((records.t.size, 3), np.nan)
        self.blows: list[tuple[float, Ints, float]] = []
        self._next = 0

    @property
    def estimated(self) -> bool:
        """Whether it estimates all of its states."""
        return bool(self.group.keep.all())

    def run(self, until: float) -> None:
        """Take the records up to `until` [s], which count with those of that time, and predict to it."""
        for t, rows, variance in self.blows:
            if self.belief.clock[0] < t <= until:
                self._run(t)
                self.belief.P[rows, rows] += variance
        self._run(until)

    def _run(self, until: float) -> None:
        r, first = self.records, self._next
        last = int(np.searchsorted(r.t, until, side="right"))
        part = slice(first, last)
        self._alive()
        belief, work = self._inner
        if belief is not self.belief:
            belief.P[...] = self.belief.P[self._inside]
        self._kept = group.run(
            self.group, belief, work, r.t[part], r.source[part], r.z[part], r.r[part], until, self._kept,
            self.at, self.x, self.P, self.out[part],
        )  # fmt: skip
        if belief is not self.belief:
            self.belief.P[self._inside] = belief.P
        self._next = last

    def _alive(self) -> None:
        """Make room for the errors that are not zero for certain: most teams leave out states that their model has."""
        if self.belief.carried.size:
            return
        on = self._grows | self.belief.P.any(axis=1)
        while (fed := on | (self._feeds & on).any(axis=1)).sum() > on.sum():
            on = fed
        for row in self.group.rotations[:, 2].tolist():
            on[row : row + 3] |= on[row : row + 3].any()
        full = np.flatnonzero(on)
        if not np.array_equal(full, self._inner[1].full):
            whole = full.size == on.size
            small = self.belief if whole else self.belief._replace(P=np.zeros((full.size, full.size)))
            self._inner = small, self.work if whole else group.scratch(self.group, full, False)
            self._inside = np.ix_(full, full)

    def sample(self, at: Floats) -> None:
        """From now on keep the estimates at the times `at` (k,) s as rows of x and P."""
        n, self.at, self._kept = self.group.keep.size, at, 0
        self.x, self.P = np.zeros((at.size, self.belief.x.size)), np.zeros((at.size, n, n))

    def snapshot(self) -> tuple[Floats, Floats, int]:
        """The input in force and how many records were taken, to come back to."""
        return self.belief.u.copy(), self.belief.fed.copy(), self._next

    def restore(self, kept: tuple[Floats, Floats, int], clock: float) -> None:
        """Go back to a snapshot of the time `clock` [s]; state and covariance are for the caller to set."""
        self.belief.u[...], self.belief.fed[...], self._next = kept
        self.belief.clock[0] = clock

    def feed(self, records: Records) -> None:
        """Further records instead of those that it has taken; their verdicts are in `out`."""
        self.records, self._next = records, 0
        self.out = np.full((records.t.size, 3), np.nan)

    def extend(self, records: Records) -> None:
        """Further records after those that it has, which stay for `restore` to come back to."""
        old = self.records
        self.records = Records(
            t=np.concatenate([old.t, records.t]), source=np.concatenate([old.source, records.source]),
            z=np.concatenate([old.z, records.z]), r=np.concatenate([old.r, records.r]),
        )  # fmt: skip
        self.out = np.concatenate([self.out, np.full((records.t.size, 3), np.nan)])

    def view(self) -> tuple[Floats, Floats]:
        """Kinematic view k of the one member, and its Jacobian K (T_SIZE, n)."""
        group.look(self.group, self.belief, self.work, 0)
        return self.work.k[0], self.work.K[0]

    def correct(self, dx: Floats, P: Floats) -> None:
        """x <- x [+] dx and P <- P as it is after the update, symmetric; considered states keep value and variance."""
        g, b = self.group, self.belief
        fixed = g.keep == 0.0
        step = np.where(fixed, 0.0, dx)
        b.P[...] = np.where(np.outer(fixed, fixed), b.P, 0.5 * (P + P.T))
        transport(b.P, step, g.rotations, False, self.work.w.J)
        retract(b.x, step, g.table)

    def follow(self, A: Floats, dx: Floats) -> None:
        """Rows of A (n, ...) that are errors of this filter, after its mean has moved by dx."""
        if self.group.rotations.size:
            group.turn_rows(A, np.ascontiguousarray(dx), self.group.rotations, self.work.w.J)

    def forget(self) -> None:
        """Begin anew after an exchange: Psi = I, nothing told."""
        b = self.belief
        b.carried[...] = np.eye(b.carried.shape[0])
        b.told[...], b.heard[...] = 0.0, 0.0


def _group(members: Sequence[Member], sources: Sequence[Source], gate: Floats) -> Group:
    names = [m.name for m in members]
    index, tables, rotations = np.zeros((len(members), 7), np.int64), [], []
    thetas = [m.model.theta() for m in members]
    theta = np.zeros((len(members), max(a.size for a in thetas)))
    n_x = n = row = 0
    for i, m in enumerate(members):
        layout = m.belief.layout
        theta[i, : thetas[i].size] = thetas[i]
        index[i] = [int(m.motion), n_x, layout.size, n, layout.error_size, row, len(layout.table)]
        tables.append(layout.table)
        rotations.append(layout.table[layout.table[:, 0] == Manifold.ROTATION] + [0, 0, n, 0])
        n_x, n, row = n_x + layout.size, n + layout.error_size, row + len(layout.table)
    return Group(
        rows=index, theta=theta, table=np.concatenate(tables),
        rotations=np.ascontiguousarray(np.concatenate(rotations)),
        keep=np.concatenate([kept(m.belief.layout, m.consider) for m in members]),
        code=np.array([-1 if s.sensor is None else int(s.sensor.code) for s in sources], np.int64),
        member=np.array([names.index(s.robot) for s in sources], np.int64),
        partner=np.array([names.index(s.partner) if s.partner else -1 for s in sources], np.int64),
        parameters=np.array([np.zeros(THETA_SIZE) if s.sensor is None else s.sensor.theta() for s in sources]).reshape(
            -1, THETA_SIZE
        ),
        gate=gate, begin=np.array([m.start for m in members]),
    )  # fmt: skip
