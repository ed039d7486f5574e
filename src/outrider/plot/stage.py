"""A simulation from above, as SVG that a script moves: the outline of the world, tracks, robots, movers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, log10
from typing import Any, Final, TypeAlias, final

import numpy as np
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from outrider.plot.style import FUSED, SOURCES, css_name
from outrider.sim.engine import Simulation
from outrider.sim.truth import Truth
from outrider.sim.world import World
from outrider.typing import Floats

COLOURS: Final = (FUSED, *SOURCES)
CELLS: Final = 220  # of the longer side, on which the outline is drawn
CEILING: Final = 60.0  # m: what stands higher is not drawn
FRAMES: Final = 900  # of the animation, at most
SLOWEST_HZ: Final = 10.0
KEYS: Final = 7  # moments that stay visible on paper
MARGIN: Final = 4.0  # m around what is shown

Goals: TypeAlias = Mapping[str, Sequence[tuple[float, float]]]


@final
@dataclass(frozen=True, slots=True)
class Window:
    """The part of the plane that is shown [m]."""

    west: float
    south: float
    east: float
    north: float

    @property
    def size(self) -> tuple[float, float]:
        """Width and height."""
        return self.east - self.west, self.north - self.south


def colours(run: Simulation) -> dict[str, str]:
    """The CSS colour of each robot."""
    return {name: f"var({css_name(COLOURS[k % len(COLOURS)])})" for k, name in enumerate(run.truth)}


def stage(
    run: Simulation, goals: Goals | None = None, mission: Mapping[str, Any] | None = None
) -> tuple[Markup, dict[str, Any]]:
    """The picture, and the data that its script moves it with (x east and y south of the picture's corner [m]).

    goals : east, north [m] of where each robot was sent;  mission : of a patrol, as in the summary
    """
    sent = {name: np.array(places).reshape(-1, 2) for name, places in (goals or {}).items()}
    window = _window(run, [*sent.values(), *_places(mission)])
    wide, high = window.size
    unit = max(wide, high) / 100.0  # a hundredth of the picture: sizes of text and strokes
    frames = _moments(run)
    seconds = (frames - run.monitor.start) * 1e-9
    hues = colours(run)
    robots = [_robot(run, truth, frames, window, hues[name]) for name, truth in run.truth.items()]
    movers = [{"name": m.name, "radius": m.radius, **_placed(m.at(seconds), window)} for m in run.monitor.world.movers]
    parts = [
        f'<svg id="stage" viewBox="0 0 {wide:.2f} {high:.2f}" role="img" aria-label="the run from above" '
        f'style="--u:{unit:.3f}px">',
        f'<path class="world" d="{outline(run.monitor.world, window)}"/>',
        _fence(run.monitor.world, window),
        _mission(mission, window, unit, hues) if mission else "",
        _scale_bar(window, unit),
        *(_track(robot) for robot in robots),
        *(_goals(places, window, unit, hues[name]) for name, places in sent.items()),
        *(_keys(robot, unit) for robot in robots),
        *(f'<circle class="mover" r="{m["radius"]:.2f}"><title>{escape(m["name"])}</title></circle>' for m in movers),
        *(_marker(robot, unit, below=k % 2 > 0) for k, robot in enumerate(robots)),
        "</svg>",
    ]
    data = {"t": np.round(seconds, 2).tolist(), "robots": robots, "movers": movers}
    return Markup("".join(parts)), data


def outline(world: World, window: Window) -> str:
    """What stands in the world as one SVG path: the contour of what covers the ground seen from above."""
    wide, high = window.size
    step = max(wide, high) / CELLS
    x = np.arange(window.west, window.east + step, step)
    y = np.arange(window.south, window.north + step, step)
    field = _cover(replace(world, movers=()), x, y)
    if not (field < 0.0).any():
        return ""
    drawn = Figure().subplots().contourf(x, y, field, levels=[-1e3, 0.0])
    flip = np.array([1.0, -1.0])
    corner = np.array([window.west, window.north])
    paths = [ring for path in drawn.get_paths() for ring in path.to_polygons(closed_only=True)]
    return "".join(_path((np.asarray(ring) - corner) * flip) + "Z" for ring in paths)


def _cover(world: World, x: Floats, y: Floats) -> Floats:
    """(rows, columns) the least distance from anything over each point of the plane, by marching straight up."""
    p = np.column_stack([*(a.ravel() for a in np.meshgrid(x, y)), np.full(x.size * y.size, 0.05)])
    best, rows = np.full(len(p), np.inf), np.arange(len(p))
    while rows.size:
        d = world.clearance(p[rows])
        best[rows] = np.minimum(best[rows], d)
        p[rows, 2] += np.maximum(np.abs(d), 0.15)
        rows = rows[p[rows, 2] < CEILING]
    return np.clip(best, -999.0, 999.0).reshape(y.size, x.size)


def _places(mission: Mapping[str, Any] | None) -> list[Floats]:
    """(n, 2) m: the stops of each round, and the alerts that somebody had a way to."""
    if not mission:
        return []
    alerts = [[a["east_m"], a["north_m"]] for a in mission["alerts"] if a["way_m"] is not None]
    return [np.array(r["stops"])[:, :2] for r in mission["robots"].values()] + [np.array(alerts).reshape(-1, 2)]


def _window(run: Simulation, places: Sequence[Floats]) -> Window:
    """Around all that moves, around all places where somebody is sent, and around what stands close to it."""
    tracks = [truth.p[:, :2] for truth in run.truth.values()] + [m.p[:, :2] for m in run.monitor.world.movers]
    tracks += [p for p in places if len(p)]
    low, high = np.min([p.min(axis=0) for p in tracks], axis=0), np.max([p.max(axis=0) for p in tracks], axis=0)
    around = np.maximum(MARGIN, 0.12 * (high - low))
    low, high = low - around, high + around
    short = np.maximum(0.55 * float((high - low).max()) - (high - low), 0.0)  # no narrow strips
    low, high = low - 0.5 * short, high + 0.5 * short
    return Window(float(low[0]), float(low[1]), float(high[0]), float(high[1]))


def _moments(run: Simulation) -> Any:
    """Stamps of the frames [ns]."""
    lasted = run.ended - run.monitor.start
    count = int(min(FRAMES, max(2, lasted * 1e-9 * SLOWEST_HZ)))
    return run.monitor.start + np.linspace(0, lasted, count).astype(np.int64)


def _robot(run: Simulation, truth: Truth, frames: Any, window: Window, colour: str) -> dict[str, Any]:
    here = truth.at(np.clip(frames, truth.t[0], truth.t[-1]))
    hull = run.monitor.hulls[truth.robot]
    return {
        "name": truth.robot,
        "colour": colour,
        "radius": hull.radius,
        "yaw": np.round(np.degrees(here.trajectory().yaw), 1).tolist(),
        "z": np.round(here.p[:, 2], 2).tolist(),
        "v": np.round(np.linalg.norm(here.v, axis=1), 2).tolist(),
        **_placed(here.p, window),
    }


def _placed(p: Floats, window: Window) -> dict[str, list[float]]:
    """Rows of positions in the picture."""
    return {"x": np.round(p[:, 0] - window.west, 2).tolist(), "y": np.round(window.north - p[:, 1], 2).tolist()}


def _path(p: Floats) -> str:
    return "M" + "L".join(f"{a:.2f} {b:.2f}" for a, b in p)


def _track(robot: Mapping[str, Any]) -> str:
    way = _path(np.column_stack([robot["x"], robot["y"]]))
    return f'<path class="track" style="stroke:{robot["colour"]}" d="{way}"/>'


def _mission(mission: Mapping[str, Any], window: Window, unit: float, hues: Mapping[str, str]) -> str:
    """Passages, zones, rounds, and alerts: a cross, within two deviations of where it was said to be."""
    corner, flip = np.array([window.west, window.north]), np.array([1.0, -1.0])
    out = [f'<path class="passage" d="{_path((np.array(p) - corner) * flip)}Z"/>' for p in mission["passages"]]
    for z in mission["zones"]:
        told = f"{z['speed_mps']:g} m/s" if z["kind"] == "speed" else f"one way, {z['heading_deg']:.0f} deg"
        outline, words = _path((np.array(z["area"]) - corner) * flip), escape(f"{z['name'] or 'zone'}: {told}")
        middle = ((np.array(z["area"]).mean(axis=0) - corner) * flip).tolist()
        label = f'<text x="{middle[0]:.2f}" y="{middle[1]:.2f}">{words}</text>'
        out.append(f'<g class="zone"><path d="{outline}Z"/>{label}</g>')
    for name, r in mission["robots"].items():
        way = _path((np.array(r["stops"]) - corner) * flip)
        out.append(f'<path class="round" style="stroke:{hues[name]}" d="{way}Z"/>')
    for a in mission["alerts"]:
        x, y = ((np.array([a["east_m"], a["north_m"]]) - corner) * flip).tolist()
        d, told = 0.8 * unit, escape(f"alert {a['alert']}: {a['text']}")
        cross = f"M{x - d:.2f} {y - d:.2f}l{2 * d:.2f} {2 * d:.2f}M{x - d:.2f} {y + d:.2f}l{2 * d:.2f} {-2 * d:.2f}"
        disc = f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{2.0 * a["sigma_m"]:.2f}"/><path d="{cross}"/>'
        number = f'<text x="{x + 1.2 * d:.2f}" y="{y - 1.2 * d:.2f}">{a["alert"]}</text>'
        done = " done" if a["state"] == "observed" else ""
        out.append(f'<g class="alert{done}">{disc}<title>{told}</title>{number}</g>')
    return "".join(out)


def _goals(places: Floats, window: Window, unit: float, colour: str) -> str:
    """Each goal a ring with a cross, numbered in the order in which they are visited."""
    out: list[str] = []
    at = (places - np.array([window.west, window.north])) * np.array([1.0, -1.0])
    for k, (x, y) in enumerate(at.tolist()):
        r, told = 0.9 * unit, f"goal {k + 1} at ({places[k, 0]:g}, {places[k, 1]:g})"
        shape = f"M{x - r:.2f} {y:.2f}h{2 * r:.2f}M{x:.2f} {y - r:.2f}v{2 * r:.2f}"
        ring = f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{r:.2f}"/><path d="{shape}"/>'
        number = f'<text x="{x + 1.3 * r:.2f}" y="{y - 1.1 * r:.2f}">{k + 1}</text>'
        out.append(f'<g class="goal" style="stroke:{colour}">{ring}<title>{told}</title>{number}</g>')
    return "".join(out)


def _keys(robot: Mapping[str, Any], unit: float) -> str:
    """The robot at a few moments, so that the picture tells the run without a script."""
    rows = np.linspace(0, len(robot["x"]) - 1, KEYS).astype(int)
    spots = "".join(
        f'<circle cx="{robot["x"][k]}" cy="{robot["y"][k]}" r="{max(robot["radius"], 0.4 * unit):.2f}"/>' for k in rows
    )
    return f'<g class="keys" style="stroke:{robot["colour"]}">{spots}</g>'


def _marker(robot: Mapping[str, Any], unit: float, *, below: bool) -> str:
    """A robot: its hull to scale, an arrow that can be seen, its name above or below: neighbours stay legible."""
    r, a = robot["radius"], max(robot["radius"], 1.1 * unit)
    arrow = f"M{a:.2f} 0L{-0.75 * a:.2f} {0.65 * a:.2f}L{-0.4 * a:.2f} 0L{-0.75 * a:.2f} {-0.65 * a:.2f}Z"
    return (
        f'<g class="robot" transform="translate({robot["x"][-1]} {robot["y"][-1]})" style="color:{robot["colour"]}">'
        f'<circle class="hull" r="{r:.2f}"/><path class="arrow" transform="rotate({-robot["yaw"][-1]})" d="{arrow}"/>'
        f'<text x="{1.3 * a:.2f}" y="{3.0 * a if below else -1.1 * a:.2f}">{escape(robot["name"])}</text></g>'
    )


def _fence(world: World, window: Window) -> str:
    if world.fence is None:
        return ""
    p = (world.fence.polygon - np.array([window.west, window.north])) * np.array([1.0, -1.0])
    return f'<path class="fence" d="{_path(p)}Z"/>'


def _scale_bar(window: Window, unit: float) -> str:
    """A round length in the lower left corner."""
    wide, high = window.size
    power = 10.0 ** (ceil(log10(0.25 * wide)) - 1)
    length = max(n for n in (1, 2, 5) if n * power <= 0.25 * wide) * power
    x, y = 2.0 * unit, high - 2.0 * unit
    return (
        f'<g class="bar"><path d="M{x:.2f} {y - 0.6 * unit:.2f}v{0.6 * unit:.2f}h{length:g}v{-0.6 * unit:.2f}"/>'
        f'<text x="{x + 0.4 * unit:.2f}" y="{y - 0.8 * unit:.2f}">{length:g} m</text></g>'
    )
