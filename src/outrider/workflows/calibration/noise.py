"""How loud sources and process are: the factors of standard deviations at which the innovations are likeliest.

    max over f of  -1/2 sum_k (min(y' S^-1 y, clip) + log det S),

over the records of positions, velocities and headings: what wheels and gyro predict. Coordinate steps on log f. With
noise that is right, innovations are white, and least squares on them has the covariance that it says (Mehra 1970).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from outrider.typing import Bools, Floats
from outrider.workflows.assembly import RELATIVE
from outrider.workflows.bench import Bench, Innovations
from outrider.workflows.parameters import DENSITIES, Noise, Parameter

FACTORS: Final = (8.0, 3.0, 1.6, 1.2)  # tried up and down, coarse to fine
LIMITS: Final = (0.02, 50.0)
SOFTEST: Final = 0.2  # of a source: a receiver that is smoother still errs slowly, not less
PASSES: Final = 2  # with one factor, while anything gains
CLIP: Final = 25.0  # NIS per degree of freedom at which one record's say stops growing
WORTH: Final = 0.5  # log-likelihood that a step must win
SIMPLEX: Final = 0.15  # of the logarithms
FEW: Final = 20  # records in either half

Values = Mapping[Parameter, float]


@final
@dataclass(frozen=True, slots=True)
class Said:
    """What innovations between two times say. likelihood : log, to a constant;  nis : per degree of freedom, by stream
    of an absolute source."""

    likelihood: float
    nis: Mapping[str, float]


def knobs(bench: Bench, cut: int) -> list[Noise]:
    """What may be tuned: streams with enough records before and after a stamp [ns], and densities of the process."""
    out: dict[Noise, None] = {}
    for c, part in zip(bench.channels, bench.parts, strict=True):
        enough = min((part.t < cut).sum(), (part.t >= cut).sum()) >= FEW
        if c.sensor is not None and not c.scored and not c.still and enough:
            out[Noise(c.stream)] = None
    return [*out, *DENSITIES.get(bench.motion, ())]


def loudness(
    bench: Bench, which: Sequence[Noise], values: Values, until: float,
    progress: Callable[[float], None] = lambda _: None, *, polish: int = 0,
) -> dict[Noise, float]:  # fmt: skip
    """The factors of which the records up to `until` [s since the first event] are likeliest. polish : runs of the log
    that a simplex (Nelder & Mead 1965) on the logarithms may take afterwards."""
    cut = bench.start + int(until * 1e9)
    factor = dict.fromkeys(which, 1.0)

    def score(trial: Mapping[Noise, float]) -> float:
        tried = bench.noisy(trial)
        return said(tried, tried.run(values, until=until), np.less, cut).likelihood

    best = score(factor)
    for k, step in enumerate(FACTORS):
        progress(k / len(FACTORS))
        for _ in range(PASSES):
            before = best
            for name in which:
                for way in (step, 1.0 / step):
                    trial = {**factor, name: bounded(name, factor[name] * way)}
                    if (here := score(trial)) > best + WORTH:
                        best, factor = here, trial
                        break
            if best == before:
                break
    return polished(factor, score, polish) if polish and which else factor


def bounded(name: Noise, factor: float) -> float:
    """Within what a source, or a density of the process, can be off by."""
    return float(np.clip(factor, LIMITS[0] if name.row is not None else SOFTEST, LIMITS[1]))


def polished(
    factor: Mapping[Noise, float], score: Callable[[Mapping[Noise, float]], float], runs: int
) -> dict[Noise, float]:  # fmt: skip
    """Off the grid of the steps, to the best of a simplex around it."""
    from scipy.optimize import minimize

    def at(x: Floats) -> dict[Noise, float]:
        return {name: bounded(name, float(f)) for name, f in zip(factor, np.exp(x), strict=True)}

    x = np.log(list(factor.values()))
    simplex = x + np.vstack([np.zeros(len(x)), SIMPLEX * np.eye(len(x))])

    def cost(x: Floats) -> float:
        return -score(at(x))

    options = {"maxfev": runs, "initial_simplex": simplex, "xatol": 0.02, "fatol": 0.1}
    return at(minimize(cost, x, method="Nelder-Mead", options=options).x)


def said(
    bench: Bench, run: Sequence[Innovations], side: Callable[["np.ndarray", int], Bools], cut: int
) -> Said:  # fmt: skip
    """What the records on one side of a stamp [ns] say of positions, velocities and headings."""
    total, nis = 0.0, dict[str, tuple[float, int]]()
    for c, part, one in zip(bench.channels, bench.parts, run, strict=True):
        if c.scored or c.sensor is None or c.sensor in RELATIVE:
            continue
        ok = (one.dof > 0) & side(part.t, cut)
        s = one.s[ok]
        total -= 0.5 * float(np.sum(np.fmin(one.nis[ok], CLIP * one.dof[ok])))
        total -= float(np.log(np.where(s > 0.0, s, 1.0)).sum())
        sum_, dof = nis.get(c.stream, (0.0, 0))
        nis[c.stream] = sum_ + float(one.nis[ok].sum()), dof + int(one.dof[ok].sum())
    return Said(total, {name: value / max(dof, 1) for name, (value, dof) in nis.items()})


__all__ = ["SOFTEST", "Said", "knobs", "loudness", "said"]
