"""Scenarios of one drone that follows another."""

from dataclasses import dataclass
from typing import Any, Final, Literal, final

from outrider.scenarios.registry import Description, scenario

Behaviour = Literal["straight", "turn", "stop", "reverse", "climb", "hover", "speeds", "silent", "spoofed", "clock"]
BEHAVIOURS: Final[dict[str, dict[str, Any]]] = {
    "straight": {"waypoints": [[120.0, 0.0]]},
    "turn": {"waypoints": [[40.0, 0.0], [40.0, 60.0]]},
    "stop": {"waypoints": [[120.0, 0.0]], "stops_s": [[15.0, 30.0]]},
    "reverse": {"waypoints": [[30.0, 0.0], [-20.0, 0.0]]},
    "climb": {"waypoints": [[30.0, 0.0, 10.0], [60.0, 0.0, 30.0], [100.0, 0.0, 12.0]]},
    "hover": {"waypoints": [[0.0, 0.0]]},
    "speeds": {"waypoints": [[20.0, 0.0], [40.0, 0.0], [80.0, 0.0]], "speeds": [2.0, 0.7, 2.2]},
    "silent": {"waypoints": [[120.0, 0.0]], "silent_s": [[15.0, 27.0]]},
    "spoofed": {"waypoints": [[120.0, 0.0]], "spoofs": [{"spell_s": [15.0, 17.0], "by": [0.0, 50.0, 0.0]}]},
    "clock": {"waypoints": [[120.0, 0.0]], "clock_s": 1.0},
}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Follow:
    """target : what it does;  danger, zone : m, radii of the danger and the rendezvous zone;  speed : m/s, of the
    target;  fastest : m/s, of the follower;  gnss_hz, latency_s : of the receivers;  wind : m/s, from the west;
    physics : own or mujoco."""

    target: Behaviour = "turn"
    danger: float = 3.0
    zone: float = 8.0
    speed: float = 2.0
    fastest: float = 4.0
    gnss_hz: float = 5.0
    latency_s: float = 0.1
    wind: float = 0.0
    physics: Literal["own", "mujoco"] = "own"


@scenario("follow-leader", tags=("air", "follow"))
def follow_leader(cfg: Follow) -> Description:
    """A drone comes up with another, holds its distance, and copes with what the other does (`target`)."""
    gnss = {
        "type": "gnss", "rate_hz": cfg.gnss_hz, "sigma": 0.15, "sigma_up": 0.25, "latency_s": cfg.latency_s,
    }  # fmt: skip
    velocity = {"type": "gnss_velocity", "rate_hz": cfg.gnss_hz, "latency_s": cfg.latency_s}
    rotors = {"type": "rotorcraft"} if cfg.physics == "mujoco" else {"type": "multirotor"}
    leads = dict(BEHAVIOURS[cfg.target])
    if cfg.target == "speeds":
        leads["speeds"] = [cfg.speed * s / 2.0 for s in leads["speeds"]]
    return {
        "duration_s": 60.0,
        "world": {
            "place": {"type": "open_field", "side": 400.0, "ceiling": 60.0},
            "wind": {"mean": [cfg.wind, 0.0, 0.0], "sigma": [0.2 * cfg.wind] * 2 + [0.1 * cfg.wind]},
        },
        "team": {
            "target": {
                "start": {"z": 10.0},
                "sensors": [gnss, velocity],
                "mission": {"type": "lead", "speed": cfg.speed, **leads},
            },
            "follower": {
                "vehicle": rotors,
                "physics": cfg.physics,
                "start": {"x": -15.0, "y": -5.0, "z": 8.0},
                "sensors": [gnss, velocity, {"type": "heading", "rate_hz": 5.0, "sigma_deg": 3.0}],
                "mission": {
                    "type": "follow", "leader": "target", "speed": cfg.fastest, "far_speed": cfg.fastest,
                    "zones": {"danger": cfg.danger, "zone": cfg.zone}, "wind": 1.0 if cfg.wind > 0.0 else 0.0,
                    **({"target_turn_deg": 180.0, "approach": cfg.speed} if cfg.target == "reverse" else {}),
                },
            },
        },
    }  # fmt: skip
