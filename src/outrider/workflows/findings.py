"""What the run says about the data: plain statements, each with a cause and a remedy.

One function per question; each looks at a finished run (and the plan it came from) and returns findings.
"""

from typing import Final

import numpy as np

from outrider.data import Finding, Kind, Run, SensorState, Stream, Verdict
from outrider.filters.align import HEADINGS, Alignment
from outrider.models.motion import Motion
from outrider.models.sensors import Sensor
from outrider.typing import Floats
from outrider.workflows.discover import Plan

CONFLICT: Final = np.radians(10.0)
GRAVITY: Final = 9.81
GAP: Final = 3.0  # s without a usable fix that is worth a line
OVERCONFIDENT: Final = 3.0  # mean NIS per degree of freedom
WHEEL_SCALE: Final = 0.01


def judge(run: Run, chosen: Plan, aligned: Alignment) -> tuple[Finding, ...]:
    """All findings, worst first."""
    found: list[Finding] = list(chosen.findings)
    for question in (
        alignment, heading_conflicts, gravity_and_mounts, units, unused_sources, outages, confidence, wheel_scale,
        resets, refusals, covariances, clocks, divergence,
    ):  # fmt: skip
        found += question(run, chosen, aligned)
    order = {"error": 0, "warning": 1, "info": 2}
    return tuple(sorted(found, key=lambda f: order[f.severity]))


def finding(severity: str, code: str, text: str, source: str = "", fix: str = "") -> Finding:
    return Finding(severity=severity, code=code, text=text, source=source, fix=fix)


def alignment(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """How it started, and whether the heading is known."""
    out = [finding("info", "alignment", "start: " + "; ".join(aligned.how))]
    if aligned.heading_known or chosen.whole.motion is Motion.FOLLOWER or not len(run.fused.t):
        return out
    known = np.flatnonzero(run.fused.valid[:, 2])
    if known.size:
        t = (run.fused.t[known[0]] - run.start) * 1e-9
        out.append(finding("info", "heading-late", f"heading was not observable before t = {t:.1f} s"))
    else:
        out.append(
            finding("warning", "heading-unobservable",
                    "yaw is unobservable: no source tells it and the robot did not move enough",
                    fix="drive a few metres, or fuse a dual antenna or another heading")
        )  # fmt: skip
    return out


def heading_conflicts(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Headings that were only compared: how far they are from the heading of motion."""
    out: list[Finding] = []
    if not len(run.fused.t) or not run.fused.valid[:, 2].any() or not any_absolute(chosen):
        return out
    for channel in chosen.whole.channels:
        if channel.sensor not in HEADINGS or channel.sensor in (Sensor.POSE, Sensor.ATTITUDE, Sensor.MAG_VECTOR):
            continue
        if channel.name not in run.innovations:
            continue
        innovations = run.innovations[channel.name]
        at = np.clip(np.searchsorted(run.fused.t, innovations.t), 0, run.fused.t.size - 1)
        y = innovations.y[run.fused.valid[at, 2] > 0, 0]
        y = y[np.isfinite(y)]
        if y.size < 10:
            continue
        phasor = np.exp(1j * y).mean()
        mean, spread = float(np.angle(phasor)), float(np.sqrt(max(-2 * np.log(max(abs(phasor), 1e-12)), 0.0)))
        if abs(mean) < CONFLICT and spread < CONFLICT:
            continue
        use = "it is not fused" if channel.scored else "it is fused, behind its gate"
        out.append(
            finding("warning", "heading-conflict",
                    f"heading conflict: {channel.name} differs from the heading of motion by {np.degrees(mean):+.0f} deg "
                    f"(spread {np.degrees(spread):.0f} deg); {use}",
                    channel.stream,
                    "a magnetic heading near metal or with a wrong reference does this; calibrate it or leave it scored")
        )  # fmt: skip
    return out


def any_absolute(chosen: Plan) -> bool:
    """Whether anything but a heading source ties the run to the site frame."""
    return any(c.reset[1] > 0 and not c.scored for c in chosen.whole.channels)


def gravity_and_mounts(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Mounts nobody gave, and mounts that gravity contradicts."""
    out: list[Finding] = []
    frames = chosen.log.mounts
    told = run.config["mounts"]
    for channel in chosen.whole.channels:
        s = chosen.log.streams[channel.stream]
        if s.kind is not Kind.IMU or channel.sensor is Sensor.SPECIFIC_FORCE:
            continue
        f = mean_force(s)
        if f is None:
            continue
        body = channel.mount.reshape(3, 3) @ f
        given = s.frame in frames or (isinstance(told, dict) and s.frame in told)
        if abs(np.linalg.norm(f) - GRAVITY) > 1.5:
            continue  # `units` has a word on it
        tilt = np.degrees(np.arccos(np.clip(body[2] / np.linalg.norm(body), -1, 1)))
        if tilt > 30.0:
            axis = "xyz"[int(np.argmax(np.abs(f)))]
            sign = "+" if f["xyz".index(axis)] > 0 else "-"
            why = "the mount given for it is wrong" if given else "no mount was given for it"
            out.append(
                finding("error", "mount-conflict",
                        f"gravity lies along the {sign}{axis} axis of {s.frame or s.name}, {tilt:.0f} deg from the body's "
                        f"up axis: {why}",
                        s.name, f"give its rotation: mounts: {{{s.frame or s.name}: {{rpy_deg: [roll, pitch, yaw]}}}}")
            )  # fmt: skip
        elif not given:
            out.append(
                finding("info", "mount-assumed", f"no mount is known for {s.frame or s.name}: taken as straight, at the "
                        "body origin", s.name, "give it under `mounts` if it is turned or away from the origin")
            )  # fmt: skip
    return out


def mean_force(s: Stream) -> Floats | None:
    """Median specific force of an IMU in its own axes, None without an accelerometer."""
    f = s.z[np.isfinite(s.z[:, 3:6]).all(axis=1), 3:6]
    if len(f) < 10 or not np.abs(f).any():
        return None
    return np.median(f[:: max(1, len(f) // 20000)], axis=0)


def units(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Accelerations in g, rates in degrees: named, not guessed away."""
    out: list[Finding] = []
    for s in chosen.log.of(Kind.IMU):
        f = mean_force(s)
        if f is not None:
            norm = float(np.linalg.norm(f))
            if 0.9 < norm < 1.1:
                out.append(finding("error", "unit-g", f"{s.name} reports accelerations in g, not m/s^2 "
                                   f"(median {norm:.2f})", s.name, "convert it with a CSV mapping, or mend the driver"))  # fmt: skip
            elif abs(norm - GRAVITY) > 1.5:
                out.append(finding("warning", "no-gravity", f"the accelerations of {s.name} have a median of {norm:.1f} "
                                   "m/s^2, not 9.8", s.name, "it may have gravity removed already, or another unit"))  # fmt: skip
        rates = np.abs(s.z[np.isfinite(s.z[:, :3]).all(axis=1), :3])
        if rates.size and float(np.percentile(rates, 95)) > 12.0:
            out.append(finding("error", "unit-deg", f"the rates of {s.name} look like degrees per second (95 % below "
                               f"{np.percentile(rates, 95):.0f})", s.name, "they must be rad/s"))  # fmt: skip
    return out


def unused_sources(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Sources that were meant to be fused and contributed nothing, and those that fell silent."""
    out = [
        finding("error", "never-used", f"{name} was to be fused and contributed nothing", name,
                "its row in the source table has the reason")
        for name in run.used_nothing_of
    ]  # fmt: skip
    end = (run.fused.t[-1] - run.start) * 1e-9 if len(run.fused.t) else 0.0
    for a in run.accounts:
        if a.role.startswith("fused") and a.used and np.isfinite(a.rate) and end - a.last > max(GAP, 20 / a.rate):
            if "at rest" not in a.source:
                out.append(finding("warning", "silent", f"{a.source} fell silent at t = {a.last:.1f} s, "
                                   f"{end - a.last:.0f} s before the end", a.source))  # fmt: skip
    return out


def outages(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Stretches without a fused position."""
    out: list[Finding] = []
    for channel in chosen.whole.channels:
        if channel.reset[1] == 0 or channel.scored or channel.name not in run.innovations:
            continue
        innovations = run.innovations[channel.name]
        used = np.isin(innovations.verdict, [int(Verdict.USED), int(Verdict.RESET)])
        t = np.concatenate([innovations.t[used], run.fused.t[-1:]])
        if t.size < 2 or "(fixed)" in channel.name:
            continue
        gaps = np.diff(t) * 1e-9
        period = np.median(gaps)
        long = np.flatnonzero(gaps > max(GAP, 10 * period))
        if long.size:
            worst = long[int(np.argmax(gaps[long]))]
            since = (t[worst] - run.start) * 1e-9
            out.append(
                finding("info", "outage", f"{channel.name}: {long.size} stretch(es) without a fused position, the longest "
                        f"{gaps[worst]:.0f} s from t = {since:.0f} s", channel.stream)
            )  # fmt: skip
    return out


def confidence(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Sources whose innovations do not fit their stated noise."""
    out: list[Finding] = []
    for channel in chosen.whole.channels:
        if channel.scored or channel.name not in run.innovations or channel.sensor is None:
            continue
        innovations = run.innovations[channel.name]
        judged = np.isin(innovations.verdict, [int(Verdict.USED), int(Verdict.GATED), int(Verdict.RESET)])
        if judged.sum() < 30:
            continue
        ratio = float(np.median(innovations.nis[judged] / innovations.dof[judged]))
        if ratio > OVERCONFIDENT:
            out.append(
                finding("warning", "overconfident", f"{channel.name} scatters about {np.sqrt(ratio / 0.5):.1f} times more "
                        "than its stated noise", channel.stream, f"sources: {{{channel.stream}: {{scale: "
                        f"{np.sqrt(ratio / 0.5):.1f}}}}}")
            )  # fmt: skip
    return out


def wheel_scale(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """A wheel scale that is clearly not one."""
    if "wheel_scale" not in run.fused.layout or not len(run.fused.t) or not any_absolute(chosen):
        return []
    s = float(run.fused.x[-1, run.fused.layout.state("wheel_scale")][0])
    sd = float(run.fused.sd[-1, run.fused.layout.error("wheel_scale")][0])
    if abs(s) < max(WHEEL_SCALE, 2 * sd):
        return []
    word = "long" if s < 0 else "short"
    return [finding("info", "wheel-scale", f"the wheels measure {abs(100 * s):.1f} % too {word} (+-{200 * sd:.1f} %); "
                    "the estimate corrects it")]  # fmt: skip


def resets(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Every deliberate jump."""
    return [
        finding("warning", "reset", f"position reset by {np.linalg.norm(r.delta):.1f} m towards {r.source} at t = "
                f"{(r.t - run.start) * 1e-9:.1f} s: {r.reason}", r.source)
        for r in run.resets
    ]  # fmt: skip


def refusals(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Sources that lost a notable share of their records, with the main reason."""
    out: list[Finding] = []
    ordinary = {
        Verdict.USED,
        Verdict.INPUT,
        Verdict.RESET,
        Verdict.WITHHELD,
        Verdict.NOT_OBSERVING,
        Verdict.NOT_ALIGNED,
    }
    for a in run.accounts:
        lost = {v: c for v, c in a.by_verdict.items() if v not in ordinary}
        total = sum(a.by_verdict.values())
        if total and sum(lost.values()) > max(0.02 * total, 2) and a.role.startswith("fused"):
            worst = max(lost, key=lambda v: lost[v])
            out.append(
                finding("warning", "refused", f"{a.source}: {sum(lost.values())} of {total} records refused, mostly "
                        f"because: {worst.name.lower().replace('_', ' ')} ({lost[worst]})", a.source)
            )  # fmt: skip
        if a.state is SensorState.FAULTED:
            out.append(finding("warning", "faulted", f"{a.source} ended in the faulted state", a.source))
    return out


def covariances(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Fused sources that state no noise, so that ours was taken."""
    silent = sorted({
        c.stream
        for c in chosen.whole.channels
        if c.sensor is not None and not c.scored and not np.isfinite(chosen.log.streams[c.stream].var).any()
    })  # fmt: skip
    if not silent:
        return []
    return [finding("info", "unstated-noise", f"no noise is stated by {', '.join(silent)}: default values were taken",
                    fix="give `sigma` if you know it")]  # fmt: skip


def clocks(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Stamps that run backwards or lag behind their arrival."""
    out: list[Finding] = []
    for s in chosen.log:
        if len(s) < 3:
            continue
        backwards = int((np.diff(s.t) < 0).sum())
        if backwards:
            out.append(finding("warning", "stamps-backwards", f"{s.name}: {backwards} stamps step back in time; the "
                               "records were put in their place", s.name))  # fmt: skip
        lag = np.median(s.t_arrival - s.t) * 1e-9
        if 0.3 < abs(lag) < 3600:
            out.append(finding("info", "latency", f"{s.name} arrives {lag:.2f} s after its stamps", s.name))
    return out


def divergence(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Updates that would have broken the estimate."""
    broken = sum(a.by_verdict.get(Verdict.DIVERGED, 0) for a in run.accounts)
    total = sum(sum(a.by_verdict.values()) for a in run.accounts)
    if not broken:
        return []
    severity = "diverged" if broken > 0.01 * total else "near-divergence"
    return [finding("error", severity, f"{broken} updates would have made the estimate non-finite and were undone",
                    fix="look for the first source with gated records")]  # fmt: skip


__all__ = ["judge"]
