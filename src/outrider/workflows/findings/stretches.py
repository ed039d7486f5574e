"""Stretches in which a source was not what it is otherwise: it jumped, or it kept far less than it claimed."""

from typing import Final

import numpy as np

from outrider.data import Finding, Fix, Innovations, Kind, Run, SensorState, Stream, Verdict
from outrider.filters.align import Alignment
from outrider.filters.channels import Channel, records
from outrider.typing import Bools, Floats
from outrider.workflows.assembly import claimed_sigma
from outrider.workflows.draft import Plan
from outrider.workflows.findings.say import warning

LASTING: Final = 1.0  # s that a jump lasts at least
FEW: Final = 3  # refused records in a row that are no accident: a gate of 0.999 has it once in 1e9
LONG: Final = 10  # the same for a source that is often refused
BEFORE: Final = 3.0  # s before a jump within which the source still agreed
MANY: Final = 30  # records that tell a scatter
TOO_SURE: Final = 3.0  # times that the scatter exceeds the claim
VISIBLE: Final = 0.05  # m of scatter; less may as well be the lever arm and the stamps
ALLOWED: Final = 0.7  # share of the scatter that the filter's own noise has to reach
ALLOW: Final = "the filter allows for it; do not use the covariances of this log as they stand"
MEDIAN_2D: Final = 1.386  # median of a chi-square of two degrees of freedom
LOOK: Final = "look at its innovations in the report; `scale` makes it count less"
RARE: Final = 0.1  # share of gated records up to which jumps are an accident of the place
SHOWN: Final = {"rad": ("deg", 180 / np.pi), "rad/s": ("deg/s", 180 / np.pi)}


def jumps(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Sources that went off for a while and came back: when, how far, and that the estimate did not follow."""
    out: list[Finding] = []
    for channel in chosen.whole.channels:
        if channel.scored or channel.name not in run.innovations:
            continue
        of = in_order(run.innovations[channel.name])
        found = jump_rows(of)
        if found:
            out.append(warning("jump", jump_text(run, channel, of, found), channel.stream, remedy(channel, of)))
    return out


def remedy(channel: Channel, i: Innovations) -> str:
    """What to do about jumps: nothing while they are rare."""
    if not channel.reset[1]:
        return LOOK
    share = float((i.verdict == Verdict.GATED).mean())
    if share <= RARE:
        return "reflections off walls do this: nothing to do while it is rare"
    return f"{100.0 * share:.0f} % of it is refused: it, or what it is held against, is wrong: leave that out"


def in_order(i: Innovations) -> Innovations:
    """The same innovations sorted by stamp."""
    k = np.argsort(i.t, kind="stable")
    return Innovations(
        t=i.t[k], y=i.y[k], s=i.s[k], nis=i.nis[k], dof=i.dof[k], verdict=i.verdict[k], z=i.z[k], columns=i.columns,
        units=i.units,
    )  # fmt: skip


def jump_rows(i: Innovations) -> list[tuple[int, int]]:
    """First and last row of each jump in innovations in order: a stretch that its gate refused and no reset ended.

    A source that is refused now and then all along has stretches by chance; they are jumps only if they are long.
    """
    gated = i.verdict == Verdict.GATED
    found = [
        (a, b) for a, b in stretches(gated)
        if b - a + 1 >= FEW and (i.t[b] - i.t[a]) * 1e-9 >= LASTING
        and (b + 1 >= i.t.size or i.verdict[b + 1] != Verdict.RESET)
    ]  # fmt: skip
    if 2 * sum(b - a + 1 for a, b in found) >= gated.sum():
        return found
    return [(a, b) for a, b in found if b - a + 1 >= LONG]


def stretches(flag: Bools) -> list[tuple[int, int]]:
    """First and last row of each stretch in which a flag stands."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def jump_text(run: Run, channel: Channel, i: Innovations, found: list[tuple[int, int]]) -> str:
    """One line on the largest jump of a source and how many there were."""
    a, b = max(found, key=lambda span: float(np.median(i.nis[span[0] : span[1] + 1])))
    agreed = a > 0 and i.verdict[a - 1] == Verdict.USED and (i.t[a] - i.t[a - 1]) * 1e-9 < BEFORE
    noun = "jump" if agreed and channel.reset[1] else "disagreement"
    begin, end = (i.t[[a, b]] - run.start) * 1e-9
    gated = sum(last - first + 1 for first, last in found)
    held = int((i.verdict == Verdict.FAULTED).sum())
    text = f"{channel.name}: " + (f"{noun} of " if len(found) == 1 else f"{len(found)} {noun}s, the worst of ")
    text += f"{how_far(i, a, b)} from t = {begin:.1f} to {end:.1f} s: {gated} records gated"
    text += f", then {held} held back on probation" if held else ""
    faulted = any(x.source == channel.name and x.state is SensorState.FAULTED for x in run.accounts)
    return text + "; the estimate did not follow" + ("; it ended in the faulted state" if faulted else "")


def how_far(i: Innovations, a: int, b: int) -> str:
    """The typical innovation of rows a to b: its length and parts, in the units that people read."""
    y = np.median(i.y[a : b + 1], axis=0)
    used = [k for k in range(len(i.columns)) if np.isfinite(y[k])]
    worst = max(used, key=lambda k: abs(y[k]) / max(float(np.median(i.s[a : b + 1, k])), 1e-12))
    used = [k for k in used if i.units[k] == i.units[worst]]
    unit, factor = SHOWN.get(i.units[worst], (i.units[worst], 1.0))
    size = f"{factor * float(np.linalg.norm(y[used])):.3g} {unit}".rstrip(" 1")
    parts = ", ".join(f"{factor * y[k]:+.1f} {i.columns[k]}" for k in used)
    return size if len(used) == 1 else f"{size} ({parts})"


def overclaimed(run: Run, chosen: Plan, channel: Channel) -> list[Finding]:
    """Fix types for which a receiver claims far less than its fixes scatter about the estimate.

    Its claims are compared, not the noise that the filter took; what of the scatter is the estimate's own uncertainty
    is taken off, and the median bears with jumps.
    """
    s = chosen.log.streams[channel.stream]
    if s.kind is not Kind.GNSS or not channel.trust_stated or len(s) < MANY:
        return []
    part = records(channel, s, chosen.verdicts[channel.stream], chosen.datum)
    i, order = run.innovations[channel.name], np.argsort(part.t, kind="stable")
    row = order[np.clip(np.searchsorted(part.t[order], i.t), 0, order.size - 1)]  # of `part`, per innovation
    fix, claims = fix_types(s), claimed_sigma(s)[part.row][row]
    judged = np.isin(i.verdict, [Verdict.USED, Verdict.GATED, Verdict.RESET]) & np.isfinite(claims)
    judged &= np.isfinite(i.y[:, :2]).all(axis=1)
    out: list[Finding] = []
    for kind in np.unique(fix[part.row]):
        here = judged & (fix[part.row][row] == kind)
        if here.sum() < MANY:
            continue
        claim, taken = float(np.median(claims[here])), part.r[row[here], :2].mean(axis=1)
        own = float(np.median(i.s[here, :2].max(axis=1) ** 2 - taken))
        off = scatter(i.y[here, :2])
        if off > VISIBLE and off**2 - max(own, 0.0) > (TOO_SURE * claim) ** 2:
            when = when_its_fix(run, s, Fix(int(kind)))
            out.append(claim_finding(channel, claim, off, float(np.sqrt(np.median(taken))), int(here.sum()), when))
    return out


def claim_finding(channel: Channel, claim: float, off: float, counted: float, n: int, when: str) -> Finding:
    """What a receiver claims [m], what it keeps, and what the filter took instead."""
    times = f"{off / claim:.0f}"
    text = f"{channel.stream} claims {claim:.2g} m but is off by {off:.2g} m, {times} times more{when}: "
    text += f"{n} records, counted as {counted:.2g} m"
    fix = ALLOW if counted >= ALLOWED * off else f"sources: {{{channel.stream}: {{scale: {times}}}}}"
    return warning("overconfident", text, channel.stream, fix)


def fix_types(s: Stream) -> Floats:
    """(n,) `Fix` codes."""
    return s.extra.get("fix", np.full(len(s), float(Fix.UNKNOWN.value)))


def scatter(y: Floats) -> float:
    """Standard deviation per axis [m] of innovations (n, 2), of the better half of them."""
    return float(np.sqrt(np.median((y**2).sum(axis=1)) / MEDIAN_2D))


def when_its_fix(run: Run, s: Stream, kind: Fix) -> str:
    """While its fix is ..., from when to when; nothing if it never is another."""
    order = np.argsort(s.t, kind="stable")
    here = fix_types(s)[order] == kind.value
    if here.all():
        return ""
    spans = (s.t[order][np.array(stretches(here))] - run.start) * 1e-9
    begin, end = spans[int(np.argmax(spans[:, 1] - spans[:, 0]))]
    many = f"in {len(spans)} stretches, the longest " if len(spans) > 1 else ""
    return f", while its fix is {kind.name.lower()}, {many}t = {begin:.1f} to {end:.1f} s"
