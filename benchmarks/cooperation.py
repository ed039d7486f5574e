"""Teams: coop2024's two robots under one filter, beside filterpy; and up to a hundred that meet at random."""

from dataclasses import replace
from functools import cache

import numpy as np

from benchmarks.table import Row, Side
from outrider.data import Gaussian
from outrider.filters.cooperative import Member, Method, Source, fuse_team
from outrider.filters.cooperative.fusion import NO_RECORDS, prepare
from outrider.filters.cooperative.group import advance, measure
from outrider.filters.cooperative.robot import Filter
from outrider.models import sensors as s
from outrider.models.motion import LAYOUTS, LaggedFollower, Motion
from outrider.scenarios.inspection import Faults, Tuning, crew, sense

SECONDS, STEP = 60.0, 0.1
PLACE_ONLY = np.array([0.1] * 3 + [np.inf] * 3)
FOLLOWER = LAYOUTS[Motion.FOLLOWER]


@cache
def tour():
    """The two robots of coop2024 and their records of 180 s."""
    return crew(0, Tuning()), sense(0, Faults(), Tuning())


def ours(seconds):
    """`fuse_team`, one filter of 31 states; places between two records, at the end of so many seconds."""
    members, sources = cut(seconds)
    done = fuse_team(members, sources, Method.JOINT, np.array([seconds + 0.005]), start=0.0, false_alarm=0.0)
    return np.concatenate([done.x["ugv"][-1, :2], done.x["uav"][-1, :3]])


def simulated(seconds):
    """The same with the records drawn anew."""
    done = fuse_team(crew(0, Tuning()), sense(0, Faults(), Tuning()), Method.JOINT, np.array([180.0]), start=0.0)
    return done.x["uav"][-1, :3]


def filterpy(seconds):
    """ExtendedKalmanFilter over both robots; models, Jacobians and innovations are ours, compiled."""
    from filterpy.kalman import ExtendedKalmanFilter

    members, sources = cut(seconds)
    ready = prepare(members, sources, Method.JOINT, np.zeros(0), start=0.0)
    ours = Filter(members, sources, NO_RECORDS, np.zeros(0), 0.0, gate=ready.gate)
    g, b, ws, records = ours.group, ours.belief, ours.work, ready.records
    n = len(b.P)
    f, spare = ExtendedKalmanFilter(n, 1), np.zeros((n, n))
    f.x, f.P = b.x.copy(), b.P.copy()
    frozen = b._replace(P=spare)
    for e in range(records.t.size):
        if records.t[e] > b.clock[0]:
            spare[...] = 0.0
            b.x[...] = f.x
            advance(g, frozen, ws, records.t[e])
            f.F, f.Q = ws.F_all.copy(), ws.Q_all.copy()
            f.P = f.F @ f.P @ f.F.T + f.Q  # as its predict(); the state has been moved already
            f.x = b.x.copy()
        b.x[...] = f.x
        m = measure(g, frozen, ws, int(records.source[e]), records.z[e], records.r[e])
        if m:
            H, y = ws.H_all[:m].copy(), ws.y[:m].copy()
            f.dim_z = m
            f._I = np.eye(n)
            f.update(y, lambda x, H=H: H, lambda x, m=m: np.zeros(m), R=np.diag(ws.r[:m]))
    b.x[...] = f.x
    advance(g, frozen, ws, seconds + 0.005)
    start = LAYOUTS[Motion.DRIFTING].size
    return np.concatenate([b.x[:2], b.x[start:][LAYOUTS[Motion.EULER].state("position")]])


@cache
def cut(seconds):
    """The tour up to so many seconds."""
    members, sources = tour()
    ends = [int(np.searchsorted(q.t, seconds + 0.005)) for q in sources]
    return members, [replace(q, t=q.t[:k], z=q.z[:k]) for q, k in zip(sources, ends, strict=True)]


@cache
def swarm(robots, shape):
    """Robots with fixes at 1 Hz that measure the next one of a ring, a neighbour of a grid, or anybody, twice a second
    each."""
    rng, t = np.random.default_rng(robots), np.arange(1.0, SECONDS + 0.5)
    first = Gaussian(np.zeros(6), np.diag([1.0] * 3 + [0.1] * 3), FOLLOWER)
    model = LaggedFollower(acceleration=0.1)
    members = [Member(name=f"r{i}", motion=Motion.FOLLOWER, model=model, belief=first) for i in range(robots)]
    fixes = [Source(robot=m.name, sensor=s.Position(sigma=0.5), t=t, z=0.5 * rng.normal(size=(t.size, 3)))
             for m in members]  # fmt: skip
    side, met = int(np.ceil(np.sqrt(robots))), {}
    for now in np.sort(rng.uniform(0.5, SECONDS, int(robots * SECONDS))):
        i = int(rng.integers(robots))
        step = {"ring": 1, "grid": int(rng.choice([1, side])), "swarm": int(rng.integers(1, robots))}[shape]
        met.setdefault((i, (i + step) % robots), []).append(now)
    seen = []
    for (i, j), times in met.items():
        z = np.zeros((len(times), 8))
        z[:, 1:4], z[:, 7] = 0.1 * rng.normal(size=(len(times), 3)), 1.0
        seen.append(Source(robot=f"r{i}", partner=f"r{j}", sensor=s.RelativePose(), sigmas=PLACE_ONLY,
                           t=np.array(times), z=z))  # fmt: skip
    return members, [*fixes, *seen]


def together(robots, shape, method):
    """A run of 60 s; an event is one robot's share of it, so that a flat cost is the same number in each row."""

    def run(events):
        for _ in range(max(1, events // robots)):
            done = fuse_team(*swarm(robots, shape), method, np.array([SECONDS]), start=0.0)
        return np.array([float(np.isfinite(done.x["r0"]).all())])

    return run


def rows():
    """Rows of this module."""
    name = "coop2024's two robots, joint filter of 31 states, 180 s at 100 Hz (per second of the run)"
    out = [
        Row(name, Side("fuse_team", ours, 180), [Side("filterpy EKF, our compiled models", filterpy, 20)],
            target=0.15e6 / 180.0, tolerance=1e-6),
        Row("the same, records simulated anew (per second of the run)", Side("sense and fuse_team", simulated, 180),
            target=0.25e6 / 180.0),
    ]  # fmt: skip
    for shape in ("ring", "grid", "swarm"):
        for robots in (10, 100):
            joint = [Side("joint", together(robots, shape, Method.JOINT), robots)] if robots == 10 else []
            out.append(
                Row(f"{robots} robots meeting in a {shape}, 60 s, distributed (per robot)",
                    Side("fuse_team", together(robots, shape, Method.DISTRIBUTED), robots), joint,
                    target=60e6 / robots, tolerance=None)
            )  # fmt: skip
    return out
