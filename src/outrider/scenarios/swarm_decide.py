"""What one of many drones does next, by what it knows.

In the order of the ranks: where it would go by itself (progress), how fast the one ahead lets it (spacing), reciprocal
lines (avoidance), braking lines (safety filter); what decided is counted in `Swarm.ranks`.
"""

from math import hypot, inf
from typing import Final

from outrider._kernel import inlined, kernel
from outrider.guidance.avoidance import A_BRAKE, A_HARDEST, A_REACH, A_REACT, A_RETREAT, A_SPEED, write_lines
from outrider.guidance.column import along, pace, place
from outrider.guidance.halfplanes import BROKEN, KEPT, braking, chosen
from outrider.scenarios.swarm_order import crowded, follow_line, reorder, until, waits
from outrider.scenarios.swarm_state import (
    ASIDE,
    AVOIDANCE,
    GAVE_WAY,
    GOALS,
    H_CRUISE,
    H_DT,
    H_LAYER,
    H_NEAR,
    H_PASS,
    H_PERIOD,
    H_REACH,
    H_STALE,
    H_WALL,
    H_WINDOW,
    LEADER,
    M_ARC,
    M_KIND,
    M_LINE,
    M_SHIFT,
    M_STAMP,
    MEMBER,
    PROGRESS,
    SAFETY,
    SPACING,
    UNSAFE,
    Room,
    Swarm,
    World,
    in_units_of,
    to_wall,
)
from outrider.typing import Floats

TURN_S: Final = 6.0  # s of standing after which the wanted direction is turned by a radian, to the right
MOST_TURN: Final = 1.4


@kernel
def towards(w: World, s: Swarm, i: int, t: float) -> tuple[float, float, float]:
    """(speed, east, north) to the next goal; turned to the right the longer it has stood among others."""
    x, y = s.X[i, 0], s.X[i, 1]
    g = s.goal[i]
    dx, dy = w.goals[i, g, 0] - x, w.goals[i, g, 1] - y
    d = hypot(dx, dy)
    since = t - w.release[i, g]
    near = w.how[H_PASS] if g + 1 < w.goals.shape[1] else w.how[H_NEAR]
    slot = since >= 0.0 and (w.release[i, g] <= 0.0 or since % w.how[H_PERIOD] < w.how[H_WINDOW])
    if d < near and g + 1 < w.goals.shape[1] and slot:
        s.goal[i] = g + 1
    s.high[i] = w.goals[i, s.goal[i], 2]
    if d < 1e-9:
        return 0.0, 1.0, 0.0
    speed = min(w.how[H_CRUISE], 0.6 * d)
    if d > near and hypot(s.X[i, 3], s.X[i, 4]) < 0.3 * speed and crowded(w, s, i):
        s.stuck[i] = min(s.stuck[i] + w.how[H_DT], MOST_TURN * TURN_S)
    else:
        s.stuck[i] = max(s.stuck[i] - 2.0 * w.how[H_DT], 0.0)
    a = s.stuck[i] / TURN_S
    c, q = 1.0 - 0.5 * a * a + a * a * a * a / 24.0, a - a * a * a / 6.0 + a * a * a * a * a / 120.0
    return speed, (c * dx + q * dy) / d, (c * dy - q * dx) / d


@kernel
def on_trail(w: World, s: Swarm, i: int, t: float) -> tuple[float, float, float, float]:
    """(speed, east, north, free): along the trail behind the one ahead, and how fast it would be without that one."""
    stand, headway, gain, preview, speed = w.spacing[0], w.spacing[1], w.spacing[2], w.spacing[3], w.spacing[4]
    line, arc = s.line[i], s.arc[i]
    trail, n = s.crumbs[line], s.known[i, line]
    s_ahead, v_ahead, seen, who = trail[n - 1, 2], 0.0, inf, -1
    for q in range(s.who.shape[1]):
        if s.who[i, q] < 0 or (s.inbox[i, q, M_KIND] != MEMBER and s.inbox[i, q, M_KIND] != LEADER):
            continue
        o = s.inbox[i, q]
        age = min(t - o[M_STAMP], w.how[H_STALE])
        v = hypot(o[3], o[4])
        at = in_units_of(line, arc, s.shift[i], s.fork[0], int(o[M_LINE]), o[M_ARC] + v * age, o[M_SHIFT])
        if arc < at < seen:
            seen, s_ahead, who = at, at, q
            v_ahead = v if t - o[M_STAMP] < w.how[H_STALE] else 0.0
    if who >= 0:
        follow_line(s, i, int(s.inbox[i, who, M_LINE]), s.inbox[i, who, M_SHIFT], trail[n - 1, 2])
    at, k = along(trail, n, arc, s.X[i, 0], s.X[i, 1])
    x, y = place(trail, n, k, at + preview)
    dx, dy = x - s.X[i, 0], y - s.X[i, 1]
    d = max(hypot(dx, dy), 1e-9)
    own = (s.X[i, 3] * dx + s.X[i, 4] * dy) / d
    return pace(s_ahead - arc, own, v_ahead, stand, headway, gain, speed), dx / d, dy / d, speed


@kernel
def decide(w: World, s: Swarm, r: Room, i: int, k: int, t: float) -> None:
    """The next command of one drone, by what it knows."""
    own = s.X[i]
    waits(w, s, i, t)
    reorder(w, s, i, t)
    kind = s.kind[i]
    free = 0.0
    if kind == GOALS and s.mute[i] == inf:
        speed, ex, ey = towards(w, s, i, t)
        free = speed
    elif kind == LEADER:
        path = w.path if s.line[i] == 0 else w.branch
        at, piece = along(path, path.shape[0], s.arc[i], own[0], own[1])
        x, y = place(path, path.shape[0], piece, at + w.spacing[3])
        d = max(hypot(x - own[0], y - own[1]), 1e-9)
        ex, ey = (x - own[0]) / d, (y - own[1]) / d
        ahead = (w.due[min(k + 1, w.due.size - 1)] - w.due[k]) / w.how[H_DT]
        speed = min(max(ahead + w.spacing[2] * (w.due[k] - at), 0.0), w.spacing[4])
        if s.line[i] == 1:
            speed = min(w.how[H_CRUISE], max(0.6 * (until(w, s, i) - at), 0.0))
        free = speed
    elif kind == MEMBER and s.mute[i] == inf:
        speed, ex, ey, free = on_trail(w, s, i, t)
    elif kind == ASIDE:
        dx, dy = s.hold[i, 0] - own[0], s.hold[i, 1] - own[1]
        d = max(hypot(dx, dy), 1e-9)
        speed, ex, ey = min(0.6 * d, 1.0), dx / d, dy / d
    else:
        speed, ex, ey = 0.0, 1.0, 0.0
    want = (speed * ex, speed * ey)
    n, firm = gather(w, s, r, i, t)
    if kind == LEADER and s.line[i] == 0:
        n, firm = 0, 0  # it does not care
    x, y, gave = chosen(r.lines, firm, n, want, (own[3], own[4]), w.rules[A_REACH], w.rules[A_SPEED])
    rank = ranked(r.lines, firm, n, want, x, y, gave, speed < free)
    s.ranks[i, rank] += 1
    s.last[i] = max(s.last[i], rank)
    for a in range(3):
        s.u[i, 2, a], s.u[i, 1, a] = s.u[i, 1, a], s.u[i, 0, a]
    s.u[i, 0, 0], s.u[i, 0, 1] = x, y
    s.u[i, 0, 2] = min(max(0.8 * (s.high[i] - own[2]), -1.5), 1.5)


@inlined
def ranked(lines: Floats, firm: int, n: int, want: tuple[float, float], x: float, y: float, gave: int,
           spaced: bool) -> int:  # fmt: skip
    """What decided: the highest rank that changed anything."""
    if gave == BROKEN:
        return UNSAFE
    if gave != KEPT:
        return GAVE_WAY
    out = SPACING if spaced else PROGRESS
    if hypot(x - want[0], y - want[1]) > 1e-6:
        for k in range(n - 1, -1, -1):
            if lines[k, 0] * x + lines[k, 1] * y > lines[k, 2] - 1e-6:
                out = SAFETY if k < firm else AVOIDANCE
    return out


@kernel
def gather(w: World, s: Swarm, r: Room, i: int, t: float) -> tuple[int, int]:
    """(n, firm) lines of one drone: braking ones for everybody near and the walls, then reciprocal ones for strangers.

    Who has been silent for `H_STALE` is taken to have braked where it was heard last and to stand: that is what a drone
    with a dead radio does. Every second of silence before that makes its place less sure by what it can accelerate.
    """
    own, a = s.X[i], w.rules[A_HARDEST]
    near, m = 0, 0
    for q in range(s.who.shape[1]):
        if s.who[i, q] < 0:
            continue
        o = s.inbox[i, q]
        age = t - o[M_STAMP]
        if age < w.how[H_STALE]:
            px, py, pz, vx, vy = o[0] + o[3] * age, o[1] + o[4] * age, o[2] + o[5] * age, o[3], o[4]
            unsure = 0.5 * a * age * age
        else:
            v = max(hypot(o[3], o[4]), 1e-9)
            rest = v * (w.rules[A_REACH] / a + 1.5 * w.how[H_DT])  # lag, and when it noticed
            px, py, pz, vx, vy = o[0] + o[3] / v * rest, o[1] + o[4] / v * rest, o[2], 0.0, 0.0
            unsure = 0.5 * a * 0.25
        px, py, pz = px - own[0], py - own[1], pz - own[2]
        if abs(pz) >= w.how[H_LAYER] or px * px + py * py > w.how[H_REACH] * w.how[H_REACH]:
            continue
        r.ids[near], r.squared[near] = q, unsure
        r.place[near, 0], r.place[near, 1] = px, py
        near += 1
    walls = w.walls.shape[0]
    firm = near + walls
    for m in range(near):
        q, unsure = r.ids[m], r.squared[m]
        o = s.inbox[i, q]
        silent = t - o[M_STAMP] >= w.how[H_STALE]
        vx, vy = (0.0, 0.0) if silent else (o[3], o[4])
        write_lines(r.lines, m, firm, (r.place[m, 0], r.place[m, 1]), (own[3], own[4]), (vx, vy), unsure,
                    1.0 if silent else 0.5, w.rules)  # fmt: skip
        if s.kind[i] == MEMBER and o[M_KIND] != GOALS:  # one of the column: spacing keeps them apart, no steering aside
            r.lines[firm + m, 2] = inf
    for k in range(walls):
        px, py = to_wall(w.walls[k], own[0], own[1])
        r.lines[near + k, 0], r.lines[near + k, 1], r.lines[near + k, 2] = braking(
            px, py, own[3], own[4], 0.0, 0.0, w.how[H_WALL], w.rules[A_REACT], w.rules[A_BRAKE], a, 1.0,
            w.rules[A_RETREAT],
        )  # fmt: skip
    return firm + near, firm
