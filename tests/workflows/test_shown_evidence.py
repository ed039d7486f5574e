"""What is put before the reader's eyes shows the fault that was put in, and nothing that cannot be drawn."""

import json
from dataclasses import replace

import numpy as np
import pytest

from outrider.data import EventLog, Finding, Kind, Run
from outrider.data.evidence import Curve, Evidence
from outrider.sim.logs import demo_log, wheeled_log
from outrider.workflows.config import FuseConfig
from outrider.workflows.doctor.receiver import Late, told
from outrider.workflows.doctor.visit import visit
from outrider.workflows.evidence import SHOWN
from outrider.workflows.findings import HARM, in_order_of_harm
from outrider.workflows.fuse import fuse

pytestmark = pytest.mark.compiled

LATE = 0.4  # s


@pytest.fixture(scope="module")
def log() -> EventLog:
    return wheeled_log(3, 90.0)[0]


def spoilt(log: EventLog, *, force: float = 1.0, speed: float = 1.0, late: float = 0.0) -> EventLog:
    (imu,), (wheels,) = log.of(Kind.IMU), log.of(Kind.TWIST)
    z, w, shift = imu.z.copy(), wheels.z.copy(), round(late * 1e9)
    z[:, 3:] *= force
    w[:, :3] *= speed
    return log.with_streams(replace(imu, z=z), replace(wheels, z=w, t=wheels.t + shift, t_arrival=wheels.t + shift))


def shown(run: Run, code: str) -> Evidence:
    (e,) = [f.evidence for f in run.findings if f.code == code]
    assert e is not None
    assert e.curves
    return e


def test_what_is_shown_is_the_fault(log: EventLog) -> None:
    run = fuse(spoilt(log, force=1 / 9.80665, late=LATE))
    (bars,) = shown(run, "unit-g").curves
    assert bars.x[int(np.argmax(bars.y))] == pytest.approx(1.0, abs=0.3)  # as recorded, not as mended
    assert bars.y.sum() == pytest.approx(1.0)
    clock = shown(run, "clock-offset")
    (alike,) = clock.curves
    assert alike.x[int(np.argmax(alike.y))] == pytest.approx(LATE, abs=0.051)
    assert clock.at[1][0] == pytest.approx(LATE, abs=0.051)


def test_kmh_lie_along_a_line_of_that_slope(log: EventLog) -> None:
    points, same, found = shown(fuse(spoilt(log, speed=3.6)), "unit-kmh").curves
    assert same.y == pytest.approx(same.x)
    assert found.y[-1] / found.x[-1] == pytest.approx(3.6, rel=0.05)
    assert np.median(points.y / np.maximum(points.x, 0.1)) == pytest.approx(3.6, rel=0.1)


def test_a_heading_that_is_not_that_of_motion_lies_beside_the_line(log: EventLog) -> None:
    (s,) = log.of(Kind.ATTITUDE)
    turn = np.array([0.0, 0.0, np.sin(np.pi / 6), np.cos(np.pi / 6)])  # 60 deg
    x, y, z, w = s.z[:, :4].T
    q = np.column_stack([w * 0 + x * turn[3] + y * turn[2], y * turn[3] - x * turn[2],
                         z * turn[3] + w * turn[2], w * turn[3] - z * turn[2]])  # fmt: skip
    run = fuse(log.with_streams(replace(s, z=np.hstack([q, s.z[:, 4:]]))))
    points, _ = shown(run, "heading-conflict").curves
    off = (points.y - points.x + 180.0) % 360.0 - 180.0
    assert np.median(off) == pytest.approx(60.0, abs=4.0)


def test_a_hole_is_seen_where_it_is_whatever_kinds_of_fix_are_fused() -> None:
    run = fuse(demo_log(1)[0])
    (gaps,) = shown(run, "outage").curves
    assert gaps.y.max() == pytest.approx(40.0, abs=0.5)  # s without fixes, as the demo is made
    assert gaps.x[int(np.argmax(gaps.y))] == pytest.approx(190.0, abs=0.5)
    points, _, found = shown(run, "wheel-scale").curves
    moving = points.x > 0.5
    off = np.abs(points.y[moving] - points.x[moving] * found.y[-1] / found.x[-1])
    assert np.mean(off < 0.1) > 0.9  # m/s: no window reaches into the hole


def test_everything_that_is_shown_can_be_drawn_and_printed(log: EventLog) -> None:
    (gnss,) = log.of(Kind.GNSS)
    t = gnss.t.copy()
    t[40], z = t[20], gnss.z.copy()
    z[60:75, 0] += 1e-5  # 60 m north
    hole = np.r_[0:100, 160 : len(gnss)]
    seen = visit(log.with_streams(replace(gnss, t=t, z=z).select(hole)), FuseConfig())
    drawn = [f for f in seen.findings if f.evidence is not None]
    assert len({f.code for f in drawn} & set(SHOWN)) >= 3
    for f in drawn:
        assert f.evidence is not None
        for c in f.evidence.curves:
            assert 0 < c.x.size == c.y.size <= 301
            assert np.isfinite(c.x).all() and np.isfinite(c.y).all()
    kept = json.loads(json.dumps(seen.as_dict(), allow_nan=False))["findings"]
    assert [k["evidence"] is not None for k in kept] == [f.evidence is not None for f in seen.findings]


def test_a_delay_found_by_trial_carries_its_trials() -> None:
    tried = np.stack([np.linspace(-1.2, 1.2, 17), -((np.linspace(-1.2, 1.2, 17) - 0.3) ** 2)])
    e = told(Late(("rtk",), 0.3, 0.01, tried)).evidence
    assert e is not None
    assert e.curves[0].y.max() == 0.0
    assert e.at[1] == (0.3, "fits best")


def test_most_damaging_first() -> None:
    codes = ["jump", "unheard-of", "mount-found", "clock-offset"]
    found = [Finding(severity="warning", code=c, text=c) for c in codes]
    found.append(Finding(severity="error", code="unheard-of-error", text="e"))
    found.append(Finding(severity="info", code=HARM[0], text="i"))
    assert [f.code for f in in_order_of_harm(found)] == [
        "unheard-of-error", "mount-found", "clock-offset", "jump", "unheard-of", HARM[0],
    ]  # fmt: skip


def test_findings_compare_without_their_curves() -> None:
    e = Evidence(x_label="x", y_label="y", curves=(Curve(x=np.zeros(2), y=np.zeros(2)),), text="")
    bare = Finding(severity="info", code="a", text="b")
    assert replace(bare, evidence=e) == bare
