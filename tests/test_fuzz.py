"""Logs spoiled in every way that comes to mind: an answer or one clear line, no NaN, no warning, no hang."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gnss_logs
from damage import DAMAGE, damaged
from outrider.data import EventLog, Kind, Outcome, Stream
from outrider.errors import ExitCode, OutriderError
from outrider.io.registry import read_log
from outrider.sim import drone_log, wheeled_log
from outrider.workflows.config import FuseConfig
from outrider.workflows.fuse import fuse
from outrider.workflows.summary import exit_code

pytestmark = pytest.mark.compiled  # overflow is silent there; plain Python would warn of every one

CAP_S = 20.0  # far above what any of these logs takes
SECOND = 1_000_000_000
BAD = np.array([np.nan, np.inf, -np.inf, 1e308, -1e308, 1e20, 0.0, -1.0])

Mutation = Callable[[Stream, np.random.Generator], Stream]


@cache
def base(vehicle: str) -> EventLog:
    """Fifteen seconds of a robot that moves; of the walker there is a log of its receiver only."""
    if vehicle == "walker":
        with TemporaryDirectory() as folder:
            path = Path(folder) / "walk.nmea"
            path.write_text("".join(gnss_logs.nmea_epoch(k, 1) for k in range(15)), encoding="ascii")
            return read_log(path)
    if vehicle == "rover":
        return wheeled_log(11, 15.0, rate_hz=20.0, exact=True)[0]
    return drone_log(11, 15.0, rate_hz=20.0)[0]


def rows(s: Stream, rng: np.random.Generator) -> np.ndarray:
    """A random share of the rows, or one."""
    return rng.random(len(s)) < rng.choice([0.02, 0.3, 1.0])


def truncated(s: Stream, rng: np.random.Generator) -> Stream:
    return s.select(slice(0, int(rng.choice([0, 1, 2, 3, len(s) // 2]))))


def beheaded(s: Stream, rng: np.random.Generator) -> Stream:
    return s.select(slice(int(rng.choice([1, len(s) // 2, max(len(s) - 1, 0), len(s)])), None))


def spoiled_values(s: Stream, rng: np.random.Generator) -> Stream:
    z, hit = s.z.copy(), rows(s, rng)
    column = int(rng.integers(z.shape[1]))
    z[hit, column] = rng.choice(BAD, int(hit.sum()))
    return replace(s, z=z)


def spoiled_rows(s: Stream, rng: np.random.Generator) -> Stream:
    z, hit = s.z.copy(), rows(s, rng)
    z[hit] = rng.choice(BAD, (int(hit.sum()), z.shape[1]))
    return replace(s, z=z)


def noise_instead(s: Stream, rng: np.random.Generator) -> Stream:
    z, hit = s.z.copy(), rows(s, rng)
    z[hit] = rng.normal(0.0, rng.choice([1.0, 1e3]), (int(hit.sum()), z.shape[1]))
    return replace(s, z=z)


def shifted_places(s: Stream, rng: np.random.Generator) -> Stream:
    z, hit = s.z.copy(), rows(s, rng)
    z[hit, 0] += rng.choice([1e-5, 0.1, 10.0])
    return replace(s, z=z)


def variances(s: Stream, rng: np.random.Generator) -> Stream:
    var, hit = s.var.copy(), rows(s, rng)
    var[hit] = rng.choice(np.append(BAD, 1e-300), (int(hit.sum()), var.shape[1]))
    return replace(s, var=var)


def frozen(s: Stream, rng: np.random.Generator) -> Stream:
    z = s.z.copy()
    first = int(rng.integers(len(s))) if len(s) else 0
    z[first:] = z[first : first + 1]
    return replace(s, z=z)


def doubled(s: Stream, rng: np.random.Generator) -> Stream:
    return s.select(np.repeat(np.arange(len(s)), 1 + rows(s, rng)))


def reordered(s: Stream, rng: np.random.Generator) -> Stream:
    return s.select(rng.permutation(len(s)))


def late(s: Stream, rng: np.random.Generator) -> Stream:
    return replace(s, t_arrival=s.t_arrival + rng.integers(0, int(rng.choice([1, 5, 3000])) * SECOND, len(s)))


def stamped_zero(s: Stream, rng: np.random.Generator) -> Stream:
    return replace(s, t=np.where(rows(s, rng), rng.choice([0, -1, -SECOND]), s.t))


def stamped_equal(s: Stream, rng: np.random.Generator) -> Stream:
    return replace(s, t=np.full_like(s.t, s.t[0] if len(s) else 0))


def clock_jump(s: Stream, rng: np.random.Generator) -> Stream:
    jump = int(rng.choice([-3600, -30, -3, 3, 30, 3600, 86_400 * 365]) * SECOND)
    after = np.arange(len(s)) >= rng.integers(len(s) + 1)
    moved = replace(s, t=s.t + np.where(after, jump, 0))
    return replace(moved, t_arrival=moved.t.copy()) if rng.random() < 0.5 else moved


def other_epoch(s: Stream, rng: np.random.Generator) -> Stream:
    return replace(s, t=s.t - s.t.min(initial=2**62) + int(rng.choice([1, SECOND, 2**61])))


def extremes(s: Stream, rng: np.random.Generator) -> Stream:
    t = np.where(rows(s, rng), rng.choice(np.array([1, 2**62, -(2**62)])), s.t)
    return replace(s, t=t)


def further_columns(s: Stream, rng: np.random.Generator) -> Stream:
    choices = np.array([-1.0, 0.0, 1.0, 3.0, 4.0, 5.0, 7.0, 99.0, 1e308, np.nan, np.inf])
    extra = {name: np.where(rows(s, rng), rng.choice(choices, len(s)), c) for name, c in s.extra.items()}
    return replace(s, extra=extra)


def invalid(s: Stream, rng: np.random.Generator) -> Stream:
    return replace(s, extra={**s.extra, "valid": rng.choice([0.0, 1.0, np.nan], len(s))})


def damaged_stamps(s: Stream, rng: np.random.Generator) -> Stream:
    return damaged(s, rng.choice(sorted(DAMAGE)), rng, arrival_too=bool(rng.random() < 0.5)) if len(s) else s


MUTATIONS: tuple[Mutation, ...] = (
    truncated, beheaded, spoiled_values, spoiled_rows, noise_instead, shifted_places, variances, frozen, doubled,
    reordered, late, stamped_zero, stamped_equal, clock_jump, other_epoch, extremes, further_columns, invalid,
    damaged_stamps,
)  # fmt: skip

steps = st.lists(st.tuples(st.integers(0, 9), st.sampled_from(MUTATIONS), st.integers(0, 99)), max_size=5)


def spoiled(log: EventLog, changes, dropped: frozenset[int] = frozenset()) -> EventLog:
    names = sorted(log.streams)
    for which, change, seed in changes:
        s = log.streams[names[which % len(names)]]
        log = log.with_streams(change(s, np.random.default_rng(seed)))
    kept = {n: log.streams[n] for k, n in enumerate(names) if k not in dropped}
    return replace(log, streams=kept)


def judge(log: EventLog, config: FuseConfig | None = None) -> str:
    """Fuse; the outcome's name or the error's one line. What must never happen is asserted."""
    began = time.perf_counter()
    try:
        run = fuse(log, config or FuseConfig())
    except OutriderError as error:
        line = str(error)
        assert line.strip() and "\n" not in line
        return line
    assert time.perf_counter() - began < CAP_S
    for estimates in (run.fused, run.local):
        if estimates is not None:
            for name in ("x", "sd"):
                assert np.isfinite(getattr(estimates, name)).all(), name
            assert np.isfinite(estimates.pose.p).all() and np.isfinite(estimates.pose.v).all()
            assert np.isfinite(estimates.pose.P).all()
            assert (np.diff(estimates.t) > 0).all()
    for account in run.accounts:
        assert sum(account.by_verdict.values()) + account.malformed <= account.received
    for name, s in log.streams.items():  # no record vanishes between the channels of its source
        mine = [a for a in run.accounts if a.source == name or a.source in (f"{name} (fixed)",)]
        assert not mine or s.kind is not Kind.GNSS or sum(a.received for a in mine) == len(s) + s.malformed
    assert len({f.text for f in run.findings}) == len(run.findings) <= 60
    if exit_code(run) is ExitCode.OK:  # then there is something to be trusted
        assert run.outcome in (Outcome.OK, Outcome.DEGRADED, Outcome.PARTLY_VALID)
        assert run.valid_shares[0] > 0.05
        assert run.fused.pose.length < 100.0 * max(run.duration, 1.0)
        assert (run.fused.sd[-1, :2] < 1000.0).all()
    return run.outcome.name


@pytest.fixture(scope="module", autouse=True)
def warm() -> None:
    """Kernels are compiled before anything is timed."""
    fuse(base("rover"))


@pytest.mark.parametrize("vehicle", ["rover", "drone", "walker"])
def test_the_unspoiled_log_is_fine(vehicle):
    assert judge(base(vehicle)) in ("OK", "DEGRADED")


@pytest.mark.parametrize("vehicle", ["rover", "drone", "walker"])
@pytest.mark.parametrize("change", MUTATIONS, ids=lambda m: m.__name__)
def test_one_spoiled_stream(vehicle, change):
    log = base(vehicle)
    for which in range(len(log.streams)):
        judge(spoiled(log, [(which, change, which)]))


@pytest.mark.parametrize("vehicle", ["rover", "drone"])
@settings(max_examples=150, derandomize=True)
@given(changes=steps, dropped=st.frozensets(st.integers(0, 5), max_size=4))
def test_many_spoiled_streams(vehicle, changes, dropped):
    judge(spoiled(base(vehicle), changes, dropped))


@pytest.mark.evidence
@pytest.mark.parametrize("vehicle", ["rover", "drone"])
@settings(max_examples=3000)
@given(changes=steps, dropped=st.frozensets(st.integers(0, 5), max_size=4))
def test_campaign(vehicle, changes, dropped):
    """The same, at length and with new random numbers every time."""
    judge(spoiled(base(vehicle), changes, dropped))


@pytest.mark.parametrize("motion", ["planar", "strapdown", "omnidirectional", "follower"])
@settings(max_examples=20, derandomize=True)
@given(changes=steps)
def test_every_process_model(motion, changes):
    for vehicle in ("rover", "drone"):
        judge(spoiled(base(vehicle), changes), FuseConfig(motion=motion))


def test_nothing_at_all():
    assert judge(EventLog(streams={}))
    log = base("rover")
    assert judge(replace(log, streams={n: s.select(slice(0, 0)) for n, s in log.streams.items()}))


@pytest.mark.parametrize("vehicle", ["rover", "drone"])
def test_one_record_of_each_kind(vehicle):
    log = base(vehicle)
    judge(replace(log, streams={n: s.select(slice(0, 1)) for n, s in log.streams.items()}))
    for name in log.streams:
        judge(replace(log, streams={name: log.streams[name].select(slice(0, 1))}))
        judge(replace(log, streams={name: log.streams[name]}))


def test_hours_without_a_record():
    log = base("rover")
    half = log.span[0] + 7 * SECOND
    for hours in (1, 30, 9000):
        gap = hours * 3600 * SECOND
        moved = [
            replace(s, t=s.t + np.where(s.t > half, gap, 0), t_arrival=s.t_arrival + np.where(s.t > half, gap, 0))
            for s in log
        ]
        judge(log.with_streams(*moved))


def test_a_log_that_refuses_all_its_records_says_so():
    log = base("rover")
    bad = [replace(s, z=np.full_like(s.z, np.nan)) for s in log]
    line = judge(log.with_streams(*bad))
    assert "fused" in line or "usable" in line
    assert not any(s.kind is Kind.STATUS for s in log)
