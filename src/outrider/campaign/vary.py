"""What a campaign varies: lists and grids, of which every combination is run, and ranges, which are sampled."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from math import ceil, exp, isfinite, log, log2
from typing import Final, final

import numpy as np

from outrider.campaign.trials import grid
from outrider.errors import UsageError
from outrider.io.config import parse_yaml
from outrider.typing import Floats

MOST: Final = 1_000_000  # trials of one campaign
LARGEST: Final = 2**63 - 1  # seed
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_SPAN = re.compile(rf"({_NUMBER}):({_NUMBER})(?::(\d+))?(:log)?")
SHAPES: Final = "KEY=a,b,c (each), KEY=low:high:points (a grid) or KEY=low:high (sampled); `:log` spaces evenly in logs"


class Sampling(Enum):
    """How places within ranges are drawn."""

    RANDOM = "random"
    SOBOL = "sobol"
    LATIN = "lhs"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One setting that varies: over `values`, or, without any, between low and high, evenly in logs if `log`."""

    key: str
    values: tuple[object, ...] = ()
    low: float = 0.0
    high: float = 0.0
    log: bool = False

    def at(self, share: Floats) -> list[float]:
        """Values at shares (n,) of the way from low to high."""
        if self.log:
            a, b = log(self.low), log(self.high)
            return [exp(a + s * (b - a)) for s in share.tolist()]
        return [self.low + s * (self.high - self.low) for s in share.tolist()]


def axis_of(text: str) -> Axis:
    """What `--vary` says; see `SHAPES`. Raises UsageError for what is no axis, or one without a point."""
    key, sign, told = text.partition("=")
    where = f"--vary {text}"
    if not sign or not key or not all(key.split(".")) or not told.strip():
        raise UsageError("cannot be understood", where=where, fix=f"write {SHAPES}")
    span = _SPAN.fullmatch(told.strip())
    if span is None:
        values = _listed(told, where)
        if any(_is_no_number(v) for v in values):
            raise UsageError("is no number that could be run", where=where, fix="finite numbers, words, or a range")
        if len(values) != len({repr(v) for v in values}):
            raise UsageError("names a value twice", where=where, fix="name each once")
        return Axis(key=key, values=values)
    low, high, points, is_log = float(span[1]), float(span[2]), span[3], span[4] is not None
    if not low < high:
        raise UsageError("holds no points", where=where, fix="the lower end first, then the higher one")
    if is_log and not low > 0.0:
        raise UsageError("has no logarithm", where=where, fix="a range above 0, or without :log")
    axis = Axis(key=key, low=low, high=high, log=is_log)
    if points is None:
        return axis
    if int(points) < 2:
        raise UsageError("holds no grid", where=where, fix="two points or more, or a single value")
    if int(points) > MOST:
        raise UsageError(f"{points} points are too many", where=where, fix=f"at most {MOST}")
    grid_points = axis.at(np.linspace(0.0, 1.0, int(points)))
    return Axis(key=key, values=tuple(float(f"{v:.12g}") for v in grid_points))  # 0.9, not 0.8999999999999999


def _is_no_number(value: object) -> bool:
    """Whether it is, or reads like, NaN or infinity."""
    parts = value.split(":") if isinstance(value, str) else [value] if isinstance(value, float) else []
    for part in parts:
        try:
            if not isfinite(float(part)):
                return True
        except ValueError:
            continue
    return False


def _listed(told: str, where: str) -> tuple[object, ...]:
    whole = told.strip().startswith(("[", "{", '"', "'"))
    parts = [told] if whole else told.split(",")
    if not all(p.strip() for p in parts):
        raise UsageError("has an empty value", where=where, fix=f"write {SHAPES}")
    return tuple(parse_yaml(p, where) for p in parts)


def cases_of(
    axes: Sequence[Axis], runs: int, sampling: Sampling, seed: int
) -> tuple[list[dict[str, object]], tuple[int, ...]]:
    """The cases of a campaign and the seeds of each.

    Without ranges: every combination, each over `runs` seeds from `seed` on. With ranges: `runs` places drawn in them,
    the same for every combination of the rest, each once, with a seed of its own (`sample`, added to `seed`).
    """
    keys = [a.key for a in axes]
    if twice := sorted({k for k in keys if keys.count(k) > 1}):
        raise UsageError(f"'{twice[0]}' varies twice", where="--vary", fix="name each key once")
    if reserved := sorted({"seed", "sample"} & set(keys)):
        raise UsageError(f"'{reserved[0]}' is the campaign's own", where="--vary", fix="--runs N takes N seeds")
    combinations = grid(**{a.key: a.values for a in axes if a.values})
    ranges = [a for a in axes if not a.values]
    if len(combinations) * runs > MOST:
        raise UsageError(f"{len(combinations)} x {runs} trials are too many", where="--runs", fix=f"at most {MOST}")
    if seed + runs > LARGEST:
        raise UsageError(f"{runs} seeds from {seed} on go beyond 64 bits", where="--seed", fix="a smaller first one")
    if not ranges:
        return combinations, tuple(range(seed, seed + runs))
    shares = _shares(len(ranges), runs, sampling, seed)
    drawn = [a.at(shares[:, k]) for k, a in enumerate(ranges)]
    samples = [
        {"sample": i, **{a.key: values[i] for a, values in zip(ranges, drawn, strict=True)}} for i in range(runs)
    ]
    return [{**rest, **sample} for rest in combinations for sample in samples], (seed,)


def seed_of(params: Mapping[str, object], seed: int) -> int:
    """The seed of a trial: samples of a range have one each."""
    return seed + int(str(params.get("sample", 0)))


def _shares(dimensions: int, n: int, sampling: Sampling, seed: int) -> Floats:
    """(n, dimensions) points of the unit cube."""
    if sampling is Sampling.RANDOM:
        return np.random.default_rng(seed).random((n, dimensions))
    from scipy.stats import qmc  # slow to import

    rng = np.random.default_rng(seed)
    if sampling is Sampling.LATIN:
        return np.asarray(qmc.LatinHypercube(dimensions, rng=rng).random(n))
    return np.asarray(qmc.Sobol(dimensions, rng=rng).random_base2(ceil(log2(max(n, 1)))))[:n]
