"""Least squares on innovations: the values at which a log is least surprised, and how sure they are.

    min over v of  sum_k rho(y_k(v) / (s_k g_k)) + sum_i (v_i / prior_i)^2,

y the innovations and s their predicted deviations at the current values, g the gain that multiplies the record (so that
a gain cannot shrink its own residual), rho Huber's. Gauss-Newton on differences (prediction error method: Ljung,
System Identification, 1999, ch. 7). The covariance is a sandwich with A = J' W J: innovations of a filter whose noise
is not what it believes are correlated and not of unit variance. Its window of some seconds sees what is left of that
once the noise is about right (`noise`); a filter that believes too little of its past has innovations whose
correlation, weak and negative, lasts for its memory, and which would make every interval several times too wide.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from outrider.typing import Floats, Ints
from outrider.workflows.bench import Bench, Innovations, gained
from outrider.workflows.parameters import PRIORS, STEPS, Parameter, What
from outrider.workflows.sandwich import sandwich

HUBER: Final = 3.0  # deviations beyond which a residual counts linearly
SETTLE_S: Final = 5.0  # after the start, that say more about the start than about the sensors
MOST_ROUNDS: Final = 8
SLOPES: Final = 3  # rounds with slopes of their own; by then they hardly change (two of a search that begins near)
ROUGH: Final = 1.01  # by so much a cost may grow: records that change places make it rough
PARTS: Final = (1.0, 0.5, 0.25, 0.1)  # of a step, tried in turn
NEAR: Final = 0.1  # of a deviation: a step as small as this ends the search
SWEEP: Final = (-0.5, -0.2, 0.2, 0.5)  # s: delays tried before the search


@final
@dataclass(frozen=True, slots=True)
class Fit:
    """value : per parameter;  sd : of each;  rounds : of the search;  settled : whether it came to an end."""

    value: Mapping[Parameter, float]
    sd: Mapping[Parameter, float]
    rounds: int
    settled: bool


@final
@dataclass(frozen=True, slots=True)
class Scene:
    """What is held while a step is found: weights 1/s (n, ROWS) per channel and the times of the records."""

    weights: list[Floats]
    times: Floats


def fit(
    bench: Bench, parameters: Sequence[Parameter], progress: Callable[[float], None] = lambda _: None, *,
    start: Mapping[Parameter, float] | None = None, most: int = MOST_ROUNDS, until: float | None = None,
    held: Mapping[Parameter, float] | None = None,
) -> Fit:  # fmt: skip
    """Fit the parameters together. start : where from, by default from zero and the best of some delays;  most :
    rounds;  until : s since the first event, the whole log by default;  held : deviations of others that were found
    before, which are not fitted but make these less sure."""
    prior = np.array([PRIORS[q.what] for q in parameters])
    cost = Cost(bench, parameters, prior, until)
    v, base, scene = swept(cost) if start is None else begun(cost, start)
    own = SLOPES if start is None else SLOPES - 1
    cov, rounds, settled, whole, gradient = np.diag(prior**2), 0, False, True, np.zeros((0, len(parameters)))
    while rounds < most and not settled:
        progress(rounds / most)
        rounds += 1
        if fresh := rounds <= own or not whole:
            gradient = slopes(cost, v, scene)
        r, J, t = usable(residuals(bench, parameters, v, base, scene), gradient, scene.times)
        w = np.minimum(1.0, HUBER / np.maximum(np.abs(r), 1e-12))
        A = J.T @ (w[:, None] * J) + np.diag(1.0 / prior**2)
        cov = sandwich(A, w[:, None] * J * r[:, None], t, float(np.mean((w * r) ** 2)))
        step = np.clip(-np.linalg.solve(A, J.T @ (w * r) + v / prior**2), -0.5 * prior, 0.5 * prior)
        if np.all(np.abs(step) < NEAR * np.sqrt(np.diag(cov))):
            v, settled = v + step, True
            break
        before = cost(v, base, scene)
        whole = False
        for part in PARTS:
            trial = cost.run(v + part * step)
            if cost(v + part * step, trial, scene) < ROUGH * before:
                v, base, whole = v + part * step, trial, part == 1.0
                break
        else:
            settled = fresh  # no way down: the noise of the differences
        scene = scene_of(bench, base)
    sd = np.sqrt(np.diag(cov) + doubt(cost, v, base, scene, held or {}))
    return Fit(
        dict(zip(parameters, v.tolist(), strict=True)), dict(zip(parameters, sd.tolist(), strict=True)), rounds, settled
    )


def doubt(
    cost: "Cost", v: Floats, base: Sequence[Innovations], scene: Scene, held: Mapping[Parameter, float]
) -> Floats:  # fmt: skip
    """(p,) variances that come of what is held: of the shifts that an error of it makes (Schmidt 1966)."""
    if not held:
        return np.zeros(len(v))
    wider = Cost(cost.bench, (*cost.parameters, *held), np.r_[cost.prior, [PRIORS[p.what] for p in held]], cost.until)
    at = np.r_[v, np.zeros(len(held))]
    r = residuals(cost.bench, cost.parameters, v, base, scene)
    r, J, _ = usable(r, slopes(wider, at, scene), scene.times)
    W = np.minimum(1.0, HUBER / np.maximum(np.abs(r), 1e-12))[:, None]
    own, other = J[:, : len(v)], J[:, len(v) :]
    shift = np.linalg.solve(own.T @ (W * own) + np.diag(1.0 / cost.prior**2), own.T @ (W * other))
    return np.asarray(np.square(shift * list(held.values())).sum(axis=1), np.float64)


def usable(r: Floats, J: Floats, t: Floats) -> tuple[Floats, Floats, Floats]:
    """Rows that have a residual and all slopes."""
    good = np.isfinite(r) & np.isfinite(J).all(axis=1)
    return r[good], J[good], t[good]


@final
@dataclass(frozen=True, slots=True)
class Cost:
    """The objective, per residual."""

    bench: Bench
    parameters: Sequence[Parameter]
    prior: Floats
    until: float | None

    def run(self, v: Floats) -> list[Innovations]:
        """Innovations at values (p,)."""
        return self.bench.run(dict(zip(self.parameters, v.tolist(), strict=True)), until=self.until)

    def __call__(self, v: Floats, run: Sequence[Innovations], scene: Scene) -> float:
        r = residuals(self.bench, self.parameters, v, run, scene)
        a = np.abs(r[np.isfinite(r)])
        fitted = float(np.mean(np.where(a < HUBER, 0.5 * a**2, HUBER * (a - 0.5 * HUBER))))
        return fitted + 0.5 * float(np.sum((v / self.prior) ** 2)) / a.size


def begun(cost: Cost, start: Mapping[Parameter, float]) -> tuple[Floats, list[Innovations], Scene]:
    """Values to start from, with their run."""
    v = np.array([start[p] for p in cost.parameters])
    base = cost.run(v)
    return v, base, scene_of(cost.bench, base)


def swept(cost: Cost) -> tuple[Floats, list[Innovations], Scene]:
    """Where to start from: of each delay by itself the best of a few."""
    v = np.zeros(len(cost.parameters))
    base = cost.run(v)
    scene = scene_of(cost.bench, base)
    best = cost(v, base, scene)
    for k, p in enumerate(cost.parameters):
        for delay in SWEEP if p.what is What.DELAY else ():
            at = v.copy()
            at[k] = delay
            run = cost.run(at)
            if (here := cost(at, run, scene)) < best:
                v, base, best = at, run, here
    return v, base, scene_of(cost.bench, base)


def scene_of(bench: Bench, base: Sequence[Innovations]) -> Scene:
    """Weights and times at the current values."""
    first = bench.start + int((bench.aligned.t_start + SETTLE_S) * 1e9)
    weights: list[Floats] = []
    times: list[Ints] = []
    for c, part, one in zip(bench.channels, bench.parts, base, strict=True):
        late = part.t >= first
        weights.append(np.where(late[:, None] & np.isfinite(one.s) & (one.s > 0.0), 1.0 / one.s, np.nan))
        times += [] if c.scored else [np.repeat(part.t, one.s.shape[1])]
    return Scene(weights, np.asarray((np.concatenate(times) - bench.start) * 1e-9, np.float64))


def residuals(
    bench: Bench, parameters: Sequence[Parameter], v: Floats, run: Sequence[Innovations], scene: Scene
) -> Floats:
    """(n,) of all records and rows; NaN where there is none."""
    out: list[Floats] = []
    for c, one, weights in zip(bench.channels, run, scene.weights, strict=True):
        r = one.y * weights
        if c.scored:
            continue
        for p, value in zip(parameters, v.tolist(), strict=True):
            if c.stream in p.streams and p.what in (What.SPEED, What.RATE) and gained(p.what, c) is not None:
                r = r / (1.0 + value)
        out.append(r.ravel())
    return np.concatenate(out)


def slopes(cost: Cost, v: Floats, scene: Scene) -> Floats:
    """(n, p) derivatives of the residuals, by central differences."""
    columns: list[Floats] = []
    for k, p in enumerate(cost.parameters):
        ends: list[Floats] = []
        for side in (1.0, -1.0):
            at = v.copy()
            at[k] += side * STEPS[p.what]
            ends.append(residuals(cost.bench, cost.parameters, at, cost.run(at), scene))
        columns.append((ends[0] - ends[1]) / (2.0 * STEPS[p.what]))
    return np.column_stack(columns)


__all__ = ["Fit", "fit"]
