"""What a run says about its data: each statement provoked once, and silent otherwise."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scoring import codes, errors, first, only, rms, said

from outrider.core.rotations import quats_exp, quats_multiply
from outrider.data import EventLog, Fix, Verdict
from outrider.sim import drone_log, wheeled_log
from outrider.sim.faults import degrade, freeze, jump, outage, turn_heading, within
from outrider.workflows.config import FuseConfig, MountSection, SourceSection
from outrider.workflows.findings.agreement import circular, convention
from outrider.workflows.fuse import fuse

LOG, TRUTH = wheeled_log(11, 30.0, rate_hz=25.0)
SHORT = first(only(LOG, "imu", "wheels"), 30)  # quick even without the compiler
needs_speed = pytest.mark.compiled
# What an untroubled log may say.
CALM = {"alignment", "wheel-scale", "unstated-noise", "no-position", "outage", "mount-assumed"}


AS_IT_IS = FuseConfig(diagnose=False)  # what the log itself would tell is not looked for


def with_imu(log: EventLog, factor: list[float]) -> EventLog:
    s = log.streams["imu"]
    return log.with_streams(replace(s, z=s.z * np.array(factor)))


@needs_speed
def test_an_untroubled_log_is_calm():
    assert codes(fuse(LOG)) <= CALM
    assert codes(fuse(drone_log(4, 20.0)[0])) <= CALM


def test_accelerations_in_g():
    finding = said(fuse(with_imu(SHORT, [1, 1, 1, *[1 / 9.81] * 3]), AS_IT_IS), "unit-g")
    assert finding.severity == "error"
    assert finding.source == "imu"
    assert "no-gravity" in codes(fuse(with_imu(SHORT, [1, 1, 1, *[0.5] * 3])))
    assert not {"unit-g", "no-gravity", "mount-conflict"} & codes(fuse(SHORT))


@needs_speed
def test_rates_in_degrees():
    log = with_imu(only(LOG, "imu", "wheels"), [*[180 / np.pi] * 3, 1, 1, 1])
    s = log.streams["imu"]
    fast = log.with_streams(replace(s, z=s.z + np.array([0, 0, 20.0, 0, 0, 0])))  # a brisk turn, 20 deg/s
    assert "degrees per second" in said(fuse(fast, AS_IT_IS), "unit-deg").text


def test_gravity_along_the_wrong_axis():
    s = SHORT.streams["imu"]
    turned = np.hstack([s.z[:, [2, 0, 1]], s.z[:, [5, 3, 4]]])  # the sensor's x looks up
    log = SHORT.with_streams(replace(s, z=turned, frame="imu_link"))
    finding = said(fuse(log, AS_IT_IS), "mount-conflict")
    assert "+x axis of imu_link, 90 deg" in finding.text
    assert "no mount was given" in finding.text
    assert "mounts: {imu_link: {rpy_deg" in finding.fix
    wrong = FuseConfig(mounts={"imu_link": MountSection(rpy_deg=(90.0, 0.0, 0.0))})
    assert "the mount given for it is wrong" in said(fuse(log, wrong), "mount-conflict").text
    own = FuseConfig(sources={"imu": SourceSection(mount=MountSection(rpy_deg=(0.0, -90.0, -90.0)))})
    assert not {"mount-conflict", "mount-assumed"} & codes(fuse(log, own))


def test_a_mount_that_nobody_told_is_said():
    assert "mount-assumed" in codes(fuse(replace(SHORT, mounts={})))
    assert "mount-assumed" not in codes(fuse(SHORT))


@needs_speed
@pytest.mark.parametrize(
    ("degrees", "tail"),
    [(40.0, "(spread"), (-110.0, "-20 deg would remain if its zero were north instead of east"), (95.0, "without +90")],
)
def test_a_heading_conflict_says_what_another_zero_would_leave(degrees: float, tail: str):
    run = fuse(turn_heading(LOG, "imu_attitude", np.radians(degrees)))
    text = said(run, "heading-conflict").text
    assert f"{degrees:+.0f} deg" in text
    assert tail in text


@needs_speed
def test_a_heading_that_turns_the_other_way_is_recognised():
    s = LOG.streams["imu_attitude"]
    yaw = 2 * np.arctan2(s.z[:, 2], s.z[:, 3])
    about_up = np.zeros((len(s), 3))
    about_up[:, 2] = -2 * yaw
    clockwise = LOG.with_streams(replace(s, z=quats_multiply(quats_exp(about_up), s.z)))
    assert "as if it turned clockwise" in said(fuse(clockwise), "heading-conflict").text


def test_the_convention_of_a_heading():
    yaw = np.linspace(-3, 3, 50)
    assert convention(np.radians(-100.0), np.full(50, np.radians(-100.0)), yaw, 0.02).endswith("north instead of east")
    assert convention(np.radians(30.0), np.full(50, np.radians(30.0)), yaw, 0.02) == ""
    y = np.radians(90.0) - 2 * yaw
    assert "clockwise, with its zero +90 deg from east" in convention(0.0, y, yaw, circular(y)[1])


@needs_speed
def test_a_source_that_falls_silent_or_never_speaks():
    assert "fell silent at t = 1" in said(fuse(outage(LOG, "gnss", 15.0, 99.0)), "silent").text
    s = LOG.streams["gnss"]
    none = replace(s, extra={**s.extra, "fix": np.full(len(s), float(Fix.NONE.value))})
    assert "no usable record" in {a.source: a.role for a in fuse(LOG.with_streams(none)).accounts}["gnss"]
    late = replace(s, t_arrival=s.t_arrival + 10_000_000_000).select(slice(0, 100))
    run = fuse(LOG.with_streams(late))
    assert said(run, "never-used").source == "gnss"
    assert "10.12 s after" in said(run, "latency").text


@needs_speed
def test_an_outage_and_when_the_position_is_not_valid():
    run = fuse(outage(only(LOG, "imu", "gnss"), "gnss", 12.0, 24.0))
    assert "12 s from t = 12 s" in said(run, "outage").text
    assert "first from t = 1" in said(run, "position-invalid").text
    assert said(run, "position-invalid").severity == "info"  # it came back


@needs_speed
def test_refusals_give_their_reason():
    frozen = fuse(freeze(LOG, "wheels", 10.0, 20.0))
    assert "frozen" in said(frozen, "refused").text
    assert rms(errors(frozen, TRUTH).horizontal()) < 0.1


@needs_speed
@pytest.mark.parametrize(("start", "end", "metres"), [(10.0, 14.0, (16.0, -12.0, 5.0)), (20.0, 21.5, (0.0, 3.0, 0.0))])
def test_a_jump_is_named_with_its_time_and_size(start: float, end: float, metres: tuple[float, float, float]):
    run = fuse(jump(LOG, "gnss", start, end, metres))
    text = said(run, "jump").text
    size = float(re.findall(r"jump of ([\d.]+) m", text)[0])
    begin, until = map(float, re.findall(r"from t = ([\d.]+) to ([\d.]+) s", text)[0])
    assert size == pytest.approx(np.hypot(*metres[:2]), abs=0.3)
    assert (begin, until) == pytest.approx((start, end), abs=0.25)  # a fix every 0.2 s
    of = next(a for a in run.accounts if a.source == "gnss")
    assert f"{of.by_verdict[Verdict.GATED]} records gated" in text
    assert text.endswith("the estimate did not follow")
    assert "refused" not in codes(run) and not run.resets


@needs_speed
def test_scattered_outliers_are_refusals_not_jumps():
    s = LOG.streams["gnss"]
    z = s.z.copy()
    z[::8, 0] += 1e-5  # 60 m north
    run = fuse(LOG.with_streams(replace(s, z=z)))
    assert "gated" in said(run, "refused").text
    assert "jump" not in codes(run)


@needs_speed
def test_wheels_that_slip_disagree():
    s = LOG.streams["wheels"]
    slips = within(LOG, "wheels", 15.0, 18.0)
    z = s.z.copy()
    z[slips, 0] += 3.0
    text = said(fuse(LOG.with_streams(replace(s, z=z))), "jump").text
    assert re.match(r"wheels: disagreement of [23]\.?\d* m/s \(\+[23]\.\d v_x, .* from t = 15\.\d to 1[78]\.\d s", text)


@needs_speed
@pytest.mark.parametrize("told", [0.1, 1.0])
def test_float_fixes_that_claim_centimetres_are_found_out(told: float):
    run = fuse(degrade(LOG, "gnss", 10.0, 20.0, Fix.FLOAT, 0.5, np.random.default_rng(1), told))
    if told == 1.0:
        assert "overconfident" not in codes(run)
        return
    text = said(run, "overconfident").text
    claim, off, times, begin, end = map(
        float,
        re.findall(r"claims ([\d.]+) m but is off by ([\d.]+) m, (\d+) .* float, t = ([\d.]+) to ([\d.]+) s", text)[0],
    )
    assert claim == 0.05
    assert off == pytest.approx(0.5 / np.sqrt(2), rel=0.25)  # half of the error is white, the slow half stays unseen
    assert times == round(off / claim)
    assert (begin, end) == pytest.approx((10.0, 20.0), abs=0.25)
    assert "50 records, counted as 0.5 m" in text


@needs_speed
def test_a_lasting_jump_is_followed_by_one_logged_reset():
    run = fuse(jump(LOG, "gnss", 10.0, 99.0, (20.0, 0.0, 0.0)))
    (reset,) = run.resets
    assert np.linalg.norm(reset.delta) == pytest.approx(20.0, abs=1.0)
    assert "position reset by" in said(run, "reset").text
    account = next(a for a in run.accounts if a.source == "gnss")
    assert account.by_verdict[Verdict.RESET] == 1


@needs_speed
def test_a_receiver_too_sure_of_itself():
    run = fuse(drone_log(4, 20.0)[0], FuseConfig(sources={"gnss": SourceSection(sigma=0.01, gate=1.0)}))
    finding = said(run, "overconfident")
    assert finding.fix.startswith("sources: {gnss: {scale: ")


@needs_speed
def test_stamps_that_step_back():
    s = LOG.streams["gnss"]
    order = np.arange(len(s))
    order[10], order[11] = 11, 10
    assert "1 stamps step back" in said(fuse(LOG.with_streams(s.select(order))), "stamps-backwards").text


def test_noise_that_nobody_states():
    s = SHORT.streams["wheels"]
    silent = SHORT.with_streams(replace(s, var=np.full_like(s.var, np.nan)))
    assert "wheels" in said(fuse(silent), "unstated-noise").text
