"""Three Kalman filters on the same flights of a follower, over seeds; written to docs/evidence/which-filter.md.

Set OUTRIDER_SEEDS to have fewer seeds than 200, OUTRIDER_WORKERS to use processes, OUTRIDER_TRIALS to keep trials.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from outrider.campaign.papers.model import Work
from outrider.campaign.papers.swarm2023_filters import (
    EQUAL_CASES,
    GUIDED,
    HONEST,
    LATE,
    PAPER_CASES,
    SIGMA_CASES,
    SIGMAS,
    SWEEP,
    SWEEP_CASES,
    WIND,
    exactly,
    trials,
)  # fmt: skip
from outrider.campaign.trials import Params, Trials
from outrider.eval import paired
from published import publish

pytestmark = pytest.mark.evidence
SEEDS = int(os.environ.get("OUTRIDER_SEEDS", "200"))
KNOWN = {
    "no wind, with a state: end": "the bound is that of a flight without gusts, which keeps it",
}


class Page:
    def __init__(self) -> None:
        self.rows: list[tuple[str, str, str, str]] = []
        self.missed: list[str] = []

    def show(self, what: str, figure: str, bound: str = "", good: bool = True) -> None:
        self.rows.append((what, figure, bound, "" if not bound else "kept" if good else "MISSED"))
        if not good:
            self.missed.append(what)

    def mean(self, what: str, done: Trials, case: Params, name: str, low: float = 0.0, high: float = np.inf) -> float:
        values = exactly(done, case, name)
        bound = "" if high == np.inf else f"<= {high}" if low == 0.0 else f"{low} to {high}"
        good = low <= values.mean() <= high
        self.show(what, f"{values.mean():.3f} +- {values.std(ddof=1):.3f}", bound, good)
        return float(values.mean())

    def pair(self, what: str, done: Trials, case: Params, a: str, b: str, bound_mm: float = np.inf) -> None:
        p = paired(exactly(done, case, f"{a}_xyz"), exactly(done, case, f"{b}_xyz"))
        text = f"{1e3 * p.mean:+.2f} mm, 95 % {1e3 * p.low:+.2f} to {1e3 * p.high:+.2f}, less in {p.wins:.0%}"
        bound = "" if bound_mm == np.inf else f"within {bound_mm:g} mm"
        self.show(f"{what}: {a} - {b}", text, bound, abs(p.mean) <= 1e-3 * bound_mm)


def honest(page: Page, done: Trials) -> None:
    names = {
        "full signal": ("full signal", 0.185), "4 s without fixes": ("4 s outage", 0.22),
        "fixes 0.3 s late, told so": ("0.3 s late, compensated", 0.22),
    }  # fmt: skip
    for group, case in HONEST.items():
        what, bound = names.get(group, (group, np.inf))
        page.mean(f"{what}: GPS alone", done, case, "GPS_xyz")
        page.mean(f"{what}: EKF", done, case, "EKF_xyz", high=bound)
        page.mean(f"{what}: smoother", done, case, "RTS_xyz")
        page.mean(f"{what}: NEES", done, case, "EKF_nees", *((0.8, 1.2) if np.isfinite(bound) else (0.0, np.inf)))
        limit = 10.0 if case.get("outage") else 5.0
        for a in ("UKF", "EnKF"):
            page.pair(what, done, case, a, "EKF", limit)
        page.pair(what, done, case, "EnKF", "UKF", limit)
        for a in ("EnKF root", "EnKF 50", "EnKF root 20"):
            page.pair(what, done, case, a, "EKF")
            page.mean(f"{what}: NEES of {a}", done, case, f"{a}_nees")
    linear = HONEST["fixes alone, no direction of flight"]
    apart = np.abs(exactly(done, linear, "UKF_xyz") - exactly(done, linear, "EKF_xyz")).max()
    page.show("linear: largest difference of EKF and UKF", f"{apart:.0e} m", "<= 1e-9", apart <= 1e-9)
    ensemble = abs(np.mean(exactly(done, linear, "EnKF_xyz") - exactly(done, linear, "EKF_xyz")))
    page.show("linear: EnKF and EKF, mean", f"{1e3 * ensemble:.2f} mm", "<= 1 mm", ensemble <= 1e-3)
    wrong = exactly(done, HONEST["fixes 0.3 s late, not told"], "EKF_nees").mean()
    page.show("lateness not told must show: NEES", f"{wrong:.2f}", "> 1.5", wrong > 1.5)


def blocked(page: Page, done: Trials) -> None:
    bounds = {
        "no wind, no state for it": 0.25, "no wind, with a state": 0.25, "0.3 m/s, with a state": 0.5,
        "0.3 m/s, with a state, no direction either": 0.5, "no gusts or wind, with a state": 0.25,
        "no gusts or wind, no state": 0.25, "no gusts, 0.3 m/s, with a state": 0.5,
    }  # fmt: skip
    for group, case in WIND.items():
        page.mean(f"{group}: end", done, case, "EKF_end", high=bounds.get(group, np.inf))
        p95 = np.quantile(exactly(done, case, "EKF_end"), 0.95)
        page.show(f"{group}: 95 % of the ends", f"{p95:.2f} m")
        page.mean(f"{group}: whole flight", done, case, "EKF_xyz")
        page.mean(f"{group}: NEES", done, case, "EKF_nees")


def printed(page: Page, done: Trials, equal: Trials) -> None:
    for case in PAPER_CASES:
        what = f"printed tunings, {case['tuned_variant']}, {LATE} s late, outage {case['outage']} s"
        for name in ("GPS", "EKF", "UKF", "EnKF"):
            page.mean(f"{what}: {name}", done, case, f"{name}_xyz")
    for case in EQUAL_CASES:
        own = case["tuned_by"] == "printed"
        what = "each its own printed tuning" if own else f"the {case['tuned_by']}'s printed tuning for all"
        what += f", outage {case['outage']} s"
        limit = np.inf if own else 10.0 if case["outage"] else 5.0
        for a, b in (("UKF", "EKF"), ("EnKF", "EKF"), ("EnKF", "UKF")):
            page.pair(what, equal, case, a, b, limit)
    own = EQUAL_CASES[0]
    ratio = exactly(equal, own, "UKF_xyz").mean() / exactly(equal, own, "EKF_xyz").mean()
    page.show("printed tunings make the UKF look better by", f"{1 - ratio:.0%}", ">= 5 %", ratio <= 0.95)


def guided(page: Page, done: Trials) -> None:
    for group, case in GUIDED.items():
        page.mean(f"{group}: EKF", done, case, "EKF_xyz")
        page.show(f"{group}: aim", f"{exactly(done, case, 'aim').mean():.2f} deg")


def swept(page: Page, done: Trials, noise: Trials) -> None:
    for ran, cases, values, what in ((done, SWEEP_CASES, SWEEP, "gusts"), (noise, SIGMA_CASES, SIGMAS, "fixes")):
        means = {m: [float(exactly(ran, c, f"EKF_{m}").mean()) for c in cases] for m in ("xyz", "nees", "likelihood")}
        for k, v in enumerate(values):
            text = f"{means['xyz'][k]:.4f} m, likelihood {means['likelihood'][k]:.3f}, NEES {means['nees'][k]:.2f}"
            page.show(f"told {what} {v}", text)
        best = values[int(np.argmax(means["likelihood"]))]
        truth = 0.1 if what == "gusts" else 0.15
        page.show(f"most likely {what}", f"{best}", f"truth: {truth}", best == truth)


def test_which_filter() -> None:
    kept = os.environ.get("OUTRIDER_TRIALS")
    workers = int(os.environ.get("OUTRIDER_WORKERS", "0"))
    work, page = Work(seeds=SEEDS, workers=workers, trials=Path(kept) if kept else None), Page()

    def ran(name: str, cases: list[Params]) -> Trials:
        done = trials(work, name, cases)
        assert done is not None and not done.failed
        return done

    honest(page, ran("filters", list(HONEST.values())))
    blocked(page, ran("wind", list(WIND.values())))
    printed(page, ran("paper", PAPER_CASES), ran("equal", EQUAL_CASES))
    guided(page, ran("guided", list(GUIDED.values())))
    swept(page, ran("sweep", SWEEP_CASES), ran("sigma", SIGMA_CASES))
    known = "; ".join(f"{what} ({why})" for what, why in KNOWN.items())
    text = (
        f"Flights of swarm2023's localisation, 30 s, fixes of 0.15 m at 1 Hz, {SEEDS} seeds from 0; RMSE [m] over space"
        " and the seconds, mean +- spread over seeds; differences in pairs of one seed. Gusts of 0.1 m/s^2 per root Hz"
        " but where it says none, and in all rows of printed tunings. NEES is per degree of freedom of position and"
        f" velocity: 1 is honest. Known to be missed: {known}."
    )
    publish("which-filter", "Which Kalman filter?", text, ("what", "figure", "bound", ""), page.rows)
    assert set(page.missed) <= set(KNOWN)
