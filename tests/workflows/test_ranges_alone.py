"""A place from ranges alone: found where it is, whatever the start; beacons in line tell none."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.data import EventLog, Kind, Run, stream
from outrider.filters.ranged import descended as fitted
from outrider.filters.ranged import deviation, round_about, seen, spread_out
from outrider.workflows.config import FuseConfig
from outrider.workflows.fuse import fuse

CORNERS = np.array([[-20.0, -15.0, 2.0], [25.0, -10.0, 1.0], [15.0, 30.0, 2.0], [-25.0, 20.0, 0.5]])


def walk(places: np.ndarray, seed: int = 1, seconds: float = 30.0) -> tuple[Run, np.ndarray]:
    """One metre per second northward from (8, -6); ranges with 0.1 m of noise, 5 % of them 6 m too short."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 0.05)
    k = np.arange(len(t)) % len(places)
    p = np.column_stack([np.full(len(t), 8.0), t - 6.0, np.zeros(len(t))])
    r = np.linalg.norm(p - places[k], axis=1) + rng.normal(0.0, 0.1, len(t)) - 6.0 * (rng.random(len(t)) < 0.05)
    told = np.column_stack([k + 1.0, r]).astype(np.float64)
    s = stream("uwb", Kind.RANGE, np.round(t * 1e9).astype(np.int64) + 10**18, told)
    beacons = {float(i + 1): (float(x), float(y), float(z)) for i, (x, y, z) in enumerate(places)}
    return fuse(EventLog(streams={"uwb": s}, beacons=beacons), FuseConfig(local=False)), p


@pytest.mark.compiled
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_walk_among_beacons(seed: int) -> None:
    run, p = walk(CORNERS, seed)
    assert "no-position" not in {f.code for f in run.findings}
    y = np.interp((run.fused.t - 10**18) * 1e-9, np.arange(0.0, 30.0, 0.05), p[:, 1])
    off = np.hypot(run.fused.x[:, 0] - 8.0, run.fused.x[:, 1] - y)
    assert off[0] < 2.0
    assert np.sqrt(np.mean(off[20:] ** 2)) < 0.3


@pytest.mark.compiled
def test_beacons_in_line_tell_no_place() -> None:
    run, _ = walk(np.array([[0.0, 0.0, 1.0], [10.0, 0.0, 1.0], [20.0, 0.0, 1.0]]))
    assert "no-position" in {f.code for f in run.findings}


@settings(max_examples=30)
@given(x=st.floats(-60.0, 60.0), y=st.floats(-60.0, 60.0))
def test_exact_ranges_give_the_exact_place(x: float, y: float) -> None:
    p = np.array([x, y])
    r = seen(p, CORNERS)[0]
    ends = [fitted(start, CORNERS, r) for start in round_about(CORNERS, r)]
    assert min(float(np.linalg.norm(end - p)) for end in ends) < 1e-3
    assert deviation(p, CORNERS) > 0.0
    assert spread_out(CORNERS)


def test_a_few_blocked_ranges_do_not_draw_the_place_away() -> None:
    """One beacon in four is heard 8 m too far half of the time, round a corner."""
    p, k = np.array([6.0, 4.0]), np.arange(40) % 4
    r = seen(p, CORNERS[k])[0] + np.where((k == 2) & (np.arange(40) % 8 < 4), 8.0, 0.0)
    assert np.linalg.norm(fitted(np.array([0.0, 0.0]), CORNERS[k], r) - p) < 0.1
