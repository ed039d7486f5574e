"""Comparing files: formats, datums, limits, and the folder of results."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from outrider.core.geodesy import enu_to_geodetic
from outrider.data import Datum, Trajectory
from outrider.errors import DataError, OutputExistsError, UsageError
from outrider.eval import Alignment
from outrider.io.folders import read_marker
from outrider.io.trajectories import write_table
from outrider.io.tum import write_tum
from outrider.workflows.evaluate import (
    MARKER,
    SCHEMA,
    Rules,
    alignment_named,
    at_datum,
    compare_trajectories,
    evaluate_files,
)

SITE = Datum(lat=0.8, lon=0.2, alt=300.0)


def path_of(n: int = 50, datum: Datum | None = None) -> Trajectory:
    s = np.linspace(0.0, 5.0, n)
    p = np.stack([10 * s, 3 * np.sin(s), 0.2 * s], axis=1)
    q = np.stack([0 * s, 0 * s, np.sin(0.1 * s), np.cos(0.1 * s)], axis=1)
    t = 1_700_000_000_000_000_000 + np.round(s * 1e9).astype(np.int64)
    return Trajectory(t=t, p=p, q=q, v=np.ones((n, 3)), P=np.tile(np.eye(6), (n, 1, 1)), datum=datum, name="path")


def test_a_known_shift_is_the_error(tmp_path: Path) -> None:
    estimate, reference = tmp_path / "estimate.tum", tmp_path / "reference.csv"
    write_tum(replace(path_of(), p=path_of().p + np.array([3.0, 4.0, 0.0])), estimate)
    write_table(path_of(), reference)
    (done,) = evaluate_files([estimate], reference).of
    assert done.errors.position_2d.rmse == pytest.approx(5.0, abs=1e-6) and done.errors.heading.rmse < 1e-6
    assert done.within(None) and done.within(5.1) and not done.within(4.9) and not done.flat
    aligned = evaluate_files([estimate], reference, Rules(alignment=Alignment.YAW))
    assert aligned.of[0].errors.position_2d.rmse < 1e-6 and aligned.within(1e-6)
    document = aligned.as_dict()
    assert document["schema"] == SCHEMA and document["estimates"][0]["estimate"] == "estimate"


def test_rows_of_the_reference_that_hold_no_pose_are_counted(tmp_path: Path) -> None:
    estimate, reference = tmp_path / "estimate.tum", tmp_path / "reference.tum"
    write_tum(path_of(), estimate)
    lines = estimate.read_text(encoding="ascii").splitlines()
    for k in (5, 6, 7):
        cells = lines[k].split()
        lines[k] = " ".join([cells[0], "nan", *cells[2:]])
    reference.write_text("\n".join([*lines[:-1], lines[-1][:30]]), encoding="ascii")
    for rules in (Rules(), Rules(nearest_s=0.01)):
        (done,) = evaluate_files([estimate], reference, rules).of
        assert (done.errors.matched, done.errors.of) == (46, 50)
        assert [n for why, n in done.errors.lost.items() if "not finite, or damaged" in why] == [4]


def test_what_would_explain_an_error_is_told() -> None:
    s = np.arange(0.0, 60.0, 0.2)
    p = np.stack([20 * np.sin(0.2 * s), 8 * np.sin(0.4 * s), 0 * s], axis=1)
    half = 0.5 * np.arctan2(3.2 * np.cos(0.4 * s), 4 * np.cos(0.2 * s))
    q = np.stack([0 * s, 0 * s, np.sin(half), np.cos(half)], axis=1)
    right = Trajectory(t=1_700_000_000_000_000_000 + np.round(s * 1e9).astype(np.int64), p=p, q=q)

    def told(of: Trajectory) -> tuple[str, ...]:
        return compare_trajectories(right, of).causes

    noise = np.random.default_rng(4).normal(0.0, 1.0, p.shape)
    assert told(right) == told(replace(right, p=p + noise)) == told(replace(right, p=p + 5.0)) == ()
    assert "shifted by -0.70 s the horizontal RMSE" in told(replace(right, t=right.t + 700_000_000))[0]
    assert "x and y of one of them exchanged" in told(replace(right, p=p[:, [1, 0, 2]]))[0]
    (wxyz,) = told(replace(right, q=np.roll(q, 1, axis=1)))
    assert "quaternions of the reference taken as w x y z" in wxyz


def test_another_datum_is_the_same_place() -> None:
    """Two tangent planes a kilometre apart: points agree on Earth, and attitudes and velocities turn with the plane."""
    here = path_of(datum=SITE)
    lat, lon, alt = enu_to_geodetic(np.array([900.0, -700.0, 30.0]), SITE.lat, SITE.lon, SITE.alt)
    there = Datum(lat=float(lat), lon=float(lon), alt=float(alt))
    moved = at_datum(here, there)
    assert np.linalg.norm(moved.p[0] - here.p[0] - [-900.0, 700.0, -30.0]) < 0.5
    back = at_datum(moved, SITE)
    np.testing.assert_allclose(back.p, here.p, atol=1e-6)
    np.testing.assert_allclose(back.q, here.q, atol=1e-9)
    np.testing.assert_allclose(back.v, here.v, atol=1e-9)
    assert np.max(np.abs(moved.v - here.v)) > 1e-5  # the planes are not parallel
    assert compare_trajectories(here, moved).errors.position_3d.max < 1e-6
    assert at_datum(replace(here, datum=None), there).p is here.p


def test_results_are_complete_or_absent(tmp_path: Path) -> None:
    a = tmp_path / "a.tum"
    write_tum(path_of(), a)
    out = tmp_path / "out"
    evaluate_files([a], a, output=out)
    assert sorted(p.name for p in out.iterdir()) == ["error.png", MARKER, "evo.zip", "map.png"]
    assert read_marker(out, MARKER, SCHEMA)["estimates"][0]["position_2d"]["rmse"] == 0.0
    with pytest.raises(OutputExistsError):
        evaluate_files([a], a, output=out)
    evaluate_files([a, a], a, output=out, force=True)
    assert {p.name for p in out.iterdir()} >= {"1-a-map.png", "2-a-evo.zip"}
    with pytest.raises(DataError):
        evaluate_files([a], tmp_path / "none.tum", output=tmp_path / "more")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.tum", "out"]


def test_impossible_wishes(tmp_path: Path) -> None:
    a, later = tmp_path / "a.tum", tmp_path / "later.tum"
    write_tum(path_of(), a)
    write_tum(replace(path_of(), t=path_of().t + 10**12), later)
    with pytest.raises(UsageError, match="none, yaw, se2, se3, sim3"):
        alignment_named("affine")
    with pytest.raises(UsageError, match="zero"):
        Rules(max_gap_s=float("nan"))
    with pytest.raises(DataError, match="no common stamps"):
        evaluate_files([a], later)


def test_time_that_runs_backwards_or_stands_still_gives_no_figure(tmp_path: Path) -> None:
    a, damaged = tmp_path / "a.tum", tmp_path / "damaged.tum"
    write_tum(path_of(), a)
    lines = a.read_text().splitlines()
    for order, words in (([3, 2, 4, 5], "back in time"), ([1, 2, 2, 3], "two poses at one time")):
        damaged.write_text("\n".join(lines[k] for k in order) + "\n")
        for pair in (([damaged], a), ([a], damaged)):
            with pytest.raises(DataError, match=words):
                evaluate_files(*pair)
