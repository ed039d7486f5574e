"""A fleet on patrol: what becomes of random alerts, and how near the response is to the best there was; written to
docs/evidence/patrol.md."""

import signal
import sys
from dataclasses import dataclass, field, replace
from itertools import permutations
from typing import Any

import numpy as np
import pytest
from skimage.graph import MCP_Geometric

from outrider.data.agents import Action
from outrider.data.alerts import AlertState
from outrider.guidance.patrol import Duty
from outrider.planning.traversal import Traversal
from outrider.scenarios.booked import mission
from outrider.scenarios.build import build
from outrider.scenarios.files import load_scenario
from outrider.sim.engine import Ending, Simulation
from outrider.team.patrol import Patrol
from outrider.team.station import Entry, Station
from outrider.team.words import Status
from outrider.typing import Floats
from published import publish

pytestmark = pytest.mark.evidence
MINUTES, ALERTS, SEED = 60.0, 20, 1
ABOUT = 2.5  # m


@dataclass
class Watch:
    """Every moment at which somebody was sent: who was free, what waited, and who went where.

    stopped : by SIGTERM; everybody then says that he is done, and what there is by then is told.
    """

    stopped: bool = False
    sent: list[tuple[Station, list[Status], list[Entry], list[Entry]]] = field(default_factory=list)

    def over(self, send: Any) -> Any:
        def watched(s: Station, t: int) -> None:
            busy = {e.robot for e in s.book.values() if e.state in (AlertState.ASSIGNED, AlertState.ON_SCENE)}
            free = [
                x for name, x in sorted(s._heard.items())
                if name not in busy and x.order < 0 and s._fresh(t, name) and x.duty in (Duty.PATROL, Duty.STAND)
            ]  # fmt: skip
            waiting = [e for _, e in sorted(s.book.items()) if e.state is AlertState.WAITING]
            send(s, t)
            went = [s.book[e.alert.number] for e in waiting]
            went = [e for e in went if e.state is AlertState.ASSIGNED]
            if went:
                self.sent.append((s, free, waiting, went))
                told = ", ".join(f"{e.robot} to alert {e.alert.number}" for e in went)
                sys.stdout.write(f"{told}; {sum(e.state.ended for e in s.book.values())} have ended\n")
                sys.stdout.flush()

        return watched

    def ends(self, act: Any) -> Any:
        def acts(s: Any, *what: Any) -> Action:
            action = act(s, *what)
            return replace(action, done=True) if self.stopped else action

        return acts

    def stop(self, *_: object) -> None:
        self.stopped = True


def excess(s: Station, free: list[Status], waiting: list[Entry], went: list[Entry]) -> float:
    """Sum of the costs of the ways of those sent, over the least sum there was; costs by scikit-image, pairs by
    trying all."""
    weights = np.where(Traversal().weights < np.inf, Traversal().weights, -1.0)[s.costmap.cells]
    costs = np.array([_costs(s, weights, robot, waiting) for robot in free])
    n = len(went)
    rows = list(permutations(range(len(free)), n))
    columns = [j for j in permutations(range(len(waiting)), n) if list(j) == sorted(j)]
    best = min(sum(costs[i, j] for i, j in zip(a, b, strict=True)) for a in rows for b in columns)
    names, numbers = [r.robot for r in free], [e.alert.number for e in waiting]
    chosen = sum(costs[names.index(e.robot), numbers.index(e.alert.number)] for e in went)
    return chosen / best


def _costs(s: Station, weights: Floats, robot: Status, waiting: list[Entry]) -> list[float]:
    """Metres of free ground to a place with a view of each alert."""
    row, col = s.costmap.cell_of(robot.pose[:2]).tolist()  # it may stand nearer to something than it would plan to
    open_cells = np.argwhere(weights > 0.0)
    start = tuple(open_cells[np.hypot(*(open_cells - (row, col)).T).argmin()].tolist())
    spread, _ = MCP_Geometric(weights).find_costs([start])
    out: list[float] = []
    for e in waiting:
        places, grades = s._view(e.alert)
        way = spread[tuple(s.costmap.cell_of(places[:, :2]).T)]
        best = grades == grades[np.isfinite(way)].min()
        # the first and the last step are from and to the middles of cells
        out.append(float(way[best].min()) * s.costmap.resolution + s.costmap.resolution)
    return out


def patrolled(minutes: float, alerts: int) -> tuple[Simulation, dict[str, Any], Watch]:
    watch, send, acts = Watch(), Station._send, {kind: kind.act for kind in (Station, Patrol)}
    before = signal.signal(signal.SIGTERM, watch.stop)
    cast = build(*load_scenario("site-fleet", {"minutes": minutes, "alerts": alerts, "seed": SEED}))
    try:
        Station._send = watch.over(send)
        for kind, act in acts.items():
            kind.act = watch.ends(act)
        run = cast.run()
    finally:
        Station._send = send
        for kind, act in acts.items():
            kind.act = act
        signal.signal(signal.SIGTERM, before)
    told = mission(cast, run)
    assert told is not None
    return run, told, watch


def shown(value: float | None, unit: str) -> str:
    return "" if value is None else f"{value:.1f} {unit}"


def test_the_patrol_of_an_hour(minutes: float = MINUTES, alerts: int = ALERTS) -> None:
    run, told, watch = patrolled(minutes, alerts)
    booked = told["alerts"]
    worst = max(excess(*one) for one in watch.sent)
    gone = [a for a in booked if a["driven_m"] is not None and a["way_m"] > 5.0]
    each = np.array([a["driven_m"] / a["way_m"] for a in gone])
    ratio = sum(a["driven_m"] for a in gone) / sum(a["way_m"] for a in gone)
    beyond = sum(a["driven_m"] - a["way_m"] > max(0.1 * a["way_m"], ABOUT) for a in gone)
    apart = min(c.distance for pair, c in run.monitor.separations.items() if "station" not in pair)
    walls = min(c.distance for name, c in run.monitor.clearances.items() if name != "station")
    rows = [
        (
            a["alert"], f"{a['east_m']:.1f}, {a['north_m']:.1f}", shown(a["raised_s"], "s"), a["robot"],
            shown(a["sent_s"], "s"), shown(a["response_s"], "s"), shown(a["way_m"], "m"), shown(a["driven_m"], "m"),
            "" if a["driven_m"] is None else f"{a['driven_m'] / a['way_m']:.2f}", a["text"],
        )
        for a in booked
    ]  # fmt: skip
    text = (
        f"`site-fleet`: 5 robots, {alerts} random alerts, {(run.ended - run.monitor.start) / 60e9:.1f} simulated "
        f"minutes, seed {SEED}: {'stopped before its hour was over' if watch.stopped else run.sentence}. "
        f"{sum(a['ended'] for a in booked)} of the {len(booked)} alerts raised ended in a named state. "
        f"Who is sent: the sum of path costs "
        f"is at most {worst:.4f} times the least there was (scikit-image for the costs, all pairings tried; asked: "
        f"1.10). Driven from being sent to being there: {ratio:.3f} times the way planned when sent, over all ways of "
        f"more than 5 m ({each.min():.2f} to {each.max():.2f}, median {np.median(each):.2f}); {beyond} of {len(gone)} "
        f"are longer by more than 10 % and by more than the {ABOUT:g} m that it takes to turn about at speed. Robots "
        f"came no nearer than {apart:.2f} m to each other and {walls:.2f} m to anything else."
    )
    header = ("alert", "at, m", "raised", "robot", "sent", "response", "way", "driven", "ratio", "end")
    publish("patrol", "A fleet on patrol", text, header, rows)
    assert run.ending is Ending.TIME
    assert len(booked) == alerts and all(a["ended"] for a in booked)
    assert sorted(a["alert"] for a in booked) == list(range(1, alerts + 1))
    assert worst <= 1.10 and ratio <= 1.10 and min(apart, walls) > 0.0
