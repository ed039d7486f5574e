"""Scenarios of drones."""

from dataclasses import dataclass
from typing import final

from outrider.scenarios.registry import Description, scenario


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Field:
    """wind : m/s, from the west;  speed : m/s."""

    wind: float = 5.0
    speed: float = 4.0


@scenario("follow-field", tags=("air", "open loop"))
def follow_field(cfg: Field) -> Description:
    """A drone flies a lawn-mower pattern by schedule over an open field, and the wind carries it off its lanes."""
    v = cfg.speed
    lanes = [(v, 0.0), (0.0, v), (-v, 0.0), (0.0, v)]  # east, north [m/s]
    lasts = [12.0, 3.0, 12.0, 3.0]
    t, rows, now = [0.0, 3.0], [[0.0, 0.0, 2.0, 0.0], [0.0, 0.0, 2.0, 0.0]], 8.0
    for k in range(8):
        t, rows = [*t, now], [*rows, [*lanes[k % 4], 0.0, 0.0]]
        now += lasts[k % 4]
    t, rows = [*t, now, now + 4.0], [*rows, [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0]]
    return {
        "duration_s": now + 25.0,
        "world": {
            "place": {"type": "open_field", "side": 200.0, "ceiling": 40.0},
            "wind": {"mean": [cfg.wind, 0.0, 0.0], "sigma": [0.2 * cfg.wind] * 2 + [0.1 * cfg.wind]},
        },
        "team": {
            "drone": {
                "vehicle": {"type": "multirotor", "latency_s": 0.05},
                "start": {"x": -20.0, "y": -10.0},
                "sensors": [
                    {"type": "imu", "rate_hz": 200.0},
                    {"type": "gnss_receiver", "lever": [0.0, 0.0, 0.15], "latency_s": 0.1},
                    {"type": "gnss_velocity", "lever": [0.0, 0.0, 0.15], "latency_s": 0.1},
                    {"type": "baro"},
                    {"type": "heading", "sigma_deg": 1.0},
                ],
                "mission": {"type": "schedule", "t_s": t, "u": rows},
            }
        },
    }
