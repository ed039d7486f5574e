"""Rigid rotorcraft: mechanics that nobody may break, and a controller that flies."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from outrider.core.rotations import quats_to_matrices
from outrider.errors import ConfigError
from outrider.models.vehicles import LEVEL, ROW_F, ROW_P, ROW_Q, ROW_SIZE, ROW_V, ROW_W, Rotor, Rotorcraft, ring
from outrider.models.vehicles.airborne import X_Q, X_W
from outrider.models.vehicles.rigid import X_ROTORS
from outrider.models.vehicles.rotorcraft import mixer
from outrider.typing import Floats

QUAD, HEXA = Rotorcraft(), Rotorcraft.hexarotor()
both = pytest.mark.parametrize("craft", [QUAD, HEXA], ids=["quad", "hexa"])
SPUN = (0.6, -0.3, 2.0)
START = np.array([1.0, 2.0, 500.0])


def fly(
    craft: Rotorcraft, u: Floats, x: Floats | None = None, wind: Floats | None = None, ground: Floats = LEVEL
) -> Floats:
    x = craft.start(START, 0.4) if x is None else x.copy()
    out = np.empty((len(u), ROW_SIZE + len(craft.rotors)))
    craft.run(
        x, np.ascontiguousarray(u), np.zeros((len(u), 3)) if wind is None else np.tile(wind, (len(u), 1)), ground, out
    )
    return out


def held(craft: Rotorcraft, u: tuple[float, ...], seconds: float) -> Floats:
    return np.tile(np.array(u), (round(seconds / craft.step_s), 1))


def falling(craft: Rotorcraft, w: tuple[float, float, float] = SPUN) -> Floats:
    """Turning at w with rotors that stand still."""
    x = craft.launch(START, np.array([0.1, -0.2, 0.3, 0.9]) / np.sqrt(0.95), np.array([3.0, -1.0, 4.0]))
    x[X_ROTORS : X_ROTORS + 2 * len(craft.rotors)] = 0.0
    x[X_W : X_W + 3] = w
    return x


@both
def test_free_fall_keeps_energy_and_angular_momentum_and_feels_nothing(craft):
    craft = replace(craft, direct=True, drag=(0.0, 0.0, 0.0), inertia=(0.02, 0.035, 0.05))
    out = fly(craft, np.zeros((400, len(craft.rotors))), falling(craft))
    J, m, g = np.array(craft.inertia), craft.mass, craft.gravity
    v, w, R = out[:, ROW_V : ROW_V + 3], out[:, ROW_W : ROW_W + 3], quats_to_matrices(out[:, ROW_Q : ROW_Q + 4])
    energy = 0.5 * m * (v**2).sum(axis=1) + m * g * out[:, ROW_P + 2] + 0.5 * (J * w * w).sum(axis=1)
    momentum = np.einsum("nij,nj->ni", R, J * w)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-11)
    np.testing.assert_allclose(momentum, np.tile(momentum[0], (len(out), 1)), atol=1e-9)
    np.testing.assert_allclose(out[:, ROW_F : ROW_F + 3], 0.0, atol=1e-12)
    assert np.ptp(w, axis=0).min() > 0.01  # it tumbles


def test_an_unbalanced_body_precesses_but_drag_takes_energy():
    craft = replace(QUAD, direct=True)
    out = fly(craft, np.zeros((400, 4)), falling(craft))
    v = out[:, ROW_V : ROW_V + 3]
    energy = 0.5 * craft.mass * (v**2).sum(axis=1) + craft.mass * craft.gravity * out[:, ROW_P + 2]
    assert (np.diff(energy) < 0.0).all()


def test_runge_kutta_converges_with_the_fourth_power_of_the_step():
    """Against scipy's integrator of the same equations, written anew, with rotors that spin up unevenly."""
    craft = replace(QUAD, direct=True)
    goals, wind = np.array([480.0, 510.0, 470.0, 520.0]), np.array([2.0, -1.0, 0.5])
    x = falling(craft)
    J, D, M = np.array(craft.inertia), np.array(craft.drag), mixer(craft.rotors)

    def derivative(t: float, s: Floats) -> Floats:
        q, v, w = s[3:7] / np.linalg.norm(s[3:7]), s[7:10], s[10:13]
        speeds = goals * (1.0 - np.exp(-t / craft.rotor_lag_s))
        T, *torque = M @ speeds**2
        R = quats_to_matrices(q)
        a = R @ (np.array([0.0, 0.0, T]) - D * (R.T @ (v - wind))) / craft.mass - [0.0, 0.0, craft.gravity]
        x, y, z, s_ = q
        Q = np.array([[s_, -z, y], [z, s_, -x], [-y, x, s_], [-x, -y, -z]])
        return np.concatenate([v, 0.5 * Q @ w, a, (torque - np.cross(w, J * w)) / J])

    exact = solve_ivp(derivative, (0.0, 0.8), x[:13], rtol=1e-12, atol=1e-13).y[:, -1]
    errors = []
    for step in (0.02, 0.01, 0.005):
        fine = replace(craft, step_s=step)
        out = fly(fine, np.tile(goals, (round(0.8 / step), 1)), x, wind)[-1]
        errors.append(np.abs(out[:13] - exact).max())
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert errors[-1] < 1e-6, errors
    assert (orders > 3.7).all(), (errors, orders)


@both
def test_hover_is_an_equilibrium_and_costs_the_weight(craft):
    out = fly(craft, held(craft, (0.0, 0.0, 0.0, 0.0), 5.0))
    np.testing.assert_allclose(out[:, :3], np.tile(START, (len(out), 1)), atol=1e-9)
    np.testing.assert_allclose(out[:, ROW_F : ROW_F + 3], [[0.0, 0.0, craft.gravity]] * len(out), atol=1e-9)
    thrust = (mixer(craft.rotors) @ out[-1, ROW_SIZE:] ** 2)[0]
    assert thrust == pytest.approx(craft.mass * craft.gravity)


@both
@pytest.mark.parametrize("u", [(2.0, -1.0, 0.5, 0.3), (-3.0, 4.0, -1.0, -0.8), (0.0, 0.0, 0.0, 1.0)])
def test_it_reaches_the_commanded_velocity_and_yaw_rate(craft, u):
    out = fly(craft, held(craft, u, 15.0), wind=np.array([3.0, 1.0, 0.0]))
    late = out[-400:]
    np.testing.assert_allclose(late[:, ROW_V : ROW_V + 3].mean(axis=0), u[:3], atol=0.05)
    np.testing.assert_allclose(np.linalg.norm(late[:, ROW_W : ROW_W + 3], axis=1).mean(), abs(u[3]), atol=0.05)


def test_its_answer_is_that_of_a_first_order_lag():
    """Seen from outside it is a `Multirotor`: 63 % after about tau, no more than a few per cent too much."""
    out = fly(QUAD, held(QUAD, (2.0, 0.0, 0.0, 0.0), 8.0))
    v = out[:, ROW_V] / 2.0
    reached = QUAD.step_s * np.argmax(v > 1.0 - np.exp(-1.0))
    assert QUAD.tau_s < reached < 2.0 * QUAD.tau_s
    assert v.max() < 1.2
    assert abs(v[-1] - 1.0) < 0.05


@settings(max_examples=8)
@given(seed=st.integers(0, 999))
def test_rotor_speeds_stay_within_their_limits(seed):
    u = np.repeat(np.random.default_rng(seed).normal(0.0, 20.0, (6, 4)), 100, axis=0)
    out = fly(QUAD, u)
    assert out[:, ROW_SIZE:].max() <= QUAD.max_speed
    assert out[:, ROW_SIZE:].min() >= QUAD.min_speed
    assert (quats_to_matrices(out[:, ROW_Q : ROW_Q + 4])[:, 2, 2] > 0.0).all()  # never upside down


@both
def test_signs_of_roll_pitch_yaw(craft):
    """More thrust on the left rolls right (+x), in front pitches up (-y), on clockwise rotors turns left (+z)."""
    craft = replace(craft, direct=True, rotor_lag_s=0.01)
    x = craft.launch(START, np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3))
    base = x[X_ROTORS : X_ROTORS + len(craft.rotors)]
    for axis, more in (
        (0, [r.y for r in craft.rotors]),
        (1, [-r.x for r in craft.rotors]),
        (2, [-r.spin for r in craft.rotors]),
    ):
        out = fly(craft, np.tile(base + 20.0 * np.round(more, 9), (20, 1)), x)
        w = out[-1, ROW_W : ROW_W + 3]
        assert w[axis] > 0.01
        assert np.abs(np.delete(w, axis)).max() < 0.05 * w[axis]


@both
@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.1, -0.05)])
def test_it_takes_off_lands_rests_and_takes_off_again(craft, slope):
    ground = np.array([[*slope, 0.0, 0.0, 0.0]])
    stay, up = held(craft, (0.0,) * 4, 1.0), held(craft, (0.3, 0.0, 1.0, 0.0), 5.0)
    down = held(craft, (0.0, 0.0, -0.8, 0.0), 12.0)
    out = fly(craft, np.vstack([stay, up, down, up]), craft.start(np.array([4.0, 1.0, 0.0]), 0.4), ground=ground)
    above = out[:, 2] - out[:, :2] @ slope
    landed = len(stay) + len(up) + len(down) - 1
    assert (out[: len(stay)] == out[0]).all()
    assert above[len(stay) + len(up) - 1] > 3.0
    assert abs(above[landed]) < 1e-12
    assert not out[landed, ROW_V:ROW_F].any()
    assert (out[landed] == out[landed - 100])[:ROW_SIZE].all()
    assert above.min() > -0.06
    assert above[-1] > 3.0


def test_saturated_rotors_give_up_yaw_before_attitude():
    weak = replace(QUAD, max_speed=560.0)
    x = weak.launch(START, np.array([0.3, 0.0, 0.0, 1.0]) / np.sqrt(1.09), np.zeros(3))
    out = fly(weak, held(weak, (0.0, 0.0, 0.0, 1.5), 6.0), x)
    assert quats_to_matrices(out[-1, X_Q : X_Q + 4])[2, 2] > 0.99


def test_layouts_that_cannot_fly_are_refused():
    same = tuple(replace(r, spin=1) for r in ring(4, 0.25))
    row = tuple(Rotor(x=0.1 * i, y=0.0, spin=1 if i % 2 else -1) for i in range(-2, 3))
    for rotors in (same, row, ring(4, 0.25)[:3], ()):
        with pytest.raises(ConfigError, match="independently"):
            Rotorcraft(rotors=rotors)
    for wrong in ({"mass": 9.0}, {"mass": 0.01}, {"rotors": tuple(replace(r, x=r.x + 1.0) for r in ring(4, 0.25))}):
        with pytest.raises(ConfigError, match="hover"):
            Rotorcraft(**wrong)
    for wrong in ({"inertia": (0.1, 0.0, 0.1)}, {"drag": (-1.0, 0.0, 0.0)}, {"rotors": (Rotor(x=0.0, y=0.0, spin=2),)}):
        with pytest.raises(ConfigError):
            Rotorcraft(**wrong)
