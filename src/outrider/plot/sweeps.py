"""What becomes of several measures as one parameter goes over a range."""

from collections.abc import Mapping

from matplotlib.figure import Figure

from outrider.plot.style import FUSED, MUTED, SOURCES, WIDTH, finish, styled
from outrider.typing import Floats


@styled
def sweep_figure(x: Floats, label: str, curves: Mapping[str, Floats], *, truth: float | None = None) -> Figure:
    """A panel per curve over x on a logarithmic axis; truth : where x is right."""
    figure = Figure(figsize=(WIDTH, 1.7 * len(curves) + 0.4))
    axes = figure.subplots(len(curves), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (name, y), colour in zip(axes, curves.items(), (FUSED, *SOURCES), strict=False):
        ax.plot(x, y, color=colour, marker="o", markersize=4)
        ax.set_ylabel(name)
        if truth is not None:
            ax.axvline(truth, color=MUTED, linewidth=0.9, linestyle=(0, (4, 2)), label="truth")
    axes[-1].set_xscale("log")
    axes[-1].set_xticks(x, [f"{v:g}" for v in x])
    axes[-1].minorticks_off()
    axes[-1].set_xlabel(label)
    handles, _ = axes[-1].get_legend_handles_labels()
    return finish(figure, handles)
