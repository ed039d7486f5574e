"""evo's own programs on the same files: the same numbers; and they read what we write."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from outrider.core.attitudes import quats_multiply, rpy_to_quats
from outrider.data import Trajectory
from outrider.eval import Alignment, Span, Unit, align, associate_nearest, position_errors, relative_errors, statistics
from outrider.io.tum import read_tum, write_tum
from outrider.workflows.evaluate import Rules, evaluate_files

PROGRAMS = Path(sys.executable).parent
SCALED = 1.03


def winding(n: int = 400, rate_hz: float = 10.0, phase_s: float = 0.0) -> Trajectory:
    s = np.arange(n) / rate_hz + phase_s
    p = np.stack([3.0 * s, 8.0 * np.sin(0.3 * s), np.cos(0.5 * s)], axis=1)
    rpy = np.stack([0.1 * np.sin(s), 0.05 * np.cos(0.7 * s), 0.4 * np.sin(0.3 * s)], axis=1)
    t = 1_700_000_000_000_000_000 + np.rint(s * 1e9).astype(np.int64)
    return Trajectory(t=t, p=p, q=rpy_to_quats(rpy), name="reference")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """An estimate that is turned, scaled and noisy, with stamps a little off the reference's, and fewer of them."""
    folder, rng = tmp_path_factory.mktemp("evo"), np.random.default_rng(4)
    truth, like = winding(), winding(n=190, rate_hz=5.0, phase_s=0.003)
    turn = rpy_to_quats(np.array([[0.02, -0.01, 0.3]]))
    p = SCALED * like.p + rng.normal(0.0, 0.2, like.p.shape) + [5.0, -2.0, 1.0]
    q = quats_multiply(turn, quats_multiply(like.q, rpy_to_quats(rng.normal(0.0, 0.01, (len(like), 3)))))
    write_tum(truth, folder / "reference.tum")
    write_tum(replace(like, p=p, q=q), folder / "estimate.tum")
    return folder / "estimate.tum", folder / "reference.tum"


def evo(program: str, folder: Path, *options: str) -> dict[str, float]:
    """The statistics of one of evo's programs, from the zip that it saves."""
    result = folder / "result.zip"
    result.unlink(missing_ok=True)
    command = [sys.executable, PROGRAMS / program, "tum", *options, "--save_results", result, "--no_warnings"]
    done = subprocess.run(command, capture_output=True, text=True, env={"HOME": str(folder)}, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    with ZipFile(result) as archive:
        return json.loads(archive.read("stats.json"))


@pytest.mark.parametrize(
    ("how", "flags"),
    [(Alignment.NONE, ()), (Alignment.SE3, ("--align",)), (Alignment.SIM3, ("--align", "--correct_scale"))],
)
def test_absolute_errors(files: tuple[Path, Path], how: Alignment, flags: tuple[str, ...]) -> None:
    estimate, reference = files
    theirs = evo("evo_ape", estimate.parent, str(reference), str(estimate), "--t_max_diff", "0.02", *flags)
    pairs = associate_nearest(read_tum(estimate), read_tum(reference), max_diff_s=0.02)
    aligned, motion = align(pairs, how)
    ours = statistics(position_errors(aligned))
    assert len(pairs) == 190
    for name in ("rmse", "mean", "median", "max"):
        assert getattr(ours, name) == pytest.approx(theirs[name], abs=1e-9), name
    assert motion.scale == pytest.approx(1.0 / SCALED if how is Alignment.SIM3 else 1.0, rel=0.01)


@pytest.mark.parametrize(
    ("span", "flags"),
    [
        (Span(1, Unit.RECORDS, chained=True), ()),
        (Span(7, Unit.RECORDS), ("--delta", "7", "--delta_unit", "f", "--all_pairs")),
        (Span(10.0, Unit.METRES, chained=True), ("--delta", "10", "--delta_unit", "m", "--pairs_from_reference")),
    ],
)
@pytest.mark.parametrize("relation", ["trans_part", "angle_rad"])
def test_relative_errors(files: tuple[Path, Path], span: Span, flags: tuple[str, ...], relation: str) -> None:
    estimate, reference = files
    options = ("--t_max_diff", "0.02", "-r", relation, *flags)
    theirs = evo("evo_rpe", estimate.parent, str(reference), str(estimate), *options)
    pairs = associate_nearest(read_tum(estimate), read_tum(reference), max_diff_s=0.02)
    ours = statistics(relative_errors(pairs, span)[relation == "angle_rad"])
    for name in ("rmse", "mean", "median", "max"):
        assert getattr(ours, name) == pytest.approx(theirs[name], abs=1e-9), name


def test_evo_reads_what_we_write(files: tuple[Path, Path], tmp_path: Path) -> None:
    estimate, reference = files
    rules = Rules(nearest_s=0.02, alignment=Alignment.SE3)
    (done,) = evaluate_files([estimate], reference, rules, output=tmp_path / "out").of
    command = [
        sys.executable,
        PROGRAMS / "evo_res",
        tmp_path / "out" / "evo.zip",
        "--save_table",
        tmp_path / "table.csv",
    ]
    shown = subprocess.run(command, capture_output=True, text=True, env={"HOME": str(tmp_path)}, timeout=120)
    assert shown.returncode == 0, shown.stdout + shown.stderr
    head, values = ((tmp_path / "table.csv").read_text().splitlines())[:2]
    told = dict(zip(head.split(",")[1:], map(float, values.split(",")[1:]), strict=True))
    assert told["rmse"] == pytest.approx(done.errors.position_3d.rmse, abs=1e-12)
