"""The comparison of filters on one flight: what it feeds them, and figures that follow from the noise alone."""

import numpy as np
import pytest

from outrider.campaign.following import Tuning, following, records
from outrider.campaign.following_flights import SLOWEST, Flown, Scene, fly, target
from outrider.campaign.following_tunings import BLOCKED, FULL
from outrider.errors import ConfigError
from outrider.filters.following import FollowerFilter, Following
from outrider.filters.following.records import Seen
from outrider.filters.following.runs import EKF, run
from outrider.models.motion.following import FollowerModel, Variant

CALM = Scene(gust=0.0)


def test_a_flight_without_noise_is_the_lag_solved_by_hand():
    """Ten steps a second of a drone that is told a velocity each second."""
    flown = fly(Scene(gust=0.0, sigma=0.0, heading=0.0, seconds=6), 3)
    tau, v, p = 0.5, np.zeros(3), flown.x[0, :3].copy()
    for k in range(6):
        u = flown.u[k]
        p = p + u + (v - u) * tau * (1 - np.exp(-1 / tau))
        v = u + (v - u) * np.exp(-1 / tau)
        np.testing.assert_allclose(flown.x[k + 1], [*p, *v], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(flown.u, axis=1), 1.0)
    np.testing.assert_array_equal(flown.fix, flown.x[:, :3])


def test_fixes_are_late_and_missing_as_told():
    scene = Scene(gust=0.0, sigma=0.0, latency=0.3, outage=4)
    flown = fly(scene, 1)
    assert list(np.flatnonzero(~flown.came)) == [9, 10, 11, 12]
    np.testing.assert_array_equal(flown.fix[9:13], np.tile(flown.fix[8], (4, 1)))
    back = flown.x[20, :3] - flown.fix[20]  # 0.3 s at about 1 m/s
    assert 0.2 < np.linalg.norm(back) < 0.4


def test_the_target_goes_along_its_waypoints():
    np.testing.assert_allclose(target(np.array([-1.0, 0.0, 1e3])), [[0, 7, 7], [0, 7, 7], [15, 1, 7]])
    step = np.diff(target(np.arange(0.0, 20.0, 0.1)), axis=0)
    np.testing.assert_allclose(np.median(np.linalg.norm(step, axis=1)), 0.2, atol=1e-9)


def test_records_are_those_of_the_second_and_of_the_tuning():
    flown = fly(Scene(latency=0.3, outage=2), 2)
    log, x0, P0, rows = records(flown, Scene(latency=0.3, outage=2), Tuning(wind=0.3), "EKF")
    np.testing.assert_allclose(log.dt, [0.7, 0.3])
    np.testing.assert_array_equal(log.z[0::2, :3], flown.fix[1:])
    assert np.isinf(log.r[2 * 8 : 2 * 10 : 2, 0]).all() and np.isfinite(log.r[0, :3]).all()
    assert np.isinf(log.r[1::2, 0]).all() and (log.kind[1::2] == Seen.ANGLE).all()
    assert x0.size == 9 and P0.shape == (9, 9) and len(log.u[rows]) == 30
    printed = records(flown, CALM, Tuning(by="printed", variant="increment"), "UKF")[0]
    np.testing.assert_array_equal(printed.r[0], FULL["UKF"].r)
    np.testing.assert_array_equal(printed.r[8], BLOCKED["UKF"].r)
    np.testing.assert_allclose(printed.u, Variant.INCREMENT.inputs(flown.u[:-1]))
    assert printed.z[8, 5] == 0.0 < printed.z[3, 5]


@pytest.mark.parametrize(("late", "wind"), [(0.0, 0.0), (0.3, 0.0), (0.3, 0.2)])
def test_online_and_over_the_whole_flight_it_is_one_filter(late, wind):
    """Records as they come, late, against the batch in the order of time."""
    scene, tuning = Scene(latency=late, outage=3, seconds=14, wind=0.3), Tuning(wind=wind)
    flown = fly(scene, 5)
    log, x0, P0, rows = records(flown, scene, tuning, "EKF")
    track = run(EKF, log, x0, P0)
    a = tuning.acceleration
    model = FollowerModel(acceleration=a, acceleration_z=0.5 * a, wind=tuning.wind_walk if wind else 0.0)
    f = FollowerFilter(model, Following(velocity=0.05, wind=wind, slowest=SLOWEST, gate=1e9))
    r = np.full(3, tuning.sigma**2)
    f.add_fix(0.0, flown.fix[0], r)
    x, P = f._states[0].x, f._states[0].P
    x[:], P[...] = x0, P0  # the batch knows how little vertical wind there is
    for k in range(flown.x.shape[0]):
        if k:
            f.add_course(float(k), flown.nose[k], scene.heading**2, heading=True)
            if flown.came[k]:
                f.add_fix(k - late, flown.fix[k], r, now=float(k))
            b = f.belief(float(k))
            np.testing.assert_allclose(b.x, track.x[rows][k - 1], atol=1e-9)
            np.testing.assert_allclose(b.P, track.P[rows][k - 1], atol=1e-9)
        f.add_command(float(k), flown.u[k])


def test_guided_by_estimates_it_flies_elsewhere_and_the_filter_is_none_the_worse():
    ways = {by: following({"guided": by, "kinds": ["EKF"], "latency": 0.3}, 4) for by in ("fixes", "estimate")}
    assert ways["fixes"]["aim"] != ways["estimate"]["aim"] < 10.0
    assert abs(ways["fixes"]["EKF_xyz"] - ways["estimate"]["EKF_xyz"]) < 0.02
    with pytest.raises(ConfigError, match="guided by"):
        following({"guided": "hope"}, 0)


def test_printed_tunings_by_their_first_and_last_entries():
    """Entry 6 of the printed seven is dropped."""
    np.testing.assert_allclose(FULL["EKF"].r, [0.1, 0.1, 0.1, 0.5, 0.5, 1.0])
    np.testing.assert_allclose(FULL["EKF"].q, [5, 5, 1, 1, 1, 1])
    np.testing.assert_allclose(BLOCKED["EKF"].r, [6000, 100, 10, 1000, 100, 100])
    np.testing.assert_allclose(BLOCKED["EnKF"].r, [1000, 20, 1, 3000, 1000, 5])


@pytest.mark.compiled
def test_the_three_filters_are_one_where_noise_is_one():
    """40 seeds: millimetres apart, honest, better than the fixes, whose error is that of the noise."""
    rows = [following({"gust": 0.1}, s) for s in range(40)]
    mean = {k: float(np.mean([r[k] for r in rows])) for k in rows[0]}
    assert abs(mean["GPS_xyz"] - np.sqrt(3) * 0.15) < 0.01
    assert abs(mean["UKF_xyz"] - mean["EKF_xyz"]) < 1e-3 and abs(mean["EnKF_xyz"] - mean["EKF_xyz"]) < 2e-3
    assert mean["RTS_xyz"] < mean["EKF_xyz"] < 0.6 * mean["GPS_xyz"]
    assert 0.85 < mean["EKF_nees"] < 1.15


@pytest.mark.compiled
def test_ranks_by_the_printed_tunings_are_ranks_of_tunings():
    """EKF and UKF as printed differ by tens of millimetres; with either's numbers for both by less than one."""
    differ = {}
    for by in ("printed", "EKF", "UKF"):
        rows = [following({"gust": 0.0, "tuned_by": by, "kinds": ["EKF", "UKF"]}, s) for s in range(20)]
        differ[by] = float(np.mean([r["UKF_xyz"] - r["EKF_xyz"] for r in rows]))
    assert differ["printed"] < -0.03 and abs(differ["EKF"]) < 1e-3 and abs(differ["UKF"]) < 1e-3


def test_same_seed_same_bits_and_misspelt_parameters_are_named():
    few = {"seconds": 3, "kinds": ["EKF"]}
    assert following(few, 1) == pytest.approx(following(few, 1), rel=0, abs=0, nan_ok=True)
    with pytest.raises(ConfigError, match="'gusts'"):
        following({"gusts": 1.0}, 0)
    with pytest.raises(ConfigError, match="'PF'"):
        following({"kinds": ["PF"]}, 0)
    assert isinstance(fly(Scene(seconds=1), 0), Flown)
