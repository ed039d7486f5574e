"""Two sources of position that cannot both be right, and claim alike: nobody can tell which of them is wrong."""

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final, final

import numpy as np

from outrider.data import Finding, Fix, Kind, Run, Stream, Verdict
from outrider.filters.align import Alignment
from outrider.filters.channels import Channel, site_position
from outrider.models.sensors.layout import LEVER
from outrider.typing import Floats
from outrider.workflows.assembly import SLOW_FACTOR, claimed_sigma
from outrider.workflows.draft import Plan
from outrider.workflows.findings.say import error, warning

APART: Final = 2.0  # m: nearer may as well be antennas at two places of one vehicle
TIMES: Final = 5.0  # the deviation that both together claim
ALIKE: Final = 3.0  # times that one may claim of what the other does
MANY: Final = 20  # positions told by both
LEAP: Final = 0.5  # of their usual distance, from one record to the next
ACCUSATIONS: Final = frozenset({"overconfident", "faulted", "jump", "refused"})
NEAR: Final = 1.0  # s between two records of one that a record of the other is laid between


@final
@dataclass(frozen=True, slots=True)
class Pair:
    """Two sources that contradict each other. off : (n,) m between them;  claims : deviation per axis of each [m]."""

    a: Channel
    b: Channel
    off: Floats
    claims: tuple[float, float]

    @property
    def sudden(self) -> bool:
        """Whether they parted in one leap: then motion tells which of them leapt."""
        return float(np.abs(np.diff(self.off)).max()) > LEAP * float(np.median(self.off))


def contradictions(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Pairs of fused sources that lie far apart throughout for what both claim."""
    return [said(run, p) for p in pairs(chosen)]


def pairs(chosen: Plan, least: float = APART) -> list[Pair]:
    """Those that lie farther apart than that [m] and than both claim, in the order of their names."""
    sources = {c.stream: c for c in chosen.whole.channels if c.reset[1] and not c.scored}
    out: list[Pair] = []
    for a, b in combinations([sources[name] for name in sorted(sources)], 2):
        off, claims = apart(chosen, a, b), (claim(chosen, a), claim(chosen, b))
        if off.size < MANY or max(claims) > ALIKE * min(claims):
            continue
        arms = float(np.linalg.norm(a.theta[LEVER : LEVER + 3] - b.theta[LEVER : LEVER + 3]))
        if float(np.median(off)) > max(least, TIMES * float(np.hypot(*claims))) + arms:
            out.append(Pair(a, b, off, claims))
    return out


def said(run: Run, p: Pair) -> Finding:
    """The finding about a pair; which of them the estimate follows says nothing of which is right."""
    one, other = p.a.stream, p.b.stream
    middle, most = float(np.median(p.off)), float(np.percentile(p.off, 99.0))
    text = f"{one} and {other} contradict each other: they lie {middle:.3g} m apart, up to {most:.3g} m, "
    text += f"{middle / float(np.hypot(*p.claims)):.0f} times what both claim, and claim alike; one of them is wrong, "
    used = {a.source: a.used for a in run.accounts}
    n, m = used.get(p.a.name, 0), used.get(p.b.name, 0)
    follows = "" if n == m else f" (the estimate follows {one if n > m else other}, which proves nothing)"
    text += f"and nothing here tells which{follows}"
    fix = f"find out which, and leave it out: sources: {{{one}: {{use: score}}}} or {{{other}: {{use: score}}}}; "
    return error("contradiction", text, one, fix + "or give their lever arms")


def slow_pairs(chosen: Plan) -> tuple[list[Pair], set[str]]:
    """Pairs that parted slowly, however near they are, and the streams of which nothing tells whether they are wrong.

    A source that contradicts more others than any of these others does is outvoted, and none of them.
    """
    both = [p for p in pairs(chosen, 0.0) if not p.sudden]
    against: dict[str, set[str]] = {}
    for p in both:
        against.setdefault(p.a.stream, set()).add(p.b.stream)
        against.setdefault(p.b.stream, set()).add(p.a.stream)
    return both, {one for one, of in against.items() if len(of) <= max(len(against[other]) for other in of)}


def evened(chosen: Plan) -> Plan:
    """The plan in which both of a pair that parted slowly count as far off as they are apart.

    With what they claim each would be refused as soon as the other has been believed: the names would decide which, and
    a heading found between the two is anything.
    """
    both, spared = slow_pairs(chosen)
    least: dict[str, float] = {}
    for p in both:
        for one in (p.a.stream, p.b.stream) if {p.a.stream, p.b.stream} <= spared else ():
            least[one] = max(least.get(one, 0.0), float(np.median(p.off)))
    if not least:
        return chosen
    channels = tuple(counted(c, least.get(c.stream, 0.0)) for c in chosen.whole.channels)
    return replace(chosen, whole=replace(chosen.whole, channels=channels))


def counted(c: Channel, least: float) -> Channel:
    """A source of position with this least horizontal deviation [m]."""
    if not c.reset[1] or c.scored or least == 0.0:
        return c
    floor = c.floor.copy()
    floor[:2] = np.maximum(floor[:2], least)
    return replace(c, floor=floor)


def fair(found: list[Finding], chosen: Plan) -> list[Finding]:
    """Findings without those that accuse one of a pair that parted slowly, see `slow_pairs`; pairs that are too near
    each other to be called a contradiction are named instead."""
    both, spared = slow_pairs(chosen)
    if not both:
        return found
    names = {c.name for p in both for c in (p.a, p.b) if c.stream in spared} | spared
    near = [p for p in both if float(np.median(p.off)) <= APART and {p.a.stream, p.b.stream} <= spared]
    kept = [f for f in found if f.code not in ACCUSATIONS or f.source not in names]
    return kept + [asunder(p) for p in near]


def asunder(p: Pair) -> Finding:
    """The finding about a pair that may as well be two antennas."""
    one, other, middle = p.a.stream, p.b.stream, float(np.median(p.off))
    text = (
        f"{one} and {other} lie {middle:.2g} m apart, {middle / float(np.hypot(*p.claims)):.0f} times what both claim: "
    )
    text += "their antennas are in different places, or one of them wanders, and nothing here tells which; "
    text += f"both are counted as {middle:.2g} m"
    fix = f"give their lever arms, or leave one out: sources: {{{one}: {{use: score}}}} or {{{other}: {{use: score}}}}"
    return warning("apart", text, one, fix)


def apart(chosen: Plan, a: Channel, b: Channel) -> Floats:
    """(n,) m between two sources at the records of the one that lie between two near ones of the other."""
    (t, p), (u, q) = place(chosen, a), place(chosen, b)
    if t.size < 2 or u.size < 2:
        return np.zeros(0)
    k = np.clip(np.searchsorted(u, t), 1, u.size - 1)
    inside = (t >= u[0]) & (t <= u[-1]) & (u[k] - u[k - 1] < NEAR)
    there = np.column_stack([np.interp(t, u, q[:, i]) for i in range(2)])
    return np.asarray(np.hypot(*(p - there)[inside].T), np.float64)


def place(chosen: Plan, c: Channel) -> tuple[Floats, Floats]:
    """(n,) s and (n, 2) m of a source's usable positions."""
    s = chosen.log.streams[c.stream]
    p = site_position(s, chosen.datum) if s.kind is Kind.GNSS else s.z[:, :3]
    good = (chosen.verdicts[s.name] == Verdict.USED) & np.isfinite(p[:, :2]).all(axis=1)
    t, first = np.unique(s.t[good], return_index=True)
    return np.asarray((t - chosen.log.span[0]) * 1e-9, np.float64), p[good][first, :2]


def claim(chosen: Plan, c: Channel) -> float:
    """Standard deviation per axis [m] that a source claims, or is taken for it, with the slow part of plain fixes."""
    s = chosen.log.streams[c.stream]
    stated = stated_sigma(s) if c.trust_stated else np.full(len(s), np.nan)
    stated = stated[np.isfinite(stated)]
    sigma = c.scale * float(np.median(stated) if stated.size else c.sigma[0])
    fixed = "fix" in s.extra and float(np.median(s.extra["fix"])) == Fix.FIXED.value
    return sigma if fixed or s.kind is not Kind.GNSS else float(np.hypot(1.0, SLOW_FACTOR)) * sigma


def stated_sigma(s: Stream) -> Floats:
    """(n,) horizontal deviation [m] as stated."""
    if s.kind is Kind.GNSS:
        return claimed_sigma(s)
    var = np.where(s.var[:, :2] > 0.0, s.var[:, :2], np.nan).mean(axis=1)
    return np.sqrt(var)


__all__ = ["apart", "contradictions", "evened", "fair"]
