"""The reason that is named is the one without which the distance could be kept."""

import numpy as np
import pytest

from outrider.safety.separation import Hold, Separation, kept_apart
from outrider.safety.shortfall import Lack, lacking

X = Separation(distance=3.0, lag_s=1.0, acceleration=5.0, speed=2.5, other_lag_s=0.5)
AT = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def other(x: float, y: float = 0.0, vx: float = 0.0, vy: float = 0.0) -> np.ndarray:
    """Of the target."""
    return np.array([x, y, 0.0, vx, vy, 0.0])


def moving(v: float) -> np.ndarray:
    """The follower at the origin, eastwards."""
    return np.array([0.0, 0.0, 0.0, v, 0.0, 0.0])


SURE, VAGUE = np.zeros((6, 6)), np.diag([1.0, 1.0, 1.0, 0.3, 0.3, 0.3])
CASES = {
    Lack.INSIDE: (AT, other(2.0), SURE, 0.0),
    Lack.SPEED: (moving(6.0), other(5.0), SURE, 0.0),
    Lack.TURN: (AT, other(5.5, 0.0, 0.0, 2.4), SURE, 1.0),
    Lack.COVARIANCE: (AT, other(4.0), VAGUE, 0.2),
    Lack.DELAY: (moving(1.0), other(4.0, 0.0, 1.0, 1.0), SURE, 3.0),
}
MENDED = {
    Lack.SPEED: (AT, other(5.0), SURE, 0.0, X),
    Lack.TURN: (AT, other(5.5, 0.0, 0.0, 2.4), SURE, 1.0, Separation(
        distance=3.0, lag_s=1.0, acceleration=5.0, speed=2.5, other_lag_s=0.5, turn=0.0)),
    Lack.COVARIANCE: (AT, other(4.0), SURE, 0.2, X),
    Lack.DELAY: (moving(1.0), other(7.0, 3.0, 1.0, 1.0), SURE, 0.0, X),
}  # fmt: skip


@pytest.mark.parametrize("lack", CASES)
def test_every_reason_is_named(lack: Lack) -> None:
    own, target, P, age = CASES[lack]
    wish = np.array([1.0, 0.0, 0.0])
    assert kept_apart(wish, own, target, X, P=P, age_s=age)[1] is Hold.CANNOT_HOLD
    assert lacking(own, target, X, P, age) is lack


@pytest.mark.parametrize("lack", MENDED)
def test_without_it_the_distance_holds(lack: Lack) -> None:
    own, target, P, age, separation = MENDED[lack]
    assert kept_apart(np.array([1.0, 0.0, 0.0]), own, target, separation, P=P, age_s=age)[1] is not Hold.CANNOT_HOLD
