"""What the compiled loop of many drones works on, and the places of its numbers."""

from math import inf
from typing import Final, NamedTuple

from outrider._kernel import inlined
from outrider.typing import Floats, Ints

BEFORE: Final = 2.0  # m past the fork within which a drone still takes the second trail
GOALS, LEADER, MEMBER, ASIDE = range(4)  # Swarm.kind: goes to its goals; flies the path; is in the column; has left it
PROGRESS, SPACING, AVOIDANCE, SAFETY, GAVE_WAY, UNSAFE = range(6)  # columns of Swarm.ranks
M_STAMP, M_ARC, M_KNOWN, M_KIND, M_LINE, M_SHIFT, M_SIZE = 6, 7, 8, 10, 11, 12, 13  # of a message, after p and v
T_EAST, T_NORTH, T_UP, T_SPEED, T_ARC, T_AHEAD, T_GAP, T_KIND, T_LINE, T_RANK, T_OWN, T_SIZE = (*range(11), 16)
"""Of the recorded track: truth, whom it follows and how far behind, the highest rank since, its own estimate (6)."""
H_DT, H_SUB, H_RADIO, H_LOSS, H_LATE, H_FORGET, H_STALE, H_REACH, H_LAYER, H_CRUMB, H_CRUISE, H_NEAR, H_ASIDE, H_WIND, \
    H_GUST, H_GUST_KEEP, H_WALL, H_JUDGED, H_PERIOD, H_WINDOW, H_PASS, H_SIZE = range(22)  # fmt: skip


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
    kind: Ints  # (N,) what everybody is as long as its radio works
    path: Floats  # (L, 3) of the leader: east, north, arc length
    branch: Floats  # (B, 3) of who leads the second part, from the path to the path again
    second: int  # who leads it, -1 for nobody
    leaves: Floats  # (N,) s, when a drone leaves the column for its goals
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
    crumbs: Floats  # (2, C, 3) the trail of the column, and of its second part, which begins as the first does
    known: Ints  # (N, 2) points of them that have reached a drone
    line: Ints  # (N,) the trail it follows
    shift: Floats  # (N,) m, arc on the second trail less arc on the first, of who has merged; else inf
    fork: Floats  # (1,) m, arc where the second trail leaves the first
    hold: Floats  # (N, 2) m, over which who has left hovers
    mute: Floats  # (N,) s, since when its radio is dead
    rest: Floats  # (N,) s, since when a drone that has left may come back
    least: Floats  # (N,) m, the least distance to any other so far
    when: Floats  # (N,) s
    broken: Ints  # (3,) steps with two nearer than separation, drones in a wall, messages heard
    ranks: Ints  # (N, 6)
    last: Ints  # (N,) the highest rank that decided since the track was recorded last


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


@inlined
def in_units_of(line: int, arc: float, shift: float, fork: float, o_line: int, o_arc: float, o_shift: float) -> float:
    """Where another is, in the arc length [m] of one's own trail; -inf for who is on a trail that is none of its own.

    Up to the fork both trails are one; who has merged knows by how much they differ.
    """
    if line == o_line:
        return o_arc
    if line == 0 and shift < inf:
        return o_arc - shift
    if line == 0 and arc < fork + BEFORE:
        return o_arc
    if line == 1 and o_shift < inf:
        return o_arc + o_shift
    return -inf


@inlined
def to_wall(wall: Floats, x: float, y: float) -> tuple[float, float]:
    """From a point to the nearest of a piece of wall."""
    dx, dy = wall[2] - wall[0], wall[3] - wall[1]
    q = min(max(((x - wall[0]) * dx + (y - wall[1]) * dy) / (dx * dx + dy * dy), 0.0), 1.0)
    return wall[0] + q * dx - x, wall[1] + q * dy - y
