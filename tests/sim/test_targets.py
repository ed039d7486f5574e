"""What a target is told to do, and what becomes of its fixes."""

import numpy as np
import pytest

from outrider.sim.targets import Behaviour, displaced, heard, target_velocity


def told(b: Behaviour, t: float) -> np.ndarray:
    out = np.empty(3)
    target_velocity(b.code, t, 30.0, 2.0, np.pi / 2, out)
    return out


@pytest.mark.parametrize("behaviour", list(Behaviour))
def test_before_its_moment_it_flies_north(behaviour: Behaviour) -> None:
    still = behaviour is Behaviour.HOVER
    np.testing.assert_allclose(told(behaviour, 20.0), [0.0, 0.0 if still else 2.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("behaviour", "t", "velocity"),
    [
        (Behaviour.STRAIGHT, 40.0, [0, 2, 0]),
        (Behaviour.TURN, 29.5, [0, 1, 0]),
        (Behaviour.TURN, 30.5, [-1, 0, 0]),
        (Behaviour.TURN, 32.0, [-2, 0, 0]),
        (Behaviour.STOP, 30.0, [0, 0, 0]),
        (Behaviour.REVERSE, 30.0, [0, -2, 0]),
        (Behaviour.CLIMB, 31.0, [0, 2**0.5, 2**0.5]),
        (Behaviour.SPEEDS, 31.0, [0, 0.6, 0]),
        (Behaviour.SPEEDS, 35.0, [0, 2, 0]),
        (Behaviour.SILENT, 30.5, [0, 2, 0]),
        (Behaviour.SILENT, 31.0, [0, 0, 0]),
        (Behaviour.JUMP, 31.0, [0, 0, 0]),
    ],
)
def test_at_its_moment(behaviour: Behaviour, t: float, velocity: list[float]) -> None:
    np.testing.assert_allclose(told(behaviour, t), velocity, atol=1e-12)


def test_signals() -> None:
    assert heard(Behaviour.SILENT.code, 29.9, 30.0)
    assert not heard(Behaviour.SILENT.code, 30.0, 30.0)
    assert heard(Behaviour.JUMP.code, 31.0, 30.0)
    assert [displaced(Behaviour.JUMP.code, t, 30.0) for t in (29.9, 30.0, 34.9, 35.0)] == [0.0, 50.0, 50.0, 0.0]
    assert displaced(Behaviour.STOP.code, 31.0, 30.0) == 0.0
