# ruff: noqa: T201
"""
Simulate with and without a fault
=================================

Simulate a scenario file with and without its fault, into a folder with a recording, the truth and a summary.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

from outrider.plot.simulation import simulation_figure
from outrider.plot.style import save_png
from outrider.scenarios.files import load_scenario
from outrider.scenarios.runs import run_scenario

YARD = Path(__file__).with_suffix(".yaml")

runs = {}
with TemporaryDirectory() as room:
    for name, given in (("as it is", {}), ("without the fault", {"team.rover.faults": []})):
        scenario, where = load_scenario(str(YARD), given)
        done, summary = run_scenario(scenario, Path(room) / name, where=where, report=False)
        runs[name] = done.run
        rover = summary["robots"]["rover"]
        near, wrong = rover["clearance"], rover["estimate"]["rmse_m"]
        print(f"{name}: {done.run.sentence} after {summary['duration_s']:.1f} s and {rover['distance_m']:.1f} m")
        print(f"  off by {wrong:.3f} m about its place, {near['distance_m']:.1f} m from the {near['to']}")

figure = simulation_figure(runs["as it is"])
assert figure is not None  # there is something to keep clear of
save_png(figure, Path("04_simulate.png"))
print("finished")
