"""What a team's estimate says of its sensors: who agrees with whom, and what nothing has measured."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.special import chdtri

from outrider.data import Verdict
from outrider.filters.cooperative.fusion import TeamEstimate
from outrider.filters.cooperative.robot import Source

BAND: Final = 0.95
UNTOLD: Final = 0.98  # of its first variance: what is left of it if nothing was learnt


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """The innovations of one sensor, or of one robot's looks at another.

    nis : mean per degree of freedom, 1 is honest;  inside : share of them below the 95 % bound of their own;
    NaN without records in use
    """

    robot: str
    sensor: str
    partner: str
    used: int
    refused: int
    nis: float
    inside: float


def agreements(done: TeamEstimate, sources: Sequence[Source]) -> list[Agreement]:
    """One row for each source that measures, in the order of the sources."""
    out: list[Agreement] = []
    for k, s in enumerate(sources):
        if s.sensor is None:
            continue
        mine = done.source == k
        used = mine & (done.verdict == Verdict.USED) & (done.dof > 0)
        refused = mine & np.isin(done.verdict, [Verdict.GATED, Verdict.DIVERGED])
        dof, nis = done.dof[used], done.nis[used]
        told = nis.size > 0
        out.append(
            Agreement(
                robot=s.robot, sensor=s.sensor.code.name.lower(), partner=s.partner, used=int(used.sum()),
                refused=int(refused.sum()), nis=float(nis.sum() / dof.sum()) if told else float("nan"),
                inside=float(np.mean(nis <= chdtri(dof, 1.0 - BAND))) if told else float("nan"),
            )
        )  # fmt: skip
    return out


def unobserved(done: TeamEstimate) -> list[str]:
    """A sentence for each block of which the run has told nothing: no variance of it is below what it was at first."""
    out: list[str] = []
    for name, m in done.members.items():
        first, last = np.diag(m.belief.P), np.diag(done.P[name][-1])
        for block in m.belief.layout:
            e = block.error
            if block.name not in m.consider and first[e].max() > 0.0 and (last[e] >= UNTOLD * first[e]).all():
                out.append(f"{block.name} of {name}: nothing has measured it; add a sensor, or a partner that has one")
    return out
