"""The papers' tables: the arithmetic that was recomputed by hand, verdicts, and the document they become."""

import json
from collections.abc import Sequence
from math import isnan, nan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from trial_functions import drift

from outrider.campaign import grid
from outrider.campaign.papers import (
    SCHEMA,
    Pair,
    Paper,
    Picture,
    Row,
    Table,
    Verdict,
    Work,
    exact,
    find_paper,
    make_document,
    paper_names,
)
from outrider.campaign.papers.printed import CONTROL, GOALS, HEADINGS, LOCALISATION, PATHS
from outrider.errors import UsageError
from outrider.eval import paired, summary


def rows_of(name: str) -> dict[str, Row]:
    tables = [make(Work(seeds=0)) for make in find_paper(name).tables]
    return {f"{t.key}: {r.group and r.group + ', '}{r.name} [{r.unit}]": r for t in tables for r in t.rows}


AMR = {
    "goals: mean, seven real drives [m]": (0.349, Verdict.AGREES),
    "goals: mean, all nine drives [m]": (0.279, Verdict.DIFFERS),
    "goals: RMSE, real drives [m]": (0.380, Verdict.UNPRINTED),
    "goals: largest, real drives [m]": (0.683, Verdict.UNPRINTED),
    "headings: mean error [deg]": (0.367, Verdict.AGREES),
    "headings: mean square error [deg^2]": (0.890, Verdict.AGREES),
    "headings: root mean square error [deg]": (0.943, Verdict.AGREES),
    "headings: mean absolute error [deg]": (0.811, Verdict.UNPRINTED),
    "headings: share up to 1.1 deg [%]": (77.778, Verdict.AGREES),
    "headings: share up to 1 deg [%]": (66.667, Verdict.UNPRINTED),
    "headings: largest error [deg]": (1.800, Verdict.DIFFERS),
    "paths: smoothness driven / planned, map 3, smoothness kept [%]": (90.072, Verdict.DIFFERS),
    "paths: smoothness driven / planned, map 1, smoothness kept [%]": (88.848, Verdict.AGREES),
    "paths: length driven / planned - 1, map 3, longer by [%]": (1.140, Verdict.AGREES),
    "paths: length driven / planned - 1, map 1, longer by [%]": (8.535, Verdict.AGREES),
    "paths: length driven / planned - 1, map 2, longer by [%]": (22.373, Verdict.UNPRINTED),
    "control: largest MAE [m/s]": (0.037, Verdict.DIFFERS),
    "control: largest MAE without map 2 [m/s]": (0.018, Verdict.AGREES),
    "control: smallest correlation []": (0.908, Verdict.AGREES),
}


@pytest.mark.parametrize("name", AMR)
def test_amr2025_by_hand(name: str) -> None:
    row, (value, verdict) = rows_of("amr2025")[name], AMR[name]
    assert row.ours is not None and round(row.ours.mean, 3) == value and row.verdict is verdict


def test_printed_rows_fit_their_own_columns() -> None:
    """A slip of the transcription would show: derived columns follow from the others to their last digit."""
    for g in GOALS:
        assert np.hypot(*np.subtract(g.actual, g.target)) == pytest.approx(g.d, abs=0.0075)
    np.testing.assert_allclose(np.abs(HEADINGS[:, 0] - HEADINGS[:, 1]), HEADINGS[:, 2], atol=1e-9)
    for by_method in LOCALISATION.values():
        for x, y, xy, xyz in by_method:
            assert np.hypot(float(x), float(y)) == pytest.approx(float(xy), abs=1.5e-5)
            assert 0.04 < np.sqrt(float(xyz) ** 2 - float(xy) ** 2) < 0.06
    for p in PATHS:
        assert float(p.smc_driven) < float(p.smc_planned) < 1 and float(p.length_driven) > float(p.length_planned)
    for c in CONTROL:
        assert float(c.mae) < float(c.rmse)


def test_gains_of_coop2024_and_what_its_spread_means() -> None:
    rows = rows_of("coop2024")
    assert all(r.verdict is not Verdict.DIFFERS for r in rows.values())
    assert rows["gains: UGV position, gain [%]"].verdict is Verdict.AGREES
    constant = rows["spreads: printed, UAV, spread / mean []"].ours
    noise = rows["spreads: zero-mean error, in the plane (Rayleigh) []"].ours
    assert constant is not None and noise is not None and constant.mean < 0.06 < 0.52 < noise.mean
    drawn = np.linalg.norm(np.random.default_rng(0).normal(size=(200_000, 2)), axis=1)
    assert noise.mean == pytest.approx(drawn.std() / drawn.mean(), rel=0.01)


def test_swarm2023_is_told_where_it_contradicts_itself() -> None:
    rows = rows_of("swarm2023")
    told = {n: r.verdict for n, r in rows.items() if n.startswith("elsewhere")}
    assert len(told) == 6 and set(told.values()) == {Verdict.DIFFERS}
    assert {r.verdict for n, r in rows.items() if n.startswith("horizontal: xy")} == {Verdict.AGREES}


@pytest.mark.parametrize("name", paper_names())
def test_what_nobody_simulated_is_not_claimed(name: str) -> None:
    """Rows from seeds carry their number; without seeds every value of ours follows from printed ones."""
    rows = rows_of(name).values()
    assert any(r.verdict is Verdict.OPEN for r in rows)
    assert all(r.ours is None or r.ours.n == 0 for r in rows)
    assert all((r.verdict is Verdict.OPEN) == (r.ours is None) for r in rows)


@pytest.mark.parametrize(
    ("printed", "relation", "ours", "verdict"),
    [
        ("0.35", "=", 0.3549, Verdict.AGREES),
        ("0.35", "=", 0.355, Verdict.AGREES),
        ("0.35", "=", 0.3551, Verdict.DIFFERS),
        ("0.350", "=", 0.3509, Verdict.DIFFERS),
        ("12", "=", 12.4, Verdict.AGREES),
        ("12", "=", 12.6, Verdict.DIFFERS),
        ("0.02", "<", 0.019, Verdict.AGREES),
        ("0.02", "<", 0.021, Verdict.DIFFERS),
        ("0.9", ">", 0.95, Verdict.AGREES),
        ("0.9", ">", 0.85, Verdict.DIFFERS),
        ("-1.5", "=", -1.54, Verdict.AGREES),
        ("0.35", "=", nan, Verdict.NEVER),
        ("", "=", 0.3, Verdict.UNPRINTED),
    ],
)
def test_digits_say_how_exact(printed: str, relation: str, ours: float, verdict: Verdict) -> None:
    row = Row(name="x", printed=printed, relation=relation, ours=exact(ours))
    assert row.verdict is verdict
    kept_bound = relation != "=" and verdict is Verdict.AGREES
    assert isnan(row.deviation) == (kept_bound or not printed or isnan(ours))


@given(st.decimals(-1000, 1000, places=3), st.integers(0, 3))
def test_every_rounding_agrees_with_what_was_rounded(value: object, places: int) -> None:
    number = float(str(value))
    assert Row(name="x", printed=f"{number:.{places}f}", ours=exact(number)).verdict is Verdict.AGREES


def test_a_band_stands_over_the_digits() -> None:
    seeds = summary([0.4, 0.5, 0.6])
    assert Row(name="x", printed="0.51", ours=seeds, accept=(0.45, 0.65)).verdict is Verdict.AGREES
    assert Row(name="x", printed="0.51", ours=seeds, accept=(0.51, 0.65)).verdict is Verdict.DIFFERS
    assert Row(name="x", printed="0.51").verdict is Verdict.OPEN and Row(name="x").verdict is Verdict.OPEN


def test_too_few_seeds_have_no_verdict() -> None:
    rows = [Row(name=f"value {k}", printed="0.51", ours=summary([0.4, 0.62]), accept=(0.5, 0.52)) for k in range(9)]
    assert rows[0].ours is not None and rows[0].ours.mean == pytest.approx(0.51)  # in the band, and yet
    assert {r.verdict for r in rows} == {Verdict.FEW}
    assert Table(key="few", title="", rows=tuple(rows)).sentence == "9 without a verdict: it takes 3 seeds or more"


def test_a_sentence_lists_no_more_than_a_few_names() -> None:
    rows = tuple(Row(name=f"x, {k % 6}", printed="1.0", ours=exact(2.0)) for k in range(32))
    said = Table(key="many", title="", rows=rows).sentence
    assert said.endswith("what differs: x, 0; x, 1; x, 2; x, 3 and 28 more")


@pytest.fixture
def simulated() -> Paper:
    """A paper with experiments of ours: one campaign, two tables."""
    paper = Paper(name="toy", title="A toy", citation="Nobody (2030)")
    cases = grid(sigma=[0.5, 1.0])

    @paper.table
    def spread(work: Work) -> Table:
        trials = work.run("drift", drift, cases, seeds=8)
        rows = [
            Row(name=f"sigma {s}", unit="m", printed="2.0", ours=summary(trials.column("rms", sigma=s)), accept=(1, 3))
            for s in (0.5, 1.0)
        ]
        return Table(key="spread", title="Spread", rows=tuple(rows))

    @paper.table
    def compared(work: Work) -> Table:
        trials = work.run("drift", drift, cases, seeds=8)
        result = paired(trials.column("rms", sigma=0.5), trials.column("rms", sigma=1.0), rng=np.random.default_rng(0))
        return Table(key="compared", title="Compared", pairs=(Pair(name="half - whole", unit="m", result=result),))

    return paper


def test_tables_share_their_trials(simulated: Paper, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []
    import trial_functions

    monkeypatch.setattr(trial_functions, "CALLS", calls)
    document, _ = make_document([simulated], Work())
    assert len(calls) == 16
    first, second = document["papers"][0]["tables"]
    assert first["rows"][0]["ours"]["n"] == 8 and first["rows"][0]["verdict"] in ("agrees", "differs")
    assert first["rows"][1]["ours"]["mean"] == pytest.approx(2 * first["rows"][0]["ours"]["mean"])
    assert second["pairs"][0]["wins"] == 1.0 and second["pairs"][0]["high"] < 0
    made, _ = make_document([simulated], Work(seeds=3))
    assert made["papers"][0]["tables"][0]["rows"][0]["ours"]["n"] == 3 and made["seeds"] == 3


def test_kept_trials_are_taken_up_again(simulated: Paper, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import trial_functions

    first, _ = make_document([simulated], Work(trials=tmp_path, seeds=4))
    calls: list[str] = []
    monkeypatch.setattr(trial_functions, "CALLS", calls)
    again, _ = make_document([simulated], Work(trials=tmp_path, seeds=4))
    assert calls == [] and again == first and [p.name for p in tmp_path.iterdir()] == ["drift"]


def test_the_document_is_plain_and_complete() -> None:
    papers = [find_paper(name) for name in paper_names()]
    document, pictures = make_document(papers, Work(seeds=0))
    assert json.loads(json.dumps(document, allow_nan=False)) == document and document["schema"] == SCHEMA
    for paper in document["papers"]:
        rows = [r for t in paper["tables"] for r in t["rows"]]
        assert sum(paper["counts"].values()) == len(rows) and rows
        assert [f["key"] for f in paper["figures"]] == [p.key for p in pictures[paper["name"]]]
        assert all(t["sentence"] or not any(r["printed"] for r in t["rows"]) for t in paper["tables"])
    assert make_document(papers, Work(seeds=0))[0] == document


def test_a_paper_that_is_not_there() -> None:
    with pytest.raises(UsageError, match=r"no paper 'swarm' \(did you mean 'swarm2023'\?\)"):
        find_paper("swarm")
    with pytest.raises(UsageError, match="amr2025, coop2024, swarm2023"):
        find_paper("../os")


def test_keys_are_anchors() -> None:
    paper = Paper(name="toy", title="", citation="")

    def same(keys: Sequence[str]) -> None:
        for key in keys:
            paper.picture(lambda work, key=key: Picture(key=key, title="", draw=lambda: None))

    same(["a", "a"])
    with pytest.raises(UsageError, match="toy: two tables or pictures are called a"):
        make_document([paper], Work())


def test_tables_of_amr2025_from_given_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three seeds whose numbers are known: means, worst, ratios and verdicts follow."""
    from outrider.campaign.papers import amr2025_tables as tables

    def column(work: Work, place: str, name: str) -> np.ndarray | None:
        if place == tables.MUJOCO:
            return None
        n = 3 if place == "map 3" else 2
        known = {
            "goal_error": np.full((3, n), 0.02) + np.array([[0.0], [0.02], [0.01]]),
            "goal_estimate": np.full((3, n), 0.01),
            "goal_control": np.full((3, n), 0.03),
            "length_planned": np.array([100.0, 200.0, 200.0]),
            "length_driven": np.array([101.0, 206.0, 204.0]),
            "raw_rmse": np.array([2.0, 4.0, 2.0]),
            "degraded_rmse": np.array([1.0, 1.0, 0.75]),
            "degraded_ratio": np.array([0.5, 0.25, 0.375]),
        }
        return known.get(name, np.array([0.9, 0.9, 0.9]))

    monkeypatch.setattr(tables, "column", column)
    goals = {f"{r.group}: {r.name}": r for r in tables.driven_goals(Work(seeds=0)).rows}
    mean, worst = goals["seven goals of the real maps: mean"], goals["seven goals of the real maps: worst of all seeds"]
    assert mean.ours is not None and mean.ours.mean == pytest.approx(0.03) and mean.ours.n == 3
    assert worst.ours is not None and worst.ours.mean == pytest.approx(0.04) and worst.verdict is Verdict.AGREES
    assert goals[f"{tables.MUJOCO}: (-2.78, -7.42)"].verdict is Verdict.OPEN
    paths = {f"{r.group}: {r.name}": r for r in tables.driven_paths(Work(seeds=0)).rows}
    longer = paths["map 3: longer by"]
    assert longer.ours is not None and longer.ours.mean == pytest.approx(2.0) and longer.verdict is Verdict.DIFFERS
    ratio = tables.degraded(Work(seeds=0)).rows[2]
    assert ratio.ours is not None and ratio.ours.mean == pytest.approx(0.375) and ratio.printed == "0.57"
