"""How the estimate began, what it learned, and where it was moved or nearly broken."""

from typing import Final

import numpy as np

from outrider.data import Finding, Run, Verdict
from outrider.filters.align import Alignment
from outrider.models.motion import Motion
from outrider.models.sensors import Sensor
from outrider.workflows.draft import Plan
from outrider.workflows.findings.say import any_absolute, error, info, warning

WHEEL_SCALE: Final = 0.01  # departure from one worth a line
INVALID: Final = 1.0  # s without a valid position worth a line
BROKEN: Final = 0.01  # share of undone updates beyond which the run has diverged


def alignment(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """How it started, and whether the heading is known."""
    out = [info("alignment", "start: " + "; ".join(aligned.how))]
    if aligned.heading_known or chosen.whole.motion is Motion.FOLLOWER or not len(run.fused.t):
        return out
    known = np.flatnonzero(run.fused.valid[:, 2])
    if known.size:
        t = (run.fused.t[known[0]] - run.start) * 1e-9
        return [*out, info("heading-late", f"heading was not observable before t = {t:.1f} s")]
    text = "yaw is unobservable: no source tells it and the robot did not move enough"
    fix = "drive a few metres, or fuse a dual antenna or another heading"
    return [*out, warning("heading-unobservable", text, fix=fix)]


def reliance(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Whether anything ties the run to a place, and for how long its position is not valid."""
    out: list[Finding] = []
    if not any_absolute(chosen):
        out.append(
            info("no-position", "nothing here tells where it is: the site frame begins at the start, and drifts")
        )
    t, valid = run.fused.t, run.fused.valid[:, 0] > 0
    lost = (1.0 - run.valid_shares[0]) * run.duration
    if lost < INVALID:
        return out
    begin = 0.0 if valid.all() or t[0] - run.start > INVALID * 1e9 else (t[int(np.argmin(valid))] - run.start) * 1e-9
    text = f"the position is not valid for {lost:.0f} s of {run.duration:.0f} s, first from t = {begin:.0f} s"
    say = info if valid[-1] else warning
    return [*out, say("position-invalid", text, fix="its covariance still bounds it; the report shows when")]


def preset(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """What a preset takes on trust."""
    name = run.config["preset"]
    if name == "robot_localization":
        text = "preset robot_localization: the attitude of the IMU is trusted as it stands and GNSS is not used"
        return [info("preset", text)]
    if name != "amr2025":
        return []
    text = "preset amr2025: the paper's own choice of RTK x, y, odometry v_x, v_y and the IMU's yaw. It puts filter on "
    text += "filter: that yaw has been filtered in the IMU, its errors are coloured and shared, and ours count as white"
    if not any(c.sensor is Sensor.YAW_OF_ATTITUDE for c in chosen.whole.channels):
        text += "; this log has no such yaw, so the raw rates stand in"
    return [info("preset", text, fix="the default preset fuses raw rates with a bias of their own")]


def wheel_scale(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """A wheel scale that is clearly not one."""
    layout = run.fused.layout
    if "wheel_scale" not in layout or not len(run.fused.t) or not any_absolute(chosen):
        return []
    s = float(run.fused.x[-1, layout.state("wheel_scale")][0])
    sd = float(run.fused.sd[-1, layout.error("wheel_scale")][0])
    if abs(s) < max(WHEEL_SCALE, 2 * sd):
        return []
    word = "long" if s < 0 else "short"
    text = f"the wheels measure {abs(100 * s):.1f} % too {word} (+-{200 * sd:.1f} %); the estimate corrects it"
    return [info("wheel-scale", text)]


def resets(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Every deliberate jump."""
    out: list[Finding] = []
    for r in run.resets:
        t = (r.t - run.start) * 1e-9
        text = f"position reset by {np.linalg.norm(r.delta):.1f} m towards {r.source} at t = {t:.1f} s: {r.reason}"
        out.append(warning("reset", text, r.source))
    return out


def divergence(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Updates that would have broken the estimate."""
    broken = sum(a.by_verdict.get(Verdict.DIVERGED, 0) for a in run.accounts)
    total = sum(sum(a.by_verdict.values()) for a in run.accounts)
    if not broken:
        return []
    code = "diverged" if broken > BROKEN * total else "near-divergence"
    text = f"{broken} updates would have made the estimate non-finite and were undone"
    return [error(code, text, fix="look for the first source with gated records")]
