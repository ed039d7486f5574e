"""Time association: the estimate at the reference's stamps. Nothing is extrapolated, every loss is counted."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from outrider.core.rotations import slerp
from outrider.data import Trajectory
from outrider.errors import DataError
from outrider.typing import Bools, Floats, Ints

MAX_GAP_S = 0.5
UNREADABLE = "without a pose in the reference's file: not finite, or damaged"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Association:
    """Two trajectories on the same stamps; `lost` says why reference rows have no partner (reason -> count)."""

    estimate: Trajectory
    reference: Trajectory
    lost: Mapping[str, int]

    def __len__(self) -> int:
        return len(self.reference)


def associate(estimate: Trajectory, reference: Trajectory, *, max_gap_s: float = MAX_GAP_S) -> Association:
    """Interpolate the estimate at the reference's stamps: linear in p, v and P, SLERP in q.

    A reference row is lost if its file held no pose there, if it is not finite or declared invalid, lies before or
    after the estimate, falls into a gap of the estimate longer than `max_gap_s` [s], or if the estimate declares itself
    invalid there.
    """
    lost: dict[str, int] = {}
    if len(estimate) == 0 or len(reference) == 0:
        raise DataError("a trajectory without poses cannot be compared", where=estimate.name or reference.name)
    keep = np.ones(len(reference), np.bool_)
    if reference.dropped:
        lost[UNREADABLE] = reference.dropped

    def lose(reason: str, hit: Bools) -> None:
        lost[reason] = int(np.sum(hit & keep))
        keep[hit] = False

    lose("reference not finite", ~_finite(reference.p))
    if reference.valid.size:
        lose("reference declared invalid", ~reference.valid)
    lose("before the estimate", reference.t < estimate.t[0])
    lose("after the estimate", reference.t > estimate.t[-1])
    i, j = _neighbours(estimate.t, reference.t)
    lose(f"in a gap longer than {max_gap_s:g} s", estimate.t[j] - estimate.t[i] > max_gap_s * 1e9)
    if estimate.valid.size:
        lose("estimate declared invalid", ~(estimate.valid[i] & estimate.valid[j]))
    lose("estimate not finite", ~(_finite(estimate.p[i]) & _finite(estimate.p[j])))
    there = _rows(reference, keep)
    return Association(estimate=_interpolated(estimate, i[keep], j[keep], there.t), reference=there, lost=lost)


def associate_nearest(estimate: Trajectory, reference: Trajectory, *, max_diff_s: float) -> Association:
    """Pair poses as they are, without interpolation: those of the shorter trajectory with the nearest of the longer.

    Where two are equally near, the earlier one is taken. A pose without another within `max_diff_s` [s] is lost, and so
    is one that is not finite or declared invalid.
    """
    if len(estimate) == 0 or len(reference) == 0:
        raise DataError("a trajectory without poses cannot be compared", where=estimate.name or reference.name)
    shorter = len(estimate) < len(reference)
    few, many = (estimate, reference) if shorter else (reference, estimate)
    i, j = _neighbours(many.t, few.t)
    at = np.where(np.abs(few.t - many.t[i]) <= np.abs(many.t[j] - few.t), i, j)
    near = np.abs(many.t[at] - few.t) <= max_diff_s * 1e9
    good = near & _usable(few) & _usable(many)[at]
    rows = {True: np.flatnonzero(good), False: at[good]}  # of the shorter one, of the longer one
    unread = {UNREADABLE: reference.dropped} if reference.dropped and not shorter else {}
    lost = unread | {
        f"farther than {max_diff_s:g} s": int((~near).sum()),
        "not finite or invalid": int((near & ~good).sum()),
    }
    return Association(
        estimate=_rows(estimate, rows[shorter]), reference=_rows(reference, rows[not shorter]), lost=lost
    )


def _usable(x: Trajectory) -> Bools:
    return _finite(x.p) & x.valid if x.valid.size else _finite(x.p)


def _finite(rows: Floats) -> Bools:
    return np.asarray(np.isfinite(rows).all(axis=1))


def _neighbours(t: Ints, at: Ints) -> tuple[Ints, Ints]:
    """Rows at or before, and at or after; the same row where a stamp is hit exactly."""
    last = t.size - 1
    i = np.clip(np.searchsorted(t, at, side="right") - 1, 0, last)
    return i, np.where(t[i] == at, i, np.minimum(i + 1, last))


def _rows(x: Trajectory, keep: Bools | Ints) -> Trajectory:
    optional = {name: column[keep] for name in ("v", "P", "valid") if (column := getattr(x, name)).shape[0]}
    return replace(x, t=x.t[keep], p=x.p[keep], q=x.q[keep], **optional)


def _interpolated(x: Trajectory, i: Ints, j: Ints, t: Ints) -> Trajectory:
    span = np.maximum(x.t[j] - x.t[i], 1)
    u = (t - x.t[i]) / span

    def line(column: Floats) -> Floats:
        part = u.reshape(-1, *[1] * (column.ndim - 1))
        return np.where(part == 0.0, column[i], column[i] + part * (column[j] - column[i]))

    q = np.full((t.size, 4), np.nan)
    known = _finite(x.q)
    both = known[i] & known[j]
    if both.any():
        q[both] = slerp(t[both], x.t[known], x.q[known])
    optional = {name: line(column) for name in ("v", "P") if (column := getattr(x, name)).shape[0]}
    valid = np.ones(t.size, np.bool_) if x.valid.size else x.valid
    return replace(x, t=t, p=line(x.p), q=q, valid=valid, **optional)
