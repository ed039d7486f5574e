"""Noise of sources and of the motion from a log, as a configuration: kept only where a half that it has not seen gains.

The first half of the log says which factors are likeliest (`noise.loudness`), the second what they are worth. Factors
are tried in one go; if the second half is not likelier with all of them, those of the sources alone are tried, and then
nothing is changed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from outrider.data import EventLog
from outrider.io.config import merged
from outrider.workflows.bench import Bench
from outrider.workflows.calibration.noise import Said, knobs, loudness, said
from outrider.workflows.config import FuseConfig, SourceSection
from outrider.workflows.parameters import Noise

POLISH: Final = 80  # runs of half the log
LEAST: Final = 0.05  # relative change that is worth a line


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Changed:
    """One standard deviation. name : of a source or of a density of the process;  factor : what multiplies it;
    value : what the configuration then says."""

    name: str
    factor: float
    value: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"name": self.name, "factor": self.factor, "value": self.value}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Tuned:
    """What tuning did. changes : empty if nothing gained;  before, after : log-likelihood (to a constant) and NIS per
    degree of freedom of the second half, which the factors have not seen."""

    changes: tuple[Changed, ...]
    before: Said
    after: Said

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "changes": [c.as_dict() for c in self.changes],
            "likelihood_before": self.before.likelihood, "likelihood_after": self.after.likelihood,
            "nis": {n: {"before": x, "after": self.after.nis.get(n)} for n, x in self.before.nis.items()},
        }  # fmt: skip


def tune(log: EventLog, cfg: FuseConfig, progress: Callable[[str, float], None]) -> tuple[Tuned, FuseConfig]:
    """What tuning changes of all that is not told, and the configuration with it."""
    bench, half = Bench(log, cfg), 0.5 * log.duration
    cut = bench.start + int(half * 1e9)
    free = [n for n in knobs(bench, cut) if not stated(cfg, bench, n)]
    found = loudness(bench, free, {}, half, lambda done: progress("tuning", done), polish=POLISH)
    before = held(bench, {}, cut)
    for kept in (found, {n: f for n, f in found.items() if n.row is None}):
        some = {n: f for n, f in kept.items() if abs(f - 1.0) > LEAST}
        after = held(bench, some, cut)
        if some and after.likelihood > before.likelihood:
            changes = tuple(change(bench, n, f) for n, f in some.items())
            return Tuned(changes=changes, before=before, after=after), changed(cfg, bench, some, changes)
    return Tuned(changes=(), before=before, after=before), cfg


def stated(cfg: FuseConfig, bench: Bench, n: Noise) -> bool:
    """Whether the configuration says it already."""
    if n.row is None:
        return "scale" in cfg.sources.get(n.name, SourceSection()).model_fields_set
    return getattr(getattr(cfg, bench.motion.name.lower()), n.name) is not None


def held(bench: Bench, factors: Mapping[Noise, float], cut: int) -> Said:
    """What the second half says with these factors."""
    b = bench.noisy(factors)
    return said(b, b.run({}), np.greater_equal, cut)


def change(bench: Bench, n: Noise, factor: float) -> Changed:
    """A factor with what it makes."""
    value = factor if n.row is None else factor * float(bench.filter.theta[n.row])
    return Changed(name=n.name, factor=factor, value=float(f"{value:.3g}"))


def changed(
    cfg: FuseConfig, bench: Bench, factors: Mapping[Noise, float], changes: tuple[Changed, ...]
) -> FuseConfig:  # fmt: skip
    """The configuration with these values."""
    more: dict[str, Any] = {}
    for n, c in zip(factors, changes, strict=True):
        where = {"sources": {n.name: {"scale": c.value}}} if n.row is None else {
            bench.motion.name.lower(): {n.name: c.value}
        }  # fmt: skip
        more = merged(more, where)
    return FuseConfig.model_validate(merged(cfg.model_dump(exclude_unset=True), more))


__all__ = ["Changed", "Tuned", "tune"]
