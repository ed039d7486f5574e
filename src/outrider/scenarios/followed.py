"""What became of a pursuit: how near they came and for how long, what the follower was about and why, its errors."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, final

import numpy as np

from outrider.filters.channels import site_position
from outrider.guidance.rendezvous import Stage
from outrider.safety.separation import Hold
from outrider.scenarios.build import Cast
from outrider.sim.engine import Simulation
from outrider.sim.truth import EPOCH
from outrider.team.pursuer import Pursuer
from outrider.typing import Bools, Floats, Ints

if TYPE_CHECKING:
    from outrider.plot.following import Pursuit

SHOWN_S: Final = 0.1  # s between what is measured and drawn
HELD: Final = 1.25  # m off the set-point within which it counts as held
FOLLOWING: Final = (Stage.LOCALISE, Stage.RENDEZVOUS, Stage.DANGER)  # the target is heard; else it is lost, or at home


def pursuers(cast: Cast) -> dict[str, Pursuer]:
    """Who follows, by name."""
    return {r.name: r.agent for r in cast.team if isinstance(r.agent, Pursuer)}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Breach:
    """A follower nearer to its target than its protective distance R_d, between the centres.

    since_s : when that was so first;  inside_s : for how long altogether;  least, at_s : m and when, at worst;
    guarded : whether a safety filter was to prevent it
    """

    follower: str
    leader: str
    danger: float
    since_s: float
    inside_s: float
    least: float
    at_s: float
    guarded: bool

    @property
    def sentence(self) -> str:
        """Who, when and how deep."""
        least, deep = f"{self.least:.3g} m between centres after {self.at_s:.1f} s", f"{self.danger - self.least:.3g} m"
        what = f"{self.follower} broke its protective distance of {self.danger:g} m behind {self.leader}: {least}"
        spell = f"{deep} too near at worst, inside for {self.inside_s:.3g} s from {self.since_s:.1f} s on"
        return f"{what}, {spell}" + ("" if self.guarded else " (its law flies without a safety filter)")


def apart(run: Simulation, a: str, b: str) -> tuple[Floats, Floats]:
    """(n,) s since the start, and (n,) m between the centres of two robots then, at every row of the first."""
    one, two = run.truth[a], run.truth[b]
    s, other = (np.asarray((x.t - run.monitor.start) * 1e-9, np.float64) for x in (one, two))
    p = np.column_stack([np.interp(s, other, two.p[:, k]) for k in range(3)])
    return s, np.asarray(np.linalg.norm(one.p - p, axis=1), np.float64)


def breaches(cast: Cast, run: Simulation) -> list[Breach]:
    """Whose protective distance did not hold, in order of time."""
    out: list[Breach] = []
    for name, agent in pursuers(cast).items():
        s, d = apart(run, name, agent.bearings.leader)
        inside, k = d < agent.zones.danger, int(d.argmin())
        if inside.any():
            spent = float(np.diff(s, prepend=s[0])[inside].sum())
            out.append(Breach(
                follower=name, leader=agent.bearings.leader, danger=agent.zones.danger, inside_s=spent,
                since_s=float(s[inside.argmax()]), least=float(d[k]), at_s=float(s[k]),
                guarded=agent.separation is not None,
            ))  # fmt: skip
    return sorted(out, key=lambda b: b.since_s)


def strayed(cast: Cast) -> list[str]:
    """Who is not following at the end, what it is about instead, and why."""
    missions = {name: agent.mission for name, agent in pursuers(cast).items()}
    return [f"{n} at the end: {m.stage.value} ({m.why.value})" for n, m in missions.items() if m.stage not in FOLLOWING]


def promises(cast: Cast) -> list[str]:
    """What every follower's distance holds against, before anything flies."""
    return [f"{name}: {agent.promise}" for name, agent in pursuers(cast).items() if agent.promise]


def pursuit(cast: Cast, run: Simulation) -> dict[str, Any] | None:
    """Of every follower; None without any. SI units."""
    return {name: _one(run, name, agent) for name, agent in pursuers(cast).items()} or None


def _one(run: Simulation, name: str, agent: Pursuer) -> dict[str, Any]:
    s, d = apart(run, name, agent.bearings.leader)
    t = _times(run)
    seconds = _s(t)
    shown = np.interp(seconds, s, d)
    f, R_d = agent.flown, agent.zones.danger
    goal = f.set_point[-1] if f.set_point else float("nan")
    near = np.flatnonzero(np.abs(shown - _wanted(agent, t)) <= HELD)
    hulls = run.monitor.separations.get((min(name, agent.bearings.leader), max(name, agent.bearings.leader)))
    since = seconds >= (seconds[near[0]] if near.size else np.inf)
    following = since & follows(agent, t)
    used = {f"{who}: {o.name.lower()}": n for (who, o), n in sorted(agent.bearings.outcomes.items(), key=str)}
    held = {h: f.hold.count(h) for h in dict.fromkeys(f.hold)}
    return {
        "leader": agent.bearings.leader, "promise": agent.promise,
        "danger_m": R_d, "zone_m": agent.zones.zone, "set_point_m": goal,
        "least_m": float(d.min()), "least_at_s": float(s[d.argmin()]),
        "least_between_hulls_m": None if hulls is None else float(hulls.distance),
        "broke_danger": bool((d < R_d).any()), "inside_s": float(np.diff(s, prepend=s[0])[d < R_d].sum()),
        "held_after_s": float(seconds[near[0]]) if near.size else None,
        "followed_s": float(following.sum() * SHOWN_S),
        "mean_m": float(shown[following].mean()) if following.any() else None,
        "sd_m": float(shown[following].std()) if following.any() else None,
        "lost": _lost(agent, t, shown, since),
        "stage": {"code": agent.mission.stage.name.lower(), "text": agent.mission.stage.value,
                  "why": agent.mission.why.value},
        "changes": [{"stage": s.name.lower(), "why": w.value, "times": n} for (s, w), n in agent.counts.items()],
        "blocked": agent.blocked, "fixes": used, "delay_s": _finite(agent.bearings.delay_s),
        "clock_ahead_s": _finite(agent.bearings.clocks.ahead_s),
        "safety": [
            {"code": h.name.lower(), "text": h.value, "times": n, "share": n / len(f.hold),
             "total_s": n * agent.style.command_s,
             "because": _because(agent) if h is Hold.CANNOT_HOLD else []}
            for h, n in held.items()
        ],
    }  # fmt: skip


def _wanted(agent: Pursuer, t: Ints) -> Floats:
    """(n,) m, its set-point at some times [ns], NaN while it has none."""
    if not agent.flown.t:
        return np.full(len(t), np.nan)
    rows = np.searchsorted(np.array(agent.flown.t, np.int64), t, side="right") - 1
    return np.where(rows < 0, np.nan, np.array(agent.flown.set_point)[rows])


def stages_at(agent: Pursuer, t: Ints) -> list[Stage]:
    """What it was about at some times [ns]."""
    if not agent.flown.t:
        return [agent.mission.stage] * len(t)
    rows = np.searchsorted(np.array(agent.flown.t, np.int64), t, side="right") - 1
    return [agent.flown.stage[max(k, 0)] for k in rows.tolist()]


def follows(agent: Pursuer, t: Ints) -> Bools:
    """Whether it was following at some times [ns]: neither searching nor predicting, neither hovering nor at home."""
    return np.array([stage in FOLLOWING for stage in stages_at(agent, t)], np.bool_)


def _lost(agent: Pursuer, t: Ints, apart: Floats, since: Bools) -> list[dict[str, Any]]:
    """For how long it was about anything else once it had followed, and how far from the target meanwhile."""
    stages = stages_at(agent, t)
    out = list[dict[str, Any]]()
    for stage in dict.fromkeys(stages):
        here = since & np.array([s is stage for s in stages], np.bool_)
        if stage not in FOLLOWING and here.any():
            told = {"stage": stage.name.lower(), "text": stage.value, "seconds": float(here.sum() * SHOWN_S)}
            out.append({**told, "mean_m": float(apart[here].mean()), "largest_m": float(apart[here].max())})
    return out


def _because(agent: Pursuer) -> list[dict[str, Any]]:
    """For which reasons no distance could be guaranteed, and how many times each."""
    return [{"code": lack.name.lower(), "text": lack.value, "times": n} for lack, n in agent.flown.lack.most_common()]


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
