"""What is wrong with the data, in plain words: headlines, small figures of the evidence, and a page of its own."""

from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from outrider.data import Finding, Outcome
from outrider.data.evidence import BARS, POINTS, REFUSED, Curve, Evidence
from outrider.plot.style import AXES, INK, MUTED, REJECTED, label, styled

WIDE: Final = 4.4  # inches
TALL: Final = 2.0
FEW: Final = 60  # points that are drawn larger
HEADLINES: Final[Mapping[str, str]] = {
    "altitude-reference": "Two sources count height from different zeros",
    "apart": "Two sources lie apart for what both claim",
    "clock-offset": "One source's clock is off",
    "contradicted": "A source contradicts the estimate",
    "contradiction": "Two sources contradict each other, and claim alike",
    "datum-far": "The origin of the site is far away",
    "diverged": "The estimate broke down",
    "faulted": "A source was given up",
    "heading-conflict": "The heading of a sensor is not the heading of motion",
    "heading-late": "The heading was not known at first",
    "heading-unobservable": "The heading is not known",
    "input-missing": "The recording lacks what was to be fused",
    "jump": "A source went off for a while",
    "latency": "Records arrive late",
    "mount-assumed": "Nobody said how a sensor is mounted",
    "mount-conflict": "A sensor is not mounted as it was told",
    "mount-found": "A sensor is mounted turned, and nobody said so",
    "mount-unused": "A mount was given for a frame that is not there",
    "near-divergence": "The estimate nearly broke down",
    "never-used": "A source contributed nothing",
    "no-gravity": "An accelerometer does not feel gravity",
    "no-position": "Nothing here tells where it is",
    "not-credible": "The result is not credible",
    "not-diagnosed": "Nothing was diagnosed",
    "other-clock": "A source keeps another clock",
    "outage": "A source of position was away for a while",
    "overconfident": "A source is surer of itself than it may be",
    "position-invalid": "The position was lost for a while",
    "range-scale": "Ranges are too long or too short in proportion",
    "refused": "Many records of a source were refused",
    "reset": "The estimate was moved by force",
    "setting-unused": "A setting was given to a source that it is not for",
    "silence": "Nothing was heard for a while",
    "silent": "A source fell silent",
    "stamps-backwards": "Stamps run backwards",
    "stamps-refused": "Some stamps are wrong",
    "turn-sense": "A sensor turns the wrong way round",
    "unit-deg": "Rates of turn are in degrees, not in radians",
    "unit-g": "Accelerations are in g, not in m/s²",
    "unit-kmh": "Speeds are in km/h, not in m/s",
    "wheel-scale": "The wheels do not measure metres",
}  # fmt: skip


def headline(f: Finding) -> str:
    """What is wrong in a few words; nothing for a code that has none."""
    return HEADLINES.get(f.code, "")


def summary(found: Iterable[Finding], outcome: Outcome) -> str:
    """One sentence on how bad it is."""
    found = list(found)
    errors, warnings = (sum(f.severity == s for f in found) for s in ("error", "warning"))
    if not errors + warnings:
        if outcome is Outcome.OK:
            return "Nothing wrong was found."
        return "There are remarks, and no errors or warnings." if found else "There are no findings."
    said = [f"{n} {what}{'s' * (n != 1)}" for n, what in ((errors, "error"), (warnings, "warning")) if n]
    rest = "; an error means that the result is wrong or that a source was in vain" if errors else ""
    return f"{' and '.join(said)}, most damaging first{rest}."


@styled
def evidence_figure(e: Evidence) -> Figure:
    """Evidence as a small figure."""
    figure = Figure(figsize=(WIDE, TALL))
    ax = figure.add_subplot()
    if e.log_y:
        ax.set_yscale("log")
    colours = iter(AXES * len(e.curves))
    for c in e.curves:
        draw(ax, c, REJECTED if c.drawn == REFUSED else next(colours))
    mark(ax, e)
    if e.square:
        ax.set_aspect("equal", adjustable="box", anchor="W")
        if e.x_label.endswith("[deg]"):
            ax.set_xticks(range(-180, 181, 90))
            ax.set_yticks(range(-180, 181, 90))
    if e.names:
        ax.set_xticks(range(len(e.names)), [label(n) for n in e.names])
    ax.set_xlabel(label(e.x_label))
    ax.set_ylabel(label(e.y_label))
    if sum(bool(c.name) for c in e.curves) > 0 and len(e.curves) > 1:
        if e.square:
            ax.legend(fontsize=7.5, handlelength=1.4, loc="upper left", bbox_to_anchor=(1.02, 1.0))
        else:
            ax.legend(fontsize=7.5, handlelength=1.4, loc="best")
    figure.subplots_adjust(left=0.17, right=0.98, bottom=0.23, top=0.95)
    return figure


def draw(ax: Axes, c: Curve, colour: str) -> None:
    """One series."""
    name = label(c.name) if c.name else "_nolegend_"
    if c.drawn == BARS:
        wide = float(np.min(np.diff(c.x))) if len(c.x) > 1 else 1.0
        ax.bar(c.x, c.y, 0.9 * wide, color=colour, alpha=0.75, label=name)
    elif c.drawn in (POINTS, REFUSED):
        size = 4.5 if len(c.x) < FEW else 2.2
        ax.plot(c.x, c.y, "x" if c.drawn == REFUSED else "o", ms=size, mew=0.8, color=colour, alpha=0.6, label=name)
    else:
        ax.plot(c.x, c.y, color=colour, lw=1.2, label=name)


def mark(ax: Axes, e: Evidence) -> None:
    """Marked places, with their words."""
    for k, (x, word) in enumerate(e.at):
        ax.axvline(x, color=MUTED, lw=0.9, ls="--")
        low, high = ax.get_xlim()
        right = x > low + 0.7 * (high - low)
        ax.annotate(label(word), (x, 0.98 - 0.1 * (k % 3)), xycoords=("data", "axes fraction"), fontsize=7, color=INK,
                    xytext=(-3 if right else 3, 0), textcoords="offset points", va="top",
                    ha="right" if right else "left")  # fmt: skip
    for y, word in e.levels:
        ax.axhline(y, color=MUTED, lw=0.9, ls="--")
        ax.annotate(label(word), (0.99, y), xycoords=("axes fraction", "data"), xytext=(0, 2),
                    textcoords="offset points", fontsize=7, color=INK, ha="right")  # fmt: skip


__all__ = ["evidence_figure", "headline", "summary"]
