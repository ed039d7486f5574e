"""Two robots meet: one measures the other, both correct themselves, nobody else is asked.

`catch_up` is what makes the distributed filter exact for two. Let P_ij = s_i s_j' after the last meeting, and Psi,
Lambda, xi of both as in `group`; with l = s' Lambda s and h = s' xi of each, all that both have measured meanwhile is

    p_j = (I - l_j l_i)^-1 (h_j - l_j h_i),   x_i <- x_i [+] S_i p_j,   S = Psi s,
    P_ii <- P_ii - S_i (I - l_j l_i)^-1 l_j S_i',   P_ij = S_i (I - l_j l_i)^-1 S_j',

and the same with i and j exchanged: both errors conditioned on both robots' innovations, each white, and correlated
through s_i s_j' only. Derivation and code are our own.

With third parties no two robots can know what they share without asking these. `factored` lets their factors follow by
P_new P_old^-1, the idea of Luft et al. 2018: right if they know of the partner only through this robot, and else too
sure. Teams of a few pass on what they have heard instead (`gossip`); large ones leave it to the exact pair, and turn to
covariance intersection where others are concerned.
"""

from typing import NamedTuple

import numpy as np

from outrider.data import Verdict
from outrider.filters.cooperative.group import relate, squeeze
from outrider.filters.cooperative.robot import Filter
from outrider.filters.state import ROWS
from outrider.models.kinematics import T_SIZE
from outrider.models.sensors.layout import THETA_SIZE
from outrider.typing import Floats


class Sighting(NamedTuple):
    """One relative record, linearised: innovation y (m,), Jacobians by the errors of both, variances r (m,)."""

    y: Floats
    H_i: Floats
    H_j: Floats
    r: Floats


class Outcome(NamedTuple):
    """What became of it."""

    verdict: Verdict
    nis: float
    dof: int


def sight(i: Filter, j: Filter, code: int, theta: Floats, z: Floats, r: Floats) -> Sighting:
    """Robot i's record of robot j at the estimates of both."""
    y, D, variances = np.zeros(ROWS + 1), np.zeros((2, ROWS + 1, T_SIZE)), np.zeros(ROWS + 1)
    (k_i, K_i), (k_j, K_j) = i.view(), j.view()
    m = squeeze(relate(code, k_i, k_j, z, theta, np.zeros(THETA_SIZE), y, D), r, y, variances, D)
    return Sighting(y[:m], D[0, :m] @ K_i, D[1, :m] @ K_j, variances[:m])


def judged(S: Floats, y: Floats, gate: Floats) -> Outcome:
    """The innovation against its covariance."""
    if y.size == 0:
        return Outcome(Verdict.NOT_OBSERVING, float("nan"), 0)
    nis = float(y @ np.linalg.solve(S, y))
    if not 0.0 <= nis < np.inf:
        return Outcome(Verdict.DIVERGED, nis, y.size)
    return Outcome(Verdict.USED if nis <= gate[y.size] else Verdict.GATED, nis, y.size)


def update_pair(i: Filter, j: Filter, s: Sighting, P_ij: Floats) -> tuple[Outcome, Floats]:
    """Correct both by one record; their cross-covariance before and, second, after it."""
    P_i, P_j = i.belief.P, j.belief.P
    PH_i = P_i @ s.H_i.T + P_ij @ s.H_j.T
    PH_j = P_ij.T @ s.H_i.T + P_j @ s.H_j.T
    S = s.H_i @ PH_i + s.H_j @ PH_j + np.diag(s.r)
    outcome = judged(S, s.y, i.group.gate)
    if outcome.verdict is not Verdict.USED:
        return outcome, P_ij
    K_i, K_j = np.linalg.solve(S, PH_i.T).T, np.linalg.solve(S, PH_j.T).T
    K_i, K_j = K_i * i.group.keep[:, None], K_j * j.group.keep[:, None]
    new_i, new_j = _joseph(P_i, K_i, PH_i, S), _joseph(P_j, K_j, PH_j, S)
    cross = P_ij - K_i @ PH_j.T - PH_i @ K_j.T + K_i @ S @ K_j.T
    dx_i, dx_j = K_i @ s.y, K_j @ s.y
    i.correct(dx_i, new_i)
    j.correct(dx_j, new_j)
    i.follow(cross, dx_i)
    other = np.ascontiguousarray(cross.T)
    j.follow(other, dx_j)
    return outcome, np.ascontiguousarray(other.T)


def _joseph(P: Floats, K: Floats, PH: Floats, S: Floats) -> Floats:
    """Covariance after an update with any gain K, PH = P H'."""
    return P - K @ PH.T - PH @ K.T + K @ S @ K.T


def naive(i: Filter, j: Filter, s: Sighting) -> Outcome:
    """Each takes the other's estimate, with its covariance, for independent of its own: unsafe.  coop2024, III"""
    return update_pair(i, j, s, np.zeros((i.belief.P.shape[0], j.belief.P.shape[0])))[0]


def catch_up(i: Filter, j: Filter, s_i: Floats, s_j: Floats) -> Floats:
    """Both robots hear what the other has measured since their last meetings; returns P_ij.  s_i, s_j: factors."""
    S_i, S_j = i.belief.carried @ s_i, j.belief.carried @ s_j
    if not (i.estimated and j.estimated):  # nothing was told
        return S_i @ S_j.T
    l_i, l_j = s_i.T @ i.belief.told @ s_i, s_j.T @ j.belief.told @ s_j
    h_i, h_j = s_i.T @ i.belief.heard, s_j.T @ j.belief.heard
    A = np.linalg.inv(np.eye(len(l_i)) - l_j @ l_i)
    p_j = A @ (h_j - l_j @ h_i)
    p_i = h_i - l_i @ p_j
    for robot, S, p, G in ((i, S_i, p_j, A @ l_j), (j, S_j, p_i, l_i @ A)):
        robot.correct(S @ p, robot.belief.P - S @ G @ S.T)
        robot.follow(S, S @ p)
    return S_i @ A @ S_j.T


def factored(i: Filter, j: Filter, a: int, b: int, code: int, theta: Floats, z: Floats, r: Floats) -> Outcome:
    """Robot i (number a) has seen robot j (number b): fuse with their cross-covariance."""
    old_i, old_j = i.belief.P.copy(), j.belief.P.copy()
    known = b in i.factors
    P_ij = np.zeros((len(old_i), len(old_j)))
    if known:
        P_ij = catch_up(i, j, i.factors[b], j.factors[a])
    outcome, P_ij = update_pair(i, j, sight(i, j, code, theta, z, r), P_ij)
    if known or outcome.verdict is Verdict.USED:
        i.factors[b], j.factors[a] = P_ij, np.eye(len(old_j))
        _settle(i, b, old_i)
        _settle(j, a, old_j)
    return outcome


def _settle(robot: Filter, partner: int, old: Floats) -> None:
    """Third parties' factors follow the robot through a meeting: s <- P P_old^-1 Psi s; it starts anew.

    P_old, of before the meeting, is singular where a state is not in use.
    """
    others = [k for k in robot.factors if k != partner]
    if others:
        used = np.diag(old) > 0.0
        whole = np.where(np.outer(used, used), old, np.eye(len(old)))
        change = np.linalg.solve(whole, robot.belief.P).T @ robot.belief.carried
        for k in others:
            robot.factors[k] = change @ robot.factors[k]
    robot.before[...] = robot.belief.P
    robot.forget()
