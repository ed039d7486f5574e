"""Trails, spacing and its stability, and the order of a column."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.errors import ConfigError, UsageError
from outrider.guidance.column import Spacing, along, latest, pace, place
from outrider.guidance.formation import Column, join, leave, merge, split
from outrider.typing import Floats

NAMES = ("a", "b", "c", "d")
COLUMN = Column(NAMES, "target")


def circle(radius: float = 40.0, turns: float = 2.0) -> Floats:
    """A trail of 1 m steps, about, with its arc length."""
    angle = np.linspace(0.0, 2.0 * np.pi * turns, round(2.0 * np.pi * turns * radius))
    p = radius * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    return np.column_stack([p, np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(p, axis=0).T))])])


@settings(max_examples=50)
@given(st.floats(1.0, 480.0), st.floats(-3.0, 3.0), st.floats(-4.0, 4.0))
def test_the_arc_length_is_that_of_the_angle(s: float, aside: float, off: float) -> None:
    trail, R = circle(), 40.0
    x, y = (R + aside) * np.sin(s / R), R - (R + aside) * np.cos(s / R)
    got, k = along(trail, len(trail), s + off, x, y)
    assert got == pytest.approx(s, abs=0.06)
    p = place(trail, len(trail), k, got)
    assert np.hypot(p[0] - x, p[1] - y) == pytest.approx(abs(aside), abs=0.01)


def test_where_a_trail_crosses_itself_the_near_pass_counts_and_beyond_its_ends_it_goes_straight_on() -> None:
    trail = circle()
    assert along(trail, len(trail), 5.0, 3.0, 0.0)[0] == pytest.approx(3.0, abs=0.06)
    assert along(trail, len(trail), 255.0, 3.0, 0.0)[0] == pytest.approx(3.0 + 2.0 * np.pi * 40.0, abs=0.1)
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [2.0, 0.0, 2.0]])
    assert along(line, 3, 0.0, -7.0, 2.0)[0] == pytest.approx(-7.0)
    assert along(line, 3, 2.0, 9.0, 2.0)[0] == pytest.approx(9.0)
    assert place(line, 3, 1, 9.0) == pytest.approx((9.0, 0.0)) and place(line, 3, 0, -2.0) == pytest.approx((-2.0, 0.0))


def test_the_latest_pass_is_the_one_that_counts_for_who_comes_back() -> None:
    trail, once = circle(), 2.0 * np.pi * 40.0
    x, y = 40.0 * np.sin(1.0), 40.0 - 40.0 * np.cos(1.0)
    assert latest(trail, len(trail), x, y, 5.0) == pytest.approx(once + 40.0, abs=0.6)
    assert latest(trail, round(len(trail) * 0.52), x, y, 5.0) == pytest.approx(40.0, abs=0.6)  # before the second round
    assert latest(trail, len(trail), 0.0, 40.0, 5.0) == -np.inf


def ripple(spacing: Spacing, drones: int = 8, lag: float = 0.5, dt: float = 0.01) -> Floats:
    """(steps, drones) errors of spacing behind a leader that brakes and speeds up; v' = (u - v) / lag."""
    steps = round(90.0 / dt)
    x = -np.arange(drones + 1) * (spacing.stand + spacing.headway_s * 3.0)
    v = np.full(drones + 1, 3.0)
    out = np.zeros((steps, drones))
    for k in range(steps):
        u = np.full(drones + 1, 3.0 if (k * dt) % 40.0 < 20.0 else 1.0)
        for i in range(1, drones + 1):
            u[i] = pace(x[i - 1] - x[i], v[i], v[i - 1], spacing.stand, spacing.headway_s, spacing.gain, 9.0)
        x, v = x + v * dt, v + (u - v) / lag * dt
        out[k] = x[:-1] - x[1:] - spacing.stand - spacing.headway_s * v[1:]
    return out


def test_errors_of_spacing_shrink_down_a_stable_column_and_grow_down_another() -> None:
    errors = ripple(Spacing())
    for norm in (np.abs(errors).max(axis=0), np.linalg.norm(errors, axis=0)):
        assert (norm[1:] < norm[:-1]).all()
    bad = ripple(Spacing(headway_s=0.1, gain=1.5))
    assert np.linalg.norm(bad[:, -1]) > np.linalg.norm(bad[:, 1])


def test_the_amplification_is_the_one_of_the_transfer_function() -> None:
    k, h, tau = 0.4, 1.2, 0.5
    s = 1j * np.geomspace(1e-3, 1e2, 4000)
    G = (s + k) / (tau * s**2 + (1.0 + k * h) * s + k)
    assert Spacing(gain=k, headway_s=h).amplification(tau, 0.0, 0.0) == pytest.approx(np.abs(G).max(), rel=1e-12)
    assert Spacing().amplification(0.5, 0.1, 0.2) <= 1.0
    Spacing().check(0.5, 0.1, 0.2)
    with pytest.raises(ConfigError, match="grows by"):
        Spacing(headway_s=0.3).check(0.5, 0.1, 0.2)
    with pytest.raises(ConfigError, match="headway_s"):
        Spacing(headway_s=0.0)


def test_who_follows_whom() -> None:
    assert [COLUMN.ahead(n) for n in NAMES] == ["target", "a", "b", "c"]
    assert leave(COLUMN, "b").ahead("c") == "a" and leave(COLUMN, "a").ahead("b") == "target"
    assert join(COLUMN, "e").ahead("e") == "d"
    between = join(COLUMN, "e", behind="a")
    assert between.ahead("e") == "a" and between.ahead("b") == "e"
    assert join(COLUMN, "e", behind="target").ahead("a") == "e"
    ahead, behind = split(COLUMN, "c", "other")
    assert ahead.order == ("a", "b") and behind.ahead("c") == "other"
    assert merge(ahead, behind) == COLUMN
    assert COLUMN.order == NAMES  # nothing changed what was


@given(st.permutations(NAMES), st.sampled_from(NAMES))
def test_to_leave_undoes_to_join_and_to_merge_undoes_to_split(order: list[str], name: str) -> None:
    column = Column(tuple(order), "t")
    assert merge(*split(column, name, "u")) == column
    at = column.ahead(name)
    assert join(leave(column, name), name, behind=at) == column


def test_orders_that_cannot_be() -> None:
    with pytest.raises(UsageError, match="twice"):
        join(COLUMN, "a")
    with pytest.raises(UsageError, match="twice"):
        merge(COLUMN, COLUMN)
    with pytest.raises(UsageError, match="not in the column"):
        leave(COLUMN, "x")
    with pytest.raises(UsageError, match="there are: none"):
        Column((), "t").ahead("x")
