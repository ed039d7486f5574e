"""A thousand seeds per behaviour of a target: does the distance hold? Written to docs/evidence/chase.md.

Set OUTRIDER_SEEDS to have fewer seeds than 1000.
"""

import os
from dataclasses import replace

import numpy as np
import pytest

from outrider.errors import ConfigError
from outrider.safety.admissible import Fixes
from outrider.safety.separation import Separation
from outrider.scenarios.chase import Chase, Law, Runs
from outrider.scenarios.chase_steps import C_DISTANCE, C_LEAST, C_OWN_V, PERIOD
from outrider.sim.targets import Behaviour
from outrider.typing import Floats
from published import publish

pytestmark = pytest.mark.evidence

SEEDS = int(os.environ.get("OUTRIDER_SEEDS", "1000"))
LATENCIES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
LIKE = Separation(distance=3.0, lag_s=1.0, acceleration=5.0, speed=2.5, other_lag_s=1.0)
KEPT = (Behaviour.STRAIGHT, Behaviour.TURN, Behaviour.STOP)

Row = tuple[str, str, str, str]
ROWS: list[Row] = []


def chases(rate: float, separation: Separation) -> list[Runs]:
    return [Runs(Chase(separation=separation, fixes=Fixes(rate_hz=rate, latency_s=late))) for late in LATENCIES]


def nearest(runs: list[Runs], behaviour: Behaviour) -> Floats:
    """(seeds,) the least true distance of each run; the latency goes round with the seed."""
    return np.array([runs[s % len(runs)].run(behaviour, s)[:, C_LEAST].min() for s in range(SEEDS)])


def told(what: str, least: Floats, bound: str, kept: bool) -> None:
    below = int((least < LIKE.distance).sum())
    figure = f"{least.min():.2f} m at worst, {least.mean():.2f} m on average, below R_d in {below} of {least.size}"
    ROWS.append((what, figure, bound, "yes" if kept else "no"))
    print(what, figure)  # noqa: T201


@pytest.mark.parametrize("rate", [1.0, 10.0])
def test_the_distance_holds(rate: float) -> None:
    runs = chases(rate, LIKE)
    chosen = [r.chase.answer.set_point for r in runs]
    figure = ", ".join(f"{s:.2f}" for s in chosen)
    bound = ("5.5 m at 0.3 s", "yes") if rate == 1.0 else ("", "")
    ROWS.append((f"{rate:g} Hz: set-points chosen for 0 to 0.5 s", f"{figure} m", *bound))
    assert rate != 1.0 or chosen[3] <= 5.5
    for behaviour in Behaviour:
        if behaviour is Behaviour.REVERSE:
            continue
        least = nearest(runs, behaviour)
        kept = bool((least >= LIKE.distance).all())
        told(f"{rate:g} Hz: {behaviour.value}", least, "R_d = 3 m", kept)
        assert kept or behaviour not in KEPT


@pytest.mark.parametrize("rate", [1.0, 10.0])
def test_a_target_that_comes_back(rate: float) -> None:
    back = replace(LIKE, approach=2.0)
    runs = chases(rate, back)
    figure = ", ".join(f"{r.chase.answer.set_point:.2f}" for r in runs)
    ROWS.append((f"{rate:g} Hz: set-points for a target that may come back", f"{figure} m", "", ""))
    least = nearest(runs, Behaviour.REVERSE)
    told(f"{rate:g} Hz: {Behaviour.REVERSE.value}, and was expected to", least, "1.5 m", bool((least >= 1.5).all()))
    assert (least >= 1.5).all()
    surprised = nearest(chases(rate, LIKE), Behaviour.REVERSE)
    told(f"{rate:g} Hz: {Behaviour.REVERSE.value}, which nobody had told", surprised, "none is promised", True)
    with pytest.raises(ConfigError, match="it takes"):
        Chase(separation=back, fixes=Fixes(rate_hz=1.0, latency_s=0.3), most=5.5)


def test_the_law_of_the_paper_enters_its_danger_zone() -> None:
    for law, behaviour in (
        (Law.ZONES, Behaviour.TURN),
        (Law.ZONES, Behaviour.STRAIGHT),
        (Law.UNGUARDED, Behaviour.SILENT),
    ):
        runs = [Runs(Chase(separation=LIKE, law=law))]
        least = nearest(runs, behaviour)
        share = float(np.mean(least < LIKE.distance))
        bound = "below in 95 % of the turns" if behaviour is Behaviour.TURN else ""
        who = "swarm2023" if law is Law.ZONES else "no filter below the law"
        told(f"1 Hz, 0.3 s, {who}: {behaviour.value}", least, bound, share >= 0.95)
        assert behaviour is not Behaviour.TURN or share >= 0.95


def bang_bang(far: float, near: float, v_target: float, x: Separation, band: float) -> float:
    """Least time [s] from rest until `near + band`, such that it comes to rest relative to the target at `near`."""
    h, v, t = 0.005, 0.0, 0.0

    def way(v: float) -> float:
        gained = 0.0
        while v > v_target:
            v += h * max(-x.acceleration, (-x.speed - v) / x.lag_s)
            gained += h * (v - v_target)
        return gained

    ways = [(w, way(w)) for w in np.linspace(v_target, x.speed, 40)]
    speeds, gained = np.array(ways).T
    while far > near + band:
        brakes = v > v_target and far - near <= np.interp(v, speeds, gained)
        u = -x.speed if brakes else x.speed
        v += h * max(-x.acceleration, min(x.acceleration, (u - v) / x.lag_s))
        far, t = far - h * (v - v_target), t + h
    return t


@pytest.mark.parametrize(("behaviour", "start"), [(Behaviour.STRAIGHT, 12.0), (Behaviour.HOVER, 12.0)])
def test_time_to_the_set_point(behaviour: Behaviour, start: float) -> None:
    runs = Runs(Chase(separation=LIKE, adapt=0.0, start_m=start))
    near, ratios = runs.chase.answer.set_point, list[float]()
    for seed in range(min(SEEDS, 200)):
        run = runs.run(behaviour, seed)
        begun = int(np.argmax(np.linalg.norm(run[:, C_OWN_V : C_OWN_V + 3], axis=1) > 0.0)) - 1
        there = int(np.argmax(run[:, C_DISTANCE] <= near + 0.25))
        v_target = 0.0 if behaviour is Behaviour.HOVER else 2.0
        ratios.append((there - begun) * PERIOD / bang_bang(run[begun, C_DISTANCE], near, v_target, LIKE, 0.25))
    mean, worst = float(np.mean(ratios)), float(np.max(ratios))
    figure = f"{mean:.2f} of the bang-bang minimum, {worst:.2f} at worst ({len(ratios)} seeds)"
    ROWS.append(
        (
            f"1 Hz, 0.3 s: time to 0.25 m from the set-point, {behaviour.value}",
            figure,
            "1.3",
            "yes" if mean <= 1.3 else "no",
        )
    )
    assert mean <= 1.3


ABOUT = f"""{SEEDS} seeds (0 to {SEEDS - 1}) a row, 60 s each; latency 0, 0.1 ... 0.5 s in turn with the seed unless
a row says otherwise. R_d 3 m, target at 2 m/s, follower up to 2.5 m/s, both `Multirotor` with a lag of 1 s in calm air;
fixes of 0.15 m and 0.05 m/s on each axis; it starts at rest 12 m behind, 0.3 rad to the side (one sigma). The moment of
the target is drawn from 30 to 36 s. Distances are the true ones, at 50 Hz.
[How close may a follower fly?](../how-close.md) says what is behind it. Alone:
`pytest -m evidence tests/evidence/test_chase_evidence.py`."""


def test_page() -> None:
    """Last: writes what the tests above have measured."""
    assert len(ROWS) >= 20
    publish(
        "chase",
        "A thousand seeds behind one target",
        ABOUT.replace("\n", " "),
        ("what", "figure", "bound", "kept"),
        ROWS,
    )
