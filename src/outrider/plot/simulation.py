"""The report of a simulation: one HTML file that needs nothing else, and moves."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from outrider.plot import tables
from outrider.plot.report import page_environment
from outrider.plot.series import extremes, seconds
from outrider.plot.stage import COLOURS, KEYS, colours, stage
from outrider.plot.style import DARK, css_name, finish, panels, styled, to_svg
from outrider.sim.engine import Simulation
from outrider.typing import Floats, Ints

Json = dict[str, Any]
Curve = tuple[str, str, Ints, Floats]  # name, colour, stamps [ns], values
FAR = 15.0  # m: larger distances are cut off, the small ones matter


def write_simulation_report(
    run: Simulation,
    summary: Json,
    path: Path,
    *,
    scenario: str,
    command: str = "",
    figures: Sequence[tuple[str, Figure]] = (),
) -> None:
    """Write the page. summary : schema `outrider.simulation/1`;  scenario : its resolved text;  command : what to type
    to get the run again;  figures : more to show, with their titles."""
    goals = {name: [(g["east_m"], g["north_m"]) for g in r["goals"]] for name, r in summary["robots"].items()}
    picture, data = stage(run, goals, summary["mission"])
    figure = simulation_figure(run)
    html = (
        page_environment()
        .get_template("simulation.html.j2")
        .render(
            s=summary,
            tone=_tone(summary),
            stage=picture,
            data=Markup(json.dumps(data, separators=(",", ":")).replace("</", "<\\/")),
            curves=Markup(to_svg(figure, "distances over time")) if figure else "",
            figures=[(title, Markup(to_svg(f, title))) for title, f in figures],
            far=FAR,
            keys=KEYS,
            colours=colours(run),
            cards=_cards(summary),
            goals=[(name, k + 1, g) for name, r in summary["robots"].items() for k, g in enumerate(r["goals"])],
            held=_held(summary),
            scenario=scenario,
            command=command or f"outrider run {_word(summary['scenario'])} --seed {summary['seed']}",
            palette=[(css_name(light), light, dark) for light, dark in DARK.items()],
            versions=summary["versions"],
            number=_number,
            span=tables.span,
        )
    )
    path.write_text(html, encoding="utf-8")


@styled
def simulation_figure(run: Simulation) -> Figure | None:
    """Clearance, separation and margin to the fence [m], height [m], and the error of a robot's own estimate [m]."""
    told = {unit: curves for unit, curves in _curves(run).items() if curves}
    if not told:
        return None
    figure, axes = panels(len(told), 1.35)
    handles: dict[str, Line2D] = {}
    for ax, (unit, curves) in zip(axes, told.items(), strict=True):
        ax.set_ylabel(unit)
        for name, colour, t, values in curves:
            _draw(ax, run, t, values, colour)
            handles.setdefault(name, Line2D([], [], color=colour, label=name))
        if unit.startswith(("clearance", "separation")):
            top = min(FAR, max(float(np.max(v)) for *_, v in curves) * 1.05)
            ax.set_ylim(min(0.0, *(float(np.min(v)) for *_, v in curves)), max(top, 0.1))
    return finish(figure, list(handles.values()))


def _tone(summary: Json) -> str:
    if summary["outcome"]["code"] not in ("goal", "time"):
        return "error"
    missed = [g for r in summary["robots"].values() for g in r["goals"] if g["outcome"] != "arrived"]
    alerts = summary["mission"]["alerts"] if summary["mission"] else []
    missed += [a for a in alerts if a["state"] in ("timed_out", "unreachable")]
    return "warning" if missed else "good"


def _curves(run: Simulation) -> dict[str, list[Curve]]:
    hue = {name: COLOURS[k % len(COLOURS)] for k, name in enumerate(run.truth)}
    near = {name: run.monitor.clearance(truth) for name, truth in run.truth.items()}
    pairs = sorted(run.monitor.separations)
    apart = {pair: run.monitor.separation(run.truth[pair[0]], run.truth[pair[1]]) for pair in pairs}
    close = [pair for pair in pairs if np.min(apart[pair][1]) < FAR]
    later = COLOURS[len(run.truth) :] or COLOURS
    rises = any(np.ptp(truth.p[:, 2]) > 0.5 for truth in run.truth.values())
    errors = {s.robot: _error(run, s.robot, s.t, s.z) for s in run.log if s.name.split("/")[-1] == "estimate"}
    return {
        "clearance [m]": [(n, hue[n], t, np.minimum(g, 1e3)) for n, (t, g) in near.items() if np.isfinite(g).any()],
        "separation [m]": [(" – ".join(pair), later[k % len(later)], *apart[pair]) for k, pair in enumerate(close)],
        "height [m]": [(n, hue[n], truth.t, truth.p[:, 2]) for n, truth in run.truth.items() if rises],
        "error of own\nestimate [m]": [(n, hue[n], *error) for n, error in errors.items()],
    }


def _error(run: Simulation, robot: str, t: Ints, z: Floats) -> tuple[Ints, Floats]:
    return t, np.linalg.norm((z[:, :3] - run.truth[robot].at(t).p)[:, :2], axis=1)


def _draw(ax: Axes, run: Simulation, t: Ints, values: Floats, colour: str) -> None:
    rows = extremes(values)
    ax.plot(seconds(t, run.monitor.start)[rows], values[rows], color=colour)


def _cards(summary: Json) -> list[dict[str, str]]:
    """The key figures."""
    cards = [
        _card("simulated", tables.span(summary["duration_s"]), f"{summary['times_real_time']:,.0f} times real time"),
        _card("records", f"{summary['log']['records']:,}", f"of {_sensors(summary)} streams"),
    ]
    for name, r in summary["robots"].items():
        how = f"{r['vehicle']}, {r['driven_by']}" if r["vehicle"] != "carried" else "carried along a track"
        cards.append(_card(f"{name} travels", tables.number(r["distance_m"], "m"), how))
        if r["clearance"]:
            near = r["clearance"]
            cards.append(_card(f"{name} comes near", _number(near["distance_m"]) + " m", _moment(near)))
        if r["fence"]:
            fence = r["fence"]
            where = f"at least, {fence['t_s']:.1f} s"
            cards.append(_card(f"{name} inside the fence", _number(fence["distance_m"]) + " m", where))
        if r["estimate"]:
            worst = f"RMSE; {_number(r['estimate']['largest_m'])} m at worst"
            cards.append(_card(f"{name} mistakes its place by", _number(r["estimate"]["rmse_m"]) + " m", worst))
    for pair in summary["separations"]:
        name = " and ".join(pair["robots"])
        where = f"hull to hull, at least, {pair['t_s']:.1f} s"
        cards.append(_card(f"{name} apart", _number(pair["distance_m"]) + " m", where))
    for name, r in (summary["pursuit"] or {}).items():
        where = f"between centres, at least, {r['least_at_s']:.1f} s; danger zone {r['danger_m']:g} m"
        where += f", inside for {_number(r['inside_s'])} s" if r["broke_danger"] else ", never inside"
        cards.append(_card(f"{name} behind {r['leader']}", _number(r["least_m"]) + " m", where))
    return cards


def _held(summary: Json) -> list[tuple[str, Json]]:
    """Robot, and what was done to its commands why."""
    held = [(name, h) for name, r in summary["robots"].items() for h in r["safety"]]
    for name, r in (summary["pursuit"] or {}).items():
        for h in r["safety"]:
            why = "; ".join(f"{_times(b['times'])} because {b['text']}" for b in h["because"])
            held += [(name, {**h, "text": f"{h['text']} ({why})" if why else h["text"]})] if h["code"] != "free" else []
    return held


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _word(name: str) -> str:
    """A scenario's name as a word of a command line."""
    return name if name.replace("-", "").replace("_", "").isalnum() else "scenario.yaml"


def _card(name: str, value: str, note: str) -> dict[str, str]:
    return {"name": name, "value": value, "note": note}


def _moment(near: Json) -> str:
    return f"{near['to']}, {near['t_s']:.1f} s"


def _sensors(summary: Json) -> int:
    return sum(len(r["sensors"]) for r in summary["robots"].values())


def _number(value: float | None, digits: int = 3) -> str:
    return tables.number(float("nan") if value is None else value, digits=digits)
