"""The tables of swarm2023's filters: what is printed is there, ours beside it, nothing made up without trials."""

import pytest

from outrider.campaign.papers.model import Verdict, Work
from outrider.campaign.papers.printed import LOCALISATION
from outrider.campaign.papers.swarm2023_filters import (
    HONEST,
    PICTURES,
    SWEEP,
    TABLES,
    equal,
    filters,
    localisation,
    sweep,
    tuning,
)  # fmt: skip


def test_without_trials_only_what_is_printed_stands_there():
    work = Work(seeds=0)
    table = localisation(work)
    assert len(table.rows) == 32 and {r.verdict for r in table.rows} == {Verdict.OPEN}
    assert [r.printed for r in table.rows if r.name == "EnKF, xyz"] == [v[3][3] for v in LOCALISATION.values()]
    assert all(not make(work).rows for make in TABLES)
    assert all(draw(work) is None for draw in PICTURES)


@pytest.mark.compiled
def test_ours_stand_beside_the_printed_and_filters_are_paired():
    work = Work(seeds=3)
    table = localisation(work)
    printed = [r for r in table.rows if r.printed]
    assert len(printed) == 32 and all(r.ours is not None and r.ours.n == 3 for r in table.rows)
    found = {(r.group, r.name): r.ours.mean for r in table.rows if r.ours is not None}
    assert 0.28 < found["full signal", "GPS, xyz"] < 0.38  # 0.15 m and 0.2 s at 1 m/s
    assert found["blocked signal", "GPS, xyz"] > 0.9
    even = equal(work)
    apart = {p.name: p.result.mean for p in even.pairs}
    own, one = (f"printed tunings, {who}, full signal: UKF - EKF" for who in ("each its own", "the EKF's for all"))
    assert apart[own] < -0.03 < -0.005 < apart[one] < 0.005


@pytest.mark.compiled
def test_every_scene_and_every_told_noise_has_its_rows():
    work = Work(seeds=2)
    table = filters(work)
    assert {r.group for r in table.rows} == set(HONEST) and len(table.pairs) == 4 * len(HONEST)
    rows = sweep(work).rows
    means = [r.ours.mean for r in rows if r.name == "EKF, likelihood" and r.ours and "acceleration" in r.group]
    assert len(means) == len(SWEEP) and means.index(max(means)) not in (0, len(SWEEP) - 1)
    picture = tuning(work)
    assert picture is not None and len(picture.draw().axes) == 2
