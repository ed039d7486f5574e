"""What one robot knows of its whole team: every record that ever reached it, each counted once.

Between two nodes (times at which it meets somebody) a robot's own records come to one Gaussian factor of its errors at
both ends, a `Segment`, whatever their number. With P the covariance at its start, and Psi, Lambda, xi as in `group`,

    A = (I - P Lambda)^-1,  G = Psi A,  J = Lambda A,  h = A' xi,  c = -G P xi,  W = P_end - Psi P G',

the records say exp(h'e - e'J e / 2) of the error e at the start, and the error at the end is N(G e + c, W). None of
this depends on what the robot believed: it tells what happened, not what it concluded, and nothing is counted twice
however often and by whatever way it is passed on. The ledger is the joint filter over the last nodes of all robots that
it has heard of. A segment advances its robot to the next node, a relative record ties two robots at a common time. What
has been heard is complete for each robot up to its last node there; so news may come late and in any order of robots,
and nothing is ever undone. Derivation and code are our own; that what one has heard suffices for what a central filter
would know is the idea of Leung, Barfoot and Liu (2010), who pass on records.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from outrider.core.manifold import local, retract
from outrider.data import Verdict
from outrider.filters.cooperative import group
from outrider.filters.cooperative.group import I_E, I_N, I_NX, I_TABLE, I_TABLES, I_X, relate, squeeze
from outrider.filters.cooperative.meeting import Outcome, judged
from outrider.filters.cooperative.robot import Filter
from outrider.filters.ekf import transport
from outrider.filters.state import ROWS
from outrider.models.kinematics import T_SIZE
from outrider.models.sensors.layout import THETA_SIZE
from outrider.typing import Floats

TELLING = 1e-12  # least information of a direction, relative to what is known of it, that is passed on


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """All that a robot's own records say from one node to the next.  x_start, x_end : its estimates there."""

    robot: int
    start: float
    end: float
    x_start: Floats
    x_end: Floats
    G: Floats
    c: Floats
    W: Floats
    J: Floats
    h: Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Relative:
    """One robot's record of another at a node of both.  z (columns,), r (rows,) variances: as its sensor reads them;
    serial : tells records of one time apart."""

    observer: int
    observed: int
    t: float
    serial: int
    code: int
    theta: Floats
    z: Floats
    r: Floats

    @property
    def key(self) -> tuple[float, int, int, int]:
        """Tells it from others; keys sort by time."""
        return self.t, self.observer, self.observed, self.serial

    @property
    def meeting(self) -> tuple[float, int, int]:
        """Its time, and both robots, the lower number first."""
        return self.t, min(self.observer, self.observed), max(self.observer, self.observed)


def close(robot: Filter, number: int, start: float, x_start: Floats) -> Segment:
    """What `robot`, which carries, has come to since its last node. It has run up to its clock, the new node."""
    b, P, one = robot.belief, robot.before, np.eye(len(robot.before))
    A = np.linalg.inv(one - P @ b.told)
    G, J = b.carried @ A, b.told @ A
    c = -G @ (P @ b.heard)
    W = b.P - b.carried @ P @ G.T
    return Segment(
        robot=number, start=start, end=float(b.clock[0]), x_start=x_start, x_end=b.x.copy(), G=G, c=c,
        W=0.5 * (W + W.T), J=0.5 * (J + J.T), h=A.T @ b.heard,
    )  # fmt: skip


@final
class Ledger:
    """The joint filter over the last known nodes of a team.  node : (robots,) s;  `joint`: its members and belief."""

    def __init__(self, joint: Filter, start: float) -> None:
        self.joint = joint
        self.node = np.full(len(joint.members), start)
        rows = joint.group.rows
        self._errors = [slice(e, e + n) for e, n in rows[:, [I_E, I_N]].tolist()]
        self._states = [slice(x, x + n) for x, n in rows[:, [I_X, I_NX]].tolist()]
        self._tables = [joint.group.table[a : a + n] for a, n in rows[:, [I_TABLE, I_TABLES]].tolist()]
        self._rotations = [r[(s.start <= r[:, 2]) & (r[:, 2] < s.stop)] for s in self._errors
                           for r in (joint.group.rotations,)]  # fmt: skip

    def belief(self, robot: int) -> tuple[Floats, Floats]:
        """State and covariance of one robot at its last node."""
        e = self._errors[robot]
        return self.joint.belief.x[self._states[robot]].copy(), self.joint.belief.P[e, e].copy()

    def begin_anew(self, robot: int, times: float) -> None:
        """Forget what is known of one robot but for its place: so many times its first covariance, and nothing shared
        with others."""
        e, P = self._errors[robot], self.joint.belief.P
        first = self.joint.members[robot].belief.P
        fresh = times * first + P[e, e]
        P[e], P[:, e] = 0.0, 0.0
        P[e, e] = fresh

    def advance(self, s: Segment, *, trusted: bool = True) -> Outcome:
        """Take one robot from its last node, where the segment starts, to the next.

        Unless `trusted`, what the segment says is judged; if it is too far from what is known, it is left out.
        """
        m, e, b = s.robot, self._errors[s.robot], self.joint.belief
        shift = self._step(s.x_start, m)
        y, H, r = _measured(s, np.diag(b.P)[e], shift)
        PH = b.P[:, e] @ H.T
        S = H @ PH[e] + np.diag(r)
        outcome = Outcome(Verdict.NOT_OBSERVING, 0.0, 0)
        if y.size:
            outcome = judged(S, y, np.full(y.size + 1, np.inf) if trusted else self._gate(y.size))
            if outcome.verdict is not Verdict.USED:
                y = y[:0]
        dx = self._condition(PH, S, y)
        self._turn(m, shift)
        moved = s.G @ (dx[e] - shift) + s.c
        b.P[e] = s.G @ b.P[e]
        b.P[:, e] = b.P[:, e] @ s.G.T
        b.P[e, e] += s.W
        b.x[self._states[m]] = s.x_end
        dx[e] = moved
        self._correct(dx)
        self.node[m] = s.end
        return outcome

    def relate(self, record: Relative, *, fuse: bool = True) -> Outcome:
        """Tie two robots, both at the node of the record; without `fuse` only judge it."""
        y, H, r = self.linearised(record)
        PH = self.joint.belief.P @ H.T
        S = H @ PH + np.diag(r)
        outcome = judged(S, y, self.joint.group.gate)
        if fuse and outcome.verdict is Verdict.USED:
            self._correct(self._condition(PH, S, y))
        return outcome

    def linearised(self, record: Relative) -> tuple[Floats, Floats, Floats]:
        """Innovation y (m,), Jacobian (m, n) by the errors of all, variances (m,)."""
        f = self.joint
        i, j = record.observer, record.observed
        for robot in (i, j):
            group.look(f.group, f.belief, f.work, robot)
        y, D, r = np.zeros(ROWS + 1), np.zeros((2, ROWS + 1, T_SIZE)), np.zeros(ROWS + 1)
        k, K = f.work.k, f.work.K
        rows = relate(record.code, k[i], k[j], record.z, record.theta, np.zeros(THETA_SIZE), y, D)
        m = squeeze(rows, record.r, y, r, D)
        H = np.zeros((m, f.belief.P.shape[0]))
        for side, robot in enumerate((i, j)):
            e = self._errors[robot]
            H[:, e] = D[side, :m] @ K[robot][:, : e.stop - e.start]
        return y[:m], H, r[:m]

    def _step(self, x: Floats, robot: int) -> Floats:
        e = self._errors[robot]
        dx = np.zeros(e.stop - e.start)
        local(np.ascontiguousarray(x), self.joint.belief.x[self._states[robot]], self._tables[robot], dx)
        return dx

    def _gate(self, dof: int) -> Floats:
        gate = np.full(dof + 1, np.inf)
        known = self.joint.group.gate
        # beyond the table: Wilson and Hilferty's scaling of its last entry
        gate[dof] = known[dof] if dof < known.size else known[-1] * dof / (known.size - 1)
        return gate

    def _condition(self, PH: Floats, S: Floats, y: Floats) -> Floats:
        """P after an update; returns the correction. Considered states keep value and variance."""
        b, keep = self.joint.belief, self.joint.group.keep
        if not y.size:
            return np.zeros(len(keep))
        K = np.linalg.solve(S, PH.T).T
        if keep.all():
            b.P[...] -= K @ PH.T
        else:
            np.multiply(K, keep[:, None], out=K)
            b.P[...] += K @ S @ K.T - K @ PH.T - PH @ K.T
        return K @ y

    def _turn(self, robot: int, dx: Floats) -> None:
        """Errors of one robot about an estimate that lies dx from the present one."""
        if self._rotations[robot].size:
            whole = np.zeros(len(self.joint.belief.P))
            whole[self._errors[robot]] = dx
            transport(self.joint.belief.P, whole, self._rotations[robot], False, self.joint.work.w.J)

    def _correct(self, dx: Floats) -> None:
        b, g = self.joint.belief, self.joint.group
        b.P[...] = 0.5 * (b.P + b.P.T)
        transport(b.P, dx, g.rotations, False, self.joint.work.w.J)
        for x, e, table in zip(self._states, self._errors, self._tables, strict=True):
            retract(b.x[x], dx[e], table)


def _measured(s: Segment, variances: Floats, shift: Floats) -> tuple[Floats, Floats, Floats]:
    """A segment's information as independent measurements: y (k,), H (k, n), r (k,)."""
    scale = np.sqrt(variances)
    back = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0.0)
    size, U = np.linalg.eigh(scale[:, None] * s.J * scale)
    telling = size > TELLING
    size, H = size[telling], U[:, telling].T * back
    z = (U[:, telling].T @ (scale * s.h)) / size
    return z + H @ shift, H, 1.0 / size
