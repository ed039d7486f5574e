"""amr2025 driven over many seeds: written to docs/evidence/amr2025.md, each bound asserted."""

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from outrider.campaign.papers.amr2025_drives import drive, turn
from outrider.campaign.papers.amr2025_tables import PLACES, REAL
from outrider.campaign.trials import Trials, run_trials
from published import publish

pytestmark = pytest.mark.evidence
SEEDS = int(os.environ.get("OUTRIDER_SEEDS", "20"))
HEADING = "turning on the spot"
Line = tuple[str, str, str, bool]


def measured() -> dict[str, Trials]:
    """Every drive and the turn, over the same seeds."""
    out = {place: run_trials(drive, [{"scenario": name}], SEEDS) for place, name in PLACES.items()}
    return {**out, HEADING: run_trials(turn, [{"scenario": "amr2025-heading"}], SEEDS)}


def lines(trials: Mapping[str, Trials]) -> list[Line]:
    """What is asked, the figure over all seeds, the bound, and whether it is kept."""
    error, parts = _all(trials, "goal_error"), {k: _all(trials, k) for k in ("goal_estimate", "goal_control")}
    split = ", ".join(f"{what} {1e3 * np.nanmean(parts[k]):.0f} mm" for k, what in
                      (("goal_estimate", "estimate"), ("goal_control", "control")))  # fmt: skip
    out: list[Line] = [
        _line(
            "goal error, real maps, mean", f"{np.nanmean(error):.3f} m ({split})", "0.10 m", np.nanmean(error) <= 0.10
        ),
        _line("goal error, real maps, worst", f"{np.nanmax(error):.3f} m", "0.25 m", np.nanmax(error) <= 0.25),
    ]
    turned = np.abs(trials[HEADING].column("heading_error")).mean(axis=1)
    out.append(_line("heading at nine stops, MAE", _spread(turned, "deg"), "0.5 deg", turned.mean() <= 0.5))
    for place in REAL:
        x = trials[place].column("heading_mae")
        out.append(_line(f"heading on {place}, MAE", _spread(x, "deg"), "0.5 deg", np.nanmean(x) <= 0.5))
    ratio = trials["map 3"].column("degraded_ratio")
    raw, fused = (trials["map 3"].column(k) for k in ("raw_rmse", "degraded_rmse"))
    told = f"{_spread(ratio, '')} ({np.nanmean(raw):.2f} m alone, {np.nanmean(fused):.2f} m fused)"
    out.append(_line("degraded GNSS, fused / alone", told, "0.5", np.nanmean(ratio) <= 0.5))
    for place, most in (("map 1", 4.0), ("map 3", 1.0)):
        longer = 100.0 * (trials[place].column("length_driven") / trials[place].column("length_planned") - 1.0)
        out.append(
            _line(f"longer than planned, {place}", _spread(longer, "%"), f"{most:g} %", np.nanmean(longer) <= most)
        )
    for place in PLACES:
        kept = 100.0 * trials[place].column("smc_driven") / trials[place].column("smc_planned")
        out.append(_line(f"smoothness kept (0.5 m), {place}", _spread(kept, "%"), "95 %", np.nanmean(kept) >= 95.0))
    for place in PLACES:
        mae, r = trials[place].column("speed_mae"), trials[place].column("speed_r")
        out.append(_line(f"speed, MAE, {place}", _spread(mae, "m/s", 4), "0.015 m/s", np.nanmean(mae) <= 0.015))
        out.append(_line(f"speed, Pearson's r, {place}", _spread(r, "", 4), "0.97", np.nanmean(r) >= 0.97))
    for place, t in trials.items():
        n, missed = len(t.rows), [r.error for r in t.failed]
        told = f"{n - len(missed)} of {n}" + (f" ({missed[0]})" if missed else "")
        out.append(_line(f"runs that ended well, {place}", told, "all", not missed))
    return out


def write(trials: Mapping[str, Trials], rows: list[Line]) -> None:
    """The page."""
    seeds = ", ".join(f"{place} {len(t.rows)}" for place, t in trials.items())
    publish(
        "amr2025",
        "The drives of amr2025",
        f"Mean and standard deviation over seeds ({seeds}). The robot drives on its own estimate; start points, speed, "
        "size and sensor errors are ours. A bound that is not kept says so. `outrider papers amr2025` shows all "
        "beside the paper's.",
        ("what", "figure", "bound", "kept"),
        [(what, figure, bound, "yes" if good else "no") for what, figure, bound, good in rows],
    )


def _all(trials: Mapping[str, Trials], name: str) -> Any:
    return np.concatenate([trials[place].column(name).ravel() for place in REAL])


def _line(what: str, figure: str, bound: str, good: object) -> Line:
    return what, figure, bound, bool(good)


def _spread(x: Any, unit: str, digits: int = 2) -> str:
    sd = f" ± {np.nanstd(x, ddof=1):.{digits}f}" if np.isfinite(x).sum() > 1 else ""
    return f"{np.nanmean(x):.{digits}f}{sd} {unit}".rstrip()


def test_the_drives_of_amr2025() -> None:
    trials = measured()
    rows = lines(trials)
    write(trials, rows)
    assert all(good for *_, good in rows), [what for what, *_, good in rows if not good]
