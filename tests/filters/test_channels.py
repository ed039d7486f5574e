"""Channels: what becomes of a stream's columns and claims before the filter sees them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import channel

from outrider.core.geodesy import enu_to_geodetic
from outrider.core.rotations import quats_exp, quats_to_matrices
from outrider.data import Datum, Fix, Kind, Stream, Verdict, stream
from outrider.filters.channels import (
    GNSS_DEFAULT,
    GNSS_FLOOR,
    STILL_TIME,
    Rest,
    default_sigma,
    gnss_variance,
    records,
    site_position,
    standstill,
)
from outrider.filters.screen import screen
from outrider.filters.step import INPUT_SENSOR, ROWS
from outrider.models.sensors import (
    SPECS,
    Attitude,
    BodyVelocity,
    GnssPosition,
    GnssVelocity,
    Gyro,
    Pose,
    Position,
    Range,
    Sensor,
    SpecificForce,
    Twist,
)

SECOND = 1_000_000_000
SITE = Datum(lat=0.7, lon=0.2, alt=100.0)


def made(kind: Kind, z, **rest) -> Stream:
    z = np.atleast_2d(np.asarray(z, float))
    return stream("s", kind, np.arange(1, len(z) + 1) * SECOND, z, **rest)


def taken(c, s: Stream, datum: Datum | None = SITE, verdict=None):
    return records(replace(c, stream="s"), s, np.zeros(len(s), np.int64) if verdict is None else verdict, datum)


def fixes(n: int = 4, fix: Fix = Fix.SINGLE, **extra) -> Stream:
    enu = np.arange(3.0 * n).reshape(n, 3)
    place = np.stack(enu_to_geodetic(enu, SITE.lat, SITE.lon, SITE.alt), axis=1)
    return made(Kind.GNSS, place, extra={"fix": np.full(n, float(fix.value)), **extra})


# ------------------------------------------------------------------------------------------------ records


def test_positions_arrive_in_metres_of_the_site():
    part = taken(channel("s", GnssPosition()), fixes())
    np.testing.assert_allclose(part.z[:, :3], np.arange(12.0).reshape(4, 3), atol=1e-6)
    assert part.z.shape == part.r.shape == (4, ROWS)
    assert not part.z[:, 3:].any() and np.isinf(part.r[:, 3:]).all()
    np.testing.assert_array_equal(part.flag, Verdict.USED)
    np.testing.assert_array_equal(part.row, np.arange(4))


def test_without_a_datum_there_is_no_position():
    part = taken(channel("s", GnssPosition()), fixes(), None)
    np.testing.assert_array_equal(part.flag, Verdict.NOT_FINITE)


def test_a_fix_without_height_still_has_a_place():
    s = fixes()
    s.z[2, 2] = np.nan
    part = taken(channel("s", GnssPosition()), s)
    assert part.flag[2] == Verdict.USED and np.isnan(part.z[2, 2])
    np.testing.assert_allclose(part.z[2, :2], [6.0, 7.0], atol=1e-3)


@pytest.mark.parametrize("place", [[np.nan, 0.2, 1.0], [np.inf, 0.2, 1.0], [0.7, 1e308, 1.0], [45.0, 7.6, 1.0]])
def test_impossible_places_are_no_positions(place):
    s = fixes()
    s.z[1] = place
    assert np.isnan(site_position(s, SITE)[1]).all()
    assert np.isfinite(site_position(s, SITE)[0]).all()


def test_a_channel_takes_only_its_fixes():
    s = fixes(6)
    s.extra["fix"][:] = [Fix.FIXED.value, Fix.SINGLE.value, Fix.FLOAT.value, Fix.FIXED.value, Fix.NONE.value, np.nan]
    part = taken(channel("s", Position(), fixes=frozenset({Fix.FIXED.value})), s)
    np.testing.assert_array_equal(part.row, [0, 3])
    np.testing.assert_array_equal(part.t, s.t[[0, 3]])


def test_a_channel_takes_only_its_beacon():
    s = made(Kind.RANGE, [[7.0, 3.0], [8.0, 4.0], [7.0, 5.0], [np.nan, 1.0]])
    part = taken(channel("s", Range(beacon=(0.0, 0.0, 0.0)), beacon=7.0), s)
    np.testing.assert_array_equal(part.row, [0, 2])
    np.testing.assert_array_equal(part.z[:, :2], [[7.0, 3.0], [7.0, 5.0]])


def test_a_verdict_of_screening_stays():
    s = fixes()
    verdict = np.array([Verdict.USED, Verdict.FROZEN, Verdict.NULL_POSITION, Verdict.USED], np.int64)
    for role, expected in (("fused", Verdict.USED), ("scored: on request", Verdict.WITHHELD)):
        part = taken(channel("s", GnssPosition(), role=role), s, verdict=verdict)
        np.testing.assert_array_equal(part.flag, [expected, Verdict.FROZEN, Verdict.NULL_POSITION, expected])
    np.testing.assert_array_equal(verdict, [0, Verdict.FROZEN, Verdict.NULL_POSITION, 0])  # not changed


@pytest.mark.parametrize(
    ("model", "kind"),
    [
        (Position(), Kind.POSITION),
        (GnssVelocity(), Kind.GNSS_VELOCITY),
        (Twist(), Kind.TWIST),
        (BodyVelocity(), Kind.BODY_VELOCITY),
    ],
)
def test_a_missing_column_costs_its_row_only(model, kind):
    width = len(kind.columns)
    z = np.ones((3, width))
    z[1, 1], z[2] = np.nan, np.nan
    part = taken(channel("s", model), made(kind, z))
    np.testing.assert_array_equal(part.flag, [Verdict.USED, Verdict.USED, Verdict.NOT_FINITE])


@pytest.mark.parametrize(("model", "kind"), [(Attitude(), Kind.ATTITUDE), (Pose(), Kind.POSE), (Gyro(), Kind.IMU)])
def test_a_missing_column_costs_the_record_where_rows_mix_columns(model, kind):
    z = np.full((2, len(kind.columns)), 0.5)
    z[1, 1] = np.nan
    part = taken(channel("s", model), made(kind, z))
    np.testing.assert_array_equal(part.flag, [Verdict.USED, Verdict.NOT_FINITE])


# ------------------------------------------------------------------------------------------------ variances


def test_variances_stated_unstated_floored_and_unused():
    s = made(
        Kind.POSITION,
        np.zeros((4, 3)),
        var=[[0.5, 0.5, 0.5], [np.nan, 0.0, -1.0], [1e-9, 1.0, 1.0], [0.5, np.inf, 0.5]],
    )
    c = channel("s", Position(sigma=0.2), use=(0, 1), floor=np.full(3, 0.1))
    r = taken(c, s).r
    np.testing.assert_allclose(r[:, :2], [[0.5, 0.5], [0.04, 0.04], [0.01, 1.0], [0.5, 0.04]])
    assert np.isinf(r[:, 2:]).all()
    np.testing.assert_allclose(taken(replace(c, trust_stated=False), s).r[:, :2], 0.04)
    np.testing.assert_allclose(taken(replace(c, scale=3.0), s).r[:, :2], 9.0 * r[:, :2])


@pytest.mark.parametrize("spec", list(SPECS.values()), ids=lambda spec: spec.sensor.name)
def test_every_sensor_gets_positive_variances(spec):
    """Whatever the stream states: finite and positive where a row is used, infinite elsewhere."""
    for kind in spec.kinds:
        n = 5
        width = spec.rows if kind is Kind.WHEELS else len(kind.columns)
        z = np.full((n, width), 0.5)
        blank = stream("s", kind, np.arange(1, n + 1) * SECOND, z)
        for value in (np.nan, 0.0, -1.0, 1e-30, 4.0):
            s = replace(blank, var=np.full_like(blank.var, value))
            part = taken(channel("s", spec.usual), s)
            m = spec.usual.sigmas().size
            assert (part.r[:, :m] > 0.0).all() and np.isfinite(part.r[:, :m]).all()
            assert np.isinf(part.r[:, m:]).all()
        assert default_sigma(spec.sensor).size == spec.usual.sigmas().size <= spec.rows


@pytest.mark.parametrize("fix", [f for f in Fix if f is not Fix.NONE])
def test_no_receiver_is_believed_below_the_floor_of_its_fix(fix):
    boastful = replace(fixes(fix=fix), var=np.full((4, 3), 1e-8))
    silent = fixes(fix=fix)
    (floor, floor_up), (default, default_up) = GNSS_FLOOR[fix], GNSS_DEFAULT[fix]
    np.testing.assert_allclose(gnss_variance(boastful)[0], np.square([floor, floor, floor_up]))
    np.testing.assert_allclose(gnss_variance(silent)[0], np.square([default, default, default_up]))


def test_a_float_solution_errs_far_more_than_it_claims():
    claim = replace(fixes(fix=Fix.FLOAT), var=np.full((4, 3), 0.1**2))
    assert (gnss_variance(claim)[:, 0] >= 0.99).all()
    plain = replace(fixes(fix=Fix.SINGLE), var=np.full((4, 3), 3.0**2))
    np.testing.assert_allclose(gnss_variance(plain), 9.0)


def test_claims_in_metres_and_dilution_stand_in_for_variances():
    hacc = fixes(hacc=np.full(4, 3.0), vacc=np.full(4, 5.0))
    np.testing.assert_allclose(gnss_variance(hacc)[0], [9.0, 9.0, 25.0])
    dilution = fixes(hdop=np.full(4, 2.0), vdop=np.full(4, 4.0))
    np.testing.assert_allclose(gnss_variance(dilution)[0], [9.0, 9.0, 36.0])
    useless = fixes(hdop=np.array([0.0, -1.0, np.nan, 99.99]), vdop=np.full(4, np.nan))
    np.testing.assert_allclose(gnss_variance(useless), gnss_variance(fixes()))
    both = replace(fixes(hacc=np.full(4, 3.0)), var=np.full((4, 3), 4.0))
    np.testing.assert_allclose(gnss_variance(both)[0, :2], 4.0)  # a stated variance goes first


@pytest.mark.parametrize("absurd", [1e12, np.inf, 0.0, -1.0, np.nan])
def test_an_absurd_claim_is_none(absurd):
    s = replace(fixes(), var=np.full((4, 3), absurd))
    np.testing.assert_allclose(gnss_variance(s), gnss_variance(fixes()))


# ------------------------------------------------------------------------------------------------ inertial units


@pytest.mark.parametrize("phi", [(0.0, 0.0, 0.0), (np.pi, 0.0, 0.0), (0.3, -0.4, 1.2)])
def test_an_imu_is_turned_into_body_axes(phi):
    R = quats_to_matrices(quats_exp(np.array(phi))[None])[0]
    w, a = np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, 9.0])
    s = made(Kind.IMU, np.concatenate([R.T @ w, R.T @ a]), var=np.tile([1e-4] * 3 + [1e-2] * 3, (1, 1)))
    mount = {"mount": R.ravel()}
    drives = taken(channel("s", None, **mount), s)
    np.testing.assert_allclose(drives.z[0, :6], [*w, *a], atol=1e-12)
    np.testing.assert_allclose(taken(channel("s", Gyro(), **mount), s).z[0, :3], w, atol=1e-12)
    force = taken(channel("s", SpecificForce(), **mount), s)
    np.testing.assert_allclose(force.z[0, :3], a, atol=1e-12)
    np.testing.assert_allclose(force.r[0, :3], 1e-2)  # equal variances stay equal in any axes
    assert channel("s", None).code == INPUT_SENSOR and channel("s", Gyro()).code == Sensor.GYRO


def test_records_that_screening_refused_do_not_warn():
    s = made(Kind.IMU, [[0.1, 0.1, 0.1, 0.0, 0.0, 9.8], [np.inf] * 6, [1e308] * 6, [np.nan] * 6])
    part = taken(channel("s", None, mount=np.full(9, 0.7)), s, verdict=screen(s))
    assert part.flag[0] == Verdict.USED and (part.flag[1:] != Verdict.USED).all()


# ------------------------------------------------------------------------------------------------ standstill


def test_standstill_needs_half_a_second_of_no_motion():
    n = 60
    z = np.zeros((n, 6))
    z[20:30, 0], z[40, 5] = 0.5, 0.1
    s = stream("s", Kind.TWIST, np.arange(1, n + 1) * (SECOND // 10), z)
    still = standstill(s)
    wait = round(STILL_TIME * 10)
    moving = np.r_[20:30, 40]
    assert not still[moving].any()
    assert not still[:wait].any() and still[wait:20].all()
    assert not still[30 : 29 + wait].any() and still[29 + wait : 40].all()
    assert not still[40 : 40 + wait].any() and still[40 + wait :].all()
    part = taken(channel("s", Twist(), still=True), s)
    np.testing.assert_array_equal(part.row, np.flatnonzero(still))


@given(st.lists(st.integers(0, 59), max_size=8), st.lists(st.integers(1, 59), max_size=20))
def test_standstill_of_a_stream_in_pieces_is_that_of_the_whole(moves: list[int], cuts: list[int]):
    """Online, records come in pieces that are shorter than the standstill that counts."""
    z = np.zeros((60, 6))
    z[moves, 0] = 0.5
    s = stream("s", Kind.TWIST, np.arange(1, 61) * (SECOND // 10), z)
    ends, rest = [0, *sorted(set(cuts)), 60], Rest()
    pieces = [standstill(s.select(np.arange(a, b)), rest) for a, b in pairwise(ends)]
    np.testing.assert_array_equal(np.concatenate(pieces), standstill(s))


def test_what_is_no_number_does_not_stand_still():
    z = np.zeros((30, 6))
    z[:, 0] = np.nan
    assert not standstill(stream("s", Kind.TWIST, np.arange(1, 31) * SECOND, z)).any()
    assert standstill(stream("s", Kind.TWIST, np.zeros(0), np.zeros((0, 6)))).shape == (0,)


def test_an_empty_stream_gives_no_records():
    for kind, model in ((Kind.GNSS, GnssPosition()), (Kind.IMU, None), (Kind.TWIST, Twist())):
        s = stream("s", kind, np.zeros(0), np.zeros((0, len(kind.columns))))
        part = taken(channel("s", model), s)
        assert part.t.size == part.flag.size == 0 and part.z.shape == (0, ROWS)
