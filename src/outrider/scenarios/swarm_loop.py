"""The compiled loop of many drones: everyone flies, estimates where it is, hears some of the others, and decides.

What a drone knows is its own estimate (`Swarm.X`, `P`) and its inbox; truth (`Swarm.body`) is read by its receiver, by
the air between the radios, and by the judge that measures how near drones came.
"""

from math import hypot, inf, sqrt

from outrider._kernel import kernel
from outrider.filters.following.steps import predict, update
from outrider.guidance.column import along
from outrider.guidance.neighbours import nearest, sort_into_cells
from outrider.models.vehicles.airborne import X_P, X_V
from outrider.models.vehicles.multirotor import X_CURSOR, fly_step, velocity_command
from outrider.scenarios.swarm_air import dead, hear, judge
from outrider.scenarios.swarm_decide import decide
from outrider.scenarios.swarm_state import (
    GOALS,
    H_CRUMB,
    H_DT,
    H_GUST,
    H_GUST_KEEP,
    H_RADIO,
    H_SUB,
    H_WIND,
    LEADER,
    M_ARC,
    M_KIND,
    M_KNOWN,
    M_LINE,
    M_SHIFT,
    M_STAMP,
    MEMBER,
    T_AHEAD,
    T_ARC,
    T_EAST,
    T_GAP,
    T_KIND,
    T_LINE,
    T_NORTH,
    T_OWN,
    T_RANK,
    T_SPEED,
    T_UP,
    Room,
    Swarm,
    World,
    in_units_of,
)
from outrider.typing import Floats


@kernel
def fly(w: World, s: Swarm, r: Room, begin: int, fix: Floats, gust: Floats, chance: Floats, track: Floats,
        every: int) -> None:  # fmt: skip
    """As many decisions as there are rows of noise, from number `begin` on.

    fix (steps, N, 6), gust (steps, N, 3) : standard normal;  chance (steps, N, S, 2) : uniform, of loss and delay;
    track (rows, N, T_SIZE) <- truth of every decision whose number is a multiple of `every`.
    """
    n = s.X.shape[0]
    for row in range(fix.shape[0]):
        k = begin + row
        t = k * w.how[H_DT]
        for i in range(n):
            estimate(w, s, r, i, fix[row, i])
        for i in range(n):
            speak(w, s, i, k, t)
        for i in range(n):
            r.place[i, 0], r.place[i, 1], r.place[i, 2] = s.body[i, X_P], s.body[i, X_P + 1], s.body[i, X_P + 2]
        sort_into_cells(r.place, w.how[H_RADIO], r.first, r.members)
        for i in range(n):
            found = nearest(r.place, w.how[H_RADIO], r.first, r.members, i, w.how[H_RADIO], inf, r.ids, r.squared)
            judge(w, s, r, i, found, t)
            hear(w, s, r, i, found, k, t, chance[row, i])
        for i in range(n):
            decide(w, s, r, i, k, t)
        if k % every == 0 and k // every < track.shape[0]:
            record(s, track[k // every])
        for i in range(n):
            move(w, s, r, i, gust[row, i])


@kernel
def estimate(w: World, s: Swarm, r: Room, i: int, noise: Floats) -> None:
    """The filter of one drone: the command that has acted since the last fix, then the fix."""
    predict(s.X[i], s.P[i], s.u[i, 2, :3], w.step)
    for part in range(2):
        for a in range(3):
            truth = s.body[i, X_P + a] if part == 0 else s.body[i, X_V + a]
            r.z[a] = truth + w.sigma[part, a] * noise[3 * part + a]
        update(s.X[i], s.P[i], 3 * part, r.z, w.variance[part], inf)


@kernel
def speak(w: World, s: Swarm, i: int, k: int, t: float) -> None:
    """Where on its trail it is, and the message that it sends now."""
    line = s.line[i]
    trail, place_now = s.crumbs[line], 0.0
    if s.kind[i] == LEADER:
        path = w.path if line == 0 else w.branch
        s.arc[i] = along(path, path.shape[0], s.arc[i], s.X[i, 0], s.X[i, 1])[0]
        m = s.known[i, line]
        if s.arc[i] >= s.dropped[i] + w.how[H_CRUMB] and m < trail.shape[0]:
            d = hypot(s.X[i, 0] - trail[m - 1, 0], s.X[i, 1] - trail[m - 1, 1])
            trail[m, 0], trail[m, 1], trail[m, 2] = s.X[i, 0], s.X[i, 1], trail[m - 1, 2] + d
            s.known[i, line] = m + 1
            s.dropped[i] = s.arc[i]
        last = trail[s.known[i, line] - 1, 2]
        place_now = along(trail, s.known[i, line], last, s.X[i, 0], s.X[i, 1])[0]
        s.true_arc[i] = along(trail, s.known[i, line], last, s.body[i, X_P], s.body[i, X_P + 1])[0]
    elif s.kind[i] != GOALS:
        place_now = along(trail, s.known[i, line], s.arc[i], s.X[i, 0], s.X[i, 1])[0]
        s.arc[i] = place_now
        s.true_arc[i] = along(trail, s.known[i, line], s.arc[i], s.body[i, X_P], s.body[i, X_P + 1])[0]
    m = s.sent[k % s.sent.shape[0], i]
    for a in range(6):
        m[a] = s.X[i, a]
    m[M_STAMP], m[M_ARC], m[M_KIND], m[M_LINE], m[M_SHIFT] = t, place_now, s.kind[i], line, s.shift[i]
    m[M_KNOWN], m[M_KNOWN + 1] = s.known[i, 0], s.known[i, 1]
    if dead(w, i, t):
        m[M_STAMP] = -inf
        s.mute[i] = min(s.mute[i], t)
    else:
        s.mute[i] = inf


@kernel
def record(s: Swarm, row: Floats) -> None:
    """Truth, the estimate, what decided, and whom a drone follows: the next ahead in the column, -1 for nobody."""
    n = s.X.shape[0]
    for i in range(n):
        row[i, T_EAST], row[i, T_NORTH], row[i, T_UP] = s.body[i, X_P], s.body[i, X_P + 1], s.body[i, X_P + 2]
        row[i, T_SPEED], row[i, T_ARC] = hypot(s.body[i, X_V], s.body[i, X_V + 1]), s.true_arc[i]
        row[i, T_KIND], row[i, T_LINE], row[i, T_RANK] = s.kind[i], s.line[i], s.last[i]
        s.last[i] = 0
        for a in range(6):
            row[i, T_OWN + a] = s.X[i, a]
        row[i, T_AHEAD], row[i, T_GAP] = -1.0, inf
        if s.kind[i] != MEMBER:
            continue
        best, own = inf, s.true_arc[i]
        for j in range(n):
            if (s.kind[j] == MEMBER or s.kind[j] == LEADER) and j != i:
                at = in_units_of(s.line[i], own, s.shift[i], s.fork[0], s.line[j], s.true_arc[j], s.shift[j])
                if own < at < best:
                    best = at
                    row[i, T_AHEAD], row[i, T_GAP] = j, at - own


@kernel
def move(w: World, s: Swarm, r: Room, i: int, noise: Floats) -> None:
    """Fly until the next decision, in wind with gusts."""
    keep, x, theta = w.how[H_GUST_KEEP], s.body[i], w.vehicle
    for a in range(3):
        s.gust[i, a] = keep * s.gust[i, a] + sqrt(1.0 - keep * keep) * w.how[H_GUST] * noise[a]
        r.air[0, a] = s.gust[i, a] + (w.how[H_WIND] if a == 0 else 0.0)
    for _ in range(int(w.how[H_SUB])):
        command = velocity_command(x, X_CURSOR, int(theta[13]), s.u[i], 0, theta[9], theta[10], theta[11], theta[12])
        fly_step(x, command, r.air, 0, theta)
