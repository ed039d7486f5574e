"""How every figure looks: colours, type, and figures as SVG for the page or PNG for a file.

Figures are drawn on `matplotlib.figure.Figure` directly, so no window system and no global figure list is involved.
The ink of axes and text is written as CSS variables, so that one SVG follows the reader's light or dark theme.
"""

import io
import re
import warnings
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any, Final, ParamSpec, TypeVar

import matplotlib as mpl
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from outrider.data import SensorState

T = TypeVar("T")
A = ParamSpec("A")

INK: Final = "#1c2530"
MUTED: Final = "#5a6774"
GRID: Final = "#dce2e9"
PAPER: Final = "#fefefe"

# Distinct for colour-blind readers and legible on white, see tests/plot/test_style.py.
FUSED: Final = "#1a7fc4"
LOCAL: Final = "#6633ee"
REJECTED: Final = "#d9480f"
SOURCES: Final = ("#0b8f5a", "#e8a10c", "#e57fc2", "#80602a", "#58bdea", "#9c1f4d", "#6f7f8f")
AXES: Final = (FUSED, "#e8a10c", "#0b8f5a")  # x, y, z components

# Each colour on near-black: the same hue, lighter where it needs to be.
DARK: Final[Mapping[str, str]] = {
    INK: "#e4eaf0",
    MUTED: "#97a5b3",
    GRID: "#2a343f",
    PAPER: "#161d25",
    FUSED: "#4ba6e8",
    LOCAL: "#9a7bff",
    REJECTED: "#f0702b",
    "#0b8f5a": "#2ab880",
    "#e8a10c": "#f0b132",
    "#e57fc2": "#ee94cf",
    "#80602a": "#bd9350",
    "#58bdea": "#8fd5f5",
    "#9c1f4d": "#cf477c",
    "#6f7f8f": "#8497a6",
    "#b9c4cf": "#55626f",
}


def css_name(colour: str) -> str:
    """The CSS variable of one of our colours, e.g. `--c-1a7fc4`."""
    return f"--c-{colour[1:]}"


STATE_COLOURS: Final[Mapping[SensorState, str]] = {
    SensorState.WARMING: "#b9c4cf",
    SensorState.HEALTHY: "#0b8f5a",
    SensorState.SUSPECT: "#e8a10c",
    SensorState.FAULTED: "#d9480f",
    SensorState.RECOVERING: "#58bdea",
    SensorState.SILENT: "#6f7f8f",
}

WIDTH: Final = 9.6  # inches; the page shows one inch as about 110 pixels
LEFT, RIGHT, BELOW, ABOVE = 0.98, 0.12, 0.46, 0.06  # inches around the axes
_GAP: Final = 0.14  # inches between panels
_RC: Final[dict[str, Any]] = {
    "figure.facecolor": "none",
    "savefig.facecolor": "none",
    "axes.facecolor": "none",
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.formatter.useoffset": False,
    "axes.xmargin": 0.01,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "text.color": INK,
    "font.size": 8.5,
    "font.family": ["DejaVu Sans"],
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "legend.borderaxespad": 0.2,
    "lines.linewidth": 1.3,
    "lines.solid_joinstyle": "round",
    "path.simplify": True,
    "path.simplify_threshold": 0.2,
    "svg.fonttype": "none",
    "svg.hashsalt": "outrider",
}


def styled(draw: Callable[A, T]) -> Callable[A, T]:
    """Run a drawing function under our settings, whatever the user's matplotlibrc says, and put them back."""

    @wraps(draw)
    def inner(*args: A.args, **kwargs: A.kwargs) -> T:
        with mpl.rc_context(), warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", UserWarning
            )  # a source name with letters our font lacks; the browser has them
            mpl.rcdefaults()
            mpl.rcParams.update(_RC)  # type: ignore[call-overload]  # the stubs list every key as a literal
            return draw(*args, **kwargs)

    return inner


def panels(rows: int, height: float = 1.5) -> tuple[Figure, list[Axes]]:
    """A figure of `rows` panels over one time axis [s]; height per panel in inches."""
    figure = Figure(figsize=(WIDTH, rows * height + (rows - 1) * _GAP))
    axes = list(figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0])
    figure.subplots_adjust(hspace=_GAP / height)
    axes[-1].set_xlabel("time from start [s]")
    figure.align_ylabels(axes)
    return figure, axes


def finish(figure: Figure, handles: Iterable[Artist], *, left: float = LEFT) -> Figure:
    """Margins in inches around the axes, and one legend above them, never over the data, that is read row by row.

    The figure grows by what stands outside of the axes. A fixed left margin puts all time axes of a page in line.
    """
    named = list({str(h.get_label()): h for h in handles}.items())
    room = 72 * (WIDTH - left)
    columns = max(1, min(len(named), int(room / (4.8 * max((len(name) for name, _ in named), default=1) + 36))))
    legend_height = 0.185 * -(-len(named) // columns) + (0.08 if named else 0.0)
    tall = figure.get_figheight() + BELOW + legend_height + ABOVE
    figure.set_figheight(tall)
    figure.subplots_adjust(
        left=left / WIDTH, right=1 - RIGHT / WIDTH, bottom=BELOW / tall, top=1 - (legend_height + ABOVE) / tall
    )
    if named:
        by_row = [
            handle for k in range(columns) for _, handle in named[k::columns]
        ]  # matplotlib fills column by column
        figure.legend(
            handles=by_row,
            loc="upper left",
            bbox_to_anchor=((left - 0.08) / WIDTH, 1.0),
            ncols=columns,
            handlelength=1.6,
            columnspacing=1.6,
            borderpad=0.2,
        )
    return figure


def label(name: str) -> str:
    """A name from a log as matplotlib text: no mathematics, never hidden for a leading underscore."""
    text = name.replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text


def source_colours(names: Iterable[str]) -> dict[str, str]:
    """The colour of each source, the same in every figure and table of a report."""
    return {name: SOURCES[i % len(SOURCES)] for i, name in enumerate(dict.fromkeys(names))}


@styled
def save_png(figure: Figure, path: Path, *, dpi: int = 150) -> None:
    """Write a figure to a PNG file on white paper."""
    FigureCanvasAgg(figure)
    figure.savefig(
        path, format="png", dpi=dpi, bbox_inches="tight", pad_inches=0.12, facecolor=PAPER, metadata={"Software": None}
    )


@styled
def to_svg(figure: Figure, name: str) -> str:
    """The figure as an inline SVG element in theme colours; artists marked `rasterized` become PNG inside it.

    `name` describes the figure to a screen reader and keeps its ids apart from those of other figures on the page.
    """
    mpl.rcParams["svg.hashsalt"] = name
    buffer = io.StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    figure.savefig(buffer, format="svg", dpi=130, metadata=nothing)
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r' width="[\d.]+pt" height="[\d.]+pt"| xmlns(:xlink)?="[^"]*"| version="[\d.]+"', "", svg, count=4)
    used = set(re.findall(r'(?:url\(|href=")#([\w.-]+)', svg))
    svg = re.sub(r' id="([\w.-]+)"', lambda m: m[0] if m[1] in used else "", svg)
    svg = re.sub(r' d="[^"]*"', lambda m: _shorten(m[0]), svg)
    svg = re.sub(r"font: ([\w. ]*?px)[^;\"]*", r"font: \1 var(--sans)", svg)
    for colour in DARK:
        svg = svg.replace(colour, f"var({css_name(colour)})")
    return svg.replace("<svg", f'<svg role="img" aria-label="{re.sub("[^ ,.()/a-zA-Z0-9-]", "", name)}"', 1).strip()


def _shorten(path: str) -> str:
    """Path coordinates to a hundredth of a point: half the bytes, no visible change."""
    return re.sub(r"(\.\d\d)\d+", r"\1", path).replace("\n", "")
