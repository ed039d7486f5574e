# ruff: noqa: T201
"""
One drone follows another
=========================

How near a follower may fly at some rates of fixes, and how near it comes when its target stops dead.
"""

from pathlib import Path

from outrider.errors import ConfigError
from outrider.guidance.rendezvous import Stage, Why
from outrider.plot.style import save_png
from outrider.scenarios.build import build
from outrider.scenarios.files import load_scenario
from outrider.scenarios.followed import pursuers, pursuit, pursuit_figures

for rate_hz in (1.0, 5.0):
    given = {"target": "stop", "gnss_hz": rate_hz, "zone": 9.0, "duration_s": 35.0}
    cast = build(*load_scenario("follow-leader", given))
    chosen = pursuers(cast)["follower"].set_point.distance(2.0, 0.1)
    told = (pursuit(cast, cast.run()) or {})["follower"]
    print(f"fixes at {rate_hz:g} Hz: set-point {chosen:.2f} m, never nearer than {told['least_m']:.2f} m")

try:
    build(*load_scenario("follow-leader", {"gnss_hz": 1.0, "team.follower.mission.distance": 3.5}))
except ConfigError as e:
    print(f"refused: {e.what}; {e.fix}")

# a target that is silent for twelve seconds: predicted, searched for, found
cast = build(*load_scenario("follow-leader", {"target": "silent", "duration_s": 35.0}))
run = cast.run()
for note in run.notes:
    print(f"{(note.t - run.monitor.start) * 1e-9:5.1f} s  {note.robot}: {note.text}")
((title, figure),) = pursuit_figures(cast, run)
save_png(figure, Path("08_follow.png"))
assert pursuers(cast)["follower"].counts[Stage.SEARCH, Why.LOST] == 1
print("finished")
