"""How good an estimate is: errors against a reference, honesty of its covariance, drift through outages."""

from outrider.eval.align import Alignment, Rigid, align
from outrider.eval.associate import Association, associate
from outrider.eval.compare import Comparison, compare
from outrider.eval.consistency import (
    Test,
    average_bounds,
    average_test,
    chi_square,
    effective_samples,
    ellipse_coverage,
    family_level,
)
from outrider.eval.metrics import (
    Statistics,
    heading_errors,
    pose_errors,
    position_errors,
    relative_errors,
    statistics,
    velocity_errors,
)
from outrider.eval.outage import OutageScore, outage_windows, score_outages
from outrider.eval.paired import Paired, Summary, bootstrap, corrected, paired, summary, wilcoxon

__all__ = [
    "Alignment", "Association", "Comparison", "OutageScore", "Paired", "Rigid", "Statistics", "Summary", "Test",
    "align", "associate", "average_bounds", "average_test", "bootstrap", "chi_square", "compare", "corrected",
    "effective_samples", "ellipse_coverage", "family_level", "heading_errors", "outage_windows", "paired",
    "pose_errors", "position_errors", "relative_errors", "score_outages", "statistics", "summary", "velocity_errors",
    "wilcoxon",
]  # fmt: skip
