"""What of a surface was seen, and along which paths: from above, and from the side."""

from collections.abc import Mapping
from typing import NamedTuple

from matplotlib.figure import Figure

from outrider.plot.style import FUSED, REJECTED, SOURCES, styled
from outrider.typing import Bools, Floats


class Inspected(NamedTuple):
    """One robot's part. surface : (n, 3) m;  seen : (n,);  planned, driven : (k, 3) m."""

    surface: Floats
    seen: Bools
    planned: Floats
    driven: Floats


@styled
def inspection_figure(robots: Mapping[str, Inspected]) -> Figure:
    """Two views of each robot's part, east and north, and east and up [m]."""
    figure = Figure(figsize=(4.8 * len(robots), 7.0), layout="constrained")
    axes = figure.subplots(2, len(robots), squeeze=False, height_ratios=(3.0, 1.3))
    for column, (name, r) in zip(axes.T, robots.items(), strict=True):
        for ax, (i, j) in zip(column, ((0, 1), (0, 2)), strict=True):
            for rows, colour, told in ((r.seen, SOURCES[0], "seen"), (~r.seen, REJECTED, "not seen")):
                ax.plot(*r.surface[rows][:, [i, j]].T, ".", ms=2.0, color=colour, label=f"{told}, {rows.mean():.0%}")
            ax.plot(*r.planned[:, [i, j]].T, color=SOURCES[-1], lw=0.8, ls="--", label="planned")
            ax.plot(*r.driven[:, [i, j]].T, color=FUSED, lw=1.2, label="as it went")
            ax.set_aspect("equal")
            ax.set_xlabel("east [m]")
        column[0].set_ylabel("north [m]")
        column[1].set_ylabel("up [m]")
        column[0].set_title(name)
        column[0].legend(loc="lower right", fontsize=6, markerscale=4.0)
    return figure
