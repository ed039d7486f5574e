"""Many drones: one step of avoidance beside pyrvo's ORCA, neighbours beside scipy's tree, a column of a thousand."""

from functools import cache

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.table import Row, Side
from outrider.guidance.avoidance import Avoidance, avoid_all
from outrider.guidance.neighbours import Cells
from outrider.scenarios.swarm import Sky, fly_swarm
from outrider.scenarios.swarm_tasks import column

N, MOST, REACH, DT = 200, 10, 15.0, 0.1
RULES = Avoidance()


@cache
def crowd():
    """Drones 5 m apart, about, that want to go anywhere: places, velocities, wants."""
    rng, side = np.random.default_rng(0), int(np.ceil(np.sqrt(N)))
    k = np.arange(N)
    want = 2.0 * rng.normal(size=(N, 2))
    return 5.0 * np.column_stack([k % side, k // side]) + rng.uniform(-1.0, 1.0, (N, 2)), want, want


def ours(steps):
    """`avoid_all`: neighbours anew, braking and reciprocal lines, the nearest velocity by rank."""
    p, v, want = (a.copy() for a in crowd())
    cells, out, ranks = Cells(N, REACH), np.zeros((N, 2)), np.zeros(N, np.int64)
    lines, ids, squared, theta = np.zeros((2 * MOST, 3)), np.zeros(MOST, np.int64), np.zeros(MOST), RULES.theta()
    for _ in range(steps):
        avoid_all(p, v, want, theta, REACH, np.inf, cells.side, cells.first, cells.members, lines, ids, squared, out,
                  ranks)  # fmt: skip
        v[:] = out
        p += v * DT
    return p.ravel()


def orca(steps):
    """pyrvo (the RVO2 library, C++): reciprocal lines only, velocities that change at once."""
    from pyrvo import RVOSimulator

    p, v, want = crowd()
    radius = 0.5 * (RULES.separation + RULES.margin + RULES.comfort)
    sim = RVOSimulator(DT, REACH, MOST, RULES.horizon_s, RULES.horizon_s, radius, RULES.speed)
    for at in p:
        sim.add_agent((float(at[0]), float(at[1])))
    for i in range(N):
        sim.set_agent_velocity(i, (float(v[i, 0]), float(v[i, 1])))
        sim.set_agent_pref_velocity(i, (float(want[i, 0]), float(want[i, 1])))
    for _ in range(steps):
        sim.do_step()
    return np.array([c for i in range(N) for c in (sim.get_agent_position(i).x, sim.get_agent_position(i).y)])


@cache
def places():
    """A thousand points, 5 m apart on average."""
    return np.random.default_rng(1).uniform(0.0, 5.0 * np.sqrt(1000.0), (1000, 2))


def grid(times):
    """The eight nearest within 15 m of everybody."""
    cells = Cells(1000, REACH)
    for _ in range(times):
        ids = cells.near(places(), REACH, 8)
    return ids[:, 0].astype(np.float64)


def tree(times):
    """The same by a k-d tree, built anew."""
    for _ in range(times):
        found = cKDTree(places()).query(places(), k=9, distance_upper_bound=REACH)[1]
    return found[:, 1].astype(np.float64)


def thousand(decisions):
    """Everybody estimated from fixes at 10 Hz, on the air with 20 % losses, and guided."""
    seconds = max(decisions, 10) / 10.0
    done = fly_swarm(column(1001, seconds, 0), 0, sky=Sky(radio=40.0), until_there=False, room=16, every=1000)
    return np.array([float(done.violations)])


def rows():
    """Rows of this module."""
    return [
        Row(f"avoidance for {N} drones (per step)", Side("avoid_all", ours, 50),
            [Side("pyrvo, no acceleration limits, no braking lines", orca, 50)], target=2000.0, tolerance=None),
        Row("eight nearest neighbours of 1000 (per search of all)", Side("grid", grid, 20),
            [Side("scipy cKDTree", tree, 20)]),
        Row("1000 followers simulated, estimated and guided at 10 Hz (per decision of all)",
            Side("fly_swarm", thousand, 50), target=100_000.0),
    ]  # fmt: skip
