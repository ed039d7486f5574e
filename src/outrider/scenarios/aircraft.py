"""coop2024 in closed loop: ground robots and a drone inspect a parked airliner along planned paths."""

from dataclasses import dataclass
from math import inf, isfinite
from typing import Any, final

from outrider.scenarios.cooperative import DRIFT
from outrider.scenarios.crews import MethodName
from outrider.scenarios.ground import WHEELS
from outrider.scenarios.registry import Description, scenario

BLOCKED = [[28.0, -9.0], [28.6, -9.0], [28.6, 9.0], [28.0, 9.0]]  # m, what nobody has drawn
PAD = {"place": [0.0, 0.0, 0.65], "radius": 0.5, "tolerance": 0.3}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Inspection:
    """method : of sharing;  rovers : robots on the ground;  endurance, charge : s that a battery of the drone lasts, 0
    for ever, and that it takes to charge;  duration : s;  loss (share), delay (s), radio_range (m) : of the radio;
    ablate : whether to tell what each sensor was worth."""

    method: MethodName = "joint"
    rovers: int = 1
    endurance: float = 0.0
    charge: float = 30.0
    duration: float = 180.0
    loss: float = 0.0
    delay: float = 0.02
    radio_range: float = inf
    ablate: bool = False


@scenario("aircraft-inspection", tags=("cooperative", "closed loop", "coop2024"))
def aircraft_inspection(cfg: Inspection) -> Description:
    """Ground robots see the lower half of an airliner and a drone the upper, on estimates that they share."""
    path = cfg.duration - 12.0
    team: dict[str, Any] = {}
    for k in range(cfg.rovers):
        name = "ugv" if cfg.rovers == 1 else f"ugv{k + 1}"
        start = {"x": 2.5 * (k - 0.5 * (cfg.rovers - 1)), "y": -2.0, "yaw_deg": 90.0}
        team[name] = _rover(cfg.method, start, path)
    middle = list(team)[cfg.rovers // 2]
    team["uav"] = _drone(cfg, middle, path)
    recharges = cfg.endurance > 0.0 and isfinite(cfg.endurance)
    return {
        "duration_s": cfg.duration * (3.0 if recharges else 1.0),
        "world": {"place": {"type": "parked_airliner"}},
        "radio": {"loss": cfg.loss, "latency_s": cfg.delay, "range_m": cfg.radio_range},
        "team": team,
        "cooperation": {"method": cfg.method, "ablate": cfg.ablate},
    }


def _rover(method: str, start: dict[str, float], path: float) -> Description:
    return {
        "vehicle": {"type": "mecanum", "wheels": WHEELS, "radius": 0.5, "height": 0.6, "step_s": 0.01},
        "start": start,
        "pad": PAD,
        "drift": DRIFT,
        "sensors": [
            *_common((0.3, 0.2, 0.5)),
            {"type": "body_twist", "name": "wheels", "rate_hz": 100.0, "sigma_v": 0.4, "sigma_w": 0.05,
             "rolling": False},
            {"type": "object_pose", "name": "lidar", "object": "airliner", "rate_hz": 1.0},
            {"type": "robot_camera", "name": "camera_up", "mount_rpy_deg": [0.0, -90.0, 0.0], "lever": [0.0, 0.0, 0.6]},
        ],
        "mission": {
            "type": "inspect", "half": "lower", "method": method, "path_s": path, "margin": 0.25,
            "camera": {"height": 0.6, "far": 5.5, "half_angle": 0.7, "low": -0.2}, "pace": {"speed": 0.7},
        },
    }  # fmt: skip


def _drone(cfg: Inspection, carrier: str, path: float) -> Description:
    return {
        "vehicle": {"type": "multirotor", "radius": 0.35, "height": 0.25, "step_s": 0.01},
        "on": carrier,
        "drift": DRIFT,
        "sensors": [
            *_common((0.0, 0.0, 0.15)),
            {"type": "baro", "rate_hz": 100.0, "sigma": 0.25},
            {"type": "robot_camera", "name": "camera_down", "mount_rpy_deg": [0.0, 90.0, 0.0]},
        ],
        "mission": {
            "type": "inspect", "half": "upper", "method": cfg.method, "path_s": path, "margin": 0.8,
            "camera": {"far": 5.0, "half_angle": 0.7}, "pace": {"speed": 1.1},
            "endurance_s": cfg.endurance or 1e9, "charge_s": cfg.charge,
        },
    }  # fmt: skip


def _common(antenna: tuple[float, float, float]) -> list[Description]:
    """What both carry; deviations are the paper's, per sample."""
    root_hz = 100.0**0.5
    return [
        {"type": "imu", "gyro_density": 0.01 / root_hz, "accel_density": 0.015 / root_hz},
        {"type": "gnss", "rate_hz": 10.0, "sigma": 0.7, "sigma_up": 0.7, "lever": list(antenna), "fix": "single"},
        {"type": "gnss_velocity", "rate_hz": 10.0, "sigma": 0.05, "sigma_up": 0.05, "lever": list(antenna)},
        {"type": "stereo_velocity", "rate_hz": 2.0, "sigma": 0.2, "reach": 4.0},
    ]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Ahead:
    """tells : whether the drone can be heard;  lidar : m, that the robot on the ground sees."""

    tells: bool = True
    lidar: float = 6.0


@scenario("scout-ahead", tags=("cooperative", "closed loop", "ground", "air"))
def scout_ahead(cfg: Ahead) -> Description:
    """A drone flies ahead and tells what stands in the way; the robot on the ground goes round before it can see it."""
    down = {} if cfg.tells else {"radio": {"outages_s": {"scout>*": [[0.0, 1e6]]}}}
    gnss = {"type": "gnss", "rate_hz": 5.0, "sigma": 0.02, "sigma_up": 0.03}
    return {
        "duration_s": 120.0,
        **down,
        "world": {
            "place": {"type": "open_field", "side": 120.0},
            "walls": [{"name": "barrier", "outline": BLOCKED, "high": 3.0}],
        },
        "team": {
            "rover": {
                "vehicle": {"type": "mecanum", "wheels": WHEELS, "radius": 0.45, "height": 0.6},
                "sensors": [
                    {"type": "imu", "rate_hz": 50.0},
                    {"type": "body_twist", "name": "wheels", "rolling": False},
                    gnss,
                    {"type": "lidar", "rate_hz": 5.0, "beams": 180, "max_range": cfg.lidar},
                ],
                "mission": {"type": "goto", "goals": [[45.0, 0.0]]},
            },
            "scout": {
                "vehicle": {"type": "multirotor"},
                "start": {"x": 3.0, "y": 10.0},
                "sensors": [
                    {"type": "imu", "rate_hz": 200.0},
                    {**gnss, "lever": [0.0, 0.0, 0.15]},
                    {"type": "gnss_velocity"},
                    {"type": "baro"},
                    {"type": "heading", "sigma_deg": 1.0},
                    {"type": "lidar", "rate_hz": 5.0, "beams": 360, "max_range": 20.0},
                ],
                "mission": {"type": "scout", "waypoints": [[3, 10, 1.8], [20, 4, 1.8], [20, -4, 1.8], [20, 4, 1.8]],
                            "speed": 3.0},
            },
        },
    }  # fmt: skip
