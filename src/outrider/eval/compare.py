"""Everything about one estimate against one reference, as `outrider eval` prints it."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import isfinite
from typing import final

import numpy as np

from outrider.data import Trajectory
from outrider.errors import DataError
from outrider.eval.align import Alignment, align
from outrider.eval.associate import MAX_GAP_S, Association, associate, associate_nearest
from outrider.eval.consistency import Test, average_test, chi_square, ellipse_coverage
from outrider.eval.metrics import (
    Statistics,
    heading_errors,
    position_errors,
    relative_errors,
    statistics,
    velocity_errors,
)
from outrider.eval.spans import USUAL_SPAN, Span, Unit, fitting_lengths
from outrider.typing import Floats

SCHEMA = "outrider.comparison/2"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """Relative errors in space over ways of several lengths [m], each divided by its length: the mean per km.

    Of an estimate that knows where it is, this says how noisy it is; of dead reckoning, how it drifts.
    """

    lengths_m: tuple[float, ...]
    m_per_km: float
    rad_per_km: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Errors over the common stamps. Positions m, headings rad, velocities m/s; n = 0 and NaN where nothing is known.

    relative : horizontal drift over `span`;  drift : m and rad per km, over ways of the lengths that fit;  scale : what
    the alignment found;  nees (per degree of freedom), its `verdict` against chi-square bounds, and `coverage` of the
    95 % ellipse concern the horizontal position and are NaN or None without covariance.
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
    span: Span
    drift: Drift
    scale: float
    nees: float
    verdict: Test | None
    coverage: float

    def as_dict(self) -> dict[str, object]:
        """For JSON: unknown numbers are null, the alignment is its name."""
        spelled = {"alignment": self.alignment.name.lower(), "span": str(self.span)}
        plain = _plain({**asdict(self), **spelled})
        assert isinstance(plain, dict)
        return {"schema": SCHEMA, **plain}


def compare(
    estimate: Trajectory,
    reference: Trajectory,
    *,
    alignment: Alignment = Alignment.NONE,
    max_gap_s: float = MAX_GAP_S,
    nearest_s: float | None = None,
    span: Span = USUAL_SPAN,
) -> Comparison:
    """Associate in time, align only if asked to, and count errors.

    nearest_s : pair with the nearest pose within so many seconds, instead of interpolating.
    """
    return compare_pairs(pairs_of(estimate, reference, max_gap_s=max_gap_s, nearest_s=nearest_s), alignment, span)[0]


def pairs_of(
    estimate: Trajectory, reference: Trajectory, *, max_gap_s: float = MAX_GAP_S, nearest_s: float | None = None
) -> Association:
    """What is to be compared. Raises DataError if nothing is."""
    for x in (estimate, reference):
        if (still := np.diff(x.t) <= 0).any():
            k = int(np.flatnonzero(still)[0]) + 1
            what = "has two poses at one time" if x.t[k] == x.t[k - 1] else "goes back in time"
            raise DataError(f"{what}: pose {k + 1} of {len(x)}", where=x.name, fix="sort it, each stamp once")
    if nearest_s is None:
        pairs = associate(estimate, reference, max_gap_s=max_gap_s)
    else:
        pairs = associate_nearest(estimate, reference, max_diff_s=nearest_s)
    if len(pairs) == 0:
        reasons = ", ".join(f"{n} {why}" for why, n in pairs.lost.items() if n)
        raise DataError(
            f"no common stamps: of {len(reference)} reference poses {reasons}",
            where=estimate.name,
            fix="check that both use the same clock",
        )
    return pairs


def compare_pairs(pairs: Association, alignment: Alignment, span: Span) -> tuple[Comparison, Association]:
    """Errors of what is already paired, and the pairs as aligned."""
    of = len(pairs) + sum(pairs.lost.values())
    pairs, motion = align(pairs, alignment)
    nees, verdict, coverage = _honesty(pairs)
    comparison = Comparison(
        matched=len(pairs),
        of=of,
        lost={why: n for why, n in pairs.lost.items() if n},
        span_s=float(pairs.reference.t[-1] - pairs.reference.t[0]) * 1e-9,
        path_m=pairs.reference.length,
        alignment=alignment,
        position_2d=statistics(position_errors(pairs, 2)),
        position_3d=statistics(position_errors(pairs, 3)),
        heading=statistics(heading_errors(pairs)),
        velocity=statistics(velocity_errors(pairs)),
        relative=statistics(relative_errors(pairs, span)[0][:, :2]),
        span=span,
        drift=_drift(pairs),
        scale=motion.scale,
        nees=nees,
        verdict=verdict,
        coverage=coverage,
    )
    return comparison, pairs


def _drift(pairs: Association) -> Drift:
    lengths = fitting_lengths(pairs.reference.length)
    metres, angles = [np.zeros(0)], [np.zeros(0)]
    for length in lengths:
        gone, turned = relative_errors(pairs, Span(length, Unit.METRES))
        metres.append(np.linalg.norm(gone, axis=1) / length)
        angles.append(turned / length)
    return Drift(lengths_m=lengths, m_per_km=1e3 * _mean(metres), rad_per_km=1e3 * _mean(angles))


def _mean(parts: list[Floats]) -> float:
    known = np.concatenate(parts)
    known = known[np.isfinite(known)]
    return float(known.mean()) if known.size else float("nan")


def _honesty(pairs: Association) -> tuple[float, Test | None, float]:
    """NEES per degree of freedom of the horizontal position, its test, and coverage of the 95 % ellipse."""
    nan = float("nan")
    if not pairs.estimate.P.shape[0]:
        return nan, None, nan
    e, P = position_errors(pairs, 2), pairs.estimate.P[:, :2, :2]
    values = chi_square(e, P)
    values = values[np.isfinite(values)]
    if not values.size:
        return nan, None, nan
    test = average_test(values, 2, probability=0.95, independent=False)
    return float(values.mean() / 2), test, ellipse_coverage(e, P)


def _plain(x: object) -> object:
    if isinstance(x, Mapping):
        return {str(k): _plain(v) for k, v in x.items()}
    if isinstance(x, list | tuple):
        return [_plain(v) for v in x]
    return None if isinstance(x, float) and not isfinite(x) else x
