# ruff: noqa: T201
"""
Many runs, and two methods compared
===================================

Repeat an experiment over seeds on several processes, and compare two methods on the same noise.
"""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from outrider.campaign import grid, run_trials
from outrider.eval import corrected, paired, summary
from outrider.plot.campaign import spread_figure
from outrider.plot.style import save_png

PICTURE = Path("03_many_runs.png")


def survey(params: Mapping[str, Any], seed: int) -> dict[str, float]:
    """How far off a point is that was surveyed with 200 fixes, some of them reflected by a wall [m]."""
    rng = np.random.default_rng(seed)
    fixes = rng.normal(0.0, 0.7, (200, 2))
    fixes[rng.uniform(size=200) < params["reflected"]] += [3.0, 1.0]
    average = {"mean": np.mean, "median": np.median}[params["average"]]
    return {"error_m": float(np.hypot(*average(fixes, axis=0)))}


if __name__ == "__main__":  # the processes import this file, too
    cases = grid(reflected=[0.0, 0.02, 0.1], average=["mean", "median"])
    with TemporaryDirectory() as folder:
        trials = run_trials(survey, cases, seeds=60, workers=2, store=Path(folder) / "survey")
    p_values = []
    for reflected in (0.0, 0.02, 0.1):
        mean = trials.column("error_m", reflected=reflected, average="mean")
        median = trials.column("error_m", reflected=reflected, average="median")
        s, d = summary(median), paired(median, mean, rng=np.random.default_rng(0))
        p_values.append(d.p_wilcoxon)
        print(
            f"{reflected:4.0%} reflected: median off by {s.mean:.3f} m [{s.low:.3f}, {s.high:.3f}]; median - mean "
            f"{d.mean:+.3f} m [{d.low:+.3f}, {d.high:+.3f}], better in {d.wins:.0%} of {d.n} seeds"
        )
    print("p, corrected for three tests:", ", ".join(f"{p:.2g}" for p in corrected(p_values)))
    names = [f"{c['reflected']:.0%} reflected, {c['average']}" for c in cases]
    errors = np.array([row.values["error_m"] for row in trials.rows], float)
    save_png(spread_figure({"error [m]": errors}, np.array([r.case for r in trials.rows]), names), PICTURE)
    print(f"finished: {len(trials.rows)} trials, {len(trials.failed)} failed")
