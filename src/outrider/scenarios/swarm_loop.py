"""The compiled loop of many drones: everyone flies, estimates where it is, hears some of the others, and decides.

What a drone knows is its own estimate (`Swarm.X`, `P`) and its inbox; truth (`Swarm.body`) is read by its receiver, by
the air between the radios, and by the judge that measures how near drones came.

A decision in the order of its ranks: where it would go by itself (progress), how fast the one ahead lets it (spacing),
reciprocal lines (avoidance), braking lines (safety filter); what decided is counted in `Swarm.ranks`.
"""

from math import floor, hypot, inf, sqrt
from typing import Final, NamedTuple

from outrider._kernel import inlined, kernel
from outrider.filters.following.steps import predict, update
from outrider.guidance.avoidance import A_BRAKE, A_HARDEST, A_PART, A_REACH, A_REACT, A_RETREAT, A_SPEED, write_lines
from outrider.guidance.column import along, latest, pace, place
from outrider.guidance.halfplanes import BROKEN, KEPT, braking, chosen
from outrider.guidance.neighbours import nearest, sort_into_cells
from outrider.models.vehicles.airborne import X_P, X_V
from outrider.models.vehicles.multirotor import X_CURSOR, fly_step, velocity_command
from outrider.typing import Floats, Ints

GOALS, LEADER, MEMBER, ASIDE = range(4)  # Swarm.kind: goes to its goals; flies the path; is in the column; has left it
PROGRESS, SPACING, AVOIDANCE, SAFETY, GAVE_WAY, UNSAFE = range(6)  # columns of Swarm.ranks
M_STAMP, M_ARC, M_KNOWN, M_KIND, M_SIZE = 6, 7, 8, 9, 10  # of a message, after position and velocity
T_EAST, T_NORTH, T_UP, T_SPEED, T_ARC, T_AHEAD, T_SIZE = range(7)  # of the recorded track
H_DT, H_SUB, H_RADIO, H_LOSS, H_LATE, H_FORGET, H_STALE, H_REACH, H_LAYER, H_CRUMB, H_CRUISE, H_NEAR, H_ASIDE, H_WIND, \
    H_GUST, H_GUST_KEEP, H_WALL, H_JUDGED, H_PERIOD, H_WINDOW, H_PASS, H_SIZE = range(22)  # fmt: skip
TURN_S: Final = 6.0  # s of standing after which the wanted direction is turned by a radian, to the right
MOST_TURN: Final = 1.4


class World(NamedTuple):
    """What does not change."""

    how: Floats  # (H_SIZE,)
    rules: Floats  # Avoidance.theta
    spacing: Floats  # stand, headway, gain, preview, speed
    vehicle: Floats  # Multirotor's theta
    step: Floats  # (3, STEP) of the filter, one decision long
    variance: Floats  # (2, 3) of position and velocity fixes
    sigma: Floats  # (2, 3) their true deviations
    walls: Floats  # (m, 4) east, north of both ends
    goals: Floats  # (N, W, 3)
    release: Floats  # (N, W) s, from when on a drone may go on from a goal, for a window in every period
    silent: Floats  # (N, windows, 2) s, from when to when its radio is dead
    path: Floats  # (L, 3) of the leader: east, north, arc length
    due: Floats  # (steps,) m, arc length where the leader should be


class Swarm(NamedTuple):
    """What changes."""

    body: Floats  # (N, width) truth
    X: Floats  # (N, 6)
    P: Floats  # (N, 6, 6)
    u: Floats  # (N, 3, 4) commands: just decided, acting next, and the one that has acted
    gust: Floats  # (N, 3)
    sent: Floats  # (K, N, M_SIZE) the last messages of everybody
    who: Ints  # (N, S) senders in the inbox
    inbox: Floats  # (N, S, M_SIZE)
    kind: Ints  # (N,)
    goal: Ints  # (N,)
    stuck: Floats  # (N,) s
    high: Floats  # (N,) m, wanted height
    arc: Floats  # (N,) m, on the trail; the leader's on its path
    true_arc: Floats  # (N,)
    dropped: Floats  # (N,) m, on its path, where the leader added to the trail last
    crumbs: Floats  # (C, 3) the trail
    known: Ints  # (N,) points of it that have reached a drone
    mute: Floats  # (N,) s, since when its radio is dead
    rest: Floats  # (N,) s, since when nobody of the column was behind a drone that waits to join
    least: Floats  # (N,) m, the least distance to any other so far
    when: Floats  # (N,) s
    broken: Ints  # (3,) steps with two nearer than separation, drones in a wall, messages heard
    ranks: Ints  # (N, 6)


class Room(NamedTuple):
    """Scratch."""

    place: Floats  # (N, 3)
    first: Ints
    members: Ints
    ids: Ints  # (S,)
    squared: Floats  # (S,)
    lines: Floats  # (2 S + walls, 3)
    z: Floats  # (3,)
    air: Floats  # (1, 3)


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


@inlined
def dead(w: World, i: int, t: float) -> bool:
    """Whether the radio of a drone is."""
    out = False
    for k in range(w.silent.shape[1]):
        out = out or w.silent[i, k, 0] <= t < w.silent[i, k, 1]
    return out


@kernel
def speak(w: World, s: Swarm, i: int, k: int, t: float) -> None:
    """Where on the trail it is, and the message that it sends now."""
    if s.kind[i] == LEADER:
        s.arc[i] = along(w.path, w.path.shape[0], s.arc[i], s.X[i, 0], s.X[i, 1])[0]
        m = s.known[i]
        if s.arc[i] >= s.dropped[i] + w.how[H_CRUMB] and m < s.crumbs.shape[0]:
            d = hypot(s.X[i, 0] - s.crumbs[m - 1, 0], s.X[i, 1] - s.crumbs[m - 1, 1])
            s.crumbs[m, 0], s.crumbs[m, 1], s.crumbs[m, 2] = s.X[i, 0], s.X[i, 1], s.crumbs[m - 1, 2] + d
            s.known[i] = m + 1
            s.dropped[i] = s.arc[i]
        last = s.crumbs[s.known[i] - 1, 2]
        place_now = along(s.crumbs, s.known[i], last, s.X[i, 0], s.X[i, 1])[0]
        s.true_arc[i] = along(s.crumbs, s.known[i], last, s.body[i, X_P], s.body[i, X_P + 1])[0]
    elif s.kind[i] != GOALS:
        place_now = along(s.crumbs, s.known[i], s.arc[i], s.X[i, 0], s.X[i, 1])[0]
        s.arc[i] = place_now
        s.true_arc[i] = along(s.crumbs, s.known[i], s.arc[i], s.body[i, X_P], s.body[i, X_P + 1])[0]
    else:
        place_now = 0.0
    m = s.sent[k % s.sent.shape[0], i]
    for a in range(6):
        m[a] = s.X[i, a]
    m[M_STAMP], m[M_ARC], m[M_KNOWN], m[M_KIND] = t, place_now, s.known[i], s.kind[i]
    if dead(w, i, t):
        m[M_STAMP] = -inf
        s.mute[i] = min(s.mute[i], t)
    else:
        s.mute[i] = inf


@kernel
def hear(w: World, s: Swarm, r: Room, i: int, found: int, k: int, t: float, chance: Floats) -> None:
    """What reaches a drone now: of everybody in range one message, some steps old, unless it is lost."""
    slots = s.who.shape[1]
    for q in range(slots):
        if s.who[i, q] >= 0 and t - s.inbox[i, q, M_STAMP] > w.how[H_FORGET]:
            s.who[i, q] = -1
    if dead(w, i, t):
        return
    for m in range(found):
        late = 1 + floor(chance[m, 1] * w.how[H_LATE])
        if chance[m, 0] < w.how[H_LOSS] or late > k:
            continue
        j = r.ids[m]
        message = s.sent[(k - late) % s.sent.shape[0], j]
        if message[M_STAMP] == -inf:
            continue
        at, oldest = -1, inf
        for q in range(slots):
            if s.who[i, q] == j:
                at = q
                break
            stamp = s.inbox[i, q, M_STAMP] if s.who[i, q] >= 0 else -inf
            if stamp < oldest:
                at, oldest = q, stamp
        if s.who[i, at] == j and s.inbox[i, at, M_STAMP] >= message[M_STAMP]:
            continue
        s.who[i, at] = j
        for a in range(message.size):
            s.inbox[i, at, a] = message[a]
        s.known[i] = max(s.known[i], int(message[M_KNOWN]))
        s.broken[2] += 1


@kernel
def judge(w: World, s: Swarm, r: Room, i: int, found: int, t: float) -> None:
    """How near a drone came in truth, between this step and the next if nobody changes its velocity."""
    nearest_now, dt = inf, w.how[H_DT]
    for m in range(found):
        j = r.ids[m]
        pp, pv, vv = 0.0, 0.0, 0.0
        for a in range(3):
            p, v = s.body[j, X_P + a] - s.body[i, X_P + a], s.body[j, X_V + a] - s.body[i, X_V + a]
            pp, pv, vv = pp + p * p, pv + p * v, vv + v * v
        tau = min(max(-pv / vv, 0.0), dt) if vv > 0.0 else 0.0
        nearest_now = min(nearest_now, pp + 2.0 * tau * pv + tau * tau * vv)
    d = sqrt(max(nearest_now, 0.0))
    if d < s.least[i]:
        s.least[i], s.when[i] = d, t
    if d < w.how[H_JUDGED]:
        s.broken[0] += 1
    for k in range(w.walls.shape[0]):
        x, y = to_wall(w.walls[k], s.body[i, X_P], s.body[i, X_P + 1])
        if hypot(x, y) < 0.5 * w.how[H_JUDGED]:
            s.broken[1] += 1


@inlined
def to_wall(wall: Floats, x: float, y: float) -> tuple[float, float]:
    """From a point to the nearest of a piece of wall."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    q = min(max(((x - wall[0]) * dx + (y - wall[1]) * dy) / (dx * dx + dy * dy), 0.0), 1.0)
    return wall[0] + q * dx - x, wall[1] + q * dy - y


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
    met = 2.0 * w.rules[A_PART]
    crowded = False
    for q in range(s.who.shape[1]):
        if s.who[i, q] >= 0 and hypot(s.inbox[i, q, 0] - x, s.inbox[i, q, 1] - y) < met:
            crowded = True
    if crowded and d > near and hypot(s.X[i, 3], s.X[i, 4]) < 0.3 * speed:
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
    n, arc = s.known[i], s.arc[i]
    s_ahead, v_ahead, seen = s.crumbs[n - 1, 2], 0.0, inf
    for q in range(s.who.shape[1]):
        if s.who[i, q] < 0 or (s.inbox[i, q, M_KIND] != MEMBER and s.inbox[i, q, M_KIND] != LEADER):
            continue
        age = min(t - s.inbox[i, q, M_STAMP], w.how[H_STALE])
        v = hypot(s.inbox[i, q, 3], s.inbox[i, q, 4])
        at = s.inbox[i, q, M_ARC] + v * age
        if arc < at < seen:
            seen, s_ahead = at, at
            v_ahead = v if t - s.inbox[i, q, M_STAMP] < w.how[H_STALE] else 0.0
    at, k = along(s.crumbs, n, arc, s.X[i, 0], s.X[i, 1])
    x, y = place(s.crumbs, n, k, at + preview)
    dx, dy = x - s.X[i, 0], y - s.X[i, 1]
    d = max(hypot(dx, dy), 1e-9)
    own = (s.X[i, 3] * dx + s.X[i, 4] * dy) / d
    return pace(s_ahead - arc, own, v_ahead, stand, headway, gain, speed), dx / d, dy / d, speed


@kernel
def waits(w: World, s: Swarm, i: int, t: float) -> None:
    """A drone whose radio is dead stands, then climbs out of the column; heard again, it joins behind the last."""
    if s.kind[i] == MEMBER and t - s.mute[i] > 2.0:
        s.kind[i] = ASIDE
        s.high[i] += w.how[H_ASIDE]
        s.rest[i] = inf
    if s.kind[i] != ASIDE or s.mute[i] < inf:
        return
    arc, behind, ahead = latest(s.crumbs, s.known[i], s.X[i, 0], s.X[i, 1], 10.0), False, False
    for q in range(s.who.shape[1]):
        if s.who[i, q] >= 0 and (s.inbox[i, q, M_KIND] == MEMBER or s.inbox[i, q, M_KIND] == LEADER):
            gap = s.inbox[i, q, M_ARC] - arc
            behind = behind or -w.how[H_RADIO] < gap < w.spacing[0]
            ahead = ahead or w.spacing[0] <= gap < w.how[H_RADIO]  # and not a round of the way later
    s.rest[i] = min(s.rest[i], t) if ahead and not behind else inf
    if t - s.rest[i] > 3.0:
        s.kind[i], s.arc[i] = MEMBER, arc
        s.high[i] -= w.how[H_ASIDE]


@kernel
def decide(w: World, s: Swarm, r: Room, i: int, k: int, t: float) -> None:
    """The next command of one drone, by what it knows."""
    own = s.X[i]
    waits(w, s, i, t)
    kind = s.kind[i]
    free = 0.0
    if kind == GOALS:
        speed, ex, ey = towards(w, s, i, t)
        free = speed
    elif kind == LEADER:
        at, piece = along(w.path, w.path.shape[0], s.arc[i], own[0], own[1])
        x, y = place(w.path, w.path.shape[0], piece, at + w.spacing[3])
        d = max(hypot(x - own[0], y - own[1]), 1e-9)
        ex, ey = (x - own[0]) / d, (y - own[1]) / d
        ahead = (w.due[min(k + 1, w.due.size - 1)] - w.due[k]) / w.how[H_DT]
        speed = min(max(ahead + w.spacing[2] * (w.due[k] - at), 0.0), w.spacing[4])
        free = speed
    elif kind == MEMBER and s.mute[i] == inf:
        speed, ex, ey, free = on_trail(w, s, i, t)
    else:
        speed, ex, ey = 0.0, 1.0, 0.0
    want = (speed * ex, speed * ey)
    n, firm = gather(w, s, r, i, t)
    if kind == LEADER:
        n, firm = 0, 0  # it does not care
    x, y, gave = chosen(r.lines, firm, n, want, (own[3], own[4]), w.rules[A_REACH], w.rules[A_SPEED])
    s.ranks[i, ranked(r.lines, firm, n, want, x, y, gave, speed < free)] += 1
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
            rest = w.rules[A_REACT] * v + 0.5 * v * v / w.rules[A_BRAKE]
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


@kernel
def record(s: Swarm, row: Floats) -> None:
    """Truth, and whom a drone follows: the next one ahead that is in the column, -1 for nobody."""
    n = s.X.shape[0]
    for i in range(n):
        row[i, T_EAST], row[i, T_NORTH], row[i, T_UP] = s.body[i, X_P], s.body[i, X_P + 1], s.body[i, X_P + 2]
        row[i, T_SPEED], row[i, T_ARC] = hypot(s.body[i, X_V], s.body[i, X_V + 1]), s.true_arc[i]
        row[i, T_AHEAD] = -1.0
        if s.kind[i] != MEMBER:
            continue
        best = inf
        for j in range(n):
            if (s.kind[j] == MEMBER or s.kind[j] == LEADER) and s.true_arc[i] < s.true_arc[j] < best and j != i:
                best = s.true_arc[j]
                row[i, T_AHEAD] = j


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
