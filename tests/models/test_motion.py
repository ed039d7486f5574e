"""Laws that every process model obeys, by registry: a new model inherits them."""

import numpy as np
import pytest

from outrider.core.manifold import local, retract
from outrider.models import kinematics as kin
from outrider.models.motion import (
    LAYOUTS,
    DriftingRover,
    EulerBody,
    LaggedFollower,
    Motion,
    OdometricRobot,
    OmnidirectionalBody,
    PlanarRobot,
    StrapdownIns,
    kinematic_view,
    propagate,
)

PARAMETERS = {
    Motion.PLANAR: PlanarRobot(gnss_bias=1.0, range_bias=2.0),
    Motion.STRAPDOWN: StrapdownIns(gnss_bias=1.0, gnss_bias_up=2.0, wind_walk=0.1),
    Motion.OMNIDIRECTIONAL: OmnidirectionalBody(),
    Motion.FOLLOWER: LaggedFollower(lag=0.7),
    Motion.DRIFTING: DriftingRover(gnss_bias=1.0, gyro_bias_walk=0.1),
    Motion.EULER: EulerBody(gnss_bias=1.0, accel_bias_walk=0.1, gyro_bias_walk=0.1),
    Motion.ODOMETRIC: OdometricRobot(),
}
ALL = sorted(Motion)


def draw(motion, rng):
    """A random state, input and workspace."""
    layout = LAYOUTS[motion]
    x = layout.zeros()
    retract(x, rng.normal(size=layout.error_size), layout.table)
    return layout, x, rng.normal(size=6) + np.array([0, 0, 0, 0, 0, 9.8])


def step(motion, x, dt, u):
    """Propagate a copy; returns x, F, Q."""
    n = LAYOUTS[motion].error_size
    x, F, Q = x.copy(), np.eye(n), np.zeros((n, n))
    propagate(int(motion), x, dt, u, PARAMETERS[motion].theta(), F, Q)
    return x, F, Q


def seen(motion, x, u):
    """Kinematic view of a state; returns k, K."""
    k, K = np.zeros(kin.K_SIZE), np.zeros((kin.T_SIZE, LAYOUTS[motion].error_size))
    kinematic_view(int(motion), x, u, PARAMETERS[motion].theta(), k, K)
    return k, K


def test_every_model_has_parameters_and_layout():
    assert set(PARAMETERS) == set(LAYOUTS) == set(Motion)


def numeric_jacobian(motion, x, dt, u, h=1e-6):
    """F by central differences on the manifold."""
    layout = LAYOUTS[motion]
    numeric = np.zeros((layout.error_size, layout.error_size))
    for j in range(layout.error_size):
        ends = []
        for sign in (1, -1):
            d = np.zeros(layout.error_size)
            d[j] = sign * h
            moved = x.copy()
            retract(moved, d, layout.table)
            ends.append(step(motion, moved, dt, u)[0])
        d = np.zeros(layout.error_size)
        local(ends[0], ends[1], layout.table, d)
        numeric[:, j] = d / (2 * h)
    return numeric


@pytest.mark.parametrize("motion", ALL)
def test_jacobian_matches_finite_differences(motion, rng):
    for _ in range(5):
        _, x, u = draw(motion, rng)
        _, F, _ = step(motion, x, 0.002, u)
        numeric = numeric_jacobian(motion, x, 0.002, u)
        # Blocks that matter only to second order in dt are left out of F: at 2 ms they are below 1e-4.
        assert np.abs(F - numeric).max() < 1e-4 * max(1.0, np.abs(numeric).max())


@pytest.mark.parametrize("motion", [m for m in ALL if "attitude" in LAYOUTS[m]])
@pytest.mark.parametrize("turn", [0.0, 1e-5, 0.2, 0.31, 1.5, 3.0, 7.0, 40.0])
def test_attitude_jacobians_hold_for_a_turn_of_any_size(motion, turn, rng):
    """What an attitude error does to everything, and everything to the attitude, in a step that turns by `turn` rad."""
    layout, x, u = draw(motion, rng)
    dt, axis = 0.1, rng.normal(size=3)
    rate = turn / dt * axis / np.linalg.norm(axis)
    if "rate" in layout:
        x[layout.state("rate")] = rate
    else:
        u[:3] = rate + x[layout.state("gyro_bias")]
    F, numeric, a = step(motion, x, dt, u)[1], numeric_jacobian(motion, x, dt, u), layout.error("attitude")
    np.testing.assert_allclose(F[a], numeric[a], atol=1e-7)
    np.testing.assert_allclose(F[:, a], numeric[:, a], atol=1e-7)
    np.testing.assert_allclose(F[a, a] @ F[a, a].T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("motion", ALL)
def test_view_jacobian_matches_finite_differences(motion, rng):
    layout = LAYOUTS[motion]
    for _ in range(5):
        _, x, u = draw(motion, rng)
        h = 1e-6
        k0, K = seen(motion, x, u)
        R0 = k0[kin.K_R : kin.K_R + 9].reshape(3, 3)
        numeric = np.zeros_like(K)
        for j in range(layout.error_size):
            d = np.zeros(layout.error_size)
            d[j] = h
            up, down = x.copy(), x.copy()
            retract(up, d, layout.table)
            retract(down, -d, layout.table)
            k1, k2 = seen(motion, up, u)[0], seen(motion, down, u)[0]
            numeric[kin.T_P : kin.T_P + 3, j] = k1[:3] - k2[:3]
            tilt = R0.T @ (k1[3:12] - k2[3:12]).reshape(3, 3)
            numeric[kin.T_TH : kin.T_TH + 3, j] = [tilt[2, 1], tilt[0, 2], tilt[1, 0]]
            numeric[kin.T_V :, j] = k1[kin.K_V :] - k2[kin.K_V :]
        assert np.abs(K - numeric / (2 * h)).max() < 1e-7 * max(1.0, np.abs(K).max())


@pytest.mark.parametrize("motion", ALL)
def test_noise_is_a_covariance_and_grows_with_time(motion, rng):
    _, x, u = draw(motion, rng)
    small, large = step(motion, x, 0.01, u)[2], step(motion, x, 0.1, u)[2]
    for Q in (small, large):
        assert np.array_equal(Q, Q.T)
        assert np.linalg.eigvalsh(Q).min() > -1e-12
    assert np.trace(large) > np.trace(small) > 0


@pytest.mark.parametrize("motion", ALL)
def test_two_half_steps_make_one(motion, rng):
    _, x, u = draw(motion, rng)
    whole = step(motion, x, 0.01, u)[0]
    halves = step(motion, step(motion, x, 0.005, u)[0], 0.005, u)[0]
    assert np.abs(whole - halves).max() < 2e-4


def test_strapdown_at_rest_stays_at_rest():
    model = StrapdownIns()
    x = LAYOUTS[Motion.STRAPDOWN].zeros()
    for _ in range(100):
        x, _, _ = step(Motion.STRAPDOWN, x, 0.01, np.array([0, 0, 0, 0, 0, model.gravity]))
    assert np.abs(x - LAYOUTS[Motion.STRAPDOWN].zeros()).max() < 1e-12


def test_planar_circle_closes():
    x = LAYOUTS[Motion.PLANAR].zeros()
    x[LAYOUTS[Motion.PLANAR].state("velocity")] = [1.0, 0.0]
    x[LAYOUTS[Motion.PLANAR].state("yaw_rate")] = 0.5
    steps = 4000
    for _ in range(steps):
        x = step(Motion.PLANAR, x, 2 * np.pi / 0.5 / steps, np.zeros(6))[0]
    assert np.abs(x[:3]).max() < 1e-5


def test_follower_reaches_its_command():
    x = LAYOUTS[Motion.FOLLOWER].zeros()
    for _ in range(100):
        x = step(Motion.FOLLOWER, x, 0.1, np.array([2.0, -1.0, 0.5, 0, 0, 0]))[0]
    assert np.allclose(x[3:], [2.0, -1.0, 0.5], atol=1e-5)


def own_coordinates(motion, x, h=1e-6):
    """d state / d error at x, where no rotation is: from errors of a stretched vector to those of the vector itself."""
    layout = LAYOUTS[motion]
    T = np.zeros((layout.size, layout.error_size))
    for j in range(layout.error_size):
        d = np.zeros(layout.error_size)
        d[j] = h
        ahead, behind = x.copy(), x.copy()
        retract(ahead, d, layout.table)
        retract(behind, -d, layout.table)
        T[:, j] = (ahead - behind) / (2 * h)
    return T


@pytest.mark.parametrize("scale", [-0.3, 0.0, 0.04, 0.5])
def test_the_scale_of_the_wheels_changes_no_noise_of_the_motion(scale):
    """Q and F in plain coordinates: an acceleration is as large, and a walking scale moves nothing, at every scale."""
    layout, dt, robot = LAYOUTS[Motion.PLANAR], 0.1, PARAMETERS[Motion.PLANAR]
    plain = {}
    for s in (scale, 0.0):
        x = layout.zeros()
        x[layout.state("velocity")], x[layout.state("heading")] = [1.5, 0.2], 0.7
        x[layout.state("wheel_scale")] = s
        end, F, Q = step(Motion.PLANAR, x, dt, np.zeros(6))
        T, back = own_coordinates(Motion.PLANAR, end), np.linalg.inv(own_coordinates(Motion.PLANAR, x))
        plain[s] = T @ Q @ T.T, T @ F @ back
    np.testing.assert_allclose(plain[scale][0], plain[0.0][0], atol=1e-10)
    np.testing.assert_allclose(plain[scale][1], plain[0.0][1], atol=1e-8)
    v, s = layout.state("velocity"), layout.state("wheel_scale")
    assert plain[scale][0][v, v][0, 0] == pytest.approx(robot.acceleration**2 * dt)
    assert np.abs(plain[scale][0][v, s]).max() < 1e-12
    assert np.abs(plain[scale][1][layout.state("position"), s]).max() < 1e-8  # a speed that is known moves as it says
