"""`outrider doctor`: a log in, what is wrong with it out, and a configuration to start from."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Any, Final, final

import numpy as np

from outrider.data import EventLog, Finding, Run, Stream
from outrider.workflows.config import FuseConfig
from outrider.workflows.doctor.prescribe import starter
from outrider.workflows.fuse import fuse

SCHEMA: Final = "outrider.doctor/1"
GAP: Final = 5.0  # usual periods that make a gap
LEAST_GAP: Final = 0.5  # s


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Visit:
    """What was seen. run : the log fused with what was prescribed;  config : that, as far as it is not default."""

    log: EventLog
    run: Run
    config: FuseConfig

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All that was found, most damaging first."""
        return self.run.findings

    @property
    def yaml(self) -> str:
        """A configuration to start from."""
        return starter(self.config, self.findings)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "schema": SCHEMA,
            "log": {"path": self.log.path, "sha256": self.log.sha256, "duration_s": self.log.duration},
            "outcome": self.run.outcome.name.lower(),
            "sources": [_row(s, roles_of(self.run).get(s.name, "")) for s in self.log],
            "findings": [
                {
                    "severity": f.severity,
                    "code": f.code,
                    "text": f.text,
                    "source": f.source,
                    "fix": f.fix,
                    "evidence": None if f.evidence is None else f.evidence.as_dict(),
                }
                for f in self.findings
            ],
            "configuration": self.config.model_dump(mode="json", exclude_unset=True),
        }


def visit(log: EventLog, cfg: FuseConfig, *, progress: Callable[[str, float], None] | None = None) -> Visit:
    """Examine a log, fuse it with what was found, and judge the result.

    Raises DataError when nothing in it can be fused.
    """
    run = fuse(log, cfg, progress=progress)
    given = cfg.model_dump(exclude_unset=True)
    found = {k: v for k, v in run.config.items() if k in ("mounts", "sources")}
    used = FuseConfig.model_validate({**found, **{k: v for k, v in given.items() if k not in found}})
    return Visit(log=log, run=run, config=_without_defaults(used))


def _without_defaults(cfg: FuseConfig) -> FuseConfig:
    """The same with only the keys of sources and mounts that say something."""
    told = cfg.model_dump(exclude_defaults=True)
    return FuseConfig.model_validate(told)


def roles_of(run: Run) -> dict[str, str]:
    """What each source is used for."""
    return {a.source.partition(" (")[0]: a.role for a in reversed(run.accounts)}


def _row(s: Stream, role: str) -> dict[str, Any]:
    gaps = gaps_of(s)
    return {
        "name": s.name, "kind": s.kind.value, "records": len(s), "rate_hz": s.rate if isfinite(s.rate) else None,
        "gaps": len(gaps), "longest_gap_s": max(gaps, default=0.0), "used_for": role,
    }  # fmt: skip


def gaps_of(s: Stream) -> list[float]:
    """Seconds of each silence of a source that is far longer than its usual period."""
    if len(s) < 3:
        return []
    steps = np.diff(np.sort(s.t)) * 1e-9
    return steps[steps > max(GAP * float(np.median(steps)), LEAST_GAP)].tolist()


__all__ = ["Visit", "gaps_of", "roles_of", "visit"]
