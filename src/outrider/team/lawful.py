"""What the zones of a site leave of a command: slow in time where they say so, and not against a one-way zone."""

from math import atan2, hypot, inf, sqrt
from typing import Final

import numpy as np

from outrider.data.driving import DriveLimits
from outrider.data.site import Shape
from outrider.mapping.zones import Zones
from outrider.planning.local.guide import cut, remaining
from outrider.planning.refine import resample
from outrider.typing import Floats

REACTION_S: Final = 0.4  # s until a robot brakes
EVERY: Final = 0.2  # m of path between two looks
CREEP: Final = 0.1  # m/s against a one-way zone, to settle at a goal or to get out of the way
SHARE: Final = 0.97  # of what is allowed: wheels are not exact


def obeyed(zones: Zones, twist: Floats, pose: Floats, path: Floats, limits: DriveLimits) -> tuple[Floats, str]:
    """(3,) the command, body frame, as far as the zones allow it, and why it is less.

    At a distance s from where v is allowed, sqrt(v^2 + 2 a s) is: the robot brakes on its way there.
    pose : (3,);  path : (n, 2) m that it follows.
    """
    speed = hypot(twist[0], twist[1])
    if speed <= CREEP:
        return twist, ""
    wrong = _wrong(zones, twist, pose)
    if wrong is not None:
        return twist * (CREEP / speed), f"one way only: {wrong.name or 'a zone'}"
    most = _most(zones, speed, pose, path, limits)
    return (twist * (most / speed), f"a zone allows {most:.1f} m/s here") if most < speed else (twist, "")


def _wrong(zones: Zones, twist: Floats, pose: Floats) -> Shape | None:
    """The one-way zone that the command goes against, here or within the way that it takes to react."""
    if not zones.one_way:
        return None
    heading = float(pose[2]) + atan2(twist[1], twist[0])
    step = REACTION_S * hypot(twist[0], twist[1]) * np.array([np.cos(heading), np.sin(heading)])
    found = (zones.against(p, heading) for p in (pose[:2], pose[:2] + step))
    return next((s for s in found if s is not None), None)


def _most(zones: Zones, speed: float, pose: Floats, path: Floats, limits: DriveLimits) -> float:
    """m/s from which the robot can slow down for every speed zone ahead."""
    if not zones.speed:
        return inf
    late = REACTION_S * speed
    reach = late + speed * speed / (2.0 * limits.deceleration) + EVERY
    ahead = remaining(path, pose[:2])
    points = resample(cut(np.vstack([pose[:2], ahead]), reach)[0], EVERY) if len(ahead) else pose[None, :2]
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    allowed = [SHARE * zones.speed_limit(p) for p in points]
    return min(
        sqrt(v * v + 2.0 * limits.deceleration * max(s - late, 0.0)) if v < inf else inf
        for v, s in zip(allowed, way.tolist(), strict=True)
    )
