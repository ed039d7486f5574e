"""Whose clock, and which time: stamps against what most sources agree on."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damage import DAMAGE, DAY, HOUR, SECOND, YEAR, damaged
from outrider.data import EventLog, Kind, Stream, stream
from outrider.filters.screen import Memory, bad_stamps
from outrider.filters.stamps import astray, stretches, usual_lags

START = 1_700_000_000 * SECOND


def source(name: str, rate_hz: float, seconds: float, *, begin: int = START, latency: float | None = None) -> Stream:
    t = begin + np.round(np.arange(round(seconds * rate_hz)) * SECOND / rate_hz).astype(np.int64)
    arrival = None if latency is None else t + round(latency * SECOND)
    return stream(name, Kind.POSITION, t, np.ones((t.size, 3)), t_arrival=arrival)


def recorded(*, arrivals: bool, seconds: float = 60.0, begin: int = START) -> EventLog:
    latency = 0.02 if arrivals else None
    rates = {"imu": 50.0, "wheels": 20.0, "gnss": 5.0}
    return EventLog(
        streams={n: source(n, r, seconds, begin=begin, latency=latency) for n, r in rates.items()},
    )


def refused(log: EventLog) -> dict[str, np.ndarray]:
    """Every record that a stamp costs, as the main job decides it."""
    lags = usual_lags(log)
    bad = {s.name: bad_stamps(s, Memory(offset=lags.get(s.name, float("nan")))) for s in log}
    stray = astray(log, bad)
    return {name: bad[name] | stray[name] for name in bad}


def joined(a: EventLog, b: EventLog) -> EventLog:
    def both(x: Stream, y: Stream) -> Stream:
        columns = {n: np.concatenate([getattr(x, n), getattr(y, n)]) for n in ("t", "z", "var", "t_arrival")}
        return replace(x, **columns)

    return EventLog(streams={n: both(s, b.streams[n]) if n in b.streams else s for n, s in a.streams.items()})


@pytest.mark.parametrize("arrivals", [True, False])
def test_a_sound_log_loses_nothing(arrivals):
    assert not any(r.any() for r in refused(recorded(arrivals=arrivals)).values())


@pytest.mark.parametrize("arrival_too", [True, False])
@pytest.mark.parametrize("which", ["imu", "wheels", "gnss"])
@pytest.mark.parametrize("damage", DAMAGE)
@settings(max_examples=12, derandomize=True)
@given(seed=st.integers(0, 2**31))
def test_damaged_stamps_are_refused_and_no_others(damage, which, arrival_too, seed):
    log = recorded(arrivals=not arrival_too)
    sound = log.streams[which]
    spoilt = damaged(sound, damage, np.random.default_rng(seed), arrival_too=arrival_too)
    lost = refused(log.with_streams(spoilt))
    assert not any(r.any() for name, r in lost.items() if name != which)
    off = np.abs((spoilt.t - sound.t) * 1e-9)
    assert lost[which][off > 130.0].all()  # further than the log is long, and a minute
    assert not lost[which][off == 0.0].any()


@pytest.mark.parametrize("arrivals", [True, False])
@pytest.mark.parametrize("away", [2 * 60 * SECOND, HOUR, DAY, YEAR])
def test_a_night_between_two_sessions_is_no_fault(arrivals, away):
    log = recorded(arrivals=arrivals)
    later = recorded(arrivals=arrivals, seconds=30.0, begin=START + 60 * SECOND + away)
    assert not any(r.any() for r in refused(joined(log, later)).values())


def test_a_restart_may_lose_a_source_but_not_most():
    log = recorded(arrivals=False)
    later = recorded(arrivals=False, begin=START + DAY)
    two = replace(later, streams={n: later.streams[n] for n in ("imu", "wheels")})
    one = replace(later, streams={"imu": later.streams["imu"]})
    assert not any(r.any() for r in refused(joined(log, two)).values())
    lost = refused(joined(log, one))
    np.testing.assert_array_equal(lost["imu"], np.arange(6000) >= 3000)


def test_a_single_source_may_restart():
    log = EventLog(streams={"gnss": source("gnss", 5.0, 60.0)})
    later = EventLog(streams={"gnss": source("gnss", 5.0, 60.0, begin=START + DAY)})
    assert not refused(joined(log, later))["gnss"].any()


def test_of_two_sources_on_two_clocks_the_richer_one_stays():
    log = EventLog(streams={"imu": source("imu", 50.0, 60.0), "gnss": source("gnss", 5.0, 60.0, begin=20 * SECOND)})
    lost = refused(log)
    assert not lost["imu"].any()
    assert lost["gnss"].all()


def test_sources_that_begin_late_end_early_or_pause_are_no_strays():
    log = recorded(arrivals=False, seconds=600.0)
    gnss, wheels = log.streams["gnss"], log.streams["wheels"]
    since = (gnss.t - START) * 1e-9
    log = log.with_streams(gnss.select((since > 200) & (since < 220)), wheels.select(slice(5000, 5002)))
    assert not any(r.any() for r in refused(log).values())


def test_a_sparse_source_is_judged_by_its_own_period():
    log = recorded(arrivals=False, seconds=600.0)
    beacon = source("beacon", 0.05, 700.0)
    assert not refused(log.with_streams(beacon))["beacon"].any()


def test_arrivals_decide_which_half_is_right():
    """Even if the wrong half is the larger: other sources show the recorder's usual latency."""
    log = recorded(arrivals=True)
    s = log.streams["imu"]
    wrong = np.arange(len(s)) % 3 > 0
    lost = refused(log.with_streams(replace(s, t=s.t + np.where(wrong, HOUR, 0))))
    np.testing.assert_array_equal(lost["imu"], wrong)


def test_a_recorder_on_another_clock_than_all_sources_does_not_matter():
    log = recorded(arrivals=True)
    moved = [replace(s, t_arrival=s.t_arrival + 40 * YEAR) for s in log]
    assert not any(r.any() for r in refused(log.with_streams(*moved)).values())


def test_a_far_future_stamp_with_an_equal_arrival_is_astray():
    s = source("gnss", 5.0, 60.0)
    t = s.t.copy()
    t[7] += 20 * YEAR
    log = recorded(arrivals=True).with_streams(replace(s, t=t, t_arrival=t))
    np.testing.assert_array_equal(np.flatnonzero(refused(log)["gnss"]), [7])


def test_stretches_end_where_a_source_pauses():
    t = np.concatenate([np.arange(100), 1000 + np.arange(50), [5000]]) * SECOND
    assert [(f.first // SECOND, f.last // SECOND, f.stamps) for f in stretches(t)] == [(0, 99, 100), (1000, 1049, 50)]
    assert stretches(np.zeros(0, np.int64)) == []
    assert len(stretches(np.array([3 * SECOND]))) == 1
