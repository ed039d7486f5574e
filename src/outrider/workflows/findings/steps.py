"""Whether a receiver's float positions keep what they claim, by the steps where a fixed one follows or goes before.

With a receiver alone the estimate follows its fixes, and no innovation tells that they are off. But ambiguities that
are fixed or lost move no robot: the step that is then left is an error of one solution or of the other.
"""

from typing import Final, NamedTuple

import numpy as np

from outrider.data import Finding, Fix, Kind
from outrider.filters.channels import Channel, site_position
from outrider.models.sensors import Sensor
from outrider.typing import Bools, Floats, Ints
from outrider.workflows.assembly import claimed_sigma
from outrider.workflows.draft import Plan
from outrider.workflows.findings.say import warning
from outrider.workflows.findings.stretches import ALLOW, MEDIAN_2D, TOO_SURE, VISIBLE, fix_types

CHANGES: Final = 8  # that tell a scatter
EVEN: Final = 0.2  # share of its period by which a record may be early or late
NEAR: Final = 30  # records before and after a change that tell how unevenly the robot moves
REACH: Final = 2  # increments on either side that say what the one between would be


class Steps(NamedTuple):
    """off : step per axis [m] beyond what motion explains;  claim : of both solutions together [m];  n : changes."""

    off: float
    claim: float
    n: int


def float_steps(chosen: Plan, channel: Channel) -> list[Finding]:
    """A receiver whose float and fixed positions lie farther apart than they claim."""
    s = chosen.log.streams[channel.stream]
    if s.kind is not Kind.GNSS or channel.sensor is not Sensor.GNSS_POSITION or chosen.datum is None:
        return []
    good = np.flatnonzero(chosen.verdicts[channel.stream] == 0)
    s = s.select(good[np.argsort(s.t[good], kind="stable")])
    found = steps(s.t, site_position(s, chosen.datum)[:, :2], fix_types(s), claimed_sigma(s))
    if found is None or found.off < max(VISIBLE, TOO_SURE * found.claim):
        return []
    text = f"{channel.stream} claims {found.claim:.2g} m, but its float and fixed positions lie {found.off:.2g} m "
    text += f"apart where one follows the other, {found.off / found.claim:.0f} times more: {found.n} changes"
    return [warning("overconfident", text, channel.stream, ALLOW)]


def steps(t: Ints, p: Floats, fix: Floats, claim: Floats) -> Steps | None:
    """Of positions p (n, 2) [m] at t (n,) [ns]; fix, claim : (n,) type and standard deviation [m]. None if too few.

    The step is the increment between two records less what a cubic through its two neighbours on either side makes of
    it; the same figure where the fix stays, close by, is what uneven motion does and is taken off.
    """
    if len(t) < 2 * NEAR:
        return None
    off2, whole = unexplained(t, p)
    k = np.arange(len(off2)) + REACH  # the record before the step
    before, after = fix[k], fix[k + 1]
    whole &= (fix[k - 1] == before) & (fix[k - 2] == before) & (fix[k + 2] == after) & (fix[k + 3] == after)
    both = (np.minimum(before, after) == Fix.FLOAT.value) & (np.maximum(before, after) == Fix.FIXED.value)
    sum2 = claim[k] ** 2 + claim[k + 1] ** 2
    at = np.flatnonzero(whole & both & np.isfinite(sum2))
    if at.size < CHANGES:
        return None
    calm = np.where(whole & (before == after), off2, np.nan)
    usual = [np.nanmedian(np.append(calm[max(i - NEAR, 0) : i + NEAR], off2[i])) for i in at]
    beyond = (float(np.median(off2[at])) - float(np.median(usual))) / MEDIAN_2D
    return Steps(float(np.sqrt(max(beyond, 0.0))), float(np.sqrt(np.median(sum2[at]))), int(at.size))


def unexplained(t: Ints, p: Floats) -> tuple[Floats, Bools]:
    """(n - 5,) squared steps [m^2] between records k and k + 1, k from 2, and whether the records there are even."""
    v, dt = np.diff(p, axis=0), np.diff(t) * 1e-9
    a, b, c, d, e = (v[i : len(v) - 4 + i] for i in range(5))
    step = c - (4.0 * (b + d) - a - e) / 6.0
    even = np.abs(dt - np.median(dt)) < EVEN * np.median(dt)
    whole = np.isfinite(step @ np.ones(step.shape[1]))
    for i in range(5):
        whole &= even[i : len(v) - 4 + i]
    return (step**2).sum(axis=1), whole


__all__ = ["Steps", "float_steps", "steps"]
