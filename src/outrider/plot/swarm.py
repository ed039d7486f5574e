"""Many drones: their ways from above, how near the nearest two were, and where on the trail a column was."""

import numpy as np
from matplotlib.figure import Figure

from outrider.plot.style import FUSED, REJECTED, SOURCES, styled
from outrider.typing import Floats


@styled
def swarm_figure(
    ways: Floats, every_s: float, nearest: Floats, allowed: float, walls: Floats, arcs: Floats | None = None
) -> Figure:
    """ways (rows, N, 2) m;  nearest (rows,) m, between any two, beside what is `allowed`;  walls (m, 4) m, ends;
    arcs (rows, N) m, along the trail of a column, NaN for who is not in it."""
    figure = Figure(figsize=(9.6, 4.8), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.2, 1.0))
    for i in range(ways.shape[1]):
        left.plot(*ways[:, i].T, color=SOURCES[i % len(SOURCES)], lw=0.6)
    left.plot(*ways[0].T, ".", ms=3.0, color=REJECTED, label="start")
    left.plot(*ways[-1].T, "o", ms=3.0, color=FUSED, label="end")
    for w in walls:
        left.plot(w[[0, 2]], w[[1, 3]], color="0.2", lw=2.0)
    left.set_aspect("equal")
    left.set_xlabel("east [m]")
    left.set_ylabel("north [m]")
    left.legend(loc="best", fontsize=6)
    t = every_s * np.arange(len(nearest))
    if arcs is None:
        right.plot(t, nearest, color=FUSED, lw=0.8, label="nearest two")
        right.axhline(allowed, color=REJECTED, lw=0.8, ls="--", label="never to be less")
        right.set_ylim(bottom=0.0)
        right.set_ylabel("distance [m]")
        right.legend(loc="upper right", fontsize=6)
    else:
        for i in range(arcs.shape[1]):
            right.plot(t, arcs[:, i], color=SOURCES[i % len(SOURCES)], lw=0.5)
        right.set_ylabel("along the trail [m]")
    right.set_xlabel("time [s]")
    return figure
