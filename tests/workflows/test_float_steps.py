"""Float positions that claim too much, by the steps where a fixed one follows; those that keep it are left alone."""

import numpy as np
import pytest

from outrider.data import EventLog, Fix, Kind, stream
from outrider.workflows.config import FuseConfig
from outrider.workflows.findings.steps import steps
from outrider.workflows.fuse import fuse

FLOAT, FIXED = float(Fix.FLOAT.value), float(Fix.FIXED.value)
METRE = 1.0 / 6.371e6  # of latitude, rad


def solution(seed: int, error: float, claim: float, speed: float = 8.0, noise: float = 0.003) -> tuple[np.ndarray, ...]:
    """A car in bends for 15 min at 1 Hz, twenty stretches of float; errors that stay for a stretch of float."""
    rng = np.random.default_rng(seed)
    t = np.arange(900.0)
    yaw = np.cumsum(0.05 * np.sin(0.07 * t))
    v = speed * (1.0 + 0.3 * np.sin(0.05 * t))[:, None]
    p = np.cumsum(v * np.column_stack([np.cos(yaw), np.sin(yaw)]), axis=0)
    part = (t // 22).astype(int)
    floats = part % 2 == 1
    p += np.where(floats[:, None], rng.normal(0.0, error, (part.max() + 1, 2))[part], 0.0)
    p += rng.normal(0.0, noise, p.shape)
    return (t * 1e9).astype(np.int64) + 10**18, p, np.where(floats, FLOAT, FIXED), np.where(floats, claim, 0.01)


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_the_step_is_the_error_and_not_the_bends(seed: int) -> None:
    found = steps(*solution(seed, 0.25, 0.01))
    assert found is not None
    assert found.n > 30
    assert found.off == pytest.approx(0.25, rel=0.5)
    assert found.claim == pytest.approx(0.0141, rel=0.01)
    still = steps(*solution(seed, 0.0, 0.01))
    assert still is not None
    assert still.off < 0.1 * found.off + 0.02
    assert steps(*(a[:200] for a in solution(seed, 0.25, 0.01))) is not None
    assert steps(*(a[:100] for a in solution(seed, 0.25, 0.01))) is None


@pytest.mark.parametrize("noise", [0.003, 0.15])
def test_over_many_drives_the_step_is_right_whatever_else_shakes(noise: float) -> None:
    """20 drives of 40 changes each: the median of squares is known to a few percent."""
    found = [steps(*solution(seed, 0.25, 0.01, noise=noise)) for seed in range(20)]
    squares = [s.off**2 for s in found if s is not None]
    assert len(squares) == 20
    assert np.sqrt(np.mean(squares)) == pytest.approx(0.25, rel=0.1)


@pytest.mark.compiled
@pytest.mark.parametrize(("error", "claim", "named"), [(0.25, 0.01, True), (0.25, 0.25, False), (0.0, 0.01, False)])
def test_a_receiver_alone_is_named_for_it(error: float, claim: float, named: bool) -> None:
    t, p, fix, sigma = solution(7, error, claim)
    z = np.column_stack([0.7 + p[:, 1] * METRE, 0.2 + p[:, 0] * METRE / np.cos(0.7), np.full(len(t), 100.0)])
    s = stream("rtk", Kind.GNSS, t, z.astype(np.float64), var=np.tile(sigma[:, None] ** 2, 3), extra={"fix": fix})
    said = [f for f in fuse(EventLog(streams={"rtk": s}), FuseConfig()).findings if f.code == "overconfident"]
    assert bool(said) is named
    assert all("float" in f.text for f in said)
