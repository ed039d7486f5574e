"""Everything about one estimate against one reference, as `outrider compare` prints it."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import isfinite
from typing import final

import numpy as np

from outrider.data import Trajectory
from outrider.errors import DataError
from outrider.eval.align import Alignment, align
from outrider.eval.associate import MAX_GAP_S, Association, associate
from outrider.eval.consistency import chi_square, ellipse_coverage
from outrider.eval.metrics import (
    Statistics,
    heading_errors,
    position_errors,
    relative_errors,
    statistics,
    velocity_errors,
)

SCHEMA = "outrider.comparison/1"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Errors over the common stamps. Positions m, headings rad, velocities m/s; n = 0 and NaN where nothing is known.

    `relative` is the horizontal drift over `relative_s` seconds; `nees` (per degree of freedom) and `coverage` of the
    95 % ellipse concern the horizontal position and are NaN without covariance.
    """

    matched: int
    of: int
    lost: Mapping[str, int]
    span_s: float
    path_m: float
    alignment: Alignment
    position_2d: Statistics
    position_3d: Statistics
    heading: Statistics
    velocity: Statistics
    relative: Statistics
    relative_s: float
    nees: float
    coverage: float

    def as_dict(self) -> dict[str, object]:
        """For JSON: unknown numbers are null, the alignment is its name."""
        plain = _plain({**asdict(self), "alignment": self.alignment.name.lower()})
        assert isinstance(plain, dict)
        return {"schema": SCHEMA, **plain}


def compare(
    estimate: Trajectory,
    reference: Trajectory,
    *,
    alignment: Alignment = Alignment.NONE,
    max_gap_s: float = MAX_GAP_S,
    relative_s: float = 10.0,
) -> Comparison:
    """Associate in time, align only if asked to, and count errors."""
    pairs = associate(estimate, reference, max_gap_s=max_gap_s)
    if len(pairs) == 0:
        reasons = ", ".join(f"{n} {why}" for why, n in pairs.lost.items() if n)
        raise DataError(
            f"no common stamps: of {len(reference)} reference poses {reasons}",
            where=estimate.name,
            fix="check that both use the same clock",
        )
    pairs, _ = align(pairs, alignment)
    nees, coverage = _honesty(pairs)
    return Comparison(
        matched=len(pairs),
        of=len(reference),
        lost={why: n for why, n in pairs.lost.items() if n},
        span_s=float(pairs.reference.t[-1] - pairs.reference.t[0]) * 1e-9,
        path_m=pairs.reference.length,
        alignment=alignment,
        position_2d=statistics(position_errors(pairs, 2)),
        position_3d=statistics(position_errors(pairs, 3)),
        heading=statistics(heading_errors(pairs)),
        velocity=statistics(velocity_errors(pairs)),
        relative=statistics(relative_errors(pairs, relative_s)[0][:, :2]),
        relative_s=relative_s,
        nees=nees,
        coverage=coverage,
    )


def _honesty(pairs: Association) -> tuple[float, float]:
    """NEES per degree of freedom and coverage of the 95 % ellipse of the horizontal position."""
    if not pairs.estimate.P.shape[0]:
        return float("nan"), float("nan")
    e, P = position_errors(pairs, 2), pairs.estimate.P[:, :2, :2]
    values = chi_square(e, P)
    known = np.isfinite(values)
    return (float(values[known].mean() / 2), ellipse_coverage(e, P)) if known.any() else (float("nan"), float("nan"))


def _plain(x: object) -> object:
    if isinstance(x, Mapping):
        return {str(k): _plain(v) for k, v in x.items()}
    return None if isinstance(x, float) and not isfinite(x) else x
