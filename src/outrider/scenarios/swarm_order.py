"""Who is in a column and on which trail: who leaves, waits, joins, and how a column splits and merges again.

Nobody is told an order: everybody follows the one that it hears right ahead of it on its trail, and takes the trail of
that one. So the order is that of `guidance.formation.Column`, and all that it takes is who leads.
"""

from math import hypot, inf
from typing import Final

from outrider._kernel import inlined, kernel
from outrider.guidance.avoidance import A_PART
from outrider.guidance.column import along, latest
from outrider.scenarios.swarm_state import (
    ASIDE,
    GOALS,
    H_ASIDE,
    H_RADIO,
    LEADER,
    M_ARC,
    M_KIND,
    M_LINE,
    M_SHIFT,
    MEMBER,
    Swarm,
    World,
    in_units_of,
)

BEGIN_M: Final = 2.0  # m from the beginning of a branch at which it is taken
WAIT_M: Final = 25.0  # m before its end where the second part waits


@inlined
def beside(w: World, s: Swarm, i: int, arc: float) -> tuple[bool, bool]:
    """Whether a drone hears the column ahead of `arc` of the first trail, and behind it."""
    behind, ahead = False, False
    for q in range(s.who.shape[1]):
        o = s.inbox[i, q]
        if s.who[i, q] >= 0 and o[M_KIND] in (MEMBER, LEADER):
            gap = in_units_of(0, arc, inf, s.fork[0], int(o[M_LINE]), o[M_ARC], o[M_SHIFT]) - arc
            behind = behind or -w.how[H_RADIO] < gap < w.spacing[0]
            ahead = ahead or w.spacing[0] <= gap < w.how[H_RADIO]  # and not a round of the way later
    return ahead, behind


@inlined
def crowded(w: World, s: Swarm, i: int) -> bool:
    """Whether somebody was heard near, seen from above."""
    met, out = 2.0 * w.rules[A_PART], False
    for q in range(s.who.shape[1]):
        if s.who[i, q] >= 0 and hypot(s.inbox[i, q, 0] - s.X[i, 0], s.inbox[i, q, 1] - s.X[i, 1]) < met:
            out = True
    return out


@kernel
def waits(w: World, s: Swarm, i: int, t: float) -> None:
    """A drone whose radio is dead stands, then climbs out of the others' way; heard again, it waits until it may sink:
    into a column behind the last, else where nobody is below for 3 s."""
    if s.kind[i] != ASIDE:
        if s.kind[i] != LEADER and t - s.mute[i] > 2.0:
            s.kind[i] = ASIDE
            s.high[i] += w.how[H_ASIDE]
            s.hold[i, 0], s.hold[i, 1], s.rest[i] = s.X[i, 0], s.X[i, 1], inf
        return
    if s.mute[i] < inf:
        return
    arc, clear = s.arc[i], False
    if w.kind[i] == MEMBER:
        arc = latest(s.crumbs[0], s.known[i, 0], s.X[i, 0], s.X[i, 1], 10.0)
        ahead, behind = beside(w, s, i, arc)
        clear = ahead and not behind
    else:
        clear = not crowded(w, s, i)
    s.rest[i] = min(s.rest[i], t) if clear else inf
    if t - s.rest[i] > 3.0:
        s.kind[i], s.arc[i] = w.kind[i], arc
        s.high[i] -= w.how[H_ASIDE]


@kernel
def follow_line(s: Swarm, i: int, line: int, shift: float, end: float) -> None:
    """A drone takes the trail of the one ahead: at the fork that of the second part; once that one has merged, the
    first trail again, where its own ends at arc `end`."""
    if s.line[i] == 0 and line == 1 and s.shift[i] == inf:
        s.line[i] = 1
    elif s.line[i] == 1 and line == 0 and s.arc[i] > end - 1.0:
        s.line[i], s.shift[i] = 0, shift
        s.arc[i] -= shift


@inlined
def until(w: World, s: Swarm, i: int) -> float:
    """How far along its branch the second part may go: to its end once the first part is all ahead of that."""
    m = w.branch.shape[0] - 1
    end = w.branch[m, 2]
    arc = latest(s.crumbs[0], s.known[i, 0], w.branch[m, 0], w.branch[m, 1], 10.0)
    passed = arc > -inf and s.crumbs[0, s.known[i, 0] - 1, 2] > arc + w.spacing[0]
    _, behind = beside(w, s, i, arc)
    return end if (passed and not behind) or s.arc[i] > end - 3.0 else end - WAIT_M


@kernel
def reorder(w: World, s: Swarm, i: int, t: float) -> None:
    """Leaves when it is time; leads the second part from where its branch begins; merges behind the last where it ends.

    Who joins is one that waits above the trail, see `waits`.
    """
    if s.kind[i] == MEMBER and t >= w.leaves[i]:
        s.kind[i] = GOALS
    if i != w.second:
        return
    x, y, end = s.X[i, 0], s.X[i, 1], w.branch[w.branch.shape[0] - 1, 2]
    if s.kind[i] == MEMBER and s.fork[0] == inf and hypot(w.branch[0, 0] - x, w.branch[0, 1] - y) < BEGIN_M:
        n = 0
        while n < s.known[i, 0] and s.crumbs[0, n, 2] <= s.arc[i]:
            for a in range(3):
                s.crumbs[1, n, a] = s.crumbs[0, n, a]
            n += 1
        s.known[i, 1], s.fork[0] = n, s.arc[i]
        s.kind[i], s.line[i], s.arc[i], s.dropped[i] = LEADER, 1, 0.0, 0.0
    elif s.kind[i] == LEADER and s.arc[i] > end - 1.0 and until(w, s, i) == end:
        last, n = s.known[i, 1], s.known[i, 0]
        arc = latest(s.crumbs[0], n, x, y, 10.0)
        s.shift[i] = along(s.crumbs[1], last, s.crumbs[1, last - 1, 2], x, y)[0] - arc
        s.kind[i], s.line[i], s.arc[i] = MEMBER, 0, arc
