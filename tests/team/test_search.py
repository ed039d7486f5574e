"""Where a silent target may be: on a straight piece that begins where it stops at once, and is avoided as a whole."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.filters.following import FollowerFilter
from outrider.models.motion.following import FollowerModel
from outrider.safety.separation import Hold, Separation, kept_apart
from outrider.team.search import GROWS_S, CredibleTrack, credible_track

KEEPS = Separation(distance=3.0, speed=4.0)


def track(v: tuple[float, float, float] = (2.0, 0.0, 0.0), silent_s: float = 10.0, speed: float = 4.0) -> CredibleTrack:
    """Of a target that was heard for five seconds, at 5 Hz, last at the origin and 10 m up."""
    f, r = FollowerFilter(FollowerModel.target()), np.full(3, 0.15**2)
    for k in range(26):
        t = 0.2 * k
        f.add_fix(t, np.array([0.0, 0.0, 10.0]) + np.array(v) * (t - 5.0), r)
        f.add_velocity(t, np.array(v), np.full(3, 0.05**2))
    return credible_track(f.belief(5.0), f.belief(5.0 + GROWS_S), 5.0 + silent_s, speed, 0.5)


def test_it_reaches_from_where_it_stops_to_where_it_flies_on_to() -> None:
    t = track()
    assert t.first == pytest.approx([1.0, 0.0, 10.0], abs=0.05)  # 0.5 s of lag at 2 m/s
    assert t.now == pytest.approx([20.0, 0.0, 10.0], abs=0.2)
    assert t.nearest(np.array([-5.0, 0.0, 10.0]))[0] == pytest.approx([1.0, 0.0, 10.0, 0.0, 0.0, 0.0], abs=0.05)
    assert t.nearest(np.array([7.0, 3.0, 12.0]))[0] == pytest.approx([7.0, 0.0, 10.0, 0.0, 0.0, 0.0], abs=0.1)
    assert t.nearest(np.array([50.0, 0.0, 10.0]))[0] == pytest.approx([20.0, 0.0, 10.0, 2.0, 0.0, 0.0], abs=0.2)


def test_nobody_is_searched_for_faster_than_one_can_fly() -> None:
    assert track((9.0, 0.0, 0.0), speed=3.0).now[0] == pytest.approx(30.0, abs=0.2)


def test_it_spreads_aside_and_not_along_and_no_longer_than_it_is_credible() -> None:
    """White acceleration q across its course: q^2 T^3 / 3."""
    t = track()
    P = t.nearest(np.array([50.0, 0.0, 10.0]))[1]
    assert P[0, 0] == pytest.approx(t.P[0, 0], rel=1e-3)
    assert P[1, 1] == pytest.approx(GROWS_S**3 / 3.0, rel=0.02)  # FollowerModel.target(): 1 m/s^2 across its course
    assert np.allclose(P, track(silent_s=25.0).nearest(np.array([99.0, 0.0, 10.0]))[1])
    assert np.allclose(t.nearest(np.array([-5.0, 0.0, 10.0]))[1], t.P)  # it stopped at once


def test_a_target_that_sank_is_not_below_the_ground() -> None:
    assert track((1.0, 0.0, -1.5), silent_s=20.0).now[2] == 0.0


@settings(max_examples=10)
@given(st.floats(-1.0, 1.0), st.floats(4.5, 8.0), st.floats(6.0, 20.0))
def test_whoever_searches_gets_over_it_and_near_no_point_of_it(aside: float, behind: float, silent: float) -> None:
    """Flown without lag: from behind it climbs over the track, and all between its ends is kept clear of."""
    p, own = np.array([-behind, aside, 9.0]), np.zeros((6, 6))
    t = track(silent_s=silent)
    for k in range(200):
        if k % 20 == 19:
            t = track(silent_s=silent + 0.1 * k)
        wish = t.over(p, t.above(KEEPS, 4.0, own), 0.5, 4.0)
        x, P = t.nearest(p)
        command, hold = kept_apart(wish, np.concatenate([p, wish]), x, KEEPS, P=P)
        assert hold is not Hold.UNKNOWN
        p = p + 0.1 * command
        assert np.linalg.norm(p - t.nearest(p)[0][:3]) > 2.9
    assert p[2] > 12.0
