"""The drives of amr2025: its targets on our drawing of its sites, an eight-wheeled mecanum robot on its own estimate.

The paper prints targets, not starts: the robot starts at the origin of each site, which is ours. So are its size, its
speed and the errors of its sensors. Lengths are to be compared with what was planned, not in metres.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import radians
from typing import Any, Final, Literal, final

from outrider.scenarios.registry import Description, scenario
from outrider.sim.places import BEND_TARGETS, LOOP_TARGETS, PASSAGE_TARGETS

SIMULATED_TARGETS: Final = ((-2.78, -7.42), (-3.38, -14.59))
STOPS_DEG: Final = (44.2, 73.9, 106.2, 126.9, 157.8, 228.2, 270.7, 312.5, 342.3)
"""Where the paper's robot stopped to have its heading measured (table 3)."""
DEGRADED_S: Final = 30.0  # s after which the second receiver has no corrections any more
QUARTER: Final = 0.7853981633974483  # rad: rollers stand at 45 degrees
AXLES: Final = ((0.3, 1.0), (0.1, 1.0), (-0.1, -1.0), (-0.3, -1.0))
"""Four axles: m ahead of the middle, handedness of the left wheel's rollers (mirrored front and rear)."""
HALF_WIDTH: Final = 0.22  # m
MOTORS: Final = {"latency_s": 0.02, "drive": {"lag_s": 0.05}}
"""Speed control of the wheels: a command is taken up after the delay, and followed with the lag."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """speed : m/s at most."""

    speed: float = 0.8


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Simulated:
    """speed : m/s at most;  physics : by our own equations, or on contacts in MuJoCo."""

    speed: float = 0.8
    physics: Literal["own", "mujoco"] = "own"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Turning:
    """turn : rad/s between two stops;  stand_s : s at each."""

    turn: float = 0.5
    stand_s: float = 5.0


@scenario("amr2025-simulation", tags=("paper", "amr2025", "goto"))
def simulation(cfg: Simulated) -> Description:
    """The simulated drive of amr2025: map 1 to scale, a differential robot, two targets."""
    rover = {"type": "differential", "track": 0.35, "radius": 0.25, "height": 0.4, **MOTORS}
    encoders = {"type": "wheel_encoders", "wheels": 2}
    robot = _robot(rover, encoders, SIMULATED_TARGETS, cfg.speed, heading_deg=0.0)
    return _drive("amr_passage", {**robot, "physics": cfg.physics}, 400.0)


@scenario("amr2025-map1", tags=("paper", "amr2025", "goto"))
def map1(cfg: Drive) -> Description:
    """Map 1 of amr2025: aisles 2 m wide between parked bicycles, two targets."""
    return _drive("amr_passage", _mecanum(PASSAGE_TARGETS, cfg.speed, heading_deg=0.0), 400.0)


@scenario("amr2025-map2", tags=("paper", "amr2025", "goto"))
def map2(cfg: Drive) -> Description:
    """Map 2 of amr2025: a road that turns, two targets."""
    return _drive("amr_bend", _mecanum(BEND_TARGETS, cfg.speed, heading_deg=90.0), 250.0)


@scenario("amr2025-map3", tags=("paper", "amr2025", "goto"))
def map3(cfg: Drive) -> Description:
    """Map 3 of amr2025: 200 m around a planted island, three targets, two obstacles that are on no map."""
    return _drive("amr_loop", _mecanum(LOOP_TARGETS, cfg.speed, heading_deg=0.0), 700.0)


@scenario("amr2025-degraded", tags=("paper", "amr2025", "goto"))
def degraded(cfg: Drive) -> Description:
    """Figure 16 of amr2025: map 3 with a second receiver, which falls from RTK to single fixes on the way."""
    receiver = {
        "type": "gnss_receiver", "name": "plain", "lever": [0.1, 0.0, 0.7], "latency_s": 0.1,
        "qualities": {"fixed": {"white": 0.01, "slow": 0.01, "tau_s": 60.0},
                      "single": {"white": 0.5, "slow": 2.0, "tau_s": 120.0}},
        "spells": [{"start_s": DEGRADED_S, "end_s": 1e6, "fix": "single"}],
    }  # fmt: skip
    robot = _mecanum(LOOP_TARGETS, cfg.speed, heading_deg=0.0)
    robot["sensors"].append(receiver)
    robot["mission"]["drive"]["without"] = ["plain"]
    return _drive("amr_loop", robot, 700.0)


@scenario("amr2025-heading", tags=("paper", "amr2025", "open loop"))
def heading(cfg: Turning) -> Description:
    """Table 3 of amr2025: the robot turns on the spot, counter-clockwise, and stops at nine angles."""
    t, times, commands = cfg.stand_s, [0.0], [[0.0, 0.0, 0.0]]
    for a, b in pairwise((0.0, *STOPS_DEG)):
        lasts = radians(b - a) / cfg.turn
        times += [t, t + lasts]
        commands += [[0.0, 0.0, cfg.turn], [0.0, 0.0, 0.0]]
        t += lasts + cfg.stand_s
    robot = _mecanum(((0.0, 0.0),), 0.8, heading_deg=0.0)
    robot["mission"] = {"type": "schedule", "t_s": times, "u": commands}
    return {"duration_s": t, "world": {"place": {"type": "open_field"}}, "team": {"robot": robot}}


def wheels() -> list[list[float]]:
    """Eight mecanum wheels: forward, left [m], angle of the touching roller left of forward [rad]."""
    sides = ((HALF_WIDTH, -1.0), (-HALF_WIDTH, 1.0))
    return [[x, y, side * hand * QUARTER] for x, hand in AXLES for y, side in sides]


def _mecanum(targets: tuple[tuple[float, float], ...], speed: float, *, heading_deg: float) -> dict[str, Any]:
    base = {"type": "mecanum", "wheels": wheels(), "radius": 0.45, "height": 0.6, **MOTORS}
    return _robot(base, {"type": "wheel_encoders", "wheels": 8}, targets, speed, heading_deg=heading_deg)


def _robot(
    vehicle: dict[str, Any],
    encoders: dict[str, Any],
    targets: tuple[tuple[float, float], ...],
    speed: float,
    *,
    heading_deg: float,
) -> dict[str, Any]:
    return {
        "vehicle": vehicle,
        "start": {"yaw_deg": heading_deg},
        "sensors": [
            {"type": "imu", "rate_hz": 50.0, "gyro_instability": 5e-5, "gyro_scale": 0.002},
            {**encoders, "scale": 0.005, "sigma": 0.003},
            {"type": "gnss_receiver", "lever": [0.1, 0.0, 0.7], "latency_s": 0.1},
            {"type": "lidar", "beams": 180, "max_range": 12.0},
        ],
        "mission": {"type": "goto", "goals": [list(t) for t in targets], "drive": {"forward": speed}},
    }


def _drive(place: str, robot: dict[str, Any], duration_s: float) -> Description:
    return {"duration_s": duration_s, "world": {"place": {"type": place}}, "team": {"robot": robot}}
