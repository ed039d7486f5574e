# ruff: noqa: T201
"""
A mission in a behaviour tree
=============================

A robot on patrol whose mission runs in a behaviour tree: it goes home early in the rain. Needs outrider[trees].
"""

from pathlib import Path

import numpy as np
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector, Sequence

from outrider.guidance.patrol import Rules
from outrider.guidance.trees import Advance, Slate, transition_of
from outrider.plot.drives import Line, Site, sites_figure
from outrider.plot.style import save_png
from outrider.scenarios.build import build
from outrider.scenarios.files import load_scenario
from outrider.team.patrol import Patrol


class Raining(Behaviour):
    """Something of one's own: here, from the 35th second on."""

    def __init__(self, slate: Slate) -> None:
        super().__init__("raining")
        self._slate, self._begun = slate, np.inf

    def update(self) -> Status:
        """See `py_trees`."""
        self._begun = min(self._begun, self._slate.now.t_s)
        return Status.SUCCESS if self._slate.now.t_s - self._begun > 35.0 else Status.FAILURE


cast = build(*load_scenario("site-patrol", {"minutes": 1.0, "at_s": 5.0, "team.r1.mission.charge": 0.5}))
robot = next(r.agent for r in cast.team if isinstance(r.agent, Patrol))

slate = Slate()
careful = Sequence("rain", memory=False, children=[Raining(slate), Advance("careful", slate, Rules(low=0.6))])
robot.transition = transition_of(Selector("robot", memory=False, children=[careful, Advance("mission", slate)]), slate)

run = cast.run()
for note in run.notes:
    print(f"{(note.t - run.monitor.start) * 1e-9:5.1f} s  {note.robot}: {note.text}")
print(f"the robot: {robot.mission.duty.value}, battery at {100 * robot.share:.0f} %")
way = Line("driven", run.truth["r1"].p[:, :2])
there = cast.world.grid
save_png(sites_figure([Site(title="the patrol that went home early", grid=there, lines=(way,))]), Path("07_patrol.png"))
print("finished")
