"""What a base will be doing when a command takes hold: exact for pieces of constant commands, humble when it is not."""

from dataclasses import replace

import numpy as np
import pytest

from outrider.team.navigator import Fused
from outrider.team.reaction import Reaction

SECOND = 1_000_000_000


def fused(t_s: float, x: float, y: float, heading: float, v: tuple[float, float], w: float) -> Fused:
    q = np.array([0.0, 0.0, np.sin(0.5 * heading), np.cos(0.5 * heading)])
    p, velocity = np.array([x, y, 0.0]), np.array([*v, 0.0])
    return Fused(t=round(t_s * SECOND), p=p, v=velocity, q=q, heading=heading, w=w, P=np.eye(3) * 1e-4)


def test_without_commands_or_delay_nothing_changes() -> None:
    here = fused(5.0, 1.0, 2.0, 0.3, (0.4, 0.1), 0.2)
    assert Reaction(seconds=0.2).ahead(here) is here
    told = Reaction(seconds=0.0)
    told.told(4.0, np.array([0.5, 0.0, 0.0]))
    assert told.ahead(here) is here


def test_commands_on_their_way_are_carried_out() -> None:
    late = Reaction(seconds=0.2)
    late.told(4.5, np.array([0.5, 0.0, 0.0]))
    late.told(4.9, np.array([0.4, 0.1, 0.5]))
    ahead = late.ahead(fused(5.0, 1.0, 2.0, 0.5 * np.pi, (0.0, 0.5), 0.0))
    # 0.1 s at 0.5 m/s to the north, then 0.1 s of a circle of 0.4, 0.1 m/s and 0.5 rad/s
    middle, chord = 0.5 * np.pi + 0.025, 0.1 * np.sinc(0.025 / np.pi)
    c, s = np.cos(middle), np.sin(middle)
    expected = [1.0 + chord * (c * 0.4 - s * 0.1), 2.05 + chord * (s * 0.4 + c * 0.1)]
    np.testing.assert_allclose(ahead.p[:2], expected, atol=1e-12)
    assert ahead.heading == pytest.approx(0.5 * np.pi + 0.05) and ahead.w == 0.5
    c, s = np.cos(ahead.heading), np.sin(ahead.heading)
    np.testing.assert_allclose([c * ahead.v[0] + s * ahead.v[1], c * ahead.v[1] - s * ahead.v[0]], [0.4, 0.1])


def test_a_base_that_does_not_obey_is_taken_as_it_moves() -> None:
    late = Reaction(seconds=0.2)
    late.told(4.0, np.array([0.8, 0.0, 0.0]))
    held_up = fused(5.0, 1.0, 2.0, 0.0, (0.1, 0.0), 0.0)
    assert late.ahead(held_up) is held_up
    lost = replace(held_up, v=np.full(3, np.nan))
    assert late.ahead(lost) is lost


def test_a_ramp_is_followed_as_late_as_the_sum_of_delay_and_lag() -> None:
    """A base with a delay of 0.05 s and a lag of 0.1 s under a command that grows evenly, integrated finely."""
    delay, lag, rate, dt = 0.05, 0.1, 0.6, 1e-4
    v = x = 0.0
    late = Reaction(seconds=delay + lag)
    for k in range(20):
        late.told(0.1 * k, np.array([rate * 0.1 * k, 0.0, 0.0]))
    places: list[tuple[float, float]] = []
    for i in range(22_000):
        t = i * dt
        u = rate * 0.1 * np.floor(min(max(t - delay, 0.0), 1.9) / 0.1 + 1e-9)
        places.append((x, v))
        x, v = x + v * dt, v + (u - v) / lag * dt
    now, then = places[round(1.95 / dt)], places[round(2.1 / dt)]
    ahead = late.ahead(fused(1.95, now[0], 0.0, 0.0, (now[1], 0.0), 0.0))
    assert abs(ahead.p[0] - then[0]) < 0.01 and abs(ahead.v[0] - then[1]) < 0.04
