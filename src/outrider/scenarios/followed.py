"""What became of a pursuit: how near they came and for how long, what the follower was about and why, its errors."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from outrider.filters.channels import site_position
from outrider.scenarios.build import Cast
from outrider.sim.engine import Simulation
from outrider.sim.truth import EPOCH
from outrider.team.pursuer import Pursuer
from outrider.typing import Floats, Ints

if TYPE_CHECKING:
    from outrider.plot.following import Pursuit

SHOWN_S: Final = 0.1  # s between what is measured and drawn
HELD: Final = 1.25  # m more than the set-point within which it counts as held


def pursuers(cast: Cast) -> dict[str, Pursuer]:
    """Who follows, by name."""
    return {r.name: r.agent for r in cast.team if isinstance(r.agent, Pursuer)}


def pursuit(cast: Cast, run: Simulation) -> dict[str, Any] | None:
    """Of every follower; None without any. SI units."""
    return {name: _one(run, name, agent) for name, agent in pursuers(cast).items()} or None


def _one(run: Simulation, name: str, agent: Pursuer) -> dict[str, Any]:
    t = _times(run)
    seconds = np.asarray((t - EPOCH) * 1e-9, np.float64)
    apart = np.linalg.norm(run.truth[name].at(t).p - run.truth[agent.bearings.leader].at(t).p, axis=1)
    f, R_d = agent.flown, agent.zones.danger
    goal = f.set_point[-1] if f.set_point else float("nan")
    near = np.flatnonzero(apart <= goal + HELD)
    since = seconds >= (seconds[near[0]] if near.size else np.inf)
    used = {f"{who}: {o.name.lower()}": n for (who, o), n in sorted(agent.bearings.outcomes.items(), key=str)}
    held = {h: f.hold.count(h) for h in dict.fromkeys(f.hold)}
    return {
        "leader": agent.bearings.leader, "danger_m": R_d, "zone_m": agent.zones.zone, "set_point_m": goal,
        "least_m": float(apart.min()), "least_at_s": float(seconds[apart.argmin()]),
        "inside_s": float((apart < R_d).sum() * SHOWN_S),
        "held_after_s": float(seconds[near[0]]) if near.size else None,
        "mean_m": float(apart[since].mean()) if since.any() else None,
        "sd_m": float(apart[since].std()) if since.any() else None,
        "stage": {"code": agent.mission.stage.name.lower(), "text": agent.mission.stage.value,
                  "why": agent.mission.why.value},
        "changes": [{"stage": s.name.lower(), "why": w.value, "times": n} for (s, w), n in agent.counts.items()],
        "blocked": agent.blocked, "fixes": used, "delay_s": _finite(agent.bearings.delay_s),
        "clock_ahead_s": _finite(agent.bearings.clocks.ahead_s),
        "safety": [{"code": h.name.lower(), "text": h.value, "share": n / len(f.hold)} for h, n in held.items()],
    }  # fmt: skip


def drawn(run: Simulation, name: str, agent: Pursuer) -> "Pursuit":
    """What the picture of one follower shows."""
    from outrider.plot.following import Pursuit  # imports matplotlib

    t = _times(run)
    own, target = run.truth[name].at(t), run.truth[agent.bearings.leader].at(t)
    e = run.log.streams[f"{name}/estimate"]
    rows = np.clip(np.searchsorted(e.t, t, side="right") - 1, 0, len(e) - 1)
    f = agent.flown
    told = np.column_stack([_s(np.array(f.t, np.int64)), f.distance, f.set_point]) if f.t else np.zeros((0, 3))
    gnss = run.log.streams[f"{name}/{agent.bearings.gnss}"]
    fixes = np.column_stack([_s(gnss.t), site_position(gnss, own.datum)])
    gaps = np.flatnonzero(np.diff(gnss.t) > 1.9e9 * max(1.0 / gnss.rate, agent.zones.blocked_s / 2.0))
    return Pursuit(
        t=_s(t), target=target.p, own=own.p, estimate=e.z[rows, :3], v_target=np.linalg.norm(target.v, axis=1),
        v_own=np.linalg.norm(own.v, axis=1), danger=agent.zones.danger, zone=agent.zones.zone, told=told,
        stages=_stages(agent), blocked=[(fixes[k, 0], fixes[k + 1, 0]) for k in gaps.tolist()], fixes=fixes,
    )  # fmt: skip


def pursuit_figures(cast: Cast, run: Simulation) -> list[tuple[str, Any]]:
    """A title and a picture for every follower."""
    from outrider.plot.following import pursuit_figure

    made = pursuers(cast)
    return [(f"{n} behind {a.bearings.leader}", pursuit_figure(drawn(run, n, a))) for n, a in made.items() if a.flown.t]


def write_pictures(figures: list[tuple[str, Any]], folder: Path) -> None:
    """As files beside the report."""
    from outrider.plot.style import save_png

    for title, figure in figures:
        save_png(figure, folder / f"{title.replace(' ', '_')}.png")


def _stages(agent: Pursuer) -> list[tuple[str, float, float]]:
    f = agent.flown
    if not f.t:
        return []
    t, out, first = _s(np.array(f.t, np.int64)), list[tuple[str, float, float]](), 0
    for k in range(1, len(f.t) + 1):
        if k == len(f.t) or f.stage[k] is not f.stage[first]:
            out.append((f.stage[first].name.lower(), float(t[first]), float(t[min(k, len(t) - 1)])))
            first = k
    return out


def _times(run: Simulation) -> Ints:
    return np.arange(run.monitor.start, run.ended + 1, round(SHOWN_S * 1e9))


def _s(t: Ints) -> Floats:
    return np.asarray((t - EPOCH) * 1e-9, np.float64)


def _finite(x: float) -> float | None:
    return x if np.isfinite(x) else None
