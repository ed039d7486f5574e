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
from outrider.data import Finding, Innovations, Run, Trajectory, Verdict
from outrider.plot import tables
from outrider.plot.compare import error_figure
from outrider.plot.health import health_figure
from outrider.plot.innovations import GATE_TAIL, innovation_figure
from outrider.plot.maps import map_figure, odom_figure, run_colours
from outrider.plot.motion import motion_figure, sigma_figure, slow_figure
from outrider.plot.series import end_time, has_height, radius_95
from outrider.plot.shapes import aligned_at_start, ellipse_rows, shown_ellipses
from outrider.plot.style import DARK, css_name, to_svg
from outrider.plot.wrong import evidence_figure, headline, summary

_NO_LOCAL = "There is no local estimate: it needs wheels or another source of body velocity, and a gyro."
_HEADING = "Headings count counter-clockwise from east."
_LOCAL_HEADING = (
    " The local one counts from the x axis of its own frame; it drifts without bound, so its band is not shown."
)
_FLAT = " Height is not estimated: the vehicle is planar."
_NO_SLOW = "This model has no bias or scale, or the log tells nothing about one."
_HEALTH = "Sources that are only compared have no health. A state lasts until the next record that changes it."
_SIGMA = "Standard deviations in the site frame."
_LOCAL_SIGMA = " The local one is the larger of its two horizontal ones."


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
        harm_summary=summary(run.findings, run.outcome),
        **_findings(run),
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


@final
@dataclass(frozen=True, slots=True)
class Shown:
    """A finding as the page shows it."""

    finding: Finding
    headline: str
    plot: Plot


def _findings(run: Run) -> dict[str, list[Shown]]:
    """What is wrong, and what is only worth knowing, each with its evidence."""
    ordered = [Shown(f, headline(f), _evidence(f, k)) for k, f in enumerate(tables.sorted_findings(run))]
    return {
        "wrong": [w for w in ordered if w.finding.severity != "info"],
        "remarks": [w for w in ordered if w.finding.severity == "info"],
    }


def _evidence(f: Finding, k: int) -> Plot:
    if f.evidence is None:
        return Plot()
    return _plot(evidence_figure(f.evidence), f"evidence {k + 1} of {f.code}", f.evidence.text)


def _plots(run: Run, reference: Trajectory | None) -> dict[str, object]:
    """Every figure of the page by the name the template uses, each drawn and let go before the next."""
    return {
        "map": _map(run, reference),
        "odom": _plot(odom_figure(run), "local odometry frame", _drift(run), absent=_NO_LOCAL),
        "motion": _plot(
            motion_figure(run), "heading and speed over time", _motion(run), absent="There is no estimate to show."
        ),
        "error": Plot() if reference is None else _reference(run, reference),
        "innovations": [_innovations(run, name, record) for name, record in run.innovations.items()],
        "sigma": _plot(
            sigma_figure(run), "position deviation over time", _sigma(run), absent="There is no covariance to show."
        ),
        "slow": _plot(slow_figure(run), "biases and scales over time", "", absent=_NO_SLOW),
        "health": _plot(
            health_figure(run), "health of the sources", _HEALTH, absent="No source has a recorded history."
        ),
    }


def _plot(figure: Figure | None, name: str, caption: str, *, absent: str = "", title: str = "") -> Plot:
    if figure is None:
        return Plot(caption=absent, title=title)
    return Plot(Markup(to_svg(figure, name)), caption, title)  # our own SVG, escaped by matplotlib


def _sigma(run: Run) -> str:
    return _SIGMA + (_LOCAL_SIGMA if _has_local(run) else "")


def _has_local(run: Run) -> bool:
    return run.local is not None and bool(run.local.t.size)


def _motion(run: Run) -> str:
    return _HEADING + (_LOCAL_HEADING if _has_local(run) else "") + ("" if has_height(run.fused.pose) else _FLAT)


def _map(run: Run, reference: Trajectory | None) -> Plot:
    if not len(run.fused.pose) and not any(len(track) for track in run.tracks.values()):
        return Plot(caption="There is no estimate and no position to show.")
    return _plot(map_figure(run, reference=reference), "map of the run", _map_caption(run))


def _reference(run: Run, reference: Trajectory) -> Plot:
    caption = "Estimate minus reference, without any alignment." + ("" if has_height(run.fused.pose) else _FLAT)
    absent = "The reference does not overlap the estimate in time."
    return _plot(
        error_figure(run.fused.pose, reference, start=run.start), "error to the reference", caption, absent=absent
    )


def _innovations(run: Run, name: str, record: Innovations) -> Plot:
    colour = run_colours(run)[name]
    tail = tables.gate_tail(run.config, name, GATE_TAIL)
    figure = innovation_figure(record, colour, run.start, end_time(run), tail)
    caption = _innovation_caption(record, tail)
    return _plot(figure, f"innovations of {name}", caption, absent="No record of this source was scored.", title=name)


def _innovation_caption(record: Innovations, tail: float) -> str:
    """How many, how consistent, and what the gate took away."""
    ratio = (record.nis / np.maximum(record.dof, 1))[np.isfinite(record.nis)]
    gated, every = int(np.sum(record.verdict == Verdict.GATED)), record.nis_per_dof()
    fused = record.nis_per_dof(Verdict.USED, Verdict.RESET)
    means = f"mean {tables.ratio(fused)} of the fused" if np.isfinite(fused) else f"mean {tables.ratio(every)}"
    means += f", {tables.ratio(every)} with the gated" if gated and np.isfinite(fused) else ""
    median = float(np.median(ratio)) if ratio.size else np.nan
    return (
        f"{tables.count(record.t.size)} records, {tables.count(gated)} gated. NIS/dof: {means}; median "
        f"{tables.ratio(median)}. The gate lets {tables.number(100 * (1 - tail), '%', 4)} of good records pass; "
        "what lies beyond a panel stands at its edge."
    )


def _map_caption(run: Run) -> str:
    """How large the ellipses are, since a good one is smaller than the line that it lies on."""
    pose = run.fused.pose
    if not len(pose):
        return "There is no estimate to show: the map holds only what each source alone says."
    laid = "Tracks from an origin of their own are laid on the fused one where both first know their heading. "
    own = run.local is not None or any(a.kind == "ODOMETRY_POSE" and a.source in run.tracks for a in run.accounts)
    return (laid if own else "") + _ellipse_caption(pose)


def _ellipse_caption(pose: Trajectory) -> str:
    rows = ellipse_rows(pose.p)
    if not pose.P.shape[0] or not rows.size:
        return ""
    radius = radius_95(pose, rows)
    best, worst = tables.number(float(radius.min()), "m"), tables.number(float(radius.max()), "m")
    hidden = rows.size - shown_ellipses(pose).size
    text = "Each ellipse holds the position with 95 % probability; they stand evenly along the path. "
    if hidden == rows.size:
        text = "The 95 % ellipses are too large for the map and left out. "
    elif hidden:
        text += f"{hidden} of {rows.size} are too large for the map and left out. "
    return text + f"Larger semi-axis: {best} at best, {worst} at worst."


def _drift(run: Run) -> str:
    """How far the local estimate ends from the fused one after both started together, and how unsure it is by then."""
    if run.local is None or not len(run.local.pose) or not len(run.fused.pose):
        return ""
    end = aligned_at_start(run.fused.pose, run.local.pose)[-1, :2]
    apart = float(np.linalg.norm(run.local.pose.p[-1, :2] - end))
    way = run.local.pose.length
    share = f" ({tables.number(100 * apart / way, '%', 2)} of {tables.number(way, 'm')})" if way > 0 else ""
    text = "Laid on one another where both first know their heading, the local and the fused track end "
    text += f"{tables.number(apart, 'm')} apart{share}"
    return f"{text}. The local one is smooth and drifts without bound. {_ellipse_caption(run.local.pose)}"


def _code(text: str) -> Markup:
    """Words between backticks as code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))  # escaped just before


def _datum(run: Run) -> str:
    if run.datum is None:
        return "none: the site frame has no place on Earth"
    d = run.datum
    lat, lon = np.degrees([d.lat, d.lon]).tolist()
    place = f"{abs(lat):.7f}° {'N' if lat >= 0 else 'S'}, {abs(lon):.7f}° {'E' if lon >= 0 else 'W'}"
    return f"{place}, {tables.number(d.alt, 'm', 5)} ({d.altitude.lower()})"
