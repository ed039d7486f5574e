"""Local planning: a warm re-plan of the elastic band beside CasADi with IPOPT on the same task with hard limits, and
with at least the clearance that the band has.

The peer's answers are kept warm, too: it starts from the band that is re-planned. Time to the goal and clearance of
both stand beside the speed, which says nothing without them; `python -m benchmarks.driving` prints every seed.
"""

from functools import cache, partial

import numpy as np

from benchmarks.table import Row, Side
from outrider.data.driving import DriveLimits, LocalPlan, Situation, Steering
from outrider.data.footprint import Footprint
from outrider.data.surroundings import Surroundings
from outrider.planning.local.teb import Teb, TebSettings
from outrider.safety.stopping import moved

BASE = DriveLimits(
    steering=Steering.DIFFERENTIAL, forward=0.4, backward=0.2, turn=0.3, acceleration=0.5, turn_acceleration=0.5
)
RADIUS, GAP, PERIOD, SEEDS = 0.05, 0.45, 0.1, 8
TASKS = {"5 m, 25 obstacles": (5.0, 25), "10 m, 50 obstacles": (10.0, 50)}


def planner(ways=4):
    """With the scan for other ways (every fifth answer) or, ways = 1, without."""
    settings = TebSettings(gap=GAP, reach=12.0, ways=ways, explore=0.5 if ways > 1 else 1e9)
    return Teb(limits=BASE, footprint=Footprint.circle(RADIUS), settings=settings)


@cache
def started(span, count, seed=0):
    """A robot that has driven for two seconds: situation, last answer, and the situation one period later."""
    rng, p = np.random.default_rng(seed), planner()
    points = np.column_stack([rng.uniform(1.0, span - 1.0, count), rng.uniform(-3.0, 3.0, count)])
    now = Situation(
        time=0.0, pose=np.zeros(3), goal=np.array([span, 0.0, 0.0]), surroundings=Surroundings.points(points)
    )
    last = None
    for _ in range(21):
        last = p.plan(now, last)
        pose = moved(now.pose, last.twist, np.array([PERIOD]))[0]
        now = Situation(
            time=now.time + PERIOD, pose=pose, goal=now.goal, twist=last.twist, surroundings=now.surroundings
        )
    return now, last


def replans(task, ways):
    """A function that answers the same question again and again; with `ways` > 1 every fifth looks for other ways."""
    p = planner(ways)

    def run(events):
        now, last = started(*TASKS[task])
        for k in range(events):
            explored = -np.inf if ways > 1 and k % 5 == 0 else np.inf
            plan = p.plan(now, _since(last, explored))
        return np.array([plan.duration, plan.clearance])

    return run


def _since(last, explored):
    from dataclasses import replace

    return replace(last, explored=explored) if isinstance(last, LocalPlan) else last


@cache
def program(n, count):
    """min sum T subject to hard limits of velocity, acceleration and clearance, without slip; built once per size."""
    import casadi as ca

    z, given, points = ca.MX.sym("z", 4, n), ca.MX.sym("given", 8), ca.MX.sym("points", 2, count)
    constraints, low, high, u = [], [], [], []

    def within(e, a, b):
        constraints.append(e), low.append(a), high.append(b)

    for i in range(n - 1):
        T, turned = z[3, i + 1] - z[3, i], z[2, i + 1] - z[2, i]
        m = 0.5 * (z[2, i] + z[2, i + 1])
        dx, dy = z[0, i + 1] - z[0, i], z[1, i + 1] - z[1, i]
        u.append((ca.vertcat(ca.cos(m) * dx + ca.sin(m) * dy, turned)) / T)
        within(ca.cos(m) * dy - ca.sin(m) * dx, 0.0, 0.0)
        within(u[-1][0], -BASE.backward, BASE.forward)
        within(u[-1][1], -BASE.turn, BASE.turn)
        within(T, 0.02, 0.6)
        if i > 0:
            within(z[3, i + 1] - 2 * z[3, i] + z[3, i - 1], 0.0, 0.0)
    u = [given[5:7], *u, ca.DM.zeros(2)]
    for k in range(n):
        tau = z[3, min(k + 1, n - 1)] - z[3, max(k - 1, 0)]
        a = 2.0 * (u[k + 1] - u[k]) / tau
        within(a[0], -BASE.acceleration, BASE.acceleration)
        within(a[1], -BASE.turn_acceleration, BASE.turn_acceleration)
    for i in range(1, n - 1):
        for j in range(count):
            d2 = ca.sumsqr(z[:2, i] - points[:, j])
            within(d2 - given[7] ** 2, 0.0, np.inf)
    for k in range(3):
        within(z[k, 0] - given[k], 0.0, 0.0)
    within(z[3, 0], 0.0, 0.0)
    within(z[:2, n - 1] - given[3:5], np.zeros(2), np.zeros(2))
    within(z[2, n - 1], 0.0, 0.0)
    options = {"ipopt.print_level": 0, "print_time": False, "ipopt.max_iter": 150, "ipopt.sb": "yes"}
    options |= {"ipopt.warm_start_init_point": "yes", "ipopt.mu_init": 1e-3, "ipopt.tol": 1e-4}
    nlp = {"x": ca.vec(z), "f": z[3, n - 1], "g": ca.vertcat(*constraints), "p": ca.vertcat(given, ca.vec(points))}
    bounds = np.hstack([np.ravel(x) for x in low]), np.hstack([np.ravel(x) for x in high])
    return ca.nlpsol("band", "ipopt", nlp, options), *bounds


def solved(now, start):
    """The peer's band from a start (n, 4), and whether IPOPT converged."""
    points = now.surroundings.discs[:, :2]
    solver, low, high = program(len(start), len(points))
    room = min(clearance(start, now), GAP) + RADIUS  # it may pass as near as the start does
    x0 = start.copy()
    x0[:, 2] = np.unwrap(x0[:, 2])
    p = np.concatenate([now.pose, now.goal[:2], now.twist[[0, 2]], [room], points.ravel()])
    answer = solver(x0=x0.ravel(), p=p, lbg=low, ubg=high)
    return np.array(answer["x"]).reshape(-1, 4), bool(solver.stats()["success"])


def peer(task):
    """IPOPT from the band that is re-planned."""

    def run(events):
        now, last = started(*TASKS[task])
        start = planner(1).plan(now, _since(last, np.inf)).band
        for _ in range(min(events, 2)):  # the comparison of results asks for more than anybody waits for
            z, _ok = solved(now, start)
        return np.array([z[-1, 3], clearance(z, now)])

    return run


def clearance(z, now):
    """Least room of the disc along a band, at its knots."""
    discs = now.surroundings.discs
    return float(np.hypot(z[:, 0, None] - discs[:, 0], z[:, 1, None] - discs[:, 1]).min() - RADIUS)


def compared(task):
    """(seed, ours s, m, IPOPT's s, m, whether it converged) of every seed."""
    for seed in range(SEEDS):
        now, last = started(*TASKS[task], seed)
        ours = planner(1).plan(now, _since(last, np.inf))
        z, ok = solved(now, ours.band)
        yield seed, ours.duration, clearance(ours.band, now), z[-1, 3], clearance(z, now), ok


def quality(task):
    """In one line."""
    cases = np.array([row[1:5] for row in compared(task) if row[5]])
    time, room = 100.0 * (cases[:, 0] / cases[:, 2] - 1.0), 100.0 * (cases[:, 1] / cases[:, 3] - 1.0)
    near = int(((time < 5.0) & (room > -5.0)).sum())
    figures = f"time {np.median(time):+.1f} % (worst {time.max():+.1f}), clearance {room.min():+.1f} % at worst"
    return f"of {SEEDS} seeds IPOPT converged in {len(cases)}, ours within 5 % in {near}: {figures}"


def rows():
    """Rows of this module."""
    return [
        row
        for task, target in (("5 m, 25 obstacles", 1300.0), ("10 m, 50 obstacles", 3000.0))
        for row in (
            Row(
                f"elastic band, warm re-plan, {task}, one way",
                Side("Teb.plan", replans(task, 1), 60),
                [Side("CasADi + IPOPT, hard limits, warm", peer(task), 2)],
                target=target,
                tolerance=None,
                quality=partial(quality, task),
            ),
            Row(
                f"elastic band, warm re-plan, {task}, other ways looked for every fifth time",
                Side("Teb.plan", replans(task, 4), 60),
                target=target,
            ),
        )
    ]


def main():
    """Time to the goal and clearance of both, seed by seed."""
    print("task | seed | ours s, m | IPOPT s, m (converged)")
    for task in TASKS:
        for seed, t, room, t_peer, room_peer, ok in compared(task):
            print(f"{task} | {seed} | {t:.2f}, {room:.3f} | {t_peer:.2f}, {room_peer:.3f} ({ok})")


if __name__ == "__main__":
    main()
