"""The report of a run: one HTML file that needs nothing else."""

import re
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import final

import numpy as np
from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from outrider import __version__
from outrider.data import Innovations, Run, Trajectory, Verdict
from outrider.plot import tables
from outrider.plot.compare import error_figure
from outrider.plot.health import health_figure
from outrider.plot.innovations import GATE_TAIL, innovation_figure
from outrider.plot.maps import aligned_at_start, ellipse_rows, map_figure, odom_figure, run_colours
from outrider.plot.motion import motion_figure, sigma_figure, slow_figure
from outrider.plot.series import radius_95
from outrider.plot.style import DARK, css_name, to_svg

_NO_LOCAL = "There is no local estimate: it needs wheels or another source of body velocity, and a gyro."
_HEADING = "Headings count counter-clockwise from east; the local one counts from the x axis of its own frame."
_SIGMA = "Standard deviations in the site frame; the local one is the larger of its two horizontal ones."


@final
@dataclass(frozen=True, slots=True)
class Plot:
    """A figure of the page, or the sentence that stands in its place."""

    svg: str = ""
    caption: str = ""
    title: str = ""


def write_report(run: Run, path: Path, *, reference: Trajectory | None = None, command: str = "") -> None:
    """Write the self-contained HTML report of a run; `command` is what to type to get it again, if not the default."""
    template = page_environment().get_template("report.html.j2")
    html = template.render(
        run=run,
        log_name=tables.log_name(run),
        verdict=run.outcome.value,
        tone=tables.tone(run.outcome),
        facts=[tables.span(run.duration), tables.number(run.fused.pose.length, "m")],
        findings=tables.sorted_findings(run),
        cards=tables.cards(run, reference),
        colours={name: f"var({css_name(colour)})" for name, colour in run_colours(run).items()},
        palette=[(css_name(light), light, dark) for light, dark in DARK.items()],
        rows=tables.account_rows(run),
        resets=tables.reset_rows(run),
        config=tables.outline(run.config) if run.config else "",
        versions=dict(run.versions) or {"outrider": __version__},
        command=command or tables.command(run),
        datum=_datum(run),
        **_plots(run, reference),
    )
    path.write_text(html, encoding="utf-8")


def page_environment() -> Environment:
    """The templates of our pages; the filter `code` sets what stands in backquotes as code."""
    loader = FunctionLoader(lambda name: files("outrider.plot").joinpath(name).read_text("utf-8"))
    made = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    made.filters["code"] = _code
    return made


def _plots(run: Run, reference: Trajectory | None) -> dict[str, object]:
    """Every figure of the page by the name the template uses, each drawn and let go before the next."""
    return {
        "map": _map(run, reference),
        "odom": _plot(odom_figure(run), "local odometry frame", _drift(run), absent=_NO_LOCAL),
        "motion": _plot(
            motion_figure(run), "heading and speed over time", _HEADING, absent="There is no estimate to show."
        ),
        "error": Plot() if reference is None else _reference(run, reference),
        "innovations": [_innovations(run, name, record) for name, record in run.innovations.items()],
        "sigma": _plot(
            sigma_figure(run), "position deviation over time", _SIGMA, absent="There is no covariance to show."
        ),
        "slow": _plot(
            slow_figure(run), "biases and scales over time", "", absent="This model estimates no bias or scale."
        ),
        "health": _plot(health_figure(run), "health of the sources", "", absent="No source has a recorded history."),
    }


def _plot(figure: Figure | None, name: str, caption: str, *, absent: str = "", title: str = "") -> Plot:
    if figure is None:
        return Plot(caption=absent, title=title)
    return Plot(Markup(to_svg(figure, name)), caption, title)  # our own SVG, escaped by matplotlib


def _map(run: Run, reference: Trajectory | None) -> Plot:
    if not len(run.fused.pose) and not any(len(track) for track in run.tracks.values()):
        return Plot(caption="There is no estimate and no position to show.")
    return _plot(map_figure(run, reference=reference), "map of the run", _map_caption(run))


def _reference(run: Run, reference: Trajectory) -> Plot:
    caption = "Estimate minus reference, without any alignment."
    absent = "The reference does not overlap the estimate in time."
    return _plot(
        error_figure(run.fused.pose, reference, start=run.start), "error to the reference", caption, absent=absent
    )


def _innovations(run: Run, name: str, record: Innovations) -> Plot:
    colour = run_colours(run)[name]
    tail = tables.gate_tail(run.config, name, GATE_TAIL)
    ratio = (record.nis / np.maximum(record.dof, 1))[np.isfinite(record.nis)]
    gated = 100.0 * float(np.mean(record.verdict == Verdict.GATED)) if record.verdict.size else 0.0
    caption = (
        f"{tables.count(record.t.size)} scored, {tables.number(gated, '%')} gated, NIS/dof mean "
        f"{tables.number(float(np.mean(ratio)) if ratio.size else np.nan)}, median "
        f"{tables.number(float(np.median(ratio)) if ratio.size else np.nan)}. The gate lets "
        f"{tables.number(100 * (1 - tail), '%', 4)} of good records pass; what lies beyond a panel stands at its edge."
    )
    figure = innovation_figure(record, colour, run.start, tail)
    return _plot(figure, f"innovations of {name}", caption, absent="No record of this source was scored.", title=name)


def _map_caption(run: Run) -> str:
    """How large the ellipses are, since a good one is smaller than the line that it lies on."""
    pose = run.fused.pose
    if not len(pose):
        return "There is no estimate to show: the map holds only what each source alone says."
    rows = ellipse_rows(pose.p)
    if not pose.P.shape[0] or not rows.size:
        return ""
    radius = radius_95(pose, rows)
    best, worst = tables.number(float(radius.min()), "m"), tables.number(float(radius.max()), "m")
    return (
        "Each ellipse holds the position with 95 % probability; they stand evenly along the path. "
        f"Larger semi-axis: {best} at best, {worst} at worst."
    )


def _drift(run: Run) -> str:
    """How far the local estimate ends from the fused one after both started together."""
    if run.local is None or not len(run.local.pose) or not len(run.fused.pose):
        return ""
    end = aligned_at_start(run.fused.pose, run.local.pose)[-1, :2]
    apart = float(np.linalg.norm(run.local.pose.p[-1, :2] - end))
    way = run.local.pose.length
    share = f" ({tables.number(100 * apart / way, '%', 2)} of {tables.number(way, 'm')})" if way > 0 else ""
    return f"Set on one start, the local and the fused track end {tables.number(apart, 'm')} apart{share}."


def _code(text: str) -> Markup:
    """Words between backticks as code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))  # escaped just before


def _datum(run: Run) -> str:
    if run.datum is None:
        return "none: the site frame has no place on Earth"
    d = run.datum
    return (
        f"{np.degrees(d.lat):.7f}° N, {np.degrees(d.lon):.7f}° E, {tables.number(d.alt, 'm', 5)} ({d.altitude.lower()})"
    )
