"""How the sources got on with the estimate: who fell silent, was refused, disagreed, or is too sure of itself."""

from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np

from outrider.data import Account, Finding, Innovations, Run, SensorState, Verdict
from outrider.filters.align import HEADINGS, Alignment
from outrider.filters.channels import Channel
from outrider.models.sensors import Sensor
from outrider.typing import Floats, Ints
from outrider.workflows.clocks import WRONG_STAMPS
from outrider.workflows.draft import Plan
from outrider.workflows.findings.say import any_absolute, error, info, warning
from outrider.workflows.findings.steps import float_steps
from outrider.workflows.findings.stretches import LOOK, in_order, jump_rows, overclaimed

CONFLICT: Final = np.radians(10.0)  # mean difference of headings worth a line
SCATTER: Final = np.radians(20.0)  # scatter of the same
GAP: Final = 3.0  # s without a usable record that is worth a line
OVERCONFIDENT: Final = 3.0  # median NIS per degree of freedom
CONTRADICTED: Final = 25.0  # the same, of a source that is not fused
HALF: Final = 0.5  # about what it is for a source whose noise is as stated
REFUSED: Final = 0.02  # share of refused records that is worth a line
ENOUGH: Final = 10  # records that a mean is worth something
NEVER_FUSED: Final = (Sensor.POSE, Sensor.ATTITUDE, Sensor.MAG_VECTOR)  # no single angle to compare
ORDINARY: Final = frozenset({
    Verdict.USED, Verdict.INPUT, Verdict.RESET, Verdict.WITHHELD, Verdict.NOT_OBSERVING, Verdict.NOT_ALIGNED
})  # fmt: skip
REMEDIES: Final = {
    Verdict.LATE: "raise `history_s` above the delay with which they arrive",
    Verdict.GATED: LOOK,
    Verdict.FROZEN: "its driver sends the last value again: restart or mend it",
}


def heading_conflicts(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Headings that are not the heading of motion."""
    if not len(run.fused.t) or not run.fused.valid[:, 2].any() or not any_absolute(chosen):
        return []
    out: list[Finding] = []
    for channel in chosen.whole.channels:
        if channel.sensor not in HEADINGS or channel.sensor in NEVER_FUSED or channel.name not in run.innovations:
            continue
        y, yaw = heading_differences(run, run.innovations[channel.name])
        if y.size < ENOUGH:
            continue
        mean, spread = circular(y)
        if abs(mean) < CONFLICT and spread < SCATTER:
            continue
        text = f"heading conflict: {channel.name} differs from the heading of motion by {np.degrees(mean):+.0f} deg "
        text += f"(spread {np.degrees(spread):.0f} deg)" + convention(mean, y, yaw, spread)
        text += "; it is not fused" if channel.scored else "; it is fused, behind its gate"
        fix = "metal nearby or a wrong reference does this to a magnetic heading; calibrate it, or leave it scored"
        out.append(warning("heading-conflict", text, channel.stream, fix))
    return out


def heading_differences(run: Run, innovations: Innovations) -> tuple[Floats, Floats]:
    """Claimed minus estimated heading and the estimated one [rad], wherever the latter is valid."""
    at = np.clip(np.searchsorted(run.fused.t, innovations.t), 0, run.fused.t.size - 1)
    keep = (run.fused.valid[at, 2] > 0) & np.isfinite(innovations.y[:, 0])
    return innovations.y[keep, 0], run.fused.pose.yaw[at[keep]]


def circular(angles: Floats) -> tuple[float, float]:
    """Mean and standard deviation on the circle [rad]."""
    phasor = np.exp(1j * angles).mean()
    return float(np.angle(phasor)), float(np.sqrt(max(-2 * np.log(max(abs(phasor), 1e-12)), 0.0)))


def convention(mean: float, y: Floats, yaw: Floats, spread: float) -> str:
    """What another zero or another sense of rotation would explain."""
    offset, mirrored = circular(y + 2 * yaw)
    if mirrored < 0.5 * spread and spread > SCATTER:
        return f", as if it turned clockwise, with its zero {np.degrees(offset):+.0f} deg from east"
    quarters = round(mean / (np.pi / 2))
    if quarters == 0:
        return ""
    left = f"{np.degrees(mean - quarters * np.pi / 2):+.0f} deg would remain"
    return (
        f"; {left} if its zero were north instead of east" if quarters == -1 else f"; {left} without {90 * quarters:+d}"
    )


def silence(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Sources that were meant to be fused and contributed nothing, and those that fell silent."""
    out: list[Finding] = []
    end = (run.fused.t[-1] - run.start) * 1e-9 if len(run.fused.t) else 0.0
    for name, members in by_stream(run, chosen):
        accounts = [a for c, a in members if a.role.startswith("fused") and not c.still]
        if accounts and all(a.source in run.used_nothing_of for a in accounts):
            text = f"{name} was to be fused and contributed nothing"
            out.append(error("never-used", text, name, "its row in the source table has the reason"))
        last = max((a.last for a in accounts if a.used), default=np.nan)
        rate = accounts[0].rate if accounts else np.nan
        if np.isfinite(last) and np.isfinite(rate) and end - last > max(GAP, 20 / rate):
            text = f"{name} fell silent at t = {last:.1f} s, {end - last:.0f} s before the end"
            out.append(warning("silent", text, name))
    return out


def by_stream(run: Run, chosen: Plan) -> Iterator[tuple[str, list[tuple[Channel, Account]]]]:
    """Channels of each stream with their accounts."""
    pairs = list(zip(chosen.whole.channels, run.accounts, strict=False))  # the accounts of channels come first
    for name in dict.fromkeys(c.stream for c, _ in pairs):
        yield name, [(c, a) for c, a in pairs if c.stream == name]


def fused_positions(run: Run, members: Iterable[tuple[Channel, Account]]) -> Ints:
    """(n,) stamps [ns] of the fused positions of a stream, of any kind of fix, and of the end; none without any."""
    positions = [run.innovations[c.name] for c, a in members if c.reset[1] and c.name in run.innovations and a.used]
    used = [i.t[np.isin(i.verdict, [Verdict.USED, Verdict.RESET])] for i in positions]
    return np.sort(np.concatenate([*used, run.fused.t[-1:]])) if used else np.zeros(0, np.int64)


def outages(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Stretches in which a source of position gave none that was fused."""
    out: list[Finding] = []
    for name, members in by_stream(run, chosen):
        t = fused_positions(run, members)
        if not len(t):
            continue
        gaps = np.diff(t) * 1e-9
        long = np.flatnonzero(gaps > max(GAP, 10 * float(np.median(gaps))))
        if long.size:
            worst = long[int(np.argmax(gaps[long]))]
            stretches = "one stretch" if long.size == 1 else f"{long.size} stretches, the longest"
            since = (t[worst] - run.start) * 1e-9
            text = f"{name}: no fused position in {stretches} of {gaps[worst]:.0f} s from t = {since:.0f} s"
            out.append(info("outage", text, name))
    return out


def confidence(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Sources whose innovations do not fit their stated noise."""
    out: list[Finding] = []
    for channel in chosen.whole.channels:
        if channel.name not in run.innovations or channel.sensor is None:
            continue
        innovations = run.innovations[channel.name]
        if channel.scored:
            out += contradicted(channel, innovations)
            continue
        judged = np.isin(innovations.verdict, [Verdict.USED, Verdict.GATED, Verdict.RESET])
        if judged.sum() < 3 * ENOUGH:
            continue
        claims = overclaimed(run, chosen, channel) or float_steps(chosen, channel)
        out += claims
        ratio = float(np.median(innovations.nis[judged] / innovations.dof[judged]))
        if ratio > OVERCONFIDENT and not claims:
            times = f"{np.sqrt(ratio / HALF):.1f}"
            text = f"{channel.name} scatters about {times} times more than its stated noise"
            fix = f"sources: {{{channel.stream}: {{scale: {times}}}}}"
            out.append(warning("overconfident", text, channel.stream, fix))
    return out


def contradicted(channel: Channel, innovations: Innovations) -> list[Finding]:
    """A source of position that is only compared, and that the estimate is far from for what both claim."""
    seen = innovations.dof > 0
    if not channel.reset[1] or seen.sum() < 3 * ENOUGH:
        return []
    ratio = float(np.median(innovations.nis[seen] / innovations.dof[seen]))
    if ratio < CONTRADICTED:
        return []
    off = float(np.median(np.linalg.norm(np.nan_to_num(innovations.y[seen][:, : channel.reset[1]]), axis=1)))
    text = (
        f"{channel.name}, which is only compared, lies {off:.3g} m from the estimate, {np.sqrt(ratio):.0f} times what "
    )
    text += "both claim: one of them is wrong"
    return [warning("contradicted", text, channel.stream, "fuse it, or find out what leads the estimate astray")]


def refusals(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Sources that lost a notable share of their records, with the main reason."""
    out: list[Finding] = []
    for a in run.accounts:
        lost = {v: c for v, c in a.by_verdict.items() if v not in ORDINARY and v not in WRONG_STAMPS}
        total = sum(a.by_verdict.values())
        jumped = refused_in_jumps(run, a.source)
        if total and sum(lost.values()) > max(REFUSED * total, 2, 2 * jumped) and a.role.startswith("fused"):
            worst = max(lost, key=lambda v: lost[v])
            why = worst.name.lower().replace("_", " ")
            text = f"{a.source}: {sum(lost.values())} of {total} records refused, mostly because: {why} ({lost[worst]})"
            say = info if worst is Verdict.NO_FIX else warning
            out.append(say("refused", text, a.source, REMEDIES.get(worst, "")))
        if a.state is SensorState.FAULTED and not jumped:  # else its jump says so
            out.append(warning("faulted", f"{a.source} ended in the faulted state", a.source))
    return out


def refused_in_jumps(run: Run, source: str) -> int:
    """How many of a source's refused records another finding has named already."""
    if source not in run.innovations:
        return 0
    of = in_order(run.innovations[source])
    return sum(b - a + 1 for a, b in jump_rows(of))
