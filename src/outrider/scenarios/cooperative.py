"""Scenarios of a ground and an aerial robot together."""

from dataclasses import dataclass
from math import inf
from typing import final

from outrider.scenarios.crews import MethodName
from outrider.scenarios.registry import Description, scenario


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Tour:
    """Speeds of the two robots [m/s];  method : of sharing;  loss (share), delay (s), radio_range (m) : of the radio;
    ablate : whether to tell what each sensor was worth."""

    ugv_speed: float = 0.68
    uav_speed: float = 0.95
    method: MethodName = "joint"
    loss: float = 0.0
    delay: float = 0.02
    radio_range: float = inf
    ablate: bool = False


# East, north (and up) [m] once around the airliner: nose at (0, 1), tail at (0, 38.6), wing tips at (+-17, 24).
UGV = (
    (0, -1), (5, -1.5), (4, 8), (9.5, 12), (10, 26), (5, 33), (3, 41),
    (-3, 41), (-5, 33), (-10, 26), (-9.5, 12), (-4, 8), (-5, -1.5), (0, -2),
)  # fmt: skip
UAV = (
    (0, -2, 4), (6, 0, 7), (6, 10, 9), (19, 20, 7), (19, 27, 5), (9, 30, 9), (9, 36, 12), (0, 42, 13),
    (-9, 36, 12), (-9, 30, 9), (-19, 27, 5), (-19, 20, 7), (-6, 10, 9), (-6, 0, 7), (0, -4, 4), (0, -4, 1.5),
)  # fmt: skip


DRIFT = {"gyro_start": 0.005, "gyro_walk": 0.0, "accel_start": 0.05, "accel_walk": 0.0, "wheels_start": 0.0}


@scenario("airliner-tour", tags=("cooperative", "open loop", "coop2024"))
def airliner_tour(cfg: Tour) -> Description:
    """A ground robot and a drone are carried around a parked airliner with every sensor of coop2024, and share."""
    return {
        "duration_s": 180.0,
        "world": {"place": {"type": "parked_airliner"}},
        "radio": {"loss": cfg.loss, "latency_s": cfg.delay, "range_m": cfg.radio_range},
        "cooperation": {"method": cfg.method, "ablate": cfg.ablate},
        "team": {
            "ugv": {
                "start": {"x": 0.0, "y": -2.0, "yaw_deg": 90.0},
                "size": {"radius": 0.5, "height": 0.6},
                "drift": DRIFT,
                "sensors": [
                    *_common(0.01, (0.3, 0.2, 0.5)),
                    {"type": "body_twist", "name": "wheels", "rate_hz": 100.0, "sigma_v": 0.4, "sigma_w": 0.05,
                     "rolling": False},
                    {"type": "robot_camera", "name": "camera_up", "mount_rpy_deg": [0.0, -90.0, 0.0], "reach": 15.0},
                ],
                "mission": {"type": "track", "points": [[*map(float, p), 0.0] for p in UGV], "speed": cfg.ugv_speed},
            },
            "uav": {
                "start": {"x": 0.0, "y": -4.0, "z": 0.0, "yaw_deg": 90.0},
                "size": {"radius": 0.35, "height": 0.25},
                "drift": DRIFT,
                "sensors": [
                    *_common(0.01, (0.0, 0.0, 0.15)),
                    {"type": "baro", "rate_hz": 100.0, "sigma": 0.25},
                    {"type": "robot_camera", "name": "camera_down", "mount_rpy_deg": [0.0, 90.0, 0.0], "reach": 15.0},
                ],
                "mission": {"type": "track", "points": [list(map(float, p)) for p in UAV], "speed": cfg.uav_speed,
                            "flies": True, "spacing_s": 1.5},
            },
        },
    }  # fmt: skip


def _common(gyro: float, antenna: tuple[float, float, float]) -> list[Description]:
    """What both carry; deviations are the paper's, per sample."""
    root_hz = 100.0**0.5
    return [
        {"type": "imu", "gyro_density": gyro / root_hz, "accel_density": 0.015 / root_hz},
        {"type": "gnss", "rate_hz": 10.0, "sigma": 0.7, "sigma_up": 0.7, "lever": list(antenna), "fix": "single"},
        {"type": "gnss_velocity", "rate_hz": 10.0, "sigma": 0.05, "sigma_up": 0.05, "lever": list(antenna)},
        {"type": "stereo_velocity", "rate_hz": 2.0, "sigma": 0.2, "reach": 4.0},
        {"type": "object_pose", "name": "lidar", "object": "airliner", "rate_hz": 1.0},
    ]
