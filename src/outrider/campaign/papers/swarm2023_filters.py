"""swarm2023's filters: Table 1 with its own tunings, the same filters on equal footing, and what tuning does."""

from dataclasses import replace
from typing import Any, Final

import numpy as np

from outrider.campaign.following import following as trial
from outrider.campaign.following_tunings import VARIANTS
from outrider.campaign.papers.model import Pair, Picture, Row, Table, Work, plain_row
from outrider.campaign.papers.printed import LOCALISATION, METHODS
from outrider.campaign.trials import Params, Trials
from outrider.eval import paired, summary
from outrider.typing import Floats

AXES: Final = ("x", "y", "xy", "xyz")
SEEDS: Final = 200
OUTAGE: Final = 4  # s, inferred from the printed error of the held fix
SIGNALS: Final = {"full signal": 0, "blocked signal": OUTAGE}
LATE: Final = 0.2  # s, fits the printed error of the fixes best
ALL: Final = ["EKF", "UKF", "EnKF", "EnKF root", "EnKF 50", "EnKF root 20"]
PAPER_CASES: Final[list[Params]] = [
    {"gust": 0.0, "latency": LATE, "outage": o, "tuned_by": "printed", "tuned_variant": v}
    for v in VARIANTS
    for o in SIGNALS.values()
]
EQUAL_CASES: Final[list[Params]] = [
    {"gust": 0.0, "outage": o, "tuned_by": by} for by in ("printed", "EKF", "UKF") for o in SIGNALS.values()
]
HONEST: Final[dict[str, Params]] = {
    "full signal": {"kinds": ALL},
    "4 s without fixes": {"outage": OUTAGE, "kinds": ALL},
    "fixes 0.3 s late, told so": {"latency": 0.3, "kinds": ALL},
    "fixes 0.3 s late, not told": {"latency": 0.3, "tuned_compensated": False, "kinds": ALL},
    "fixes alone, no direction of flight": {"tuned_direction": False, "kinds": ALL},
}
_WINDY: Final = {"tuned_wind": 0.2, "outage": OUTAGE}
WIND: Final[dict[str, Params]] = {
    "no wind, no state for it": {"outage": OUTAGE, "kinds": ["EKF"]},
    "no wind, with a state": {**_WINDY, "kinds": ["EKF"]},
    "0.3 m/s, no state for it": {"outage": OUTAGE, "wind": 0.3, "kinds": ["EKF"]},
    "0.3 m/s, with a state": {**_WINDY, "wind": 0.3, "kinds": ["EKF"]},
    "0.3 m/s, with a state, no direction either": {**_WINDY, "wind": 0.3, "tuned_blind": True, "kinds": ["EKF"]},
    "no gusts or wind, no state": {"gust": 0.0, "outage": OUTAGE, "kinds": ["EKF"]},
    "no gusts or wind, with a state": {"gust": 0.0, **_WINDY, "kinds": ["EKF"]},
    "no gusts, 0.3 m/s, with a state": {"gust": 0.0, **_WINDY, "wind": 0.3, "kinds": ["EKF"]},
    "lag taken for twice as long": {"outage": OUTAGE, "tuned_lag": 1.0, "kinds": ["EKF"]},
}
GUIDED: Final[dict[str, Params]] = {
    f"{scene}, guided by {'raw fixes' if by == 'fixes' else 'estimates'}": {**case, "guided": by, "kinds": ["EKF"]}
    for scene, case in (("no latency", {}), ("0.3 s late", {"latency": 0.3}),
                        ("0.3 s late, 4 s without fixes", {"latency": 0.3, "outage": OUTAGE}))
    for by in ("fixes", "estimate")
}  # fmt: skip
SWEEP: Final = (0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5)
SWEEP_CASES: Final[list[Params]] = [{"tuned_acceleration": a, "kinds": ["EKF"]} for a in SWEEP]
SIGMAS: Final = (0.05, 0.1, 0.15, 0.2, 0.3)
SIGMA_CASES: Final[list[Params]] = [{"tuned_sigma": s, "kinds": ["EKF"]} for s in SIGMAS]


def trials(work: Work, name: str, cases: list[Params]) -> Trials | None:
    """The trials of some cases; None if nothing is to be simulated."""
    return work.run(f"swarm2023-{name}", trial, cases, seeds=SEEDS) if work.simulates else None


def exactly(done: Trials, case: Params, name: str) -> Floats:
    """(seeds,) one value of the case that has these parameters and no others."""
    rows = done.rows[(k := done.cases.index(case)) * len(done.seeds) : (k + 1) * len(done.seeds)]
    return np.array([float(r.values.get(name, np.nan)) for r in rows])


def localisation(work: Work) -> Table:
    """Table 1: RMSE of the position, every filter with the tuning that the paper prints for it."""
    done = trials(work, "paper", PAPER_CASES)
    rows: list[Row] = []
    for signal, by_method in LOCALISATION.items():
        case = next(c for c in PAPER_CASES if c["outage"] == SIGNALS[signal] and c["tuned_variant"] == "increment")
        for k, axes in enumerate(AXES):
            for method, values in zip(METHODS, by_method, strict=True):
                ours = None if done is None else summary(exactly(done, case, f"{method}_{axes}"))
                value = float(values[k])
                accept = None if ours is None else (value - 2.0 * ours.sd, value + 2.0 * ours.sd)
                rows.append(
                    Row(name=f"{method}, {axes}", group=signal, unit="m", printed=values[k], ours=ours, accept=accept)
                )
    if done is not None:
        rows += _other_models(done)
    note = (
        f"Printed: one run each, every filter with a tuning of its own. Ours: the same tunings, fixes {LATE} s late,"
        f" velocity changed by the change of the command, {OUTAGE} s without signal (inferred); a value agrees if the"
        " printed run lies within two standard deviations of ours. With the command added to the velocity as printed,"
        " or with a lag, the same tunings rank the filters differently."
    )
    return Table(key="localisation", title="Table 1: RMSE of the position", rows=tuple(rows), note=note)


def _other_models(done: Trials) -> list[Row]:
    """What the printed tunings give with the other two readings of the model."""
    names = {"lag": "a lag", "paper_literal": "the command added, as printed (not exact)"}
    return [
        Row(
            name=f"{method} with {names[str(case['tuned_variant'])]}", unit="m",
            group=f"printed tunings, {signal}, xyz", ours=summary(exactly(done, case, f"{method}_xyz")),
        )
        for signal, seconds in SIGNALS.items()
        for case in PAPER_CASES
        if case["tuned_variant"] in names and case["outage"] == seconds
        for method in METHODS[1:]
    ]  # fmt: skip


def equal(work: Work) -> Table:
    """The three filters with one tuning for all: the paper's for the EKF, the paper's for the UKF."""
    done = trials(work, "equal", EQUAL_CASES)
    rows: list[Row] = []
    pairs: list[Pair] = []
    for case in EQUAL_CASES if done is not None else []:
        assert done is not None
        signal = "full signal" if not case["outage"] else "blocked signal"
        told = "each its own" if case["tuned_by"] == "printed" else f"the {case['tuned_by']}'s for all"
        group = f"printed tunings, {told}, {signal}"
        rows += _scores(done, case, group, METHODS[1:], ("xyz",))
        pairs += _pairs(done, case, group, (("UKF", "EKF"), ("EnKF", "UKF")))
    note = "The lag model, zero latency, no gusts. What differs between the filters is the tuning, not the filter."
    return Table(key="tunings", title="Table 1 again: whose tuning?", rows=tuple(rows), pairs=tuple(pairs), note=note)


def filters(work: Work) -> Table:
    """EKF, UKF and EnKF with the same model, Q and R, the true ones."""
    done = trials(work, "filters", list(HONEST.values()))
    rows: list[Row] = []
    pairs: list[Pair] = []
    for group, case in HONEST.items() if done is not None else ():
        assert done is not None
        rows += _scores(done, case, group, ["GPS", *ALL, "RTS"], ("xyz",))
        rows += _scores(done, case, group, ALL, ("nees",), unit="")
        pairs += _pairs(done, case, group, (("UKF", "EKF"), ("EnKF", "EKF"), ("EnKF", "UKF"), ("EnKF root", "EKF")))
    note = (
        "Gusts of 0.1 m/s^2 per root Hz, the filters' Q and R those of the noise that there is; EnKF has 900 members,"
        " other numbers as named, root: square root. RTS: the smoother. NEES per degree of freedom: 1 is honest."
    )
    return Table(key="filters", title="Three filters on equal footing", rows=tuple(rows), pairs=tuple(pairs), note=note)


def blocked(work: Work) -> Table:
    """Four seconds without fixes, in wind and with the wrong lag."""
    done = trials(work, "wind", list(WIND.values()))
    rows: list[Row] = []
    for group, case in WIND.items() if done is not None else ():
        assert done is not None
        rows += _scores(done, case, group, ["EKF"], ("end", "xyz"))
        rows += _scores(done, case, group, ["EKF"], ("nees",), unit="")
    note = "end: error when the last of four lost fixes is due. The wind blows from the start of the flight."
    return Table(key="blocked", title="Four seconds without fixes", rows=tuple(rows), note=note)


def guided(work: Work) -> Table:
    """The same flights guided by raw fixes, as the paper's are while its filters run offline, and by estimates."""
    done = trials(work, "guided", list(GUIDED.values()))
    rows: list[Row] = []
    for group, case in GUIDED.items() if done is not None else ():
        assert done is not None
        rows += _scores(done, case, group, ["EKF"], ("xyz",))
        rows.append(Row(name="aim", group=group, unit="deg", ours=summary(exactly(done, case, "aim"))))
    note = (
        "aim: RMS of the command's direction off the true line to the target, 4 to 14 m away. Estimates of both"
        " aircraft, brought up to now; the target's overshoots where it turns on the spot."
    )
    return Table(key="guided", title="Guided by fixes, guided by estimates", rows=tuple(rows), note=note)


def sweep(work: Work) -> Table:
    """Q and R over a range: RMSE, honesty, and the likelihood of the innovations, which needs no truth."""
    done, noise = trials(work, "sweep", SWEEP_CASES), trials(work, "sigma", SIGMA_CASES)
    rows: list[Row] = []
    for ran, cases, name, unit in (
        (done, SWEEP_CASES, "tuned_acceleration", "m/s^2 per root Hz"), (noise, SIGMA_CASES, "tuned_sigma", "m"),
    ):  # fmt: skip
        for case in cases if ran is not None else []:
            assert ran is not None
            group = f"{'acceleration' if 'acc' in name else 'fixes'} {case[name]} {unit}"
            rows += _scores(ran, case, group, ["EKF"], ("xyz",))
            rows += _scores(ran, case, group, ["EKF"], ("nees", "likelihood"), unit="")
    note = "Truth: 0.1 m/s^2 per root Hz and 0.15 m. Likelihood: mean logarithm of a second's innovations."
    return Table(key="sweep", title="Tuning without truth", rows=tuple(rows), note=note)


def _scores(
    done: Trials, case: Params, group: str, methods: Any, measures: tuple[str, ...], unit: str = "m"
) -> list[Row]:
    return [
        Row(name=f"{method}, {m}", group=group, unit=unit, ours=summary(exactly(done, case, f"{method}_{m}")))
        for m in measures
        for method in methods
    ]


def _pairs(done: Trials, case: Params, group: str, asked: Any) -> list[Pair]:
    return [
        Pair(
            name=f"{group}: {a} - {b}", unit="m",
            result=paired(exactly(done, case, f"{a}_xyz"), exactly(done, case, f"{b}_xyz")),
        )
        for a, b in asked
    ]  # fmt: skip


def tuning(work: Work) -> Picture | None:
    """RMSE and likelihood over what the filter is told of gusts."""
    done = trials(work, "sweep", SWEEP_CASES)
    if done is None:
        return None
    means = {m: [float(np.nanmean(exactly(done, c, f"EKF_{m}"))) for c in SWEEP_CASES] for m in ("xyz", "likelihood")}

    def draw() -> object:
        from outrider.plot.sweeps import sweep_figure

        curves = {"RMSE [m]": np.array(means["xyz"]), "log likelihood of a second": np.array(means["likelihood"])}
        return sweep_figure(np.array(SWEEP), "told acceleration [m/s² per √Hz]", curves, truth=0.1)

    caption = "The likelihood of the innovations, which needs no truth, is highest where the error is least."
    return Picture(key="tuning", title="Tuning without truth", draw=draw, caption=caption)


def ranks(work: Work) -> Picture | None:
    """RMSE by filter: with the printed tunings, with one tuning, with the true noise."""
    even, honest = equal(work).rows, filters(work).rows
    rows = [r for r in even if "full" in r.group]
    rows += [replace(r, group="the true noise for all, full signal") for r in honest
             if r.group == "full signal" and r.name in ("EKF, xyz", "UKF, xyz", "EnKF, xyz")]  # fmt: skip
    if not rows:
        return None

    def draw() -> object:
        from outrider.plot.papers import values_figure

        of_paper = [
            Row(name=f"{m}, xyz", group="swarm2023, one run", unit="m", printed=v[3])
            for m, v in zip(METHODS[1:], LOCALISATION["full signal"][1:], strict=True)
        ]
        return values_figure([plain_row(r) for r in (*of_paper, *rows)])

    caption = "Full signal, no latency: the order of the filters is the order of their tunings."
    return Picture(key="ranks", title="Whose tuning?", draw=draw, caption=caption)


TABLES: Final = (equal, filters, blocked, guided, sweep)
PICTURES: Final = (ranks, tuning)
