"""Errors of associated trajectories and their statistics. Errors are estimate minus reference; NaN where unknown."""

from dataclasses import dataclass
from typing import final

import numpy as np

from outrider.core.angles import wrap_all
from outrider.core.rotations import quats_conjugate, quats_log, quats_multiply, quats_to_matrices
from outrider.eval.associate import Association
from outrider.eval.spans import Span, span_ends
from outrider.typing import Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Statistics:
    """Of n finite magnitudes, in their own unit; NaN if there are none."""

    n: int
    rmse: float
    mean: float
    median: float
    p95: float
    max: float


def statistics(errors: Floats) -> Statistics:
    """Statistics of magnitudes: |e| of numbers (n,), Euclidean norms of vectors (n, m). Rows with NaN are left out."""
    e = np.abs(errors) if errors.ndim == 1 else np.linalg.norm(errors, axis=1)
    e = e[np.isfinite(e)]
    if e.size == 0:
        nan = float("nan")
        return Statistics(n=0, rmse=nan, mean=nan, median=nan, p95=nan, max=nan)
    return Statistics(
        n=e.size,
        rmse=float(np.sqrt(np.mean(e * e))),
        mean=float(e.mean()),
        median=float(np.median(e)),
        p95=float(np.percentile(e, 95)),
        max=float(e.max()),
    )


def position_errors(pairs: Association, axes: int = 3) -> Floats:
    """(n, axes) m, site frame: 2 for the horizontal, 3 for all. Their statistics are the absolute trajectory error."""
    return (pairs.estimate.p - pairs.reference.p)[:, :axes]


def heading_errors(pairs: Association) -> Floats:
    """(n,) rad in (-pi, pi]."""
    return wrap_all(pairs.estimate.yaw - pairs.reference.yaw)


def velocity_errors(pairs: Association, axes: int = 3) -> Floats:
    """(n, axes) m/s, site frame; (0, axes) unless both trajectories hold velocities."""
    v, v_ref = pairs.estimate.v, pairs.reference.v
    if not (v.shape[0] and v_ref.shape[0]):
        return np.zeros((0, axes))
    return (v - v_ref)[:, :axes]


def pose_errors(pairs: Association) -> Floats:
    """(n, 6) as `Trajectory.P` counts them, truth minus estimate: position (site frame), Log(R_hat' R) (body frame)."""
    estimate, reference = pairs.estimate, pairs.reference
    turn = quats_log(quats_multiply(quats_conjugate(estimate.q), reference.q))
    return np.hstack([reference.p - estimate.p, turn])


def relative_errors(pairs: Association, span: Span | float = 10.0) -> tuple[Floats, Floats]:
    """Relative pose error over a span (number: seconds): drift (k, 3) m, in the body at the start; angle (k,) rad.

    E = (R_ref_i' [p_ref_j - p_ref_i]) - (R_i' [p_j - p_i]), with i and j as `span_ends` has them.
    """
    i, j = span_ends(pairs.reference, span if isinstance(span, Span) else Span(span))

    def moved(p: Floats, q: Floats) -> tuple[Floats, Floats]:
        p_body = np.einsum("nji,nj->ni", quats_to_matrices(q[i]), p[j] - p[i])
        return p_body, quats_multiply(quats_conjugate(q[i]), q[j])

    p, q = moved(pairs.estimate.p, pairs.estimate.q)
    p_ref, q_ref = moved(pairs.reference.p, pairs.reference.q)
    return p - p_ref, np.linalg.norm(quats_log(quats_multiply(quats_conjugate(q_ref), q)), axis=1)
