"""What the simulator is worth, at length; written to docs/evidence/simulation.md."""

import subprocess
import sys
from math import inf

import numpy as np
import pytest
import shapely
from devices import sampled
from rovers import rover
from test_physics import ASIDE, GROUND, driven, gap
from test_sensing import allan, resting
from test_world import busy, flat_shape

from outrider.core.rotations import rpy_to_quats
from outrider.models.vehicles import Differential, Mecanum, Rotorcraft
from outrider.sim import Imu
from outrider.sim.engine import simulate
from outrider.sim.noise import gauss_markov
from outrider.sim.physics import MujocoRotorcraft, MujocoRover
from outrider.sim.world import World
from outrider.team import Schedule
from published import publish

pytestmark = pytest.mark.evidence
SEEDS = 20
AHEAD = Schedule(t_s=np.array([0.0]), u=np.array([[1.0, 0.0, 0.1]]))
HASH = (
    "from outrider.scenarios.build import build; from outrider.scenarios.files import load_scenario;"
    "print(build(*load_scenario('airliner-tour', {'duration_s': 20.0})).run().log.sha256)"
)


def same_bytes() -> tuple[str, bool]:
    """Two processes, one scenario of two robots with fourteen sensors."""
    runs = [subprocess.run([sys.executable, "-c", HASH], capture_output=True, text=True).stdout for _ in range(2)]
    return f"{runs[0][:12]}... and {runs[1][:12]}...", runs[0] == runs[1] and len(runs[0]) == 65


def undisturbed() -> tuple[str, bool]:
    """How much of one robot's noise changes when others join."""
    changed = 0
    for seed in range(SEEDS):
        alone = simulate(World(name="field"), [rover("a", agent=AHEAD)], 5.0, seed).log
        team = [rover("b", agent=AHEAD, start=(0.0, 9.0, 0.0, 0.0)), rover("a", agent=AHEAD)]
        both = simulate(World(name="field"), team, 5.0, seed).log
        changed += sum(both.streams[f"a/{name}"].z.tobytes() != s.z.tobytes() for name, s in alone.streams.items())
    return f"{changed} of {3 * SEEDS} streams changed", changed == 0


def against_shapely() -> tuple[str, bool]:
    """Ranges in random scenes against polygons."""
    rng, worst, beams = np.random.default_rng(7), 0.0, 0
    angles, reach = np.linspace(-np.pi, np.pi, 72, endpoint=False) + 0.01, 9.0
    for _ in range(SEEDS):
        world, t, yaw = busy(rng), rng.uniform(0.0, 25.0), rng.uniform(-3, 3)
        shape, o = flat_shape(world, t), np.array([*rng.uniform(-8, 7, 2), 0.5])
        ranges = world.scan(o, rpy_to_quats(np.array([[0.0, 0.0, yaw]]))[0], angles, reach, t)
        for angle, found in zip((angles + yaw).tolist(), ranges.tolist(), strict=True):
            beam = shapely.LineString([o[:2], o[:2] + reach * np.array([np.cos(angle), np.sin(angle)])])
            met = beam.intersection(shape)
            expected = inf if met.is_empty else shapely.Point(o[:2]).distance(met)
            beams += 1
            worst = max(worst, 0.0 if found == expected else abs(found - expected))
    return f"{worst:.1e} m at worst, {beams} beams in {SEEDS} scenes", worst <= 1e-6


def allan_deviation() -> tuple[str, bool]:
    """White noise of an IMU at rest, from its records."""
    rng, off = np.random.default_rng(3), 0.0
    for density in (1e-4, 2e-3):
        imu = Imu(rate_hz=100.0, gyro_density=density, accel_density=10 * density)
        z = sampled(imu, resting(1000.0, 100.0), rng).z
        for m in (10, 100, 300):
            asked = density / np.sqrt(m / 100.0)
            off = max(off, abs(allan(z[:, :3], m) / asked - 1.0), abs(allan(z[:, 3:], m) / (10 * asked) - 1.0))
    return f"{100 * off:.1f} % off at worst, over 0.1 to 3 s", off <= 0.1


def autocorrelation() -> tuple[str, bool]:
    """Of a Gauss-Markov process of 20 s, at 10 s, against exp(-1/2)."""
    x = gauss_markov(np.random.default_rng(5), 400_000, 1, 0.5, 1.0, 20.0)[:, 0]
    found = float((x[:-20] * x[20:]).mean() / x.var())
    return f"{found:.3f}, asked {np.exp(-0.5):.3f}", abs(found - np.exp(-0.5)) < 0.03


def physics() -> list[tuple[str, str, str, bool]]:
    """Ours and MuJoCo's under the same commands."""
    air = [[(3.0, first), (3.0, (0.0, 1.0, 0.0, 0.0))] for first in ((2.0, 0, 0, 0), (0, 0, 1.0, 0.3), (1, 1, -0.3, 0))]
    rows = []
    for name, ours, theirs, plans, p in (
        ("differential on contacts", Differential(), MujocoRover(design=Differential()), GROUND, (0, 0, 0)),
        ("mecanum on rollers", Mecanum(), MujocoRover(design=Mecanum()), GROUND[:2] + ASIDE, (0, 0, 0)),
        ("rotorcraft", Rotorcraft(), MujocoRotorcraft(), air, (0, 0, 9)),
    ):
        gaps = [gap(driven(ours, plan, p), driven(theirs, plan, p)) for plan in plans]
        share, turn = max(g[0] / max(g[1], 0.2) for g in gaps), max(g[2] for g in gaps)
        figure = f"{100 * share:.1f} % of the way, {turn:.2f} deg at worst, {len(plans)} command sequences"
        rows.append((f"{name}, ours against MuJoCo", figure, "5 %, 3 deg", share <= 0.05 and turn <= 3.0))
    return rows


def test_what_the_simulator_shows() -> None:
    rows = [
        ("two processes, one seed: hash of the log", *same_bytes(), "equal"),
        (f"one robot's records when another joins, seeds 0 to {SEEDS - 1}", *undisturbed(), "none"),
        ("lidar against shapely, seed 7", *against_shapely(), "1e-6 m"),
        ("Allan deviation of a white IMU, seed 3", *allan_deviation(), "10 %"),
        ("autocorrelation of Gauss-Markov errors, seed 5", *autocorrelation(), "0.03"),
    ]
    table = [(what, figure, bound, good) for what, figure, good, bound in rows] + physics()
    publish(
        "simulation",
        "The simulator",
        "Each figure is asserted. Speed stands in [benchmarks](benchmarks.md); sign tests, lever arms, wheel "
        "kinematics, energy and latency are laws of `make test` (tests/sim, tests/models).",
        ("what", "figure", "bound"),
        [(what, figure, bound) for what, figure, bound, _ in table],
    )
    assert all(good for *_, good in table), [what for what, *_, good in table if not good]
