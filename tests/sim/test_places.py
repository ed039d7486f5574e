"""The places are what their descriptions say."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from outrider.core import solids
from outrider.sim.places import LEGS, open_field, parked_airliner


@pytest.mark.parametrize("place", [open_field, parked_airliner])
def test_every_place_is_possible_and_has_room_at_its_origin(place) -> None:
    world = place()
    world.validate()
    assert world.name
    assert world.clearance(np.array([[0.0, 0.0, 0.5]]))[0] > 0.9


@pytest.mark.parametrize(("sharklets", "span"), [(False, 34.1), (True, 35.8)])
def test_the_airliner_has_the_size_of_an_a320(sharklets: bool, span: float) -> None:
    """Measured from far away along each axis: the distance field ends where the aircraft does."""
    world, far = parked_airliner(sharklets=sharklets), 1e7
    eye = np.vstack([-far * np.eye(3), far * np.eye(3)])
    low, high = np.split((far - world.clearance(eye)) * [-1, -1, -1, 1, 1, 1], 2)
    assert_allclose(high - low, [span, 37.57, 11.76], rtol=0, atol=0.01)
    assert_allclose(low, [-0.5 * span, 1.0, 0.0], rtol=0, atol=0.001)
    assert_allclose(solids.extent(world.solids.table), [low, high], rtol=0, atol=1e-3)


def test_the_airliner_stands_on_three_legs_nose_towards_the_origin() -> None:
    """North-east-down of the paper: x is north, y is east. Legs 5.07 m and 17.71 m behind the nose at x = 1 m."""
    world = parked_airliner()
    body = world.objects["airliner"]
    feet, up = np.array([body.feature(name) for name in LEGS]), np.array([0.0, 0.0, 0.3])
    assert_allclose(feet, [[0, 6.07, 0], [3.795, 18.71, 0], [-3.795, 18.71, 0]], atol=1e-12)
    assert world.nearest(feet + up) == LEGS
    assert (world.clearance(feet + up) < 0.0).all()
    under, beside = np.array([[0.0, 12.0, 1.0]]), np.array([[0.0, 12.0, 3.75]])
    assert world.clearance(under)[0] == pytest.approx(0.775)  # between ground and belly
    assert world.clearance(beside)[0] == pytest.approx(-1.975)  # on the axis
    assert "fuselage" in world.nearest(np.vstack([under, beside]))


def test_the_airliner_is_symmetric(rng) -> None:
    world, p = parked_airliner(sharklets=True), rng.uniform([0, -1, 0], [20, 40, 13], (300, 3))
    assert_allclose(world.clearance(p), world.clearance(p * [-1, 1, 1]), rtol=0, atol=1e-12)


def test_wings_hide_what_stands_behind_them() -> None:
    world = parked_airliner()
    below, above = np.array([[9.0, 19.0, 0.5]]), np.array([[9.0, 19.0, 8.0]])
    assert not world.sees(below, above)[0]
    aside = np.array([12.0, 0.0, 0.0])
    assert world.sees(below + aside, above + aside)[0]
    assert not world.sees(np.array([[-6.0, 15.0, 3.5]]), np.array([[6.0, 15.0, 3.5]]))[0]  # through the fuselage


def test_the_open_field_ends_at_its_fence() -> None:
    fence = open_field(100.0, ceiling=30.0).fence
    assert fence is not None
    assert_allclose(fence.margin(np.array([[0, 0, 1], [60, 0, 1], [0, 0, 31.0]])), [29, -10, -1])
