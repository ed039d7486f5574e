"""A map from above: costs, routes, docks and zones; and the page that tells of it."""

from pathlib import Path
from typing import Any, Final

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Outline
from matplotlib.transforms import Affine2D

from outrider.data.grid import INSCRIBED, LETHAL, UNKNOWN, Costmap
from outrider.data.site import Shape, ShapeKind, Site
from outrider.plot import tables
from outrider.plot.maps import _sheet
from outrider.plot.report import page_environment
from outrider.plot.style import DARK, FUSED, INK, PAPER, REJECTED, SOURCES, css_name, finish, label, styled, to_svg
from outrider.typing import Floats

Json = dict[str, Any]
SHOWN: Final = 1600  # cells of the longer side that are drawn
NEAR, FAR = "#d9822b", "#fdf6ec"  # cost just below inscribed, and next to none
TAKEN, TOO_NEAR, UNSEEN = "#1c2530", "#8a4b1f", "#c9d1d9"
_PLATE: Final = {"facecolor": PAPER, "alpha": 0.75, "edgecolor": "none", "pad": 1.0}
GREEN, YELLOW, PINK = SOURCES[:3]


def _colours() -> ListedColormap:
    ramp = np.linspace(0.0, 1.0, INSCRIBED)[:, None] ** 0.7
    table = np.ones((256, 3))
    table[:INSCRIBED] = (1.0 - ramp) * np.array(to_rgb(FAR)) + ramp * np.array(to_rgb(NEAR))
    table[0] = 1.0
    table[INSCRIBED], table[LETHAL], table[UNKNOWN] = to_rgb(TOO_NEAR), to_rgb(TAKEN), to_rgb(UNSEEN)
    return ListedColormap(table)


@styled
def site_figure(costmap: Costmap, site: Site | None, *, heading: float = 0.0) -> Figure:
    """Costs with everything that was drawn on them; `heading` [rad] of the map's columns about its corner."""
    cells, step = _coarser(costmap)
    rows, cols = cells.shape
    wide, high = cols * step, rows * step
    west, south = costmap.origin.tolist()
    turn = Affine2D().rotate_around(west, south, heading)
    box = turn.transform(
        np.array([[west, south], [west + wide, south], [west + wide, south + high], [west, south + high]])
    )
    margin = 0.02 * max(wide, high)
    figure, ax = _sheet((box.min(axis=0) - margin, box.max(axis=0) + margin), "x", "y")
    ax.set_aspect("equal")
    image = ax.imshow(
        cells, cmap=_colours(), vmin=0, vmax=255, origin="lower", interpolation="nearest",
        extent=(west, west + wide, south, south + high), zorder=1, aspect="equal",
    )  # fmt: skip
    image.set_transform(turn + ax.transData)
    ax.grid(visible=False)
    handles: list[Any] = [Patch(color=TAKEN, label="taken"), Patch(color=TOO_NEAR, label="too near for the robot")]
    handles += [Patch(color=NEAR, label="costs"), Patch(facecolor="#ffffff", edgecolor=INK, lw=0.5, label="free")]
    if (cells == UNKNOWN).any():
        handles.append(Patch(color=UNSEEN, label="unknown"))
    if site is not None:
        handles += _drawn(ax, site)
    return finish(figure, handles)


def _coarser(costmap: Costmap) -> tuple[np.ndarray, float]:
    """Cells for the picture; of many the worst one is shown, so that nothing thin is lost."""
    cells = costmap.cells
    k = -(-max(cells.shape) // SHOWN)
    if k == 1:
        return cells, costmap.resolution
    rows, cols = (-(-n // k) for n in cells.shape)
    padded = np.full((rows * k, cols * k), UNKNOWN, np.uint8)
    padded[: cells.shape[0], : cells.shape[1]] = cells
    rank = np.where(padded == UNKNOWN, 0, padded.astype(np.int16) + 1)  # anything known is worse than the unknown
    worst = rank.reshape(rows, k, cols, k).max(axis=(1, 3))
    return np.where(worst == 0, UNKNOWN, worst - 1).astype(np.uint8), costmap.resolution * k


def _drawn(ax: Axes, site: Site) -> list[Any]:
    handles: list[Any] = []
    for kind, colour, name in (
        (ShapeKind.KEEP_OUT, REJECTED, "keep out"),
        (ShapeKind.SPEED, YELLOW, "speed zone"),
        (ShapeKind.ONE_WAY, PINK, "one way"),
    ):
        shapes = site.of(kind)
        for shape in shapes:
            _zone(ax, shape, colour)
        if shapes:
            handles.append(Patch(facecolor=(colour, 0.25), edgecolor=colour, label=name))
    for gate in site.of(ShapeKind.GATE):
        p = gate.points
        colour, name = (GREEN, "open gate") if gate.open else (REJECTED, "closed gate")
        ax.plot(p[:, 0], p[:, 1], color=colour, lw=2.4, marker="o", ms=3, zorder=5)
        handles.append(Line2D([], [], color=colour, lw=2.4, label=name))
    if site.routes is not None:
        handles.append(_routes(ax, site))
    for dock in site.docks:
        x, y, heading = dock.pose.tolist()
        turned = Affine2D().rotate(heading)
        ax.plot(x, y, marker=Outline([[1.0, 0], [-0.7, 0.7], [-0.3, 0], [-0.7, -0.7], [1.0, 0]]).transformed(turned),
                ms=9, color=GREEN, mec=PAPER, mew=0.7, zorder=7, linestyle="")  # fmt: skip
        ax.annotate(label(dock.name), (x, y), xytext=(6, 5), textcoords="offset points", fontsize=8, zorder=8)
    if site.docks:
        handles.append(Line2D([], [], color=GREEN, marker=">", linestyle="", label="dock"))
    return handles


def _routes(ax: Axes, site: Site) -> Line2D:
    assert site.routes is not None
    graph = site.routes
    for a, b in graph.edges.tolist():
        p = graph.nodes[[a, b]]
        ax.plot(p[:, 0], p[:, 1], color=FUSED, lw=1.2, zorder=6)
    ax.plot(graph.nodes[:, 0], graph.nodes[:, 1], "o", ms=4, color=FUSED, mec=PAPER, mew=0.6, zorder=7)
    if len(graph.names) <= 40:
        for name, p in zip(graph.names, graph.nodes.tolist(), strict=True):
            ax.annotate(label(name), p, xytext=(4, -9), textcoords="offset points", fontsize=7, color=FUSED, zorder=8)
    return Line2D([], [], color=FUSED, marker="o", ms=4, label="routes")


def _zone(ax: Axes, shape: Shape, colour: str) -> None:
    style: dict[str, Any] = {"facecolor": (colour, 0.16), "edgecolor": colour, "lw": 1.1, "zorder": 4}
    if shape.area:
        rings = [_closed(r) for r in (shape.points, *shape.holes)]
        ax.add_patch(PathPatch(Outline.make_compound_path(*(Outline(r, closed=True) for r in rings)), **style))
    else:
        ax.plot(shape.points[:, 0], shape.points[:, 1], color=colour, lw=2.0, zorder=4)
    x, y = shape.points.mean(axis=0).tolist()
    words = [shape.name, f"{shape.speed:g} m/s" if np.isfinite(shape.speed) else ""]
    ax.annotate(
        label(" ".join(w for w in words if w)), (x, y), ha="center", fontsize=7.5, color=INK, zorder=8, bbox=_PLATE
    )
    if shape.kind is ShapeKind.ONE_WAY:
        d = 0.25 * float(np.ptp(shape.points, axis=0).max()) * np.array([np.cos(shape.heading), np.sin(shape.heading)])
        ax.annotate("", (x + d[0], y + d[1]), (x - d[0], y - d[1]),
                    arrowprops={"arrowstyle": "->", "color": colour, "lw": 1.6}, zorder=7)  # fmt: skip


def _closed(ring: Floats) -> Floats:
    return np.concatenate([ring, ring[:1]])


def write_map_report(figure: Figure, summary: Json, path: Path, *, drawing: str = "", command: str = "") -> None:
    """Write the page. summary : schema `outrider.map/1`;  drawing : its YAML text;  command : what to type to get it
    again."""
    html = (
        page_environment()
        .get_template("site.html.j2")
        .render(
            s=summary,
            tone="error" if summary["blocked"] else "good",
            verdict="not everything that was drawn can be driven on" if summary["blocked"] else "mapped",
            picture=Markup(to_svg(figure, "the map from above")),
            cards=_cards(summary),
            volume=_volume(summary["volume"]),
            drawing=drawing,
            command=command or f"outrider map {Path(summary['source']['path']).name}",
            palette=[(css_name(light), light, dark) for light, dark in DARK.items()],
            versions=summary["versions"],
            number=tables.number,
        )
    )
    path.write_text(html, encoding="utf-8")


def _cards(s: Json) -> list[Json]:
    m, v = s["map"], s["volume"]
    size = f"{m['columns'] * m['resolution_m']:.1f} × {m['rows'] * m['resolution_m']:.1f} m"
    cells = f"{m['columns']:,} × {m['rows']:,} cells of {m['resolution_m']:g} m"
    cards = [_card("size", size, cells)]
    cards.append(
        _card("ground to drive on", tables.number(v["ground_m2"], "m²"), f"robot radius {s['robot_radius_m']:g} m")
    )
    if s["routes"]:
        r = s["routes"]
        cards.append(_card("routes", tables.number(r["length_m"], "m"), f"{r['nodes']} nodes, {r['edges']} edges"))
    if s["fit"]:
        f = s["fit"]
        cards.append(
            _card("control points", tables.number(f["rmse_m"], "m") + " RMS", f"{len(f['residuals_m'])} points")
        )
    if v["dense_to_drawing"]:
        ratio = f"{v['dense_to_drawing']:,.0f} ×"
        cards.append(_card("smaller than a dense lidar map", ratio, "amr2025 says two to three orders of magnitude"))
    return cards


def _volume(v: Json) -> list[Json]:
    rows = [("the drawing: what has to be kept and edited", v["drawing_bytes"])]
    rows += [("the map, compressed", v["map_packed_bytes"]), ("the map as PGM", v["map_bytes"])]
    rows += [("a dense lidar map of the same ground and walls, reckoned", v["dense_bytes"])]
    return [
        {"what": what, "bytes": n, "share": v["dense_bytes"] / n if n else None} for what, n in rows if n is not None
    ]


def _card(name: str, value: str, note: str) -> Json:
    return {"name": name, "value": value, "note": note}
