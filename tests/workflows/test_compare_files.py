"""Comparing files: formats, datums, limits, and the folder of results."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from outrider.core.geodesy import enu_to_geodetic
from outrider.data import Datum, Trajectory
from outrider.errors import DataError, OutputExistsError, UsageError
from outrider.io.folders import read_marker
from outrider.io.trajectories import write_table
from outrider.io.tum import write_tum
from outrider.workflows.compare import MARKER, SCHEMA, at_datum, compare_files, compare_trajectories

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
    done = compare_files(estimate, reference)
    assert done.errors.position_2d.rmse == pytest.approx(5.0, abs=1e-6) and done.errors.heading.rmse < 1e-6
    assert done.within(None) and done.within(5.1) and not done.within(4.9) and not done.flat
    assert compare_files(estimate, reference, align="yaw").errors.position_2d.rmse < 1e-6
    document = done.as_dict()
    assert document["schema"] == SCHEMA and document["estimate"] == "estimate"


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
    compare_files(a, a, output=out)
    assert sorted(p.name for p in out.iterdir()) == [MARKER, "error.png", "map.png"]
    assert read_marker(out, MARKER, SCHEMA)["position_2d"]["rmse"] == 0.0
    with pytest.raises(OutputExistsError):
        compare_files(a, a, output=out)
    compare_files(a, a, output=out, force=True)
    with pytest.raises(DataError):
        compare_files(a, tmp_path / "none.tum", output=tmp_path / "more")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.tum", "out"]


def test_impossible_wishes(tmp_path: Path) -> None:
    a, later = tmp_path / "a.tum", tmp_path / "later.tum"
    write_tum(path_of(), a)
    write_tum(replace(path_of(), t=path_of().t + 10**12), later)
    with pytest.raises(UsageError, match="none, yaw, se2, se3"):
        compare_files(a, a, align="affine")
    with pytest.raises(UsageError, match="zero"):
        compare_files(a, a, max_gap_s=float("nan"))
    with pytest.raises(DataError, match="no common stamps"):
        compare_files(a, later)
