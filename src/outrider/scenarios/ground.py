"""Scenarios of ground robots."""

from dataclasses import dataclass
from itertools import pairwise
from math import hypot
from typing import Literal, final

from outrider.scenarios.registry import Description, scenario
from outrider.sim.places import BEND_TARGETS, LOOP_TARGETS, PASSAGE_TARGETS


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Patrol:
    """site : one of amr2025's; speed : m/s."""

    site: Literal["amr_passage", "amr_bend", "amr_loop"] = "amr_bend"
    speed: float = 1.0


# Ways through the middle of the road to the targets of the paper, east and north [m].
WAYS = {
    "amr_passage": ((0, 0), (9, 0), (9, -3.5), (-11, -3.5), (-11, -7), PASSAGE_TARGETS[0]),
    "amr_bend": ((0, 4), (0, 14), (3, 17.5), BEND_TARGETS[0], (3, 17.5), BEND_TARGETS[1]),
    "amr_loop": (
        (13, -1), (17.5, 4), (17.5, 60), LOOP_TARGETS[0], (13.5, 92.5), (5, 92.5), LOOP_TARGETS[1], (0, 70), (-2, 10),
        LOOP_TARGETS[2],
    ),
}  # fmt: skip
QUARTER = 0.7853981633974483  # rad: rollers stand at 45 degrees
WHEELS = [[0.25, 0.2, -QUARTER], [0.25, -0.2, QUARTER], [-0.25, 0.2, QUARTER], [-0.25, -0.2, -QUARTER]]


@scenario("patrol", tags=("ground", "closed loop"))
def patrol(cfg: Patrol) -> Description:
    """A mecanum robot tours waypoints in a site of amr2025, on its own estimate of where it is."""
    way = [list(map(float, p)) for p in WAYS[cfg.site]]
    length = sum(hypot(a[0] - b[0], a[1] - b[1]) for a, b in pairwise([[0.0, 0.0], *way]))
    return {
        "duration_s": 60.0 + 2.0 * length / cfg.speed,
        "world": {"place": {"type": cfg.site}},
        "team": {
            "robot": {
                "vehicle": {"type": "mecanum", "wheels": WHEELS, "radius": 0.45, "height": 0.6, "latency_s": 0.05},
                "start": {"yaw_deg": 90.0},
                "sensors": [
                    {"type": "imu", "rate_hz": 50.0},
                    {"type": "body_twist", "name": "wheels", "rolling": False},
                    {"type": "wheel_encoders"},
                    {"type": "gnss_receiver", "lever": [0.1, 0.0, 0.7], "latency_s": 0.1},
                    {"type": "lidar", "rate_hz": 2.0, "beams": 180, "max_range": 20.0},
                ],
                "mission": {"type": "tour", "waypoints": way, "speed": cfg.speed},
            }
        },
    }
