# ruff: noqa: T201
"""
Fuse a log from Python
======================

Fuse a log from Python: a simulated robot here, `read_log(Path("my.bag"))` for a recording.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from outrider.data import Verdict
from outrider.plot.maps import map_figure
from outrider.plot.style import save_png
from outrider.sim import wheeled_log
from outrider.workflows.config import FuseConfig
from outrider.workflows.evaluate import compare_trajectories
from outrider.workflows.fuse import fuse

log, truth = wheeled_log(seed=4, duration_s=60.0)
for stream in log:
    print(f"{stream.name:14} {stream.kind.value:10} {len(stream):6} records, {stream.rate:5.1f} Hz")

run = fuse(log, FuseConfig(withhold={"gnss": 10}))
print(run.outcome.value)
for finding in run.findings:
    print(f"{finding.severity}: {finding.text}")

last, sd = run.fused.pose.p[-1], np.sqrt(np.diag(run.fused.pose.P[-1]))
print(f"ends at {last[0]:.2f} m east, {last[1]:.2f} m north, +- {max(sd[:2]):.3f} m")

fixes = run.innovations["gnss"]
held = fixes.verdict == Verdict.WITHHELD
miss = np.hypot(*fixes.y[held, :2].T)
print(f"{held.sum()} fixes that were not used lie {np.sqrt(np.mean(miss**2)):.3f} m (RMS) from the estimate")

estimate = replace(run.fused.pose, datum=run.datum)
compared = compare_trajectories(estimate, truth.trajectory())
errors = compared.errors
heading_deg = np.degrees(errors.heading.rmse)
print(f"horizontal RMSE against the truth: {errors.position_2d.rmse:.3f} m, heading {heading_deg:.2f} deg")
save_png(map_figure(run, reference=compared.reference), Path("01_fuse_in_python.png"))
print("finished")
