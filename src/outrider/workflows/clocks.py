"""What the stamps of a log's sources say about their clocks, in words."""

from typing import Final

import numpy as np

from outrider.data import Stream, Verdict
from outrider.filters.stamps import lag, usual_lags
from outrider.typing import Bools, Floats
from outrider.workflows.draft import Draft

WRONG_STAMPS: Final = (Verdict.BAD_STAMP, Verdict.ASTRAY)
FEW: Final = 3  # records of which all may be refused without much ado: latched ones, most likely
UNITS: Final = (("years", 365.25 * 86_400.0), ("days", 86_400.0), ("h", 3600.0), ("s", 1.0))


def note_stamps(d: Draft) -> None:
    """One line for every source with refused stamps: how many, and what is wrong with them."""
    for s in d.log:
        bad = np.isin(d.verdicts[s.name], WRONG_STAMPS)
        if not bad.any() or d.section(s).use == "ignore":
            continue
        why = causes(d, s, bad)
        if bad.all() and len(s) > FEW:
            text = f"{s.name} keeps another clock than most sources: {why}; none of its records is used"
            fix = f"mend the clock that stamps it, or `sources: {{{s.name}: {{use: ignore}}}}` to go on without"
            d.note("error", "other-clock", text, s.name, fix)
        else:
            text = f"{s.name}: {int(bad.sum())} of {len(s)} records refused for their stamps: {why}"
            d.note("warning", "stamps-refused", text, s.name, "mend the clock that stamps it")


def causes(d: Draft, s: Stream, bad: Bools) -> str:
    """How many are zero, and how far off the others are."""
    zero = bad & (s.t <= 0)
    away = np.abs(distances(d, s)[bad & ~zero])
    said = [f"{int(zero.sum())} are zero or less"] if zero.any() else []
    if away.size:
        said.append(f"{away.size} are {'up to ' if np.ptp(away) > 1.0 else ''}{told(float(away.max()))} off")
    return ", ".join(said)


def distances(d: Draft, s: Stream) -> Floats:
    """(n,) s from each stamp to where it should be: by its arrival where that was noted, else to the accepted time."""
    if (s.t_arrival != s.t).any():
        return (lag(s) - usual_lags(d.log).get(s.name, 0.0)) * 1e-9
    good = [o.t[~np.isin(d.verdicts[o.name], WRONG_STAMPS)] for o in d.log]
    first = min((int(t.min()) for t in good if t.size), default=0)
    last = max((int(t.max()) for t in good if t.size), default=0)
    return (np.maximum(s.t - last, 0) + np.minimum(s.t - first, 0)) * 1e-9


def told(seconds: float) -> str:
    """A time in the unit that suits it."""
    unit, size = next((u for u in UNITS if seconds >= u[1]), UNITS[-1])
    value = seconds / size
    return f"{value:.0f} {unit}" if value >= 100 else f"{value:.3g} {unit}"
