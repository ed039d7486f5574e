"""Screening: every reason by a fault that deserves it, and the same reasons for a stream in pieces."""

from dataclasses import replace

import numpy as np
import pytest

from outrider.data import EventLog, Fix, Kind, Stream, Verdict, stream
from outrider.filters.screen import AHEAD, FROZEN_AFTER, LIMITS, Memory, screen
from outrider.sim import FAULTS, drone_log, wheeled_log
from outrider.sim import faults as spoil

SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def log() -> EventLog:
    return wheeled_log(5, 40.0, rate_hz=50.0, exact=True)[0]


def told(s: Stream) -> set[Verdict]:
    return {Verdict(int(v)) for v in screen(s)}


def refused(s: Stream, reason: Verdict) -> np.ndarray:
    """Rows refused for a reason."""
    return np.flatnonzero(screen(s) == reason)


def edited(s: Stream, row: int, **columns) -> Stream:
    """The stream with one row changed: t, t_arrival, z, var or a column of extra."""
    extra = {k: v.copy() for k, v in s.extra.items()}
    parts = {name: getattr(s, name).copy() for name in ("t", "t_arrival", "z", "var")}
    for name, value in columns.items():
        (parts if name in parts else extra)[name][row] = value
    return replace(s, **parts, extra=extra)


# ------------------------------------------------------------------------------------------------ clean data


@pytest.mark.parametrize("make", [wheeled_log, drone_log])
def test_clean_streams_pass(make):
    for s in make(1, 30.0, rate_hz=50.0)[0]:
        assert told(s) == {Verdict.USED}, s.name


def test_an_empty_stream_has_no_verdicts():
    empty = stream("imu", Kind.IMU, np.zeros(0), np.zeros((0, 6)))
    assert screen(empty).shape == (0,)
    assert screen(empty, Memory()).shape == (0,)


def test_one_record_is_enough():
    assert told(stream("p", Kind.POSITION, np.array([5]), np.ones((1, 3)))) == {Verdict.USED}


# ------------------------------------------------------------------------------------------------ simulated faults


@pytest.mark.parametrize(
    ("fault", "reason", "least"),
    [
        ("gnss-null", Verdict.NO_FIX, 15),
        ("gnss-nan", Verdict.NOT_FINITE, 2),
        ("gnss-nan", Verdict.IMPLAUSIBLE, 1),
        ("gnss-frozen", Verdict.FROZEN, 20),
        ("wheels-nan", Verdict.NOT_FINITE, 10),
        ("wheels-clock", Verdict.BAD_STAMP, 300),
        ("imu-duplicates", Verdict.DUPLICATE, 100),
        ("imu-nan", Verdict.NOT_FINITE, 3),
    ],
)
def test_a_fault_is_named(log, fault, reason, least):
    spoilt = spoil.apply(log, fault, np.random.default_rng(1))
    kind = FAULTS[fault][0]
    for s in spoilt:
        if s.kind is kind:
            assert refused(s, reason).size >= least
        else:
            assert told(s) == {Verdict.USED}


@pytest.mark.parametrize(
    "fault", ["gnss-outage", "gnss-jump", "gnss-float", "gnss-late", "wheels-scale", "imu-shuffled"]
)
def test_what_only_a_filter_can_see_is_left_to_it(log, fault):
    for s in spoil.apply(log, fault, np.random.default_rng(1)):
        assert told(s) == {Verdict.USED}


def test_every_duplicate_and_nothing_else_is_refused(log):
    clean, s = log.streams["imu"], spoil.duplicates(log, "imu", np.random.default_rng(3)).streams["imu"]
    assert (screen(s) == Verdict.DUPLICATE).sum() == len(s) - len(clean)


# ------------------------------------------------------------------------------------------------ receivers


def test_four_satellites_are_needed(log):
    s = log.streams["gnss"]
    for count, verdict in ((0.0, Verdict.FEW_SATELLITES), (3.0, Verdict.FEW_SATELLITES), (4.0, Verdict.USED)):
        assert screen(edited(s, 7, satellites=count))[7] == verdict
    for unknown in (-1.0, np.nan):
        assert screen(edited(s, 7, satellites=unknown))[7] == Verdict.USED


def test_no_fix_null_and_impossible_positions(log):
    s = log.streams["gnss"]
    assert screen(edited(s, 7, fix=float(Fix.NONE.value)))[7] == Verdict.NO_FIX
    assert screen(edited(s, 7, z=np.zeros(3)))[7] == Verdict.NULL_POSITION
    assert screen(edited(s, 7, z=[1e-9, -1e-9, 240.0]))[7] == Verdict.NULL_POSITION
    assert screen(edited(s, 7, z=[0.0, 0.13, 240.0]))[7] == Verdict.USED  # on the equator
    for place in ([2.0, 0.1, 240.0], [0.7, 7.0, 240.0], [0.7, 0.1, 2e5], [45.0, 7.6, 240.0]):
        assert screen(edited(s, 7, z=place))[7] == Verdict.IMPLAUSIBLE
    assert screen(edited(s, 7, z=[0.7, np.nan, 240.0]))[7] == Verdict.NOT_FINITE
    assert screen(edited(s, 7, z=[0.7, 0.1, np.nan]))[7] == Verdict.USED  # a fix without height


def test_a_fix_older_than_its_stamp_says_is_stale(log):
    s = log.streams["gnss"]
    for late_s, verdict in ((4.0, Verdict.USED), (6.0, Verdict.STALE)):
        assert screen(edited(s, 7, t_arrival=s.t[7] + int(late_s * SECOND)))[7] == verdict


def test_a_constant_latency_is_not_stale(log):
    s = log.streams["gnss"]
    assert told(replace(s, t_arrival=s.t_arrival + 30 * SECOND)) == {Verdict.USED}


def test_negative_and_absurd_variances(log):
    s = log.streams["gnss"]
    for bad in (-1.0, 1e31, np.inf):
        assert screen(edited(s, 7, var=[0.1, bad, 0.1]))[7] == Verdict.BAD_COVARIANCE
    for unstated in (np.nan, 0.0):
        assert screen(edited(s, 7, var=unstated))[7] == Verdict.USED


# ------------------------------------------------------------------------------------------------ clocks


def test_stamps_of_zero_or_less(log):
    s = log.streams["wheels"]
    for t in (0, -5, -SECOND):
        assert screen(edited(s, 7, t=t))[7] == Verdict.BAD_STAMP


def test_a_clock_that_begins_at_zero():
    def of(t: np.ndarray, **more: np.ndarray) -> Stream:
        return stream("x", Kind.POSITION, t.astype(np.int64), np.column_stack([t, t, t]) * 1e-9, **more)

    t = np.arange(50.0) * 0.1 * SECOND
    assert told(of(t)) == {Verdict.USED}
    later = np.where(t > 0, t + 2 * SECOND, 0)
    np.testing.assert_array_equal(refused(of(later), Verdict.BAD_STAMP), [0])
    np.testing.assert_array_equal(refused(of(np.append([0.0], t)), Verdict.BAD_STAMP), [0, 1])
    arrived = (t + 10**9 * SECOND).astype(np.int64)
    np.testing.assert_array_equal(refused(of(t, t_arrival=arrived), Verdict.BAD_STAMP), [0])


@pytest.mark.parametrize("jump_s", [30.0, AHEAD + 0.5, -700.0])
def test_a_clock_that_jumps_is_named_where_it_would_hurt_others(log, jump_s):
    s = spoil.clock_jump(log, "wheels", 25.0, jump_s).streams["wheels"]
    bad = screen(s) == Verdict.BAD_STAMP
    after = log.streams["wheels"].t >= log.span[0] + 25 * SECOND
    np.testing.assert_array_equal(bad, after)


def test_a_clock_that_falls_back_a_little_is_left_to_the_engine(log):
    """It makes its own records late, and nobody else's."""
    assert told(spoil.clock_jump(log, "wheels", 25.0, -30.0).streams["wheels"]) == {Verdict.USED}


def test_a_constant_offset_of_clocks_is_no_jump(log):
    s = log.streams["wheels"]
    assert told(replace(s, t_arrival=s.t_arrival + 40 * 365 * 86_400 * SECOND)) == {Verdict.USED}


def test_a_sender_that_stalls_and_then_bursts_is_no_jump(log):
    """Records of five seconds arrive all at once, every time: their latencies differ, their stamps are right."""
    s = log.streams["wheels"]
    burst = -(-(s.t - s.t[0]) // (3 * SECOND)) * 3 * SECOND + s.t[0]
    assert told(replace(s, t_arrival=burst)) == {Verdict.USED}


# ------------------------------------------------------------------------------------------------ values


def test_infinite_and_missing_values(log):
    s = log.streams["imu"]
    assert screen(edited(s, 7, z=np.full(6, np.nan)))[7] == Verdict.NOT_FINITE
    row = s.z[7].copy()
    row[2] = np.inf
    assert screen(edited(s, 7, z=row))[7] == Verdict.NOT_FINITE
    row[2] = np.nan
    assert screen(edited(s, 7, z=row))[7] == Verdict.USED  # the channel says which columns it needs


@pytest.mark.parametrize("kind", list(LIMITS))
def test_no_sensor_of_a_kind_reports_beyond_its_limits(kind):
    limit = LIMITS[kind]
    width = 4 if kind is Kind.WHEELS else len(kind.columns)
    z = np.tile(0.5 * np.ones(width), (20, 1)) + 1e-3 * np.arange(20)[:, None]
    if kind in (Kind.ATTITUDE, Kind.POSE):
        z[:, -4:] = (0.0, 0.0, 0.0, 1.0)
        z[:, -4] = 1e-3 * np.arange(20)
    s = stream("s", kind, np.arange(1, 21) * 100_000_000, z)
    assert told(s) == {Verdict.USED}
    for column in range(width):
        bound = limit[column] if len(limit) == width else limit[0]
        if np.isfinite(bound):
            for value in (1.01 * bound, -1.01 * bound, 1e308):
                row = z[7].copy()
                row[column] = value
                assert screen(edited(s, 7, z=row))[7] == Verdict.IMPLAUSIBLE


@pytest.mark.parametrize("kind", [Kind.ATTITUDE, Kind.POSE])
@pytest.mark.parametrize("q", [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.5), (1.0, 1.0, 0.0, 0.0)])
def test_a_quaternion_that_is_none(kind, q):
    z = np.zeros((5, len(kind.columns)))
    z[:, -1] = 1.0
    z[:, -2] = 0.01 * np.arange(5)
    z[3, -4:] = q
    assert screen(stream("q", kind, np.arange(1, 6) * SECOND, z))[3] == Verdict.IMPLAUSIBLE


@pytest.mark.parametrize("kind", [Kind.RANGE, Kind.RANGE_BEARING, Kind.RANGE_FINDER])
def test_a_distance_is_positive(kind):
    z = np.full((5, len(kind.columns)), 1.0) + 0.1 * np.arange(5)[:, None]
    z[2, 0 if kind is Kind.RANGE_FINDER else 1] = 0.0
    z[3, 0 if kind is Kind.RANGE_FINDER else 1] = -2.0
    np.testing.assert_array_equal(refused(stream("r", kind, np.arange(1, 6) * SECOND, z), Verdict.IMPLAUSIBLE), [2, 3])


def test_a_sensor_that_declares_itself_invalid():
    s = stream("p", Kind.POSITION, np.arange(1, 6) * SECOND, np.arange(15.0).reshape(5, 3))
    s = replace(s, extra={"valid": np.array([1.0, 0.0, 1.0, 0.0, 1.0])})
    np.testing.assert_array_equal(refused(s, Verdict.DECLARED_INVALID), [1, 3])


# ------------------------------------------------------------------------------------------------ frozen streams


@pytest.mark.parametrize("kind", list(FROZEN_AFTER))
def test_values_that_freeze_while_stamps_go_on(kind):
    n, period = 200, 100_000_000
    rng = np.random.default_rng(0)
    z = 0.01 * rng.standard_normal((n, len(kind.columns))) + 0.1
    if kind is Kind.ATTITUDE:
        z /= np.linalg.norm(z, axis=1, keepdims=True)
    z[60:150] = z[60]
    bad = refused(stream("s", kind, np.arange(1, n + 1) * period, z), Verdict.FROZEN)
    first = 60 + max(round(FROZEN_AFTER[kind] * 10) + 1, 5)
    np.testing.assert_array_equal(bad, np.arange(first, 150))


def test_wheels_at_rest_are_not_frozen():
    z = np.zeros((500, 6))
    assert told(stream("w", Kind.TWIST, np.arange(1, 501) * 50_000_000, z)) == {Verdict.USED}


def test_a_frozen_receiver_is_refused_before_it_could_earn_a_reset():
    from outrider.filters.engine import RESET_TIME

    assert FROZEN_AFTER[Kind.GNSS] < RESET_TIME


# ------------------------------------------------------------------------------------------------ pieces


@pytest.mark.parametrize("fault", list(FAULTS))
@pytest.mark.parametrize("piece", [1, 7, 100])
def test_pieces_get_the_verdicts_of_the_whole(log, fault, piece):
    kind = FAULTS[fault][0]
    spoilt = spoil.apply(log, fault, np.random.default_rng(2))
    for s in spoilt.of(kind):
        s = s.select(slice(0, 700))
        memory = Memory()
        in_pieces = np.concatenate([screen(s.select(slice(i, i + piece)), memory) for i in range(0, len(s), piece)])
        np.testing.assert_array_equal(in_pieces, screen(s))


def test_a_stream_frozen_across_pieces():
    z = np.full((100, 6), 0.123)
    s = stream("imu", Kind.IMU, np.arange(1, 101) * 20_000_000, z)
    memory = Memory()
    in_pieces = np.concatenate([screen(s.select(slice(i, i + 3)), memory) for i in range(0, 100, 3)])
    np.testing.assert_array_equal(in_pieces, screen(s))
    assert (in_pieces == Verdict.FROZEN).sum() > 60


def test_screening_changes_nothing_it_reads(log):
    for s in log:
        before = (s.t.tobytes(), s.z.tobytes(), s.var.tobytes(), s.t_arrival.tobytes())
        screen(s, Memory())
        assert before == (s.t.tobytes(), s.z.tobytes(), s.var.tobytes(), s.t_arrival.tobytes())
