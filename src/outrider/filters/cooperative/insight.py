"""What a team's estimate says of its sensors: who agrees with whom, and what nothing has measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.special import chdtri

from outrider.data import Verdict
from outrider.filters.cooperative.fusion import TeamEstimate
from outrider.filters.cooperative.robot import Member, Source
from outrider.typing import Floats

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


def agreement(robot: str, sensor: str, partner: str, rows: Floats) -> Agreement:
    """From rows (n, 3) of verdict, NIS and degrees of freedom."""
    verdict, nis, dof = rows.T
    used = (verdict == Verdict.USED) & (dof > 0)
    nis, dof = nis[used], dof[used]
    told = nis.size > 0
    return Agreement(
        robot=robot, sensor=sensor, partner=partner, used=int(used.sum()),
        refused=int(np.isin(verdict, [Verdict.GATED, Verdict.DIVERGED]).sum()),
        nis=float(nis.sum() / dof.sum()) if told else float("nan"),
        inside=float(np.mean(nis <= chdtri(dof, 1.0 - BAND))) if told else float("nan"),
    )  # fmt: skip


def agreements(done: TeamEstimate, sources: Sequence[Source]) -> list[Agreement]:
    """One row for each source that measures, in the order of the sources."""
    rows: Floats = np.column_stack([done.verdict, done.nis, done.dof]).astype(np.float64)
    return [
        agreement(s.robot, s.sensor.code.name.lower(), s.partner, rows[done.source == k])
        for k, s in enumerate(sources)
        if s.sensor is not None
    ]


def unobserved(done: TeamEstimate) -> list[str]:
    """A sentence for each block of which the run has told nothing: no variance of it is below what it was at first."""
    return untold(list(done.members.values()), {name: np.diag(P[-1]) for name, P in done.P.items()})


def untold(members: Sequence[Member], last: Mapping[str, Floats]) -> list[str]:
    """As `unobserved`, from the last variances (errors,) of each robot."""
    out: list[str] = []
    for m in members:
        first = np.diag(m.belief.P)
        for block in m.belief.layout:
            e = block.error
            if block.name not in m.consider and first[e].max() > 0.0 and (last[m.name][e] >= UNTOLD * first[e]).all():
                out.append(
                    f"{block.name} of {m.name}: nothing has measured it; add a sensor, or a partner that has one"
                )
    return out
