"""What a robot still does when its trajectory is blocked: slower, stop, back out, ask for another path."""

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from outrider.data.driving import Conflict, DriveLimits, LocalOutcome, LocalPlan, Situation
from outrider.safety.clearance import Around, Body, clash
from outrider.safety.stopping import braking, moved, saturated, smoothed, stop
from outrider.typing import Floats

SHARES: Final = (1.0, 0.8, 0.6, 0.4, 0.2)  # of a command that are tried before stopping
PATIENCE: Final = 20  # answers that a robot waits for what is in the way to go away
ROOM: Final = 0.5  # m to back out
STILL: Final = 0.02  # m/s
GENTLY: Final = 0.3  # of the speed backward
AMPLE: Final = 0.08  # m of room along a way that is worth driving on, for a robot that backs out
STANDS: Final = 0.1  # m/s, slower than anybody walks


@final
@dataclass(frozen=True, slots=True)
class Blocked:
    """What it takes to judge a command."""

    limits: DriveLimits
    period: float
    body: Body
    around: Around

    def stops_free(self, pose: Floats, twist: Floats, *, clear: bool) -> Conflict | None:
        """Where the robot would touch something if it kept this twist for one period and then braked; None: nowhere.

        What already touches the robot does not hold it as long as the distance grows. With a clear trajectory only
        what stands counts: before somebody who crosses, on is safer than still.
        """
        z = braking(pose, twist, self.limits, self.period)
        still = np.hypot(self.around.discs[:, 3], self.around.discs[:, 4]) < STANDS
        rows = np.flatnonzero(still) if clear else np.arange(len(still))
        around = self.around._replace(discs=np.ascontiguousarray(self.around.discs[rows]))
        hit = clash(z, self.body, around)
        if hit.free:
            return None
        if hit.knot == 0 and hit.time == 0.0:
            ends = (clash(z[:1], self.body, around).room, clash(z[-1:], self.body, around).room)
            if ends[1] > ends[0]:
                return None
        return Conflict(
            hit.knot,
            z[hit.knot, :3],
            hit.time,
            int(rows[hit.obstacle]) if hit.obstacle >= 0 else -1,
            np.array([hit.x, hit.y]),
        )


def answer(b: Blocked, now: Situation, plan: LocalPlan, last: LocalPlan | None) -> LocalPlan:
    """The plan with a command that can still be stopped before anything, and with the reason if it is another one.

    Whatever the trajectory says: the way that the robot would still go after this command is checked with its exact
    outline, and a command from which it could not stop in time is scaled down.
    """
    waited = last.blocked + 1 if last is not None else 1
    back = _back_out(b, now) if PATIENCE <= waited < PATIENCE + _periods(b) else None
    backs = last is not None and last.outcome is LocalOutcome.BACK_OUT and plan.outcome is LocalOutcome.DRIVE
    if back is not None and last is not None and backs and not (plan.conflict is None and plan.clearance > AMPLE):
        conflict = last.conflict if plan.conflict is None else plan.conflict
        return replace(plan, outcome=LocalOutcome.BACK_OUT, twist=back, conflict=conflict, blocked=waited)
    most = 1.0 if plan.conflict is None else _share_before(b, plan)
    twist, held = _stoppable(b, now, plan, most)
    conflict = held if held is not None else plan.conflict
    if conflict is None:
        return plan
    moving = np.hypot(*now.twist[:2]) > STILL or abs(now.twist[2]) > STILL
    if twist is not None and (np.hypot(*twist[:2]) > STILL or abs(twist[2]) > STILL):
        return replace(plan, outcome=LocalOutcome.SLOW, twist=twist, conflict=conflict)
    if moving or waited < PATIENCE:
        twist = stop(now.twist, b.limits, b.period)
        return replace(plan, outcome=LocalOutcome.STOP, twist=twist, conflict=conflict, blocked=waited)
    outcome = LocalOutcome.REPLAN if back is None else LocalOutcome.BACK_OUT
    twist = np.zeros(3) if back is None else back
    return replace(plan, outcome=outcome, twist=twist, conflict=conflict, blocked=waited)


def _share_before(b: Blocked, plan: LocalPlan) -> float:
    """Of the command, to be able to stop on what is left of the band before its conflict."""
    if plan.conflict is None:
        return 1.0
    way = np.vstack([plan.band[: plan.conflict.knot + 1, :2], plan.conflict.pose[:2]])
    length = float(np.hypot(*np.diff(way, axis=0).T).sum())
    speed = float(np.hypot(*plan.twist[:2]))
    most = float(np.sqrt(2.0 * b.limits.deceleration * max(length - speed * b.period, 0.0)))
    return min(1.0, most / speed) if speed > 1e-9 else 1.0


def _stoppable(b: Blocked, now: Situation, plan: LocalPlan, most: float) -> tuple[Floats | None, Conflict | None]:
    """The largest share of a command, up to `most`, after which the robot can stop free; the conflict of the whole.

    None where braking as hard as the base may would still be faster: that is a stop.
    """
    twist, clear = plan.twist, plan.conflict is None
    first = b.stops_free(now.pose, twist, clear=clear)
    if first is None and most == 1.0:
        return twist, None
    slowest = float(np.hypot(*stop(now.twist, b.limits, b.period)[:2]))
    for share in SHARES:
        some = share * most * twist
        if np.hypot(*some[:2]) < slowest - 1e-6:
            break
        if b.stops_free(now.pose, some, clear=clear) is None:
            return some, first
    return None, first


def _periods(b: Blocked) -> int:
    """How many answers long it backs out."""
    return int(ROOM / max(GENTLY * b.limits.backward * b.period, 1e-3))


def _back_out(b: Blocked, now: Situation) -> Floats | None:
    """The next twist straight back, or None where that is not free or the base cannot."""
    if b.limits.backward <= 0.0:
        return None
    speed = GENTLY * b.limits.backward
    back = np.array([-speed, 0.0, 0.0])
    t = np.linspace(0.0, ROOM / speed, 12)
    z = np.column_stack([moved(now.pose, back, t), t])
    hit, here = clash(z, b.body, b.around), clash(z[:1], b.body, b.around)
    if not hit.free and not (hit.knot == 0 and clash(z[4:], b.body, b.around).free and here.room < 0.0):
        return None
    return saturated(smoothed(back, now.twist, b.limits, b.period), b.limits)
