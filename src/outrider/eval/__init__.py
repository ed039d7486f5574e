"""How good an estimate is: errors against a reference, honesty of its covariance, drift through outages."""

from outrider.eval.align import Alignment, Similarity, align
from outrider.eval.associate import Association, associate, associate_nearest
from outrider.eval.causes import causes
from outrider.eval.compare import Comparison, Drift, compare, compare_pairs, pairs_of
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
from outrider.eval.spans import Span, Unit

__all__ = [
    "Alignment", "Association", "Comparison", "Drift", "OutageScore", "Paired", "Similarity", "Span", "Statistics",
    "Summary", "Test", "Unit", "align", "associate", "associate_nearest", "average_bounds", "average_test",
    "bootstrap", "causes", "chi_square", "compare", "compare_pairs", "corrected", "effective_samples",
    "ellipse_coverage", "family_level", "heading_errors", "outage_windows", "paired", "pairs_of", "pose_errors",
    "position_errors", "relative_errors", "score_outages", "statistics", "summary", "velocity_errors", "wilcoxon",
]  # fmt: skip
