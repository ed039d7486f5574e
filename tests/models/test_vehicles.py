"""Laws that every vehicle obeys, whatever drives it. A new vehicle joins by its entry in `VEHICLES`."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from outrider import _kernel
from outrider.core.rotations import quats_conjugate, quats_exp, quats_log, quats_multiply, quats_to_matrices
from outrider.errors import ConfigError
from outrider.models import vehicles as m
from outrider.models.vehicles import LEVEL, ROW_F, ROW_P, ROW_Q, ROW_SIZE, ROW_V, ROW_W, first_row
from outrider.typing import Floats

VEHICLES: dict[str, Callable[..., Any]] = {
    "mecanum": m.Mecanum,
    "differential": lambda **k: m.Differential(axle=0.2, **k),
    "ackermann": lambda **k: m.Steered(rear=-0.3, **k),
    "four-wheel": lambda **k: m.Steered(rear=-0.4, both_axles=True, **k),
    "multirotor": m.Multirotor,
    "quadrotor": m.Rotorcraft,
    "hexarotor": lambda **k: replace(m.Rotorcraft.hexarotor(), **k),
}
GROUND = {"mecanum", "differential", "ackermann", "four-wheel"}
SLOPE = np.array([[0.08, -0.05, 0.0, 0.0, 0.0]])
P, Q, V = slice(ROW_P, ROW_P + 3), slice(ROW_Q, ROW_Q + 4), slice(ROW_V, ROW_V + 3)
W, F = slice(ROW_W, ROW_W + 3), slice(ROW_F, ROW_F + 3)
UP = np.array([0.0, 0.0, 1.0])
few = settings(max_examples=15, suppress_health_check=list(HealthCheck))
each = pytest.mark.parametrize("name", VEHICLES)


def steps(vehicle: m.Vehicle, seconds: float) -> int:
    return round(seconds / vehicle.step_s)


def at_rest(name: str, vehicle: m.Vehicle, height: float = 20.0) -> Floats:
    return vehicle.start(np.array([3.0, -2.0, 0.0 if name in GROUND else height]), 0.7)


def wander(vehicle: m.Vehicle, seconds: float, seed: int = 0, size: float = 1.0) -> Floats:
    """Smooth commands from rest to rest: sums of sines under an envelope."""
    rng, n = np.random.default_rng(seed), steps(vehicle, seconds)
    t = np.linspace(0.0, 1.0, n)[:, None]
    waves = sum(rng.normal(0.0, size / f, len(vehicle.inputs)) * np.sin(2.0 * np.pi * f * t + f) for f in (1, 2, 3))
    return np.asarray(waves * np.sin(np.pi * t) ** 2)


def moved(
    vehicle: m.Vehicle, x: Floats, u: Floats, *, ground: Floats = LEVEL, air: Floats | None = None
) -> tuple[Floats, Floats]:
    """(rows, state after) of commands u from state x, which is left alone."""
    x, out = x.copy(), np.full((len(u), ROW_SIZE + len(vehicle.actuators)), np.nan)
    vehicle.run(x, np.ascontiguousarray(u), np.zeros((len(u), 3)) if air is None else air, ground, out)
    return out, x


def with_first(vehicle: m.Vehicle, x: Floats, u: Floats, ground: Floats = LEVEL) -> Floats:
    """All rows from the start on."""
    return np.vstack([first_row(vehicle, x, ground), moved(vehicle, x, u, ground=ground)[0]])


def strapdown(rows: Floats, h: float, gravity: float) -> tuple[Floats, Floats, Floats]:
    """p, v, q at the end from w and f alone: trapezoidal in the body rate and in the rotated specific force."""
    p, v, q = rows[0, P].copy(), rows[0, V].copy(), rows[0, Q].copy()
    a0 = quats_to_matrices(q) @ rows[0, F] - gravity * UP
    for k in range(1, len(rows)):
        q = quats_multiply(q, quats_exp(0.5 * h * (rows[k - 1, W] + rows[k, W])))
        a1 = quats_to_matrices(q) @ rows[k, F] - gravity * UP
        p = p + h * v + h * h / 6.0 * (2.0 * a0 + a1)
        v, a0 = v + 0.5 * h * (a0 + a1), a1
    return p, v, q


@each
def test_all_rows_are_finite_and_attitudes_are_unit(name):
    vehicle = VEHICLES[name]()
    rows = with_first(vehicle, at_rest(name, vehicle), wander(vehicle, 4.0, size=5.0))
    assert np.isfinite(rows).all()
    np.testing.assert_allclose(np.linalg.norm(rows[:, Q], axis=1), 1.0, atol=1e-12)
    assert np.abs(rows[:, V]).max() > 0.5


@each
@pytest.mark.parametrize("ground", [LEVEL, SLOPE], ids=["level", "slope"])
def test_rate_and_specific_force_integrate_back_to_the_motion(name, ground):
    """The error falls with the square of the step: what is left is integration."""
    errors = []
    for step in (0.008, 0.004, 0.002):
        vehicle = VEHICLES[name](step_s=step)
        rows = with_first(vehicle, at_rest(name, vehicle), wander(vehicle, 2.0, seed=3, size=3.0), ground)
        p, v, q = strapdown(rows, step, vehicle.gravity)
        assert np.linalg.norm(rows[:, P] - rows[0, P], axis=1).max() > 0.3
        turn = np.linalg.norm(quats_log(quats_multiply(quats_conjugate(q), rows[-1, Q])))
        errors.append([np.linalg.norm(p - rows[-1, P]), np.linalg.norm(v - rows[-1, V]), turn])
    coarse, middle, fine = np.array(errors)
    assert (fine < 2e-4).all(), errors
    assert (fine < 0.3 * middle + 1e-9).all(), errors
    assert (middle < 0.3 * coarse + 1e-9).all(), errors


@each
def test_a_wrong_specific_force_does_not_integrate_back(name):
    vehicle = VEHICLES[name](step_s=0.002)
    rows = with_first(vehicle, at_rest(name, vehicle), wander(vehicle, 4.0, seed=3))
    rows[:, ROW_F] += 0.01
    assert np.linalg.norm(strapdown(rows, 0.002, vehicle.gravity)[0] - rows[-1, P]) > 0.02


@each
def test_velocity_and_rate_are_derivatives_of_the_pose(name):
    """v = dp/dt and w = (R' dR/dt)^vee by finite differences over a step, at its middle."""
    vehicle = VEHICLES[name](step_s=0.001)
    rows = with_first(vehicle, at_rest(name, vehicle), wander(vehicle, 4.0, seed=5), SLOPE)
    h = vehicle.step_s
    np.testing.assert_allclose(np.diff(rows[:, P], axis=0) / h, 0.5 * (rows[1:, V] + rows[:-1, V]), atol=1e-4)
    turned = quats_log(quats_multiply(quats_conjugate(rows[:-1, Q]), rows[1:, Q])) / h
    step = np.abs(np.diff(rows[:, W], axis=0)).max()
    assert np.abs(turned - 0.5 * (rows[1:, W] + rows[:-1, W])).max() <= 0.5 * step + 1e-9
    assert step < 0.05 * np.abs(rows[:, W]).max()


@each
def test_standing_still_one_feels_gravity_alone_and_stays(name):
    for ground in (LEVEL, SLOPE):
        vehicle = VEHICLES[name]()
        x = at_rest(name, vehicle, height=-5.0)  # below the ground: drones are put on it
        rows = with_first(vehicle, x, np.zeros((50, len(vehicle.inputs))), ground)
        assert (rows == rows[0]).all()
        a, b = ground[0, :2]
        assert rows[0, 2] == pytest.approx(a * rows[0, 0] + b * rows[0, 1], abs=1e-15)
        normal = np.array([-a, -b, 1.0]) / np.sqrt(1.0 + a * a + b * b)
        R = quats_to_matrices(rows[0, Q])
        np.testing.assert_allclose(R @ UP, normal, atol=1e-12)
        np.testing.assert_allclose(R @ rows[0, F], vehicle.gravity * UP, atol=1e-12)
        assert not rows[0, ROW_V:ROW_F].any()


@each
@few
@given(data=st.data(), latency=st.integers(0, 5))
def test_many_steps_at_once_and_in_pieces_give_the_same_bits(name, data, latency):
    vehicle = VEHICLES[name](latency_s=latency * 0.005)
    u = wander(vehicle, 1.0, seed=data.draw(st.integers(0, 1000)), size=6.0)
    air = np.random.default_rng(1).normal(0.0, 3.0, (len(u), 3))
    start = at_rest(name, vehicle, height=0.0)
    whole, end = moved(vehicle, start, u, ground=SLOPE, air=air)
    cuts = sorted({0, len(u), *data.draw(st.lists(st.integers(1, len(u) - 1), max_size=6))})
    x, pieces = start, []
    for a, b in pairwise(cuts):
        rows, x = moved(vehicle, x, u[a:b], ground=SLOPE, air=air[a:b])
        pieces.append(rows)
    assert np.concatenate(pieces).tobytes() == whole.tobytes()
    assert x.tobytes() == end.tobytes()


@each
@pytest.mark.parametrize("delay", [1, 7])
def test_latency_shifts_the_answer_by_exactly_so_many_steps(name, delay):
    prompt, late = VEHICLES[name](), VEHICLES[name](latency_s=delay * 0.005)
    u = wander(prompt, 1.0, seed=2, size=3.0)
    u[0] = 0.5
    now = moved(prompt, at_rest(name, prompt, 0.0), u)[0]
    then = moved(late, at_rest(name, late, 0.0), u)[0]
    rest = first_row(late, at_rest(name, late, 0.0))
    assert then[delay:].tobytes() == now[:-delay].tobytes()
    assert (then[:delay] == rest).all()
    assert not (now[0] == rest).all()


@each
def test_impossible_numbers_are_named(name):
    make = VEHICLES[name]
    for wrong in ({"latency_s": 0.0071}, {"latency_s": -1.0}, {"step_s": 0.0}, {"step_s": 10.0}, {"radius": np.nan}):
        with pytest.raises(ConfigError):
            make(**wrong)


@each
@pytest.mark.compiled
def test_compiled_and_plain_agree(name, monkeypatch):
    """The same vehicle with every kernel of its package replaced by the Python function below it."""
    import sys

    vehicle = VEHICLES[name](latency_s=0.01)
    u = wander(vehicle, 0.5, seed=4, size=4.0)
    start = at_rest(name, vehicle)
    compiled, _ = moved(vehicle, start, u, ground=SLOPE)
    for key, module in list(sys.modules.items()):
        if key.startswith("outrider.models.vehicles"):
            for attribute, value in list(vars(module).items()):
                if isinstance(value, _kernel.Kernel):
                    monkeypatch.setattr(module, attribute, value.py_func)
    plain, _ = moved(vehicle, start, u, ground=SLOPE)
    np.testing.assert_allclose(plain, compiled, rtol=1e-9, atol=1e-9)


@each
def test_gravity_is_that_of_the_vehicle(name):
    vehicle = VEHICLES[name](gravity=9.7)
    assert first_row(vehicle, at_rest(name, vehicle))[ROW_F + 2] == pytest.approx(9.7, rel=1e-14)
    assert replace(vehicle, gravity=9.9).gravity == 9.9
