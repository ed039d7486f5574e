"""Evidence in what came of the run: headings, scatter, disagreement, how sure it was."""

from typing import Final

import numpy as np

from outrider.data import Finding, Innovations, Kind, Verdict
from outrider.data.evidence import BARS, POINTS, REFUSED, Curve, Evidence
from outrider.typing import Floats
from outrider.workflows.assembly import claimed_sigma
from outrider.workflows.evidence.case import Case, curve, histogram, present
from outrider.workflows.findings.agreement import heading_differences
from outrider.workflows.findings.contradiction import apart

TIME: Final = "time from start [s]"
LEAST: Final = 1e-3  # of a logarithmic axis
NINETY_FIVE: Final = 2.448  # deviations per axis: the radius that holds 95 % of a plane's Gaussian


def headings(case: Case, f: Finding) -> Evidence | None:
    """Claimed against estimated heading."""
    own = case.innovations(f)
    if own is None:
        return None
    y, yaw = heading_differences(case.run, own[1])
    claimed = np.degrees(np.angle(np.exp(1j * (yaw + y))))
    points = curve(np.degrees(np.angle(np.exp(1j * yaw))), claimed, "", POINTS)
    if points is None:
        return None
    same = Curve(x=np.array([-180.0, 180.0]), y=np.array([-180.0, 180.0]), name="the same")
    text = "Each dot is one record. A right heading lies along the line; a shifted zero moves the dots beside it, "
    text += "a mirrored sense crosses it."
    return Evidence(
        x_label="heading of motion [deg]", y_label="heading it claims [deg]", curves=(points, same), text=text,
        square=True,
    )  # fmt: skip


def scatter(case: Case, f: Finding) -> Evidence | None:
    """How far off a source is, beside what it claims."""
    own = case.innovations(f)
    if own is None:
        return None
    channel, i = own
    s = case.chosen.log.streams[channel.stream]
    if s.kind is Kind.GNSS and np.isfinite(claimed_sigma(s)).any():
        order = np.argsort(s.t, kind="stable")
        bound = np.maximum(NINETY_FIVE * claimed_sigma(s)[order], LEAST)
        claim = curve(case.since(s.t[order]), bound, "95 % by its own claim")
        off = curve(case.since(i.t), np.maximum(size(i), LEAST), "off by", POINTS)
        text = "Distance of each fix from where the other sources and the fixes before put it. By what the receiver "
        text += "claims, one dot in twenty would lie above the line."
        return Evidence(x_label=TIME, y_label="[m]", curves=present(off, claim), text=text, log_y=True)
    judged = np.isin(i.verdict, [Verdict.USED, Verdict.GATED, Verdict.RESET])
    bars = histogram((i.y[judged] / np.where(i.s[judged] > 0.0, i.s[judged], np.nan)).ravel(), "seen")
    return bars and Evidence(
        x_label="difference, in deviations that it should have", y_label="share", curves=(bars, bell(bars)),
        text="Differences between record and estimate over what they should be. Stated rightly, they fill the curve.",
    )  # fmt: skip


def bell(bars: Curve) -> Curve:
    """What a histogram of Gaussian numbers would be, on the same bars."""
    wide = float(bars.x[1] - bars.x[0])
    x = np.linspace(bars.x[0], bars.x[-1], 121)
    return Curve(x=x, y=wide * np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi), name="as stated")


def size(i: Innovations) -> Floats:
    """(n,) lengths of innovations; of a position the horizontal one."""
    flat = [k for k in range(len(i.columns)) if i.columns[k] in ("east", "north")] or list(range(len(i.columns)))
    return np.sqrt(np.sum(np.nan_to_num(i.y[:, flat]) ** 2, axis=1))


def disagreement(case: Case, f: Finding) -> Evidence | None:
    """How far from the estimate each record was, those refused apart."""
    own = case.innovations(f)
    if own is None or (f.code == "refused" and not (own[1].verdict == Verdict.GATED).any()):
        return account(case, f)
    channel, i = own
    t, off = case.since(i.t), np.maximum(size(i), LEAST)
    refused = np.isin(i.verdict, [Verdict.GATED, Verdict.FAULTED, Verdict.DIVERGED])
    used = curve(t[~refused], off[~refused], "compared only" if channel.scored else "fused", POINTS)
    not_used = curve(t[refused], off[refused], "refused", REFUSED)
    units = set(i.units)
    unit = {"rad": "rad", "rad/s": "rad/s", "1": ""}.get(only := next(iter(units)), only) if len(units) == 1 else ""
    at = tuple(
        ((r.t - case.run.start) * 1e-9, "reset") for r in case.run.resets if r.source in (channel.stream, channel.name)
    )
    text = "Distance of each record from what the estimate expected just before it."
    return Evidence(
        x_label=TIME, y_label=f"off by [{unit}]" if unit else "off by", curves=present(used, not_used), text=text,
        log_y=True, at=at if f.code == "reset" else (),
    ) if present(used, not_used) else None  # fmt: skip


def two_places(case: Case, f: Finding) -> Evidence | None:
    """How far two sources of position are from each other."""
    ours = {c.stream: c for c in case.chosen.whole.channels if c.reset[1] and not c.scored}
    b = next(
        (c for name, c in ours.items() if f" and {name} {'lie' if f.code == 'apart' else 'contradict'}" in f.text), None
    )
    if b is None or f.source not in ours:
        return None
    off = apart(case.chosen, ours[f.source], b)
    drawn = curve(np.arange(float(off.size)), np.maximum(off, LEAST), "", POINTS)
    text = f"Distance between the positions of {f.source} and {b.stream} at the same times."
    return drawn and Evidence(x_label="record", y_label="apart [m]", curves=(drawn,), text=text, log_y=True)


def account(case: Case, f: Finding) -> Evidence | None:
    """What became of the records of a source that has no innovations."""
    a = next((a for a in case.run.accounts if f.source in (a.source, a.source.partition(" (")[0])), None)
    many = [(Verdict(v), n) for v, n in a.by_verdict.items() if n] if a is not None else []
    if not many:
        return None
    bars = Curve(x=np.arange(float(len(many))), y=np.array([float(n) for _, n in many]), drawn=BARS)
    names = tuple(v.name.lower().replace("_", " ") for v, _ in many)
    return Evidence(x_label="", y_label="records", curves=(bars,), text="What became of its records.", names=names)


def position_deviation(case: Case, f: Finding) -> Evidence | None:
    """How well the position was known."""
    pose = case.run.fused.pose
    if not len(pose.P):
        return None
    sd = np.sqrt(np.maximum(np.maximum(pose.P[:, 0, 0], pose.P[:, 1, 1]), LEAST**2))
    drawn = curve(case.since(pose.t), sd, "one standard deviation")
    text = "How well the position is known, by the estimate's own account. It grows while nothing tells the place."
    return drawn and Evidence(x_label=TIME, y_label="[m]", curves=(drawn,), text=text, log_y=True)


def heading_deviation(case: Case, f: Finding) -> Evidence | None:
    """How well the heading was known."""
    pose = case.run.fused.pose
    if not len(pose.P):
        return None
    sd = np.degrees(np.sqrt(np.maximum(pose.P[:, 5, 5], 0.0)))
    drawn = curve(case.since(pose.t), np.clip(sd, LEAST, 180.0), "one standard deviation")
    text = "How well the heading is known, by the estimate's own account: above some 60 deg not at all."
    return drawn and Evidence(x_label=TIME, y_label="[deg]", curves=(drawn,), text=text, log_y=True)


__all__ = ["disagreement", "heading_deviation", "headings", "position_deviation", "scatter", "two_places"]
