"""What became of alerts, from the station's book and the truth of the robots."""

from typing import Any

import numpy as np

from outrider.data.alerts import AlertState
from outrider.mapping.zones import Zones
from outrider.scenarios.build import Cast
from outrider.sim.engine import Simulation
from outrider.sim.truth import Truth
from outrider.team.patrol import Patrol
from outrider.team.station import Entry, Station

FAILED = (AlertState.TIMED_OUT, AlertState.UNREACHABLE)


def stations(cast: Cast) -> list[Station]:
    """Those who keep a book."""
    return [r.agent for r in cast.team if isinstance(r.agent, Station)]


def unserved(cast: Cast) -> int:
    """How many alerts were in vain."""
    return sum(e.state in FAILED for s in stations(cast) for e in s.book.values())


def mission(cast: Cast, run: Simulation) -> dict[str, Any] | None:
    """Of a patrol: every alert, how many ended how, rounds and passages; None without one. SI units."""
    patrols = {r.name: r.agent for r in cast.team if isinstance(r.agent, Patrol)}
    if not patrols:
        return None
    book = [e for s in stations(cast) for _, e in sorted(s.book.items())]
    alerts = [_alert(run, e) for e in book]
    states = [a["state"] for a in alerts]
    passages = next(iter(patrols.values())).passages
    return {
        "alerts": alerts,
        "states": {s: states.count(s) for s in sorted(set(states))},
        "bad_lines": sum(s.faults for s in stations(cast)),
        "robots": {
            name: {
                "duty": {"code": p.mission.duty.name.lower(), "text": p.mission.duty.value},
                "battery": p.share,
                "stops": p.stops[:, :2].tolist(),
                "dock": p.dock[:2].tolist(),
                "legs": dict(p.body.driver.legs),
                "observed": sum(e.robot == name and e.state is AlertState.OBSERVED for e in book),
            }
            for name, p in patrols.items()
        },
        "passages": [p.tolist() for p in passages],
        "zones": _zones(next(iter(patrols.values())).body.driver.zones),
    }


def _zones(zones: Zones | None) -> list[dict[str, Any]]:
    """Where robots go slowly, or one way only."""
    if zones is None:
        return []
    slow = [{"kind": "speed", "name": s.name, "area": s.points.tolist(), "speed_mps": s.speed} for s in zones.speed]
    lanes = [
        {"kind": "one_way", "name": s.name, "area": s.points.tolist(), "heading_deg": float(np.degrees(s.heading))}
        for s in zones.one_way
    ]
    return slow + lanes


def _alert(run: Simulation, e: Entry) -> dict[str, Any]:
    """One alert. response_s : from being raised to a robot being there;  way_m : of the robot that was sent, as planned
    when it was sent, and `driven_m`, as driven until it was there."""
    start, a = run.monitor.start, e.alert
    sent = next((line for line in reversed(e.log) if line[1] is AlertState.ASSIGNED), None)
    there = next((line for line in reversed(e.log) if line[1] is AlertState.ON_SCENE), None)
    last = e.log[-1]

    def seconds(t: int) -> float:
        return (t - start) * 1e-9

    return {
        "alert": a.number, "east_m": float(a.p[0]), "north_m": float(a.p[1]), "sigma_m": a.sigma, "source": a.source,
        "raised_s": seconds(a.t),
        "state": e.state.name.lower(), "text": e.state.value, "ended": e.state.ended,
        "robot": e.robot or (sent[2] if sent else ""),
        "sent": sum(line[1] is AlertState.ASSIGNED for line in e.log),
        "sent_s": seconds(sent[0]) if sent else None,
        "there_s": seconds(there[0]) if there else None,
        "ended_s": seconds(last[0]) if e.state.ended else None,
        "response_s": (there[0] - a.t) * 1e-9 if there else None,
        "way_m": e.way if sent and np.isfinite(e.way) else None,
        "driven_m": _driven(run.truth[sent[2]], sent[0], there[0]) if sent and there and sent[0] < there[0] else None,
        "repeats": e.twin if e.twin >= 0 else None,
        "returned": [{"t_s": seconds(t), "robot": who, "text": why} for t, who, why in e.returned],
        "view": None if e.view is None else e.view.tolist(),
    }  # fmt: skip


def _driven(truth: Truth, since: int, until: int) -> float:
    """m of a robot's way between two moments [ns]."""
    rows = (truth.t >= since) & (truth.t <= until)
    return float(np.hypot(*np.diff(truth.p[rows, :2], axis=0).T).sum())
