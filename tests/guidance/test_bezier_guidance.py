"""Flying along the target's trail: never back, behind no point of it, slower near its end."""

import numpy as np
import pytest

from outrider.core.bezier import bezier
from outrider.errors import DataError
from outrider.guidance.bezier import Aim, aim_point, fly_along, trail_curve


def chase(aim: Aim | None, speed: float = 3.0, seconds: float = 60.0) -> tuple[np.ndarray, np.ndarray]:
    """(steps, 3) commands and (steps,) distances behind a target that turns at 60 m; once a second, lag 1 s."""
    v, p = np.zeros(3), np.array([20.0, 0.0, 7.0])
    commands, distances = list[np.ndarray](), list[float]()
    trail, u, step = list[np.ndarray](), np.zeros(3), 0
    for k in range(round(seconds * 10)):
        t = 0.1 * k
        q = np.array([0.0, 2.0 * t, 7.0]) if t < 30.0 else np.array([-2.0 * (t - 30.0), 60.0, 7.0])
        if k % 10 == 0:
            trail.append(q)
            if len(trail) >= 4:
                if aim is None:  # as printed: P(i / n), then the next curve
                    if step % 4 == 0:
                        curve = np.array(trail[-4:])
                    line = bezier(curve, (step % 4) / 3.0) - p
                    u = speed * line / np.linalg.norm(line)
                    step += 1
                else:
                    w = (trail[-1] - trail[-2]) / 1.0
                    u = fly_along(trail_curve(np.array(trail[-8:])), p, speed, aim, set_point=5.0, end_velocity=w)
        v = v + (u - v) * (1.0 - np.exp(-0.1))
        p = p + 0.1 * v
        commands.append(u)
        distances.append(float(np.linalg.norm(q - p)))
    return np.array(commands), np.array(distances)


def reversals(commands: np.ndarray) -> int:
    """How often one command points back against the one before, a second ago."""
    u = commands[::10]
    return int(((u[1:] * u[:-1]).sum(axis=1) < -1e-9).sum())


@pytest.mark.parametrize("aim", list(Aim))
def test_no_command_turns_round_and_it_stays_behind(aim: Aim) -> None:
    commands, distances = chase(aim)
    assert reversals(commands) == 0
    assert distances[450:].min() > 3.0
    assert distances[-1] == pytest.approx(5.0, abs=1.2)


def test_points_in_turn_as_printed_lie_behind_a_faster_follower() -> None:
    assert reversals(chase(None)[0]) > 5


def test_the_first_point_ahead_is_ahead_and_the_end_is_the_end() -> None:
    trail = np.array([[0.0, 0, 0], [2, 0, 0], [4, 0, 0], [6, 0, 0]])
    path = trail_curve(trail)
    np.testing.assert_allclose(aim_point(path, np.array([3.0, 1.0, 0.0]), Aim.AHEAD), [5.0, 0, 0], atol=1e-5)
    np.testing.assert_allclose(aim_point(path, np.array([9.0, 1.0, 0.0]), Aim.AHEAD), [6.0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(aim_point(path, np.zeros(3), Aim.END), [6.0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(trail_curve(trail, degree=2).at(0.0), [2.0, 0, 0])


def test_it_slows_down_before_the_end_of_a_target_that_stands() -> None:
    path = trail_curve(np.array([[0.0, 0, 0], [10.0, 0, 0]]))
    fast = [
        np.linalg.norm(fly_along(path, np.array([x, 0.0, 0.0]), 3.0, Aim.END, set_point=2.0)) for x in (0, 6, 7.9, 9)
    ]
    assert fast[0] > fast[1] > fast[2]
    assert fast[0] <= 3.0
    assert fast[3] == 0.0


def test_a_trail_of_one_place_is_said() -> None:
    for degree in (None, 3):
        with pytest.raises(DataError, match=r"two or more|hover"):
            trail_curve(np.zeros((4, 3)), degree=degree)
