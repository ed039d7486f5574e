"""Laws of the engine: the order of arrival does not matter, the drivers agree to the bit, time does what it likes."""

from dataclasses import replace

import numpy as np
import pytest
from support import (
    COMPILED,
    arrivals,
    batch,
    channel,
    delayed,
    drone,
    feed,
    online,
    parts,
    prior,
    queued,
    rover,
    same,
    scattered,
    start,
)

from outrider.core.rotations import quats_to_rpy
from outrider.data import EventLog, Verdict
from outrider.errors import ConfigError, DataError
from outrider.filters import step as one
from outrider.filters.channels import Records
from outrider.filters.engine import Filter, OnlineFilter, Queue, own_variance, queue
from outrider.filters.step import C_EVENTS, C_NOW, OUT_DOF, OUT_NIS, OUT_VERDICT, ROWS
from outrider.models.motion import LAYOUTS, LaggedFollower, Motion, OmnidirectionalBody
from outrider.models.sensors import GnssPosition, Position
from outrider.sim import Truth, drone_log, wheeled_log
from outrider.typing import Floats

SECONDS = 25.0 if COMPILED else 2.0
RATE = 50.0 if COMPILED else 10.0
COMPILED_ONLY = pytest.mark.compiled  # too slow, or full of overflow warnings, as plain Python


@pytest.fixture(scope="module", params=["rover", "drone"])
def case(request) -> tuple[Filter, EventLog, Truth]:
    if request.param == "rover":
        return rover(), *wheeled_log(3, SECONDS, rate_hz=RATE, exact=True)
    return drone(), *drone_log(3, SECONDS, rate_hz=RATE)


def shifted(log: EventLog, name: str, ns: int) -> EventLog:
    s = log.streams[name]
    return log.with_streams(replace(s, t=s.t + ns))


def follower(**changes) -> Filter:
    """The smallest filter: constant velocity and positions."""
    theta = LaggedFollower().theta()
    fix = channel("position", Position(sigma=0.1), reset=(0, 3))
    return replace(Filter(motion=Motion.FOLLOWER, theta=theta, coasting=theta, channels=(fix,)), **changes)


# ------------------------------------------------------------------------------------------------ the order of events


def test_the_estimate_is_near_the_truth(case):
    f, log, truth = case
    s, sink = batch(f, queued(f, log))
    assert np.linalg.norm(s.x[:2] - truth.p[-1, :2]) < (0.1 if f.motion is Motion.PLANAR else 1.5)
    outcomes = sink.outcomes()
    used = np.isin(outcomes[:, OUT_VERDICT], [Verdict.USED, Verdict.INPUT])
    assert used.mean() > 0.99


def test_same_input_same_bits(case):
    f, log, _ = case
    one_, two = (batch(f, queued(f, log)) for _ in range(2))
    assert same(one_[0], two[0])
    assert one_[1].outcomes().tobytes() == two[1].outcomes().tobytes()


def spread(state, table) -> Floats:
    """Standard deviation of each error by itself."""
    return np.sqrt([own_variance(state.x, state.P, table, i) for i in range(len(state.P))])


def test_drivers_agree_step_by_step(case):
    """Online, in order: every outcome and every state on the way, to the bit; deviations to rounding."""
    f, log, _ = case
    q = queued(f, log)
    s, sink = batch(f, q, period=1e-9)
    track, outcomes = sink.tracked(), sink.outcomes()
    filter_, row = OnlineFilter(f, start(f), 0.0), 0
    for i in range(len(q)):
        out = feed(filter_, q, i)
        assert out.tobytes() == outcomes[i].tobytes()
        if i + 1 == len(q) or q.events(i + 1, i + 2).t[0] > filter_.time:
            assert filter_.state.x.tobytes() == track.x[row].tobytes()
            np.testing.assert_allclose(spread(filter_.state, f.layout.table), track.sd[row], rtol=1e-12)
            row += 1
    assert row == track.t.size
    assert same(filter_.state, s)


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=COMPILED_ONLY) for k in (1, 2))])
def test_any_order_of_arrival_within_the_history_ends_in_the_same_bits(case, seed):
    f, log, _ = case
    mixed = delayed(log, 1.9, seed)
    q = queued(f, mixed)
    assert (np.diff(arrivals(q)) < 0).mean() > 0.3
    in_order, _ = online(f, queued(f, delayed(log, 0.0)))
    shuffled, _ = online(f, q)
    whole, _ = batch(f, q)
    assert shuffled.rewinds > 10 and shuffled.late == 0
    assert same(shuffled.state, in_order.state)
    assert same(shuffled.state, whole)


def test_a_delayed_run_equals_the_undelayed(case):
    f, log, _ = case
    prompt, tardy = batch(f, queued(f, delayed(log, 0.0)))[0], online(f, queued(f, delayed(log, -10.0)))[0].state
    assert same(prompt, tardy)
    hour = 3_600_000_000_000
    later = log.with_streams(*(replace(s, t=s.t + hour, t_arrival=s.t_arrival + hour) for s in log))
    assert same(batch(f, queued(f, later))[0], batch(f, queued(f, log))[0])


@pytest.mark.parametrize("history", [0.5, *(pytest.param(h, marks=COMPILED_ONLY) for h in (0.1, 1.0))])
def test_too_late_is_counted_alike_by_both_drivers(case, history):
    f, log, _ = case
    f = replace(f, history=history)
    q = queued(f, delayed(log, 1.5, 7))
    s, sink = batch(f, q)
    filter_, out = online(f, q)
    late = int((sink.outcomes()[:, OUT_VERDICT] == Verdict.LATE).sum())
    assert late == filter_.late == int((out[:, OUT_VERDICT] == Verdict.LATE).sum()) > 0
    assert same(filter_.state, s)


def test_a_record_exactly_as_old_as_the_history_is_not_late():
    """2.1 - 2.0 is more than 0.1 in floats: both drivers must draw the line at the same bit."""
    f = follower()
    t = np.array([2_100_000_000, 100_000_000, 99_999_999], np.int64)
    part = replace(
        parts_of(f, t, np.zeros((3, 3))), t_arrival=np.array([2_100_000_000, 2_200_000_000, 2_300_000_000], np.int64)
    )
    q = queue([part], 0, f.history)
    _, sink = batch(f, q, prior(f.layout))
    filter_, _ = online(f, q, prior(f.layout))
    assert (sink.outcomes()[:, OUT_VERDICT] == Verdict.LATE).sum() == filter_.late
    assert sink.outcomes()[0, OUT_VERDICT] == Verdict.LATE


def parts_of(f: Filter, t, z):
    """Records of the only channel of `follower`."""
    n = len(t)
    full = np.zeros((n, ROWS))
    full[:, :3] = z
    r = np.full((n, ROWS), np.inf)
    r[:, :3] = 0.01
    t = np.asarray(t, np.int64)
    return Records(t, t, full, r, np.zeros(n, np.int64), np.arange(n))


def test_events_of_one_instant_at_the_edge_of_the_history():
    """A record as old as the history joins those of its own instant in the order of channels, not after them."""
    fix = channel("position", Position(sigma=0.1))
    f = follower(channels=(fix, replace(fix, name="other", theta=Position().theta())))
    a = parts_of(f, [0, 1_000_000_000, 3_000_000_000], [[0, 0, 0], [5.0, 0, 0], [1, 0, 0]])
    b = parts_of(f, [0, 1_000_000_000], [[0, 0, 0], [0.0, 1, 0]])
    a = replace(a, t_arrival=np.array([0, 3_100_000_000, 3_000_000_000], np.int64))
    q = queue([a, b], 0, 2.0)
    whole, _ = batch(f, q, prior(f.layout))
    filter_, _ = online(f, q, prior(f.layout))
    assert filter_.late == 0 and filter_.rewinds == 1
    assert same(filter_.state, whole)


def crossing(log: EventLog, name: str) -> EventLog:
    """Of all streams only this one has its records on the stamps of the IMU's."""
    return scattered(log).with_streams(log.streams[name])


@pytest.mark.parametrize("ns", [1000, -1000])
@pytest.mark.parametrize("crossed", [True, False])
def test_a_microsecond_moves_the_position_by_microseconds(case, ns, crossed):
    """Also where records cross the IMU's, which drives the drone."""
    f, log, truth = case
    bound = 1e-5 * max(np.linalg.norm(truth.v, axis=1).max(), 0.1)
    for name in sorted({c.stream for c in f.channels}):
        arranged = crossing(log, name) if crossed else scattered(log)
        before, _ = batch(f, queued(f, arranged), t_start=-0.1)
        q = queue(parts(f, shifted(arranged, name, ns)), log.span[0], f.history)
        after, _ = batch(f, q, t_start=-0.1)
        assert np.abs(after.x - before.x).max() > 0.0
        assert np.linalg.norm(after.x[:2] - before.x[:2]) <= bound, name


def test_a_millisecond_would_be_noticed(case):
    f, log, truth = case
    log = scattered(log)
    before, _ = batch(f, queued(f, log), t_start=-0.1)
    q = queue(parts(f, shifted(log, "gnss", 20_000_000)), log.span[0], f.history)
    after, _ = batch(f, q, t_start=-0.1)
    assert np.linalg.norm(after.x[:2] - before.x[:2]) > 1e-5 * np.linalg.norm(truth.v, axis=1).max()


# ------------------------------------------------------------------------------------------------ the input


def ramp(between: float | None = None) -> tuple[Filter, Queue]:
    """A drone that is pushed ever harder while it turns ever faster; a record without content falls between."""
    f = drone()
    t = np.arange(0, 1_000_000_001, 100_000_000, np.int64)
    u = np.outer(t * 1e-9, [0.5, -0.3, 2.0, 3.0, 2.0, 1.0]) + np.array([0, 0, 0, 0, 0, 9.806])
    imu = Records(t, t, np.pad(u, ((0, 0), (0, ROWS - 6))), np.ones((t.size, ROWS)), *np.zeros((2, t.size), np.int64))
    at = np.array([] if between is None else [round(between * 1e9)], np.int64)
    mute = Records(
        at, at, np.zeros((at.size, ROWS)), np.full((at.size, ROWS), np.inf), *np.zeros((2, at.size), np.int64)
    )
    none = Records(t[:0], t[:0], np.zeros((0, ROWS)), np.zeros((0, ROWS)), t[:0], t[:0])
    return f, queue([imu, none, none, mute], 0, f.history)


def test_the_input_runs_straight_from_record_to_record():
    """An acceleration that grows by a(t) = k t gives v = k t^2 / 2, wherever else an event falls."""
    f, q = ramp()
    whole, _ = batch(f, q)
    for between, atol in ((0.4, 1e-12), (0.4000001, 1e-6), (0.3999999, 1e-6), (0.43, 5e-4), (0.45, 5e-4)):
        cut, _ = batch(*ramp(between))
        np.testing.assert_allclose(cut.x, whole.x, atol=atol)  # the attitude turns in two steps instead of one
    still = replace(q, parts=tuple(replace(p, z=p.z * np.array([0, 0, 0, 1, 1, 1, 0, 0])) for p in q.parts))
    v = batch(f, still)[0].x[f.layout.state("velocity")]
    np.testing.assert_allclose(v, [1.5, 1.0, 0.5], atol=1e-9)


def test_what_lies_between_two_inputs_is_replayed_when_the_second_arrives():
    """Online the first is held until then; afterwards every state is that of the batch driver, to the bit."""
    f, (log, _) = drone(), drone_log(3, SECONDS, rate_hz=RATE)
    q = queued(f, scattered(log))
    s, sink = batch(f, q, period=1e-9)
    track, filter_ = sink.tracked(), OnlineFilter(f, start(f), 0.0)
    for i in range(len(q)):
        feed(filter_, q, i)
        if f.channels[q.src[i]].sensor is None:
            assert filter_.state.x.tobytes() == track.x[np.searchsorted(track.t, filter_.time)].tobytes()
    assert filter_.rewinds == 0
    assert same(filter_.state, s)


def test_a_bad_input_is_not_looked_forward_to():
    """A record that will be refused does not bend the line; nor does one behind a long gap."""
    f, q = ramp(0.47)
    imu = q.parts[0]
    bad = replace(imu, z=np.where((imu.t == 500_000_000)[:, None], 1e9, imu.z))
    gone = replace(imu, flag=np.where(imu.t == 500_000_000, int(Verdict.FROZEN), 0))
    refused, absent = (batch(f, queue([p, *q.parts[1:]], 0, f.history)) for p in (bad, gone))
    assert same(refused[0]._replace(clock=absent[0].clock), absent[0])
    assert Verdict.IMPLAUSIBLE in refused[1].outcomes()[:, OUT_VERDICT]
    late = replace(imu, flag=np.where((imu.t > 0) & (imu.t < 1_000_000_000), int(Verdict.FROZEN), 0))
    held = batch(f, queue([late, *q.parts[1:]], 0, f.history), last=2)[0]
    assert held.u.tobytes() == imu.z[0, :6].tobytes()


# ------------------------------------------------------------------------------------------------ pieces and outputs


@pytest.mark.parametrize("piece", [7, *(pytest.param(n, marks=COMPILED_ONLY) for n in (1, 64))])
def test_pieces_change_nothing(case, piece):
    f, log, _ = case
    q = queued(f, log)
    q = replace(q, t=q.t[:300], src=q.src[:300], index=q.index[:300], late=q.late[:300])
    whole, all_at_once = batch(f, q)
    pieces, in_parts = batch(f, q, piece=piece)
    assert same(whole, pieces)
    assert all_at_once.outcomes().tobytes() == in_parts.outcomes().tobytes()
    for a, b in zip(all_at_once.tracked(), in_parts.tracked(), strict=True):
        assert a.tobytes() == b.tobytes()
    assert len(in_parts.out) > 1


def test_outputs_come_once_an_instant_and_once_a_period(case):
    f, log, _ = case
    t = batch(f, queued(f, log), period=0.2)[1].tracked().t
    assert (np.diff(t) > 0.0).all()
    assert np.diff(t).min() > 0.09 and np.median(np.diff(t)) == pytest.approx(0.2, abs=0.03)
    every = batch(f, queued(f, log), period=1e-9)[1].tracked().t
    assert every.size == np.unique(np.concatenate([p.t for p in parts(f, log)])).size


def test_last_stops_early(case):
    f, log, _ = case
    q = queued(f, log)
    s, sink = batch(f, q, last=20)
    assert s.clock[C_EVENTS] == 20 and sink.outcomes().shape[0] == 20


def test_the_pose_covariance_is_that_of_the_state():
    """Planar: the heading's variance about the vertical, and the velocity turned into the world."""
    f = rover()
    x = f.layout.zeros()
    x[f.layout.state("heading")], x[f.layout.state("velocity")] = 0.5 * np.pi, (2.0, 0.0)
    belief = prior(f.layout, 0.0, x, position=0.3, velocity=0.1, heading=0.2)
    log, _ = wheeled_log(1, 1.0, rate_hz=10.0)
    f = replace(f, channels=(replace(f.channels[0], role="scored"),))
    P = batch(f, queued(f, log), belief, last=1)[1].tracked().P[0]
    np.testing.assert_allclose(np.diag(P)[:2], 0.09, rtol=0.05)
    assert P[8, 8] == pytest.approx(0.04, rel=0.05)
    assert P[3, 3] == pytest.approx(0.01 + 4.0 * 0.04, rel=0.05)  # east is sideways: 2 m/s times the heading's error
    assert P[4, 4] == pytest.approx(0.01, rel=0.5)


# ------------------------------------------------------------------------------------------------ what time may do


def verdicts(f: Filter, part, belief=None) -> tuple[one.State, list[Verdict]]:
    s, sink = batch(f, queue([part], 0, f.history), belief or prior(f.layout))
    return s, [Verdict(int(v)) for v in sink.outcomes()[:, OUT_VERDICT]]


@pytest.mark.parametrize(
    "gap_s", [5, *(pytest.param(s, marks=COMPILED_ONLY) for s in (600, 10_800, 86_400, 630_720_000))]
)
def test_a_gap_of_any_length_is_crossed(gap_s):
    f = follower()
    t = np.array([0, 1, 2, gap_s, gap_s + 1, gap_s + 2]) * 1_000_000_000
    s, v = verdicts(f, parts_of(f, t, np.zeros((6, 3))))
    assert s.clock[C_NOW] == pytest.approx(gap_s + 2)
    assert np.isfinite(s.x).all() and np.isfinite(s.P).all()
    assert v[:3] == [Verdict.USED] * 3 and set(v[3:]) <= {Verdict.USED, Verdict.DIVERGED}


@COMPILED_ONLY
@pytest.mark.parametrize("motion", list(Motion))
@pytest.mark.parametrize("gap_s", [700, 3 * 3600, 10 * 86_400])
def test_no_model_loses_itself_in_a_gap(motion, gap_s):
    """Also one that was turning, whose covariance would overflow."""
    base = {Motion.PLANAR: rover(), Motion.STRAPDOWN: drone(), Motion.FOLLOWER: follower()}
    theta = OmnidirectionalBody().theta()
    f = base.get(motion) or Filter(motion=motion, theta=theta, coasting=theta, channels=())
    f = replace(f, channels=(channel("gnss", GnssPosition()),))
    x = LAYOUTS[motion].zeros()
    for name, value in (("rate", 1.0), ("yaw_rate", 1.0), ("velocity", 2.0)):
        if name in f.layout:
            x[f.layout.state(name)] = value
    filter_ = OnlineFilter(f, prior(f.layout, 0.1, x), 0.0)
    for t in (0.0, 0.2, gap_s, gap_s + 0.2, gap_s + 0.4):
        filter_.process(float(t), 0, np.zeros(3), np.ones(3))
        assert np.isfinite(filter_.state.x).all() and np.isfinite(filter_.state.P).all()
    assert filter_.time == gap_s + 0.4


def test_a_stamp_ahead_of_the_others_is_named_by_what_it_makes_late():
    f = follower()
    t = np.array([0, 1, 100, 2, 3, 101]) * 1_000_000_000
    part = replace(parts_of(f, t, np.zeros((6, 3))), t_arrival=np.arange(6) * 1_000_000_000)
    s, v = verdicts(f, part)
    assert sorted(v) == [Verdict.USED] * 4 + [Verdict.LATE] * 2
    assert s.clock[C_NOW] == 101.0


def test_a_clock_that_falls_back_is_late():
    f = follower()
    t = np.array([10, 11, 12, 3, 4, 13]) * 1_000_000_000
    part = replace(parts_of(f, t, np.zeros((6, 3))), t_arrival=np.arange(6) * 1_000_000_000)
    s, v = verdicts(f, part)
    assert v == [Verdict.LATE] * 2 + [Verdict.USED] * 4 and s.clock[C_EVENTS] == 4


def test_records_of_before_the_start_are_not_fused():
    f = follower()
    t = np.arange(6) * 1_000_000_000
    q = queue([parts_of(f, t, np.full((6, 3), 50.0))], 0, 10.0)
    _, sink = batch(f, q, prior(f.layout), t_start=2.5)
    assert list(sink.outcomes()[:3, OUT_VERDICT]) == [Verdict.NOT_ALIGNED] * 3
    early = OnlineFilter(f, prior(f.layout), 2.5)
    assert early.process(1.0, 0, np.full(3, 50.0), np.ones(3))[OUT_VERDICT] == Verdict.NOT_ALIGNED
    assert not early.state.x.any() and early.time == 2.5


@pytest.mark.parametrize("t", [np.nan, np.inf, -np.inf])
def test_a_time_that_is_no_number_is_a_bad_stamp(t):
    f = follower()
    filter_ = OnlineFilter(f, prior(f.layout), 0.0)
    filter_.process(1.0, 0, np.zeros(3), np.ones(3))
    before = one.snapshot(filter_.state)
    assert filter_.process(t, 0, np.zeros(3), np.ones(3))[OUT_VERDICT] == Verdict.BAD_STAMP
    assert same(before, filter_.state)


def test_the_same_record_twice_is_two_records_unless_screening_says_so():
    """The engine trusts the verdicts that records bring: screening tells duplicates, see there."""
    f = follower()
    part = parts_of(f, [0, 0, 1_000_000_000], np.zeros((3, 3)))
    part.flag[1] = Verdict.DUPLICATE
    s, v = verdicts(f, part)
    assert v == [Verdict.USED, Verdict.DUPLICATE, Verdict.USED] and s.clock[C_EVENTS] == 2


@pytest.mark.parametrize("flag", [v for v in Verdict if v not in (Verdict.USED, Verdict.WITHHELD)])
def test_a_refused_record_touches_nothing(flag):
    f = follower()
    filter_ = OnlineFilter(f, prior(f.layout), 0.0)
    filter_.process(1.0, 0, np.zeros(3), np.ones(3))
    before = one.snapshot(filter_.state)
    out = filter_.process(1.5, 0, np.full(3, np.nan), np.full(3, -1.0), flag=int(flag))
    assert out[OUT_VERDICT] == flag and same(before, filter_.state)
    late = filter_.process(1.2, 0, np.zeros(3), np.ones(3))  # the refused one did not move the clock
    assert late[OUT_VERDICT] == Verdict.USED and filter_.rewinds == 0


def test_a_withheld_record_is_scored_and_not_fused(case):
    f, log, _ = case
    held = replace(f, channels=tuple(replace(c, role="scored") if c.name == "gnss" else c for c in f.channels))
    # The prediction stops at every record, so the yardstick is a receiver that says nothing, not one that is missing.
    mute = [replace(c, sigma=np.full(3, np.inf), trust_stated=False) if c.name == "gnss" else c for c in f.channels]
    dumb = replace(f, channels=tuple(mute))
    s, sink = batch(held, queued(held, log))
    t, _ = batch(dumb, queued(dumb, log))
    assert np.array_equal(s.x, t.x) and np.array_equal(s.P, t.P)
    out = sink.outcomes()
    scored = out[out[:, OUT_VERDICT] == Verdict.WITHHELD]
    assert scored.shape[0] == len(log.streams["gnss"])
    assert np.isfinite(scored[:, OUT_NIS]).all() and (scored[:, OUT_DOF] >= 2).all()


# ------------------------------------------------------------------------------------------------ the online driver


def test_the_caller_may_reuse_his_arrays():
    """A rewind replays what was given, not what the array holds by then; short arrays are filled up."""
    f = follower()
    reference, reused = (OnlineFilter(f, prior(f.layout), 0.0) for _ in range(2))
    z, r = np.zeros(ROWS), np.full(ROWS, 0.01)
    for t in (0.1, 0.3, 0.2):
        z[:] = 10.0 * t
        reused.process(t, 0, z, r)
        reference.process(t, 0, np.full(3, 10.0 * t), np.full(3, 0.01))
        z[:] = 1e6
    assert reused.rewinds == 1
    assert same(reused.state, reference.state)


def test_a_measurement_of_the_users_own():
    """`correct` is the plain update: a direct look at the heading, which no channel has."""
    f, log = rover(), wheeled_log(3, 3.0, rate_hz=10.0)[0]
    filter_, _ = online(f, queued(f, log))
    row = f.layout.error("heading").start
    H = np.zeros((1, f.layout.error_size))
    H[0, row] = 1.0
    prior_variance, before = filter_.state.P[row, row], filter_.belief
    nis = filter_.correct(np.array([0.01]), H, np.array([1e-4]))
    S = prior_variance + 1e-4
    assert nis == pytest.approx(1e-4 / S)
    assert filter_.state.P[row, row] == pytest.approx(prior_variance * 1e-4 / S)
    moved = filter_.belief.x[f.layout.state("heading")] - before.x[f.layout.state("heading")]
    assert moved[0] == pytest.approx(0.01 * prior_variance / S)
    assert filter_.process(3.5, 1, np.zeros(6), np.ones(6))[OUT_VERDICT] == Verdict.USED


@pytest.mark.parametrize("bad", [np.nan, np.inf, pytest.param(1e308, marks=COMPILED_ONLY)])
def test_a_bad_measurement_of_the_users_own_is_an_error_and_changes_nothing(bad):
    f = rover()
    filter_ = OnlineFilter(f, start(f), 0.0)
    before = one.snapshot(filter_.state)
    with pytest.raises(DataError, match="innovation"):
        filter_.correct(np.array([bad]), np.eye(1, f.layout.error_size), np.array([0.1]))
    assert same(before, filter_.state)


def test_a_filter_without_channels_says_so():
    with pytest.raises(ConfigError, match="no channel"):
        follower(channels=()).sources()


def test_consider_states_keep_their_value(case):
    f, log, _ = case
    bias = "gyro_bias"
    f = replace(f, consider=(bias,))
    x = start(f)
    x.x[f.layout.state(bias)] = 0.003
    s, _ = batch(f, queued(f, log), x)
    assert (s.x[f.layout.state(bias)] == 0.003).all()
    assert (np.diag(s.P)[f.layout.error(bias)] > 0.0).all()


def test_memory_of_the_past_is_bounded(case):
    f, log, _ = case
    f = replace(f, history=0.5)
    filter_, _ = online(f, queued(f, log))
    assert len(filter_._past) < 0.5 * 2.0 * sum(p.t.size for p in parts(f, log)) / SECONDS + 20


# ------------------------------------------------------------------------------------------------ coasting


def test_without_its_imu_a_drone_coasts_straight_and_says_so():
    f, (log, _) = drone(), drone_log(3, SECONDS, rate_hz=RATE)
    imu = log.streams["imu"]
    cut = imu.select(imu.t < log.span[0] + int(0.5 * SECONDS * 1e9))
    s, _ = batch(f, queued(f, log.with_streams(cut)))
    full, _ = batch(f, queued(f, log))
    a = f.layout.error("attitude")
    assert np.isfinite(s.x).all()
    assert np.diag(s.P)[a].sum() > 3.0 * np.diag(full.P)[a].sum()


def test_coasting_neither_turns_nor_accelerates():
    """Whatever the last record said: a hard turn does not go on for a minute."""
    f = drone()
    filter_ = OnlineFilter(f, start(f), 0.0)
    filter_.state.x[f.layout.state("velocity")] = (3.0, 0.0, 0.0)
    filter_._base = one.snapshot(filter_.state)
    turning = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 9.806])
    for k in range(20):
        filter_.process(0.02 * k, 0, turning, np.ones(6))
    last = quats_to_rpy(filter_.belief.x[None, f.layout.state("attitude")])[0]
    filter_.process(10.0, 3, np.zeros(1), np.full(1, 1e9))
    yaw = quats_to_rpy(filter_.belief.x[None, f.layout.state("attitude")])[0]
    assert yaw[2] - last[2] == pytest.approx(0.5, abs=0.15)  # the hold of half a second, then straight
    speed = np.linalg.norm(filter_.belief.x[f.layout.state("velocity")][:2])
    assert speed == pytest.approx(3.0, abs=0.1)
