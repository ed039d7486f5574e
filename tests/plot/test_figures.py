"""The numbers behind the pictures."""

from dataclasses import replace

import factory
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from outrider.data import SensorState, Trajectory, Verdict
from outrider.plot import compare_figures, series
from outrider.plot.compare import error_figure
from outrider.plot.health import silent_bars, state_bars
from outrider.plot.maps import map_figure, odom_figure
from outrider.plot.motion import motion_figure
from outrider.plot.shapes import aligned_at_start, ellipse_rows, ellipses, shown_ellipses
from outrider.plot.tables import count, fixed, gate_tail, number, outline, span


def test_ellipses_hold_95_percent(rng: np.random.Generator) -> None:
    P = np.zeros((1, 6, 6))
    P[0, :2, :2] = [[4.0, 1.5], [1.5, 1.0]]
    shape = ellipses(np.array([[10.0, -3.0, 0.0]]), P, points=400)[0] - [10.0, -3.0]
    squared = np.einsum("ni,ij,nj->n", shape, np.linalg.inv(P[0, :2, :2]), shape)
    assert_allclose(squared, 5.991, rtol=1e-9)
    draws = rng.multivariate_normal([0, 0], P[0, :2, :2], 40_000)
    inside = np.einsum("ni,ij,nj->n", draws, np.linalg.inv(P[0, :2, :2]), draws) <= squared[0]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.005)


def test_ellipses_spread_along_the_path_not_over_the_stop() -> None:
    p = np.zeros((1000, 3))
    p[900:, 0] = np.arange(100.0)
    p[10] = np.nan
    rows = ellipse_rows(p, 11)
    assert np.diff(p[rows, 0]).max() < 12
    assert np.sum(rows < 900) <= 1
    assert ellipse_rows(np.full((3, 3), np.nan)).size == 0


@settings(max_examples=40)
@given(st.integers(1, 5000), st.integers(3, 900), st.integers(0, 99))
def test_thinning_keeps_ends_and_extremes(n: int, limit: int, seed: int) -> None:
    y = np.random.default_rng(seed).normal(size=n)
    y[seed % n] = np.nan
    rows = series.extremes(y, limit)
    assert rows.size <= max(limit + 4, 4) or n <= limit
    assert rows[0] == 0 and rows[-1] == n - 1 and np.all(np.diff(rows) > 0)
    if n > 1:
        assert np.nanmax(y[rows]) == np.nanmax(y) and np.nanmin(y[rows]) == np.nanmin(y)


@settings(max_examples=30)
@given(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2), st.floats(-3.0, 3.0), st.integers(0, 99))
def test_yaw_deviation_agrees_with_samples(roll: float, pitch: float, yaw: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(3, 3)) * 1e-3
    P = np.zeros((1, 6, 6))
    P[0, 3:, 3:] = A @ A.T + 1e-7 * np.eye(3)
    R = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    pose = Trajectory(t=np.array([0]), p=np.zeros((1, 3)), q=R.as_quat()[None], P=P)
    turned = (R * Rotation.from_rotvec(rng.multivariate_normal(np.zeros(3), P[0, 3:, 3:], 4000))).as_euler("ZYX")[:, 0]
    spread = np.std(np.angle(np.exp(1j * (turned - yaw))))
    assert series.yaw_sd(pose)[0] == pytest.approx(spread, rel=0.08)


def test_spans_of_a_flag() -> None:
    t = np.arange(10.0)
    assert series.spans(t, np.isin(t, (0, 1, 5, 9))) == [(0.0, 2.0), (5.0, 6.0), (9.0, 9.0)]
    assert series.spans(t, np.zeros(10, bool)) == []
    assert len(series.spans(np.arange(1e5), np.arange(100_000) % 2 == 0)) < 1000


def test_heading_line_breaks_where_it_wraps() -> None:
    assert np.isnan(series.break_wraps(np.array([170.0, 179.0, -179.0, -170.0]))).tolist() == [
        False,
        False,
        True,
        False,
    ]


def test_local_track_is_set_on_the_fused_start() -> None:
    t = np.linspace(0, 300, 400)
    fused, local = factory.trajectory(t, seed=0), factory.trajectory(t, turn=1.1, seed=0)
    moved = aligned_at_start(local, fused)
    assert_allclose(moved[0], fused.p[0], atol=1e-9)
    assert np.abs(moved - fused.p).max() < 0.3
    headless = replace(local, q=np.full_like(local.q, np.nan))
    assert aligned_at_start(headless, fused) is headless.p


def test_outlier_of_a_source_does_not_shrink_the_map() -> None:
    run = factory.full_run(200)
    assert np.abs(run.tracks["gnss/fix"].p).max() > 1e6
    axes = map_figure(run).axes[0]
    assert np.ptp(axes.get_xlim()) < 300 and np.ptp(axes.get_ylim()) < 300
    assert axes.get_aspect() == 1.0


def test_no_local_estimate_no_second_map() -> None:
    assert odom_figure(replace(factory.full_run(20), local=None)) is None


def test_health_bars_cover_the_run_without_gaps() -> None:
    bars = state_bars(np.array([[0.0, 0], [2, 1], [3, 1], [7, 3]]), 10.0)
    assert bars == [(0.0, 2.0, SensorState.WARMING), (2.0, 5.0, SensorState.HEALTHY), (7.0, 3.0, SensorState.FAULTED)]


def test_error_figure_shows_the_error_and_what_was_expected() -> None:
    t = np.linspace(0, 300, 3001)
    reference = factory.trajectory(t)
    shifted = replace(reference, p=reference.p + np.array([0.3, -0.4, 1.0]))
    later = replace(reference, t=reference.t + 20 * 10**9)
    figure = error_figure(shifted, reference, start=factory.T0 - 10**9)
    assert figure is not None
    horizontal, height, heading = figure.axes
    assert_allclose(horizontal.lines[0].get_ydata(), 0.5)
    assert_allclose(height.lines[0].get_ydata(), 1.0)
    assert_allclose(heading.lines[0].get_ydata(), 0.0, atol=1e-9)
    assert np.asarray(horizontal.lines[0].get_xdata())[[0, -1]] == pytest.approx([1.0, 301.0])
    expected = np.asarray(horizontal.lines[1].get_ydata())
    assert expected.min() == pytest.approx(series.radius_95(shifted).min())
    overlap = error_figure(shifted, later)
    assert overlap is not None
    assert np.asarray(overlap.axes[0].lines[0].get_xdata())[[0, -1]] == pytest.approx([20.0, 300.0])


def test_larger_semi_axis_is_that_of_the_ellipse() -> None:
    pose = factory.trajectory(np.linspace(0, 300, 50))
    outlines = ellipses(pose.p, pose.P, points=2000) - pose.p[:, None, :2]
    assert_allclose(series.radius_95(pose), np.linalg.norm(outlines, axis=2).max(axis=1), rtol=1e-5)


def test_compare_figures() -> None:
    a, b = factory.trajectory(np.linspace(0, 300, 300)), factory.trajectory(np.linspace(0, 300, 90))
    assert set(compare_figures(a, b)) == {"map", "error"}
    later = replace(b, t=b.t + 10**13)
    assert set(compare_figures(a, later)) == {"map"}


def test_numbers_for_readers() -> None:
    assert number(float("nan"), "m") == "–"
    assert number(0.0123456, "m") == "0.0123 m"
    assert number(-12345.6) == "−12\u202f346"
    assert number(41.0, "°") == "41.0°"
    assert number(3e-7) == "3.00e−07"
    assert (count(1234567), fixed(-0.123, "m")) == ("1\u202f234\u202f567", "−0.12 m")
    assert [span(s) for s in (4.21, 59.0, 185.0, 3720.0)] == ["4.2 s", "59.0 s", "3 min 05 s", "1 h 02 min"]


def test_gate_of_a_source_and_of_its_uses() -> None:
    config = {"sources": {"a": {"noise": 1.0, "gate": 0.9}, "off": {"gate": 1.0}}}
    assert gate_tail(config, "a", 0.5) == gate_tail(config, "a (heading)", 0.5) == pytest.approx(0.1)
    assert gate_tail(config, "ab", 0.001) == gate_tail(config, "off", 0.001) == 0.001
    assert gate_tail({}, "b", 0.001) == 0.001


def test_configuration_as_text() -> None:
    config = {"a": 1, "b": {"c": None, "d": [1.0, 2.0], "e": {}}, "f": [{"g": True}, {"h": "x"}]}
    expected = "a: 1\nb:\n  c: not set\n  d: [1.0, 2.0]\n  e: {}\nf:\n  - g: yes\n  - h: x\n"
    assert outline(config) == expected


def test_ellipses_that_would_cover_the_map_are_left_out() -> None:
    pose = factory.trajectory(np.linspace(0, 300, 400))
    assert shown_ellipses(pose).size == ellipse_rows(pose.p).size
    drifting = replace(pose, P=pose.P * np.linspace(1.0, 1e4, 400)[:, None, None])
    few = shown_ellipses(drifting)
    extent = np.ptp(pose.p[:, :2], axis=0).max()
    assert 0 < few.size < ellipse_rows(pose.p).size
    assert series.radius_95(drifting, few).max() <= 0.25 * extent
    hovering = replace(pose, p=pose.p * 1e-3)
    assert shown_ellipses(hovering).size == 0
    axes = map_figure(replace(factory.full_run(400), fused=factory.estimates(hovering), tracks={}, local=None)).axes[0]
    assert np.ptp(axes.get_xlim()) < 3.0 and not axes.collections  # no sheet of colour over a robot at rest


def test_tracks_are_laid_where_the_heading_has_settled() -> None:
    t = np.linspace(0, 300, 400)
    truth, local = factory.trajectory(t, seed=0), factory.trajectory(t, turn=1.1, seed=0)
    wrong = factory.trajectory(t, turn=0.6, seed=0).q  # until it is known, by a third of a right angle
    P = truth.P.copy()
    P[:40, 5, 5] = 0.4**2
    fused = replace(truth, q=np.where(np.arange(400)[:, None] < 40, wrong, truth.q), P=P)
    assert np.abs(aligned_at_start(local, fused) - truth.p).max() < 0.3


def test_gated_fixes_stand_on_the_map() -> None:
    run = factory.full_run(200)
    fixes = replace(run.innovations["gnss/fix"], columns=("east", "north"))
    gated = int((fixes.verdict == Verdict.GATED).sum())
    (cross,) = [
        line for line in map_figure(replace(run, innovations={"gnss/fix": fixes})).axes[0].lines
        if line.get_label() == f"gated ({gated})"
    ]  # fmt: skip
    assert len(np.asarray(cross.get_xdata())) == gated > 0


def test_local_estimate_has_no_band_and_a_plane_no_height() -> None:
    run = factory.full_run(200)
    both = motion_figure(run)
    alone = motion_figure(replace(run, local=None))
    assert both is not None and alone is not None
    assert len(both.axes) == len(alone.axes) == 3
    assert len(both.axes[0].collections) == len(alone.axes[0].collections)
    flat = run.fused.pose.P.copy()
    flat[:, 2, :] = flat[:, :, 2] = 0.0
    planar = replace(run.fused.pose, P=flat)
    reference = replace(run.fused.pose, p=run.fused.pose.p + np.array([0.0, 0.0, 0.6]))
    figures = motion_figure(replace(run, fused=replace(run.fused, pose=planar))), error_figure(planar, reference)
    assert all("height" not in ax.get_ylabel() for figure in figures if figure is not None for ax in figure.axes)


def test_nothing_bridges_silence() -> None:
    t = np.array([0.0, 0.2, 0.4, 0.6, 9.0, 9.2])
    u, y = series.with_gaps(t, np.ones(6))
    assert u.size == y.size == 7 and np.isnan(y[4])
    assert series.with_gaps(t[:4], np.ones(4))[1].tolist() == [1.0] * 4
    assert series.with_gaps(t[:1], np.ones(1))[0].size == 1


def test_silence_shows_in_the_health() -> None:
    run = factory.full_run(200)
    record = run.innovations["gnss/fix"]
    quiet = (record.t < factory.T0 + 100 * 10**9) | (record.t > factory.T0 + 160 * 10**9)
    kept = {name: getattr(record, name)[quiet] for name in ("t", "y", "s", "nis", "dof", "verdict", "z")}
    bars = silent_bars(replace(run, innovations={"gnss/fix": replace(record, **kept)}), "gnss/fix", 300.0)
    assert [bar[:2] for bar in bars] == [pytest.approx((100.0, 60.0), abs=2.1)]  # a fix a second, one at each end
    assert silent_bars(run, "gnss/fix", 300.0) == []
    assert [b[:2] for b in silent_bars(run, "imu/data", 400.0)] == [(300.0, 100.0)]  # it ended before the run
