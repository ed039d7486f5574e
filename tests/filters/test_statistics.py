"""Honesty: for every filter and process model, errors and innovations are as large as the filter says, and no larger.

Truth is drawn from the model itself: starts from P0, steps with noise Q, records with noise R. Over many seeds the
mean NEES at the end and the mean NIS of all updates must lie inside 99.9 % chi-square bounds that hold for the whole
table at once; a filter with a wrong R, a wrong Q or a biased sensor must leave them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pytest
from support import COMPILED, channel, prior

from outrider.core.manifold import local, retract
from outrider.core.rotations import quat_exp, quat_multiply
from outrider.data import Gaussian
from outrider.eval.consistency import average_bounds, chi_square
from outrider.filters.channels import Records
from outrider.filters.engine import Events, Filter, Track, queue, run_batch
from outrider.filters.generic import EnsembleKalman, Estimator, Extended, Measurement, Unscented, Vehicle
from outrider.filters.step import OUT_DOF, OUT_NIS, OUT_VERDICT, ROWS
from outrider.models.kinematics import K_SIZE, T_SIZE
from outrider.models.motion import (
    LaggedFollower,
    Motion,
    OmnidirectionalBody,
    PlanarRobot,
    StrapdownIns,
    kinematic_view,
)
from outrider.models.sensors import (
    Airspeed,
    Attitude,
    Baro,
    BodyVelocity,
    GnssPosition,
    GnssVelocity,
    Gyro,
    Heading,
    Mount,
    Position,
    Range,
    Sensor,
    SensorModel,
    SpecificForce,
    Twist,
    simulate,
)
from outrider.typing import Floats
from published import publish

monte_carlo = pytest.mark.compiled
DT, STEPS = 0.1, 80 if COMPILED else 5
SEEDS, MISMATCHED = 60, 12
LEVER = Mount(lever_arm=(0.3, -0.1, 0.5))
PROBABILITY, TESTS = 0.999, 32  # four filters, four models, two statistics


# ------------------------------------------------------------------------------------------------ problems


@dataclass(frozen=True)
class Look:
    """A sensor, how often it looks (every so many steps), and which rows count."""

    model: SensorModel
    every: int
    use: tuple[int, ...] | None = None

    @property
    def r(self) -> Floats:
        """(ROWS,) variances, infinite where unused."""
        sigma = self.model.sigmas()
        r = np.full(ROWS, np.inf)
        rows = range(sigma.size) if self.use is None else self.use
        r[list(rows)] = sigma[list(rows)] ** 2
        return r


@dataclass(frozen=True)
class Problem:
    """A vehicle, where it starts, what it is told, what it sees."""

    vehicle: Vehicle
    belief: Gaussian
    looks: tuple[Look, ...]
    inputs: Callable[[float], tuple[float, ...]] = lambda t: (0.0,) * 6

    def u(self, k: int) -> Floats:
        return np.array(self.inputs(k * DT))


def _problem(motion: Motion, theta: Floats, looks: tuple[Look, ...], mean: dict, sd: dict, **rest) -> Problem:
    v = Vehicle(motion, theta)
    x = v.layout.zeros()
    for name, value in mean.items():
        x[v.layout.state(name)] = value
    assert set(sd) == set(v.layout.blocks)  # every state has a spread: NEES needs a full covariance
    return Problem(v, prior(v.layout, 1.0, x, **sd), looks, **rest)


def planar() -> Problem:
    model = PlanarRobot(acceleration=0.3, lateral=0.05, yaw_acceleration=0.1, gnss_bias=0.3, gnss_time=20.0,
                        range_bias=0.3, range_time=50.0)  # fmt: skip
    looks = (
        Look(Gyro(sigma=0.01), 1, (2,)),
        Look(Twist(sigma_forward=0.05, sigma_lateral=0.05, sigma_yaw=0.05), 1, (0, 1, 5)),
        Look(GnssPosition(mount=LEVER, sigma_horizontal=0.1, sigma_vertical=0.2), 2, (0, 1)),
        Look(Range(beacon=(25.0, 15.0, 2.0), sigma=0.1), 5),
    )
    sd = {"position": 0.5, "heading": 0.05, "velocity": 0.1, "yaw_rate": 0.05, "gyro_bias": 0.01, "wheel_scale": 0.02,
          "gnss_bias": 0.3, "range_bias": 0.3}  # fmt: skip
    return _problem(Motion.PLANAR, model.theta(), looks, {"velocity": (1.5, 0.0), "yaw_rate": 0.1}, sd)


def strapdown() -> Problem:
    model = StrapdownIns(gnss_bias=0.3, gnss_bias_up=0.5, gnss_time=20.0, wind_walk=0.05)
    looks = (
        Look(GnssPosition(mount=LEVER, sigma_horizontal=0.2, sigma_vertical=0.3), 2),
        Look(GnssVelocity(mount=LEVER, sigma_horizontal=0.1, sigma_vertical=0.1), 2),
        Look(Baro(sigma=0.2), 1),
        Look(Heading(sigma=0.03), 4),
        Look(Airspeed(sigma=0.3), 1),
    )
    sd = {"position": 0.5, "velocity": 0.2, "attitude": 0.03, "gyro_bias": 0.005, "accel_bias": 0.05,
          "gnss_bias": (0.3, 0.3, 0.5), "wind": 0.5, "baro_bias": 0.5}  # fmt: skip

    def weaving(t: float) -> tuple[float, ...]:
        return 0.1 * np.sin(t), 0.05, 0.2 * np.cos(0.7 * t), 0.5 * np.sin(t), 0.8 * np.sin(0.7 * t), 9.80665

    return _problem(Motion.STRAPDOWN, model.theta(), looks, {"velocity": (9.0, 1.0, 0.0)}, sd, inputs=weaving)


def omnidirectional() -> Problem:
    looks = (
        Look(Attitude(sigma_tilt=0.02, sigma_yaw=0.03), 1),
        Look(Gyro(sigma=0.02), 1),
        Look(SpecificForce(sigma=0.1), 1),
        Look(BodyVelocity(mount=LEVER, sigma=0.05), 2),
        Look(Position(mount=LEVER, sigma=0.1), 2),
    )
    sd = {"position": 0.5, "attitude": 0.05, "velocity": 0.2, "rate": 0.1, "acceleration": 0.2}
    mean = {"velocity": (1.0, 0.2, 0.0), "rate": (0.0, 0.0, 0.2)}
    return _problem(Motion.OMNIDIRECTIONAL, OmnidirectionalBody().theta(), looks, mean, sd)


def follower() -> Problem:
    model = LaggedFollower(lag=2.0, acceleration=0.5)
    looks = (
        Look(Position(sigma=0.1), 2),
        Look(GnssVelocity(sigma_horizontal=0.1, sigma_vertical=0.1), 2),
        Look(Range(beacon=(30.0, 5.0, 10.0), sigma=0.1), 1),
    )
    sd = {"position": 0.5, "velocity": 0.3}
    return _problem(Motion.FOLLOWER, model.theta(), looks, {"velocity": (1.0, 0.0, 0.2)}, sd)


PROBLEMS = {"planar": planar, "strapdown": strapdown, "omnidirectional": omnidirectional, "follower": follower}


# ------------------------------------------------------------------------------------------------ truth


class Trial(NamedTuple):
    """One draw: the truth (STEPS + 1, size), and per look the steps it looked at and its records (n, ROWS)."""

    x: Floats
    z: list[dict[int, Floats]]


def draw_state(rng, x: Floats, P: Floats, table) -> Floats:
    """x [+] e with e ~ N(0, P), P perhaps singular."""
    values, vectors = np.linalg.eigh(P)
    out = x.copy()
    retract(out, vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(values.size)), table)
    return out


def trial(p: Problem, seed: int) -> Trial:
    """Truth and records from the model itself."""
    rng, v, table = np.random.default_rng([seed, int(p.vehicle.motion)]), p.vehicle, p.vehicle.layout.table
    x = draw_state(rng, p.belief.x, p.belief.P, table)
    truth, z = [x], [{} for _ in p.looks]
    for k in range(1, STEPS + 1):
        X, _, Q = v.moved(x[None], DT, 0.5 * (p.u(k - 1) + p.u(k)))
        x = draw_state(rng, X[0], Q, table)
        truth.append(x)
        kin, K = np.zeros(K_SIZE), np.zeros((T_SIZE, v.layout.error_size))
        kinematic_view(int(v.motion), x, p.u(k), v.theta, kin, K)
        for look, records in zip(p.looks, z, strict=True):
            if k % look.every == 0:
                records[k] = noisy(look.model, kin, rng)
    return Trial(np.array(truth), z)


def noisy(model: SensorModel, kin: Floats, rng) -> Floats:
    """(ROWS,) what the sensor reads of a kinematic state, with its own noise."""
    z, sigma = np.zeros(2 * ROWS), model.sigmas()
    m = simulate(int(model.code), kin, model.theta(), z)
    assert m == sigma.size
    noise = sigma * rng.standard_normal(m)
    if model.code is Sensor.ATTITUDE:
        turn, turned = np.zeros(4), np.zeros(4)
        quat_exp(noise, turn)
        quat_multiply(z[:4].copy(), turn, turned)
        z[:4] = turned
    else:
        first = 1 if model.code is Sensor.RANGE else 0
        z[first : first + m] += noise
    return z[:ROWS].copy()


# ------------------------------------------------------------------------------------------------ filters


class Score(NamedTuple):
    """One run: NEES at the end, the sum of NIS over all updates, the sum of their degrees of freedom."""

    nees: float
    nis: float
    dof: int


Runner = Callable[[Problem, Trial, int], Score]


def nees(p: Problem, b: Gaussian, truth: Floats) -> float:
    e = np.zeros(p.vehicle.layout.error_size)
    local(truth, b.x, p.vehicle.layout.table, e)
    return float(chi_square(e, b.P))


def by_engine(p: Problem, data: Trial, seed: int) -> Score:
    """The extended filter as logs get it: channels, a queue, the compiled loop. Gates are open: they would clip NIS."""
    v = p.vehicle
    channels = [channel(f"look {i}", look.model, probability=1.0) for i, look in enumerate(p.looks)]
    parts = []
    for look, records in zip(p.looks, data.z, strict=True):
        z = np.array(list(records.values()))
        parts.append(_records(np.array(list(records)), z, np.tile(look.r, (len(records), 1))))
    if v.motion is Motion.STRAPDOWN:
        steps = np.arange(STEPS + 1)
        u = np.zeros((steps.size, ROWS))
        u[:, :6] = [p.u(int(k)) for k in steps]
        channels, parts = [channel("imu", None), *channels], [_records(steps, u, np.ones((steps.size, ROWS))), *parts]
    f = Filter(motion=v.motion, theta=v.theta, coasting=v.theta, channels=tuple(channels))
    total = np.zeros(2)

    def add(_: int, __: Events, out: Floats, ___: Track) -> None:
        fused = out[:, OUT_DOF] > 0
        assert not out[fused, OUT_VERDICT].any()  # all of them used
        total[:] += out[fused, OUT_NIS].sum(), out[fused, OUT_DOF].sum()

    s = run_batch(f, p.belief, 0.0, queue(parts, 0, 2.0), add, period=1e9)
    return Score(nees(p, Gaussian(s.x, s.P, v.layout), data.x[-1]), float(total[0]), int(total[1]))


def _records(steps, z: Floats, r: Floats) -> Records:
    t = np.rint(np.asarray(steps) * DT * 1e9).astype(np.int64)
    return Records(t, t, np.ascontiguousarray(z), r, np.zeros(t.size, np.int64), np.arange(t.size))


def by_steps(make: Callable[[int], Estimator]) -> Runner:
    """Any filter, step by step."""

    def run(p: Problem, data: Trial, seed: int) -> Score:
        f, v = make(seed), p.vehicle
        b, nis, dof = f.start(p.belief), 0.0, 0
        looks = [(look, look.model.theta(), look.r[: look.model.sigmas().size]) for look in p.looks]
        for k in range(1, STEPS + 1):
            b = f.predict(v, b, DT, 0.5 * (p.u(k - 1) + p.u(k)))
            for (look, theta, r), records in zip(looks, data.z, strict=True):
                if k in records:
                    done = f.update(v, b, p.u(k), Measurement(look.model.code, theta, records[k], r))
                    assert done.dof > 0
                    b, nis, dof = done.belief, nis + done.nis, dof + done.dof
        return Score(nees(p, f.moments(b), data.x[-1]), nis, dof)

    return run


MEMBERS = 600 if COMPILED else 200
FILTERS: dict[str, Runner] = {
    "EKF": by_engine,
    "UKF": by_steps(lambda seed: Unscented()),
    "EnKF": by_steps(lambda seed: EnsembleKalman(MEMBERS, np.random.default_rng([seed, 1]))),
    "ETKF": by_steps(lambda seed: EnsembleKalman(MEMBERS, np.random.default_rng([seed, 2]), square_root=True)),
}


# ------------------------------------------------------------------------------------------------ verdicts


class Row(NamedTuple):
    """A line of the table: means per degree of freedom, and their bounds."""

    nees: float
    nees_bounds: tuple[float, float]
    nis: float
    nis_bounds: tuple[float, float]

    @property
    def inside(self) -> bool:
        return self.nees_inside and self.nis_inside

    @property
    def nees_inside(self) -> bool:
        return self.nees_bounds[0] <= self.nees <= self.nees_bounds[1]

    @property
    def nis_inside(self) -> bool:
        return self.nis_bounds[0] <= self.nis <= self.nis_bounds[1]


def trials(p: Problem, seeds: int) -> list[Trial]:
    return [trial(p, seed) for seed in range(seeds)]


def assess(run: Runner, believed: Problem, draws: list[Trial]) -> Row:
    """What a filter that believes a problem makes of draws, from this or from another."""
    scores = [run(believed, data, seed) for seed, data in enumerate(draws)]
    n, dof = believed.vehicle.layout.error_size, sum(s.dof for s in scores)
    values = np.array([s.nees for s in scores])
    assert np.isfinite(values).all()
    low, high = average_bounds(n, len(draws), probability=PROBABILITY, tests=TESTS)
    nis_bounds = average_bounds(1.0, dof, probability=PROBABILITY, tests=TESTS)
    return Row(float(values.mean()) / n, (low / n, high / n), sum(s.nis for s in scores) / dof, nis_bounds)


# ------------------------------------------------------------------------------------------------ mismatches


@dataclass(frozen=True)
class Scaled:
    """A sensor whose noise is believed to be other than it is."""

    model: SensorModel
    factor: float

    @property
    def code(self) -> Sensor:
        return self.model.code

    def theta(self) -> Floats:
        return self.model.theta()

    def sigmas(self) -> Floats:
        return self.factor * self.model.sigmas()


@dataclass(frozen=True)
class Biased(Scaled):
    """A sensor of position or heading that is off by `factor` of its deviations; nothing in the model explains it."""

    def sigmas(self) -> Floats:
        return self.model.sigmas()


def wrong_r(p: Problem, variance: float) -> Problem:
    """Every R believed `variance` times what it is."""
    return replace(p, looks=tuple(replace(look, model=Scaled(look.model, variance**0.5)) for look in p.looks))


# the entries of theta that are deviations of the process noise (variances for the omnidirectional body)
NOISE = {Motion.PLANAR: (0, 1, 3, 4, 5), Motion.STRAPDOWN: (0, 1, 3, 7), Motion.FOLLOWER: (1,)}


def wrong_q(p: Problem, variance: float) -> Problem:
    """The process noise believed `variance` times what it is."""
    theta = p.vehicle.theta.copy()
    if p.vehicle.motion is Motion.OMNIDIRECTIONAL:
        theta[:15] *= variance
    else:
        theta[list(NOISE[p.vehicle.motion])] *= variance**0.5
    return replace(p, vehicle=replace(p.vehicle, theta=theta))


def shifted(data: Trial, p: Problem) -> Trial:
    """Speeds (of the omnidirectional body: positions, too) read 3 deviations too much, all the time."""
    moved = [{k: z.copy() for k, z in records.items()} for records in data.z]
    for look, records in zip(p.looks, moved, strict=True):
        if look.model.code in (Sensor.TWIST, Sensor.GNSS_VELOCITY, Sensor.BODY_VELOCITY):
            for z in records.values():
                z[0] += 3.0 * look.model.sigmas()[0]
    return Trial(data.x, moved)


def biased(run: Runner) -> Runner:
    return lambda p, data, seed: run(p, shifted(data, p), seed)


MISMATCHES: dict[str, Callable[[Problem, Runner], tuple[Problem, Runner]]] = {
    "R / 4": lambda p, run: (wrong_r(p, 0.25), run),
    "R x 4": lambda p, run: (wrong_r(p, 4.0), run),
    "Q / 10": lambda p, run: (wrong_q(p, 0.1), run),
    "Q x 10": lambda p, run: (wrong_q(p, 10.0), run),
    "biased speed": lambda p, run: (p, biased(run)),
}


# ------------------------------------------------------------------------------------------------ tests


def test_the_engine_is_the_extended_filter():
    """Same records, same NEES and NIS as the pure steps: the loop adds nothing of its own."""
    plain = by_steps(lambda seed: Extended())
    for make in PROBLEMS.values():
        p = make()
        data = trial(p, 0)
        np.testing.assert_allclose(by_engine(p, data, 0), plain(p, data, 0), rtol=1e-6)


def test_filters_agree_where_the_problem_is_nearly_linear():
    p = follower()
    data = trial(p, 0)
    exact = by_engine(p, data, 0)
    np.testing.assert_allclose(FILTERS["UKF"](p, data, 0), exact, rtol=0.02)
    for name in ("EnKF", "ETKF"):
        np.testing.assert_allclose(FILTERS[name](p, data, 0)[1:], exact[1:], rtol=0.1)


@monte_carlo
@pytest.mark.parametrize("problem", PROBLEMS)
def test_the_extended_filter_is_honest(problem):
    p = PROBLEMS[problem]()
    assert assess(FILTERS["EKF"], p, trials(p, 60)).inside


@monte_carlo
@pytest.mark.parametrize("mismatch", MISMATCHES)
@pytest.mark.parametrize("problem", PROBLEMS)
def test_a_mismatched_extended_filter_is_found_out(problem, mismatch):
    p = PROBLEMS[problem]()
    believed, run = MISMATCHES[mismatch](p, FILTERS["EKF"])
    assert not assess(run, believed, trials(p, MISMATCHED)).inside


@monte_carlo
@pytest.mark.parametrize("filter_", ["UKF", "EnKF", "ETKF"])
@pytest.mark.parametrize("problem", ["planar", "follower"])
def test_other_filters_are_honest_on_small_problems(problem, filter_):
    p = PROBLEMS[problem]()
    assert assess(FILTERS[filter_], p, trials(p, 8)).inside


@monte_carlo
@pytest.mark.parametrize("square_root", [False, True], ids=["EnKF", "ETKF"])
def test_an_ensemble_not_corrected_for_its_size_is_over_confident(square_root):
    p = planar()
    draws, results = trials(p, 10), []
    for correction in (False, True):
        run = by_steps(
            lambda seed, correction=correction: EnsembleKalman(
                100, np.random.default_rng(seed), square_root=square_root, correction=correction
            )
        )
        results.append(assess(run, p, draws))
    assert results[0].nees > results[0].nees_bounds[1] > results[1].nees


@pytest.mark.evidence
def test_every_filter_on_every_model():
    """The whole table, at least 50 seeds; written to docs/evidence/consistency.md."""
    rows, failed = [], []
    for problem, make in PROBLEMS.items():
        p = make()
        draws = trials(p, SEEDS)
        for name, run in FILTERS.items():
            row = assess(run, p, draws)
            rows.append((name, problem, "none", row, "consistent" if row.inside else "NOT consistent"))
            if not row.inside:
                failed.append((name, problem, row))
            for mismatch, change in MISMATCHES.items():
                believed, changed = change(p, run)
                row = assess(changed, believed, draws[:MISMATCHED])
                rows.append((name, problem, mismatch, row, "NOT noticed" if row.inside else "noticed"))
                if row.inside:
                    failed.append((name, problem, mismatch, row))
    publish(
        "consistency",
        "Consistency of every filter on every process model",
        f"Truth is drawn from the model: starts from P0, steps with Q, records with R ({STEPS} steps of {DT} s; "
        f"{SEEDS} seeds, {MISMATCHED} for the mismatched; ensembles of {MEMBERS}). NEES is taken at the end, NIS over "
        "all updates, both per degree of freedom: 1 is honest, more is over-confident. Bounds hold for the "
        f"{TESTS} statistics of the matched filters at once with {100 * PROBABILITY} %. A mismatched filter must leave "
        "them. The EKF is the engine's compiled loop, the others are the pure steps of `outrider.filters.generic`.",
        ("filter", "model", "mismatch", "NEES", "bounds", "NIS", "bounds", "verdict"),
        [(name, problem, mismatch, *cells(row), verdict) for name, problem, mismatch, row, verdict in rows],
    )
    assert not failed


def cells(row: Row) -> tuple[str, ...]:
    bounds = ["{:.2f} to {:.2f}".format(*row.nees_bounds), "{:.3f} to {:.3f}".format(*row.nis_bounds)]
    return f"{row.nees:.2f}", bounds[0], f"{row.nis:.3f}", bounds[1]
