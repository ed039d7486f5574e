"""The main job on generated logs: as good as it says, better than its sources, the same every time."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scoring import Errors, codes, errors, first, only, rms, said, same_bits

from outrider.core.frames import frd_to_flu
from outrider.core.rotations import quats_to_matrices
from outrider.data import EventLog, Kind, Outcome, Run, Verdict
from outrider.errors import DataError
from outrider.eval.associate import associate
from outrider.eval.consistency import average_test
from outrider.filters.channels import site_position
from outrider.models.motion.planar import LAYOUT
from outrider.sim import FAULTS, Truth, demo_log, drone_log, wheeled_log
from outrider.sim.faults import shuffled
from outrider.sim.logs import ANTENNA
from outrider.workflows.config import DatumSection, FuseConfig, MountSection, SourceSection
from outrider.workflows.fuse import fuse

needs_speed = pytest.mark.compiled  # long logs
OUTAGE, FLOAT, JUMP = (150.0, 190.0), (225.0, 255.0), (275.0, 279.0)  # s, where `demo_log` puts them
GATE_999 = 13.82  # chi-square of two degrees of freedom


@cache
def demo() -> tuple[Run, EventLog, Truth, Errors]:
    log, truth = demo_log(1)
    run = fuse(log)
    return run, log, truth, errors(run, truth)


@cache
def short() -> tuple[EventLog, Truth]:
    return wheeled_log(2, 20.0, rate_hz=25.0)


@cache
def tiny() -> EventLog:
    """Short enough for plain Python."""
    return wheeled_log(2, 2.0, rate_hz=25.0)[0]


@cache
def patrol() -> tuple[EventLog, Truth]:
    return wheeled_log(7, 60.0)


# ------------------------------------------------------------------------------------------------------- the demo's log


@needs_speed
def test_the_demo_is_as_good_as_it_says():
    run, _, _, e = demo()
    assert rms(e.horizontal()) < 0.15
    assert np.degrees(rms(e.yaw)) < 1.0
    assert rms(e.v[:, :2]) < 0.1
    assert np.mean(e.nees() < GATE_999) > 0.999
    assert 0.02 < np.mean(e.nees()) / 2 < 1.2  # sure of itself, but not too much; and not lost in caution
    assert run.outcome is Outcome.DEGRADED
    assert run.fused.valid.all(axis=1).mean() > 0.97


@needs_speed
def test_the_demo_is_better_than_its_receiver():
    run, log, truth, e = demo()
    s = log.streams["gnss"]
    there = truth.at(s.t)
    antenna = there.p + quats_to_matrices(there.q) @ np.array(ANTENNA)
    site = site_position(s, truth.datum)
    raw, t = np.linalg.norm((site - antenna)[:, :2], axis=1), (s.t - run.start) * 1e-9
    for start, end in ((20.0, 140.0), FLOAT, JUMP):
        assert rms(e.horizontal(start, end)) < rms(raw[(t >= start) & (t < end)])


@needs_speed
def test_an_outage_is_bridged_and_its_error_foreseen():
    run, _, _, e = demo()
    assert e.horizontal(*OUTAGE).max() < 0.01 * 72.0  # one per cent of the way driven meanwhile
    sd = np.sqrt(e.P[:, 0, 0] + e.P[:, 1, 1])
    before, early, late = sd[np.searchsorted(e.t, [OUTAGE[0], OUTAGE[0] + 5.0, OUTAGE[1] - 0.5])]
    assert late > 3 * early > 9 * before
    assert "40 s from t = 150 s" in said(run, "outage").text


@needs_speed
def test_a_wrong_compass_is_named_and_not_believed():
    run, _, _, e = demo()
    finding = said(run, "heading-conflict")
    assert finding.source == "imu_attitude"
    assert "+40 deg" in finding.text
    assert "not fused" in finding.text
    assert np.degrees(np.abs(e.yaw[e.t > 15.0])).max() < 5.0


@needs_speed
def test_a_reflection_is_gated_not_followed():
    run, _, _, e = demo()
    fixed = run.innovations["gnss (fixed)"]
    t = (fixed.t - run.start) * 1e-9
    wrong = (t >= JUMP[0]) & (t < JUMP[1])
    assert np.isin(fixed.verdict[wrong], [Verdict.GATED, Verdict.FAULTED]).all()
    assert not run.resets
    assert e.horizontal(JUMP[0], JUMP[1] + 10.0).max() < 0.3


@needs_speed
def test_a_float_solution_is_believed_less_than_it_claims():
    run, _, _, e = demo()
    float_nis = run.innovations["gnss"]
    assert 0.05 < np.mean(float_nis.nis / float_nis.dof) < 1.3
    assert e.horizontal(*FLOAT).max() < 0.6
    assert e.horizontal(FLOAT[1] + 2.0, FLOAT[1] + 20.0).max() < 0.1


@needs_speed
def test_the_local_estimate_never_jumps_and_drifts():
    run, _, truth, e = demo()
    local = run.local
    assert local is not None
    p, t = local.pose.p, local.pose.t * 1e-9
    step = np.linalg.norm(np.diff(p, axis=0), axis=1) / np.diff(t)
    assert step.max() < 2.5  # m/s: what it drives, no more
    there = truth.at(np.clip(local.pose.t, truth.t[0], truth.t[-1]))
    start = there.p[0]
    yaw = there.trajectory().yaw[0]
    c, s = np.cos(-yaw), np.sin(-yaw)
    driven = (there.p - start) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    off = np.linalg.norm((p - driven)[:, :2], axis=1)
    assert off[-1] > 3 * e.horizontal()[-1]  # the global one does not drift
    way = np.linalg.norm(np.diff(there.p, axis=0), axis=1).sum()
    assert off.max() < 0.03 * way
    # wheels and gyro cannot tell how far the wheels are off: their error stays in the length, and the doubt as it was
    scale, sd = local.x[:, LAYOUT.state("wheel_scale")], local.sd[:, LAYOUT.error("wheel_scale")]
    assert np.abs(scale).max() < 1e-4 and sd.min() > 0.049
    wheels = 1.0 / (1.0 + truth.bias.wheels.mean())
    assert np.linalg.norm(np.diff(p, axis=0), axis=1).sum() == pytest.approx(wheels * way, rel=0.01)


@needs_speed
def test_map_to_odom_takes_all_jumps():
    run, _, _, _ = demo()
    assert run.local is not None
    always = np.zeros(0, np.bool_)
    pairs = associate(replace(run.local.pose, valid=always), replace(run.fused.pose, valid=always))
    g, o, t = pairs.reference, pairs.estimate, (pairs.reference.t - run.start) * 1e-9
    turn = g.yaw - o.yaw
    c, s = np.cos(turn), np.sin(turn)
    shift = g.p[:, :2] - np.stack([c * o.p[:, 0] - s * o.p[:, 1], s * o.p[:, 0] + c * o.p[:, 1]], axis=1)
    healthy = (t > 20.0) & (t < OUTAGE[0])
    moved = np.linalg.norm(np.diff(shift[healthy], axis=0), axis=1)
    assert np.median(moved) < 0.01  # it takes up what the local one drifts, and nothing of the motion
    assert healthy.sum() > 2000


@needs_speed
def test_the_wheels_are_calibrated_on_the_way():
    run, _, truth, _ = demo()
    layout = run.fused.layout
    scale, sd = (a[-1, layout.state("wheel_scale")][0] for a in (run.fused.x, run.fused.sd))
    assert abs(scale - truth.bias.wheels[-1]) < 4 * sd
    assert "too short" in said(run, "wheel-scale").text


# ----------------------------------------------------------------------------------------------------------- many seeds


@needs_speed
def test_drones_over_seeds_are_consistent():
    nees = []
    for seed in range(8):
        log, truth = drone_log(seed, duration_s=30.0)
        run = fuse(log, FuseConfig(local=False, output_period_s=0.5))
        e = errors(run, truth)
        assert run.outcome is Outcome.OK
        assert rms(e.v) < 0.15
        assert np.degrees(rms(e.yaw)) < 3.0
        nees.append(e.nees(3)[-1])  # one per seed: those of one run are not independent
    test = average_test(np.array(nees), 3)
    assert test.inside, test


@needs_speed
@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_is_survived_within_the_stated_sigma(fault: str):
    log, truth = wheeled_log(5, 60.0, faults=(fault,))
    run = fuse(log)
    e = errors(run, truth)
    for array in (run.fused.x, run.fused.sd, run.fused.pose.P, *(i.nis for i in run.innovations.values())):
        assert np.isfinite(array).all()
    assert np.mean(e.nees() < GATE_999) > 0.98
    assert e.horizontal(5.0).max() < 0.6
    assert not run.resets


# ------------------------------------------------------------------------------------------------------------ the same


def test_the_same_input_gives_the_same_bits():
    log = only(tiny(), "imu", "wheels")
    backwards = replace(log, streams=dict(reversed(list(log.streams.items()))))
    run = fuse(log)
    assert same_bits(run, fuse(log))
    assert same_bits(run, fuse(backwards))
    assert len(run.fused.t) > 30


@needs_speed
def test_a_second_demo_is_the_first():
    run, log, _, _ = demo()
    assert same_bits(run, fuse(log))


@needs_speed
@pytest.mark.parametrize("source", ["gnss", "wheels", "imu"])
def test_a_microsecond_moves_nothing_further_than_ten(source: str):
    log, _ = short()
    s = log.streams[source]
    a, b = fuse(log), fuse(log.with_streams(replace(s, t=s.t - 1000, t_arrival=s.t_arrival - 1000)))
    common, i, j = np.intersect1d(a.fused.t, b.fused.t, return_indices=True)
    assert common.size > 50
    moved = np.linalg.norm((a.fused.pose.p[i] - b.fused.pose.p[j])[:, :2], axis=1)
    assert moved.max() > 0.0
    assert (moved <= 1e-5 * np.maximum(np.linalg.norm(a.fused.pose.v[i], axis=1), 0.1)).all()


@needs_speed
def test_the_clock_of_the_whole_log_does_not_matter():
    log, _ = short()
    later = replace(log, streams={s.name: replace(s, t=s.t + 1000, t_arrival=s.t_arrival + 1000) for s in log})
    a, b = fuse(log), fuse(later)
    assert (b.fused.t - a.fused.t == 1000).all()
    assert a.fused.x.tobytes() == b.fused.x.tobytes()


@needs_speed
def test_arrival_order_does_not_matter_within_the_history():
    log, _ = patrol()
    rng = np.random.default_rng(4)
    late = shuffled(shuffled(log, "gnss", rng, 1.5), "imu", rng, 0.3)
    assert any((np.diff(late.streams[n].t) < 0).any() for n in ("gnss", "imu"))
    assert same_bits(fuse(log), fuse(late))


@needs_speed
def test_what_comes_too_late_is_counted_and_left_out():
    log, _ = patrol()
    s = log.streams["gnss"]
    late = fuse(log.with_streams(replace(s, t_arrival=s.t_arrival + 3_000_000_000)))
    account = next(a for a in late.accounts if a.source == "gnss")
    assert account.by_verdict[Verdict.LATE] > 0.9 * len(s)
    assert "history_s" in next(f for f in late.findings if f.code == "refused").fix
    longer = fuse(log.with_streams(replace(s, t_arrival=s.t_arrival + 3_000_000_000)), FuseConfig(history_s=4.0))
    assert same_bits(longer, fuse(log, FuseConfig(history_s=4.0)))


# --------------------------------------------------------------------------------------------------- what may be absent


def test_without_gnss_the_start_is_the_origin():
    log = tiny()
    run = fuse(only(log, "imu", "wheels"))
    assert run.datum is None
    assert np.abs(run.fused.pose.p[0]).max() < 0.1
    assert {"no-position", "alignment"} <= codes(run)
    assert run.fused.valid[-1, 1]
    assert run.fused.valid[0, 0]  # dead reckoning is a position while it is good enough


def test_with_gnss_alone_it_is_a_smoothed_track():
    log, truth = short()
    run = fuse(only(log, "gnss"))
    assert run.local is None
    lever = float(np.linalg.norm(ANTENNA))
    assert errors(run, truth).horizontal().max() < lever + 0.15
    assert not run.fused.valid[:, 2].any()  # nobody knows which way it looks
    assert np.isnan(run.fused.pose.q).all()


def test_an_imu_alone_admits_that_it_is_lost():
    log, _ = short()
    run = fuse(first(only(log, "imu"), 200))
    assert not run.fused.valid[-1, 0]
    assert {"no-position", "position-invalid"} <= codes(run)
    assert np.isfinite(run.fused.x).all()


@pytest.mark.parametrize("source", ["imu", "wheels", "gnss"])
def test_one_record_is_enough_to_say_something(source: str):
    log = tiny()
    run = fuse(first(only(log, source), 1))
    assert len(run.fused.t) == 1
    assert np.isfinite(run.fused.x).all()


def test_one_record_of_each_never_aligns():
    log = tiny()
    run = fuse(first(log, 1))
    assert run.outcome is Outcome.NEVER_ALIGNED
    assert "heading-unobservable" in codes(run)


@pytest.mark.parametrize("records", [0, None])
def test_nothing_to_fuse_is_one_clear_line(records: int | None):
    log = tiny()
    empty = replace(log, streams={}) if records is None else first(log, records)
    with pytest.raises(DataError, match="nothing in this log can be fused"):
        fuse(empty)


def test_progress_ends_at_one():
    log = tiny()
    seen: list[tuple[str, float]] = []
    fuse(only(log, "imu", "wheels"), progress=lambda what, share: seen.append((what, share)))
    assert seen[-1][1] == 1.0
    assert {"fusing", "local estimate"} == {what for what, _ in seen}


def test_every_record_is_accounted_for():
    log = tiny()
    run = fuse(log)
    for a in run.accounts:
        if a.role.startswith("fused") and "at rest" not in a.source:
            assert sum(a.by_verdict.values()) == a.received == len(log.streams[a.source])


# ---------------------------------------------------------------------------------------------------- what can be told


@needs_speed
def test_an_innovation_keeps_the_name_of_its_row():
    """Wheels that leave out their forward speed now and then: what they say of the side is not said of it."""
    log = tiny()
    wheels = log.streams["wheels"]
    z = wheels.z.copy()
    z[:, 1] = 0.25
    z[::2, 0] = np.nan
    seen = fuse(log.with_streams(replace(wheels, z=z))).innovations["wheels"]
    forward, side = (seen.columns.index(name) for name in ("v_x", "v_y"))
    half = np.isnan(seen.z[:, forward])
    assert 5 < half.sum() < half.size
    assert np.isnan(seen.y[half, forward]).all() and np.isnan(seen.s[half, forward]).all()
    assert np.isfinite(seen.y[:, side]).all() and np.isfinite(seen.y[~half, forward]).all()
    np.testing.assert_allclose(seen.y[half, side].mean(), seen.y[~half, side].mean(), atol=0.02)


def test_withheld_records_are_scored_but_change_nothing():
    log, _ = short()
    s = log.streams["gnss"]
    run = fuse(log, FuseConfig(withhold={"gnss": 5}, local=False))
    thin = fuse(log.with_streams(s.select(slice(0, None, 5))), FuseConfig(local=False))
    innovations = run.innovations["gnss"]
    assert (innovations.verdict == Verdict.WITHHELD).sum() == len(s) - -(-len(s) // 5)
    common, i, j = np.intersect1d(run.fused.t, thin.fused.t, return_indices=True)
    assert common.size > 50
    assert np.abs(run.fused.pose.p[i] - thin.fused.pose.p[j]).max() < 1e-3  # steps are cut elsewhere


@needs_speed
def test_an_outage_on_request():
    log, _ = short()
    run = fuse(log, FuseConfig(outages_s={"gnss": ((5.0, 12.0),)}, local=False))
    innovations = run.innovations["gnss"]
    t = (innovations.t - run.start) * 1e-9
    held = (t >= 5.0) & (t < 12.0)
    assert (innovations.verdict[held] == Verdict.WITHHELD).all()
    assert (innovations.verdict[~held] != Verdict.WITHHELD).all()
    sd = np.hypot(*run.fused.sd[:, :2].T)
    seconds = (run.fused.t - run.start) * 1e-9
    assert sd[np.searchsorted(seconds, 11.9)] > 1.5 * sd[np.searchsorted(seconds, 4.9)]


@needs_speed
def test_a_known_delay_is_taken_back():
    log, _ = short()
    s = log.streams["gnss"]
    stamped_late = log.with_streams(replace(s, t=s.t + 100_000_000))
    run = fuse(stamped_late, FuseConfig(sources={"gnss": SourceSection(delay_s=0.1)}))
    assert same_bits(run, fuse(log))
    wrong, right = fuse(stamped_late), fuse(log)
    assert not same_bits(wrong, right)


@needs_speed
def test_a_datum_moves_the_map_and_nothing_else():
    log, truth = short()
    d = truth.datum
    told = DatumSection(lat_deg=float(np.degrees(d.lat)), lon_deg=float(np.degrees(d.lon)), alt_m=d.alt)
    run, free = fuse(log, FuseConfig(datum=told)), fuse(log)
    assert run.datum is not None
    assert run.datum.lat == pytest.approx(d.lat, abs=1e-12)
    there = truth.at(run.fused.t)
    assert rms((run.fused.pose.p - there.p)[:, :2]) < 0.15
    moved = run.fused.pose.p - free.fused.pose.p
    assert np.ptp(moved[:, :2], axis=0).max() < 1e-3


@needs_speed
def test_a_mount_may_come_from_the_log_or_be_told():
    log, _ = short()
    x, y, z = ANTENNA
    told = FuseConfig(mounts={"gnss": MountSection(xyz_m=(x, y, z)), "imu": MountSection()})
    assert same_bits(fuse(replace(log, mounts={}), told), fuse(log))
    assert not same_bits(fuse(replace(log, mounts={})), fuse(log))


@needs_speed
def test_a_turned_imu_gives_the_same_run_once_its_mount_is_told():
    log, _ = short()
    s = log.streams["imu"]
    turned = replace(s, z=np.hstack([frd_to_flu(s.z[:, :3]), frd_to_flu(s.z[:, 3:])]))  # upside down: Rx(180 deg)
    upside_down = log.with_streams(turned)
    told = FuseConfig(sources={"imu": SourceSection(mount=MountSection(rpy_deg=(180.0, 0.0, 0.0)))})
    assert fuse(upside_down, told).fused.x == pytest.approx(fuse(log).fused.x, abs=1e-9)
    assert "mount-conflict" in codes(fuse(upside_down))


@needs_speed
@pytest.mark.parametrize("preset", ["amr2025", "robot_localization"])
def test_presets_say_what_they_trust(preset: str):
    log, truth = patrol()
    run = fuse(log, FuseConfig(preset=preset))
    assert "preset" in codes(run)
    roles = {a.source: a.role for a in run.accounts}
    if preset == "amr2025":
        assert "filter on filter" in said(run, "preset").text
        assert roles["imu_attitude (heading)"] == "fused"
        assert roles["imu"].startswith("not used")
        assert rms(errors(run, truth).horizontal(5.0)) < 0.1
    else:
        assert roles["gnss"].startswith("not used")
        assert log.streams["imu_attitude"].kind is Kind.ATTITUDE
        travelled = np.linalg.norm(np.diff(truth.p, axis=0), axis=1).sum()
        there = truth.at(run.fused.t)
        assert (
            np.linalg.norm((run.fused.pose.p[-1] - run.fused.pose.p[0] - there.p[-1] + there.p[0])[:2])
            < 0.05 * travelled
        )


@needs_speed
def test_what_it_costs_to_believe_a_compass():
    log, truth = wheeled_log(7, 60.0, faults=("heading-wrong",))
    default, paper = fuse(log), fuse(log, FuseConfig(preset="amr2025"))
    assert "heading-conflict" in codes(default)
    assert not default.resets
    assert {"reset", "overconfident"} <= codes(paper)
    assert rms(errors(paper, truth).horizontal()) > 10 * rms(errors(default, truth).horizontal())
