"""The outage protocol: take a source away for a while, score what the estimate does meanwhile on the withheld records.

RMSE within each window, then the median over windows: one lucky or lost window does not decide (after KF-GINS, which
scores the maximum; that is kept too).
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from outrider.errors import UsageError
from outrider.typing import Floats, Ints

MOST_WINDOWS: Final = 1000


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class OutageScore:
    """One row per window that held a record: windows (k, 2) ns, rmse, worst, last (k,) m, count (k,)."""

    windows: Ints
    rmse: Floats
    worst: Floats
    last: Floats
    count: Ints

    @property
    def median(self) -> float:
        """Median over windows of the RMSE; NaN without a window."""
        return float(np.median(self.rmse)) if self.rmse.size else float("nan")

    def as_dict(self) -> dict[str, float | int | None]:
        """The summary, for JSON."""
        known = self.rmse.size > 0
        return {
            "windows": int(self.rmse.size),
            "records": int(self.count.sum()),
            "median_rmse_m": self.median if known else None,
            "max_rmse_m": float(self.rmse.max()) if known else None,
            "median_worst_m": float(np.median(self.worst)) if known else None,
        }


def outage_windows(start: int, end: int, length_s: float, *, every_s: float = 10.0, after_s: float = 60.0) -> Ints:
    """(k, 2) ns: windows of `length_s` that begin every `every_s`, the first `after_s` past the start, all within."""
    if not (length_s > 0.0 and every_s > 0.0 and after_s >= 0.0):
        raise UsageError(f"no outage windows of {length_s} s every {every_s} s", fix="give positive seconds")
    if (windows := ((end - start) * 1e-9 - after_s - length_s) / every_s) > MOST_WINDOWS:
        what = f"{windows:.3g} windows, one every {every_s:g} s, are too many"
        raise UsageError(what, where="outages", fix=f"{MOST_WINDOWS} at most: each is a run of its own")
    first = start + round(after_s * 1e9)
    begins = np.arange(first, end - round(length_s * 1e9) + 1, max(round(every_s * 1e9), 1), dtype=np.int64)
    return np.column_stack([begins, begins + round(length_s * 1e9)])


def score_outages(windows: Ints, t: list[Ints], errors: list[Floats]) -> OutageScore:
    """Score each window with what was withheld in it: t[i] (n_i,) ns and errors[i] (n_i, 2 or 3) m of window i.

    One entry per window, since each is a run of its own and windows overlap; records outside it and NaN are left out.
    """
    if not len(windows) == len(t) == len(errors):
        raise UsageError(f"{len(windows)} windows, {len(t)} stamps, {len(errors)} errors", fix="one of each per window")
    rows: list[tuple[int, int, float, float, float, int]] = []
    for (begin, end), stamps, e in zip(windows, t, errors, strict=True):
        inside = (stamps >= begin) & (stamps < end) & np.isfinite(e).all(axis=1)
        d = np.linalg.norm(e[inside], axis=1)
        if d.size:
            rmse = float(np.sqrt(np.mean(d * d)))
            rows.append((int(begin), int(end), rmse, float(d.max()), float(d[-1]), d.size))
    table = list(zip(*rows, strict=True)) if rows else [()] * 6
    spans = np.array([table[0], table[1]], np.int64).T
    rmse, worst, last = (np.array(c, np.float64) for c in table[2:5])
    return OutageScore(windows=spans, rmse=rmse, worst=worst, last=last, count=np.array(table[5], np.int64))
