"""Wheels as odometry: exact where nothing slips, in doubt where the wheels contradict one another."""

from dataclasses import replace

import numpy as np
import pytest

from outrider.data import Kind, stream
from outrider.models.motion import Motion
from outrider.models.vehicles import Differential
from outrider.models.wheels import WheelKinematics
from outrider.scenarios.amr2025 import wheels
from outrider.scenarios.navigation import channels_of, filter_of
from outrider.sim.sensors import BodyTwist, GnssReceiver
from outrider.sim.truth import EPOCH
from outrider.sim.world import World
from outrider.team import Navigator
from outrider.team.odometry import Odometry

EIGHT = WheelKinematics(tuple((x, y, g) for x, y, g in wheels()))
TWISTS = np.array([[0.8, 0.0, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, 1.0], [0.5, -0.2, 0.3]])


def test_eight_wheels_that_roll_give_back_the_twist() -> None:
    told = Odometry(name="encoders", inverse=EIGHT.inverse).twist(
        stream("encoders", Kind.WHEELS, np.arange(4), EIGHT.rims(TWISTS))
    )
    assert told.kind is Kind.TWIST and told.name == "encoders"
    np.testing.assert_allclose(told.z[:, [0, 1, 5]], TWISTS, atol=1e-12)
    # eight wheels of 0.02 m/s: 1 / sqrt(8) of it forward and sideways
    np.testing.assert_allclose(np.sqrt(told.var[:, :2]), 0.02 / np.sqrt(8.0), rtol=1e-9)
    assert np.isnan(told.var[:, 2:5]).all()


def test_a_wheel_that_slips_puts_all_in_doubt() -> None:
    rims = EIGHT.rims(TWISTS[:1])
    rims[0, 3] += 0.5
    told = Odometry(name="encoders", inverse=EIGHT.inverse).twist(stream("encoders", Kind.WHEELS, np.arange(1), rims))
    residual = np.linalg.norm(EIGHT.slip(rims[0]))
    assert residual > 0.3
    expected = residual / np.sqrt(5.0) / np.sqrt(8.0)
    np.testing.assert_allclose(np.sqrt(told.var[0, :2]), expected, rtol=1e-9)


def test_two_wheels_know_nothing_of_sideways() -> None:
    told = Odometry(name="encoders", inverse=Differential(track=0.5).inverse).twist(
        stream("encoders", Kind.WHEELS, np.arange(1), np.array([[0.9, 1.1]]))
    )
    np.testing.assert_allclose(told.z[0], [1.0, 0.0, 0.0, 0.0, 0.0, 0.4], atol=1e-12)
    assert np.isnan(told.var[0, 1]) and told.var[0, 0] == pytest.approx(0.02**2 / 2.0)


def test_the_yaw_rate_counts_once_the_wheels_have_stood() -> None:
    """In pieces as they arrive: at 50 Hz a turn, then 0.6 s of rest."""
    rims = np.vstack([EIGHT.rims(np.tile([0.0, 0.0, 0.5], (10, 1))), np.zeros((30, 8))])
    t = np.arange(40) * 20_000_000
    own = Odometry(name="encoders", inverse=EIGHT.inverse)
    parts = [own.twist(stream("encoders", Kind.WHEELS, t[k : k + 5], rims[k : k + 5])) for k in range(0, 40, 5)]
    resting = np.concatenate([p.var[:, 5] for p in parts]) < 1e-5
    assert not resting[: 9 + 15].any() and resting[9 + 15 :].all()  # 0.3 s after the tenth record


def test_a_channel_of_wheels_at_rest_hears_them_online() -> None:
    """Records that come 0.1 s at a time make the estimate that they make at once: rest counts across pieces."""
    world, carried = World(name="yard"), (GnssReceiver(), BodyTwist(name="wheels", rolling=False))
    moving = channels_of(carried, Motion.PLANAR)
    (wheels,) = (c for c in moving if c.stream == "wheels")
    still = replace(wheels, name="wheels (at rest)", still=True, trust_stated=False, sigma=0.01 * wheels.sigma)
    f, prior = filter_of((*moving, still), carried, Motion.PLANAR, (0.0, 0.0, 0.0, 0.0), world)
    z, t = np.zeros((40, 6)), EPOCH + np.arange(1, 41) * 50_000_000
    z[:10, 0], z[:10, 5] = 0.5, 0.2
    whole, pieces = (Navigator(f, prior, EPOCH, world.datum) for _ in range(2))
    whole.take([stream("wheels", Kind.TWIST, t, z)])
    for k in range(0, 40, 2):
        pieces.take([stream("wheels", Kind.TWIST, t[k : k + 2], z[k : k + 2])])
    ends = [nav.now(int(t[-1])) for nav in (whole, pieces)]
    np.testing.assert_array_equal(ends[0].p, ends[1].p)
    np.testing.assert_array_equal(ends[0].P, ends[1].P)
    assert ends[0].w == ends[1].w
