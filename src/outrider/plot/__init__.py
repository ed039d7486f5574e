"""Pictures: figures on matplotlib, and the HTML report of a run."""

from outrider.plot.compare import compare_figures
from outrider.plot.maps import map_figure
from outrider.plot.report import write_report
from outrider.plot.style import save_png

__all__ = ["compare_figures", "map_figure", "save_png", "write_report"]
