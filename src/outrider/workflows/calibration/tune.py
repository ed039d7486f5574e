"""Noise of sources from a log: the factor of each one's standard deviations at which its innovations are likeliest.

Coordinate descent on the log-likelihood sum -(nis + log det S)/2 of everything fused, over the first half of the log;
the second half says what it is worth (held-out NIS). Only sources that tell where the vehicle is, or how it moves over
ground: what gyro and wheels of a planar robot say is hidden behind the motion that its process allows at their rate.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from outrider.data import EventLog
from outrider.io.config import merged
from outrider.workflows.assembly import RELATIVE
from outrider.workflows.bench import Bench, Innovations
from outrider.workflows.config import FuseConfig, SourceSection

FACTORS: Final = (4.0, 2.0, 1.4, 1.15)  # tried up and down, coarse to fine
LIMITS: Final = (0.05, 50.0)
CLIP: Final = 25.0  # NIS per degree of freedom at which one record's say stops growing
WORTH: Final = 4.0  # log-likelihood that a factor must win
FEW: Final = 20  # records in either half


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Tuned:
    """One source. scale : what multiplies its standard deviations;  before, after : NIS per degree of freedom of the
    second half, which the factors have not seen."""

    source: str
    scale: float
    before: float
    after: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"source": self.source, "scale": self.scale, "nis_before": self.before, "nis_after": self.after}


def tune(log: EventLog, cfg: FuseConfig, progress: Callable[[str, float], None]) -> tuple[list[Tuned], FuseConfig]:
    """The factors of all fused sources that are not told, and the configuration with those that matter."""
    half = 0.5 * log.duration
    bench = Bench(log, cfg)
    names = [n for n in sources(bench, half) if "scale" not in cfg.sources.get(n, SourceSection()).model_fields_set]
    scale = dict.fromkeys(names, 1.0)
    best, first = likelihood(log, with_scales(cfg, scale), half)
    for k, factor in enumerate(FACTORS):
        progress("tuning", k / len(FACTORS))
        for name in names:
            for way in (factor, 1.0 / factor):
                trial = {**scale, name: float(np.clip(scale[name] * way, *LIMITS))}
                value, _ = likelihood(log, with_scales(cfg, trial), half)
                if value > best + WORTH:
                    best, scale = value, trial
                    break
    tuned = with_scales(cfg, {n: round(s, 3) for n, s in scale.items() if s != 1.0})
    _, last = likelihood(log, tuned, half)
    return [Tuned(source=n, scale=scale[n], before=first[n], after=last[n]) for n in names], tuned


def with_scales(cfg: FuseConfig, scale: dict[str, float]) -> FuseConfig:
    """The configuration with these factors."""
    more = {"sources": {name: {"scale": value} for name, value in scale.items()}}
    return FuseConfig.model_validate(merged(cfg.model_dump(exclude_unset=True), more)) if scale else cfg


def sources(bench: Bench, half: float) -> list[str]:
    """Streams of fused absolute measurements with enough records in both halves."""
    cut = bench.start + int(half * 1e9)
    out: dict[str, None] = {}
    for c, part in zip(bench.channels, bench.parts, strict=True):
        if (
            c.sensor is not None
            and c.sensor not in RELATIVE
            and not c.scored
            and min((part.t < cut).sum(), (part.t >= cut).sum()) >= FEW
        ):
            out[c.stream] = None
    return list(out)


def likelihood(log: EventLog, cfg: FuseConfig, half: float) -> tuple[float, dict[str, float]]:
    """Log-likelihood of the first half, and NIS per degree of freedom of the second by stream."""
    bench = Bench(log, cfg)
    cut = bench.start + int(half * 1e9)
    total, late = 0.0, dict[str, tuple[float, int]]()
    for c, part, one in zip(bench.channels, bench.parts, bench.run({}), strict=True):
        if c.scored or c.sensor is None:
            continue
        total += said(one, part.t < cut)
        ok = (one.dof > 0) & (part.t >= cut)
        nis, dof = late.get(c.stream, (0.0, 0))
        late[c.stream] = nis + float(np.sum(one.nis[ok])), dof + int(one.dof[ok].sum())
    return total, {name: nis / max(dof, 1) for name, (nis, dof) in late.items()}


def said(i: Innovations, rows: "np.ndarray") -> float:
    """Log-likelihood (to a constant) of some records."""
    ok = (i.dof > 0) & rows
    s = i.s[ok]
    return -0.5 * float(np.sum(np.fmin(i.nis[ok], CLIP * i.dof[ok])) + 2.0 * np.log(np.where(s > 0.0, s, 1.0)).sum())


__all__ = ["Tuned", "tune"]
