"""swarm2023's flights, in east and north (the paper's y and x), with the signs that its text lost.

The preset `paper` guides on raw fixes by the paper's laws, once a second, without a safety filter, and its filters
only watch; `principled` guides on the estimate by the vector law, ten times a second, above a filter that keeps the
distance.
"""

from dataclasses import dataclass
from typing import Any, Final, Literal, final

from outrider.errors import ConfigError
from outrider.scenarios.registry import Description, scenario

Preset = Literal["paper", "principled"]
R_D: Final = 3.0  # m, danger zone
ZONE: Final = 6.0  # m, rendezvous zone
WIDE: Final = 9.0  # m, rendezvous zone of the principled preset: fixes of 1 Hz ask for a set-point beyond 6 m
HAIRPIN: Final = 12.0  # m, of one whose target may come back the way it went
NOISE: Final = 0.15  # m, of the fixes, on every axis
HEIGHT: Final = 7.0  # m
V_TARGET: Final = 2.0  # m/s
V_M: Final = 2.5  # m/s, inside the rendezvous zone
FIELD: Final[dict[str, Any]] = {"place": {"type": "open_field", "side": 500.0, "ceiling": 60.0}}
ALONE: Final[dict[str, Any]] = {"danger": 0.4, "zone": 0.5, "band": 0.05, "outer": 0.05}
"""Algorithm 1 knows no zones: these are so small that they are never entered."""
OUTAGE_S: Final = (9.0, 13.0)  # inferred from the table: the window is not stated


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """preset : paper or principled;  latency_s : of the receivers;  tau_s : s, the follower's velocity response;
    rate_hz : of the receivers;  physics : own, or mujoco with a rotorcraft."""

    preset: Preset = "principled"
    latency_s: float = 0.3
    tau_s: float = 1.0
    rate_hz: float = 1.0
    physics: Literal["own", "mujoco"] = "own"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Localisation:
    """preset : paper or principled;  latency_s : of the receivers;  tau_s : s, the follower's velocity response;
    speed : m/s, of the follower."""

    preset: Preset = "principled"
    latency_s: float = 0.0
    tau_s: float = 0.5
    speed: float = 1.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Real:
    """preset : paper or principled;  wind : m/s, from the south-west;  telemetry_s : delay of the radio;  loss : share
    of messages lost;  slow : m, of the receivers' error that stays for a minute."""

    preset: Preset = "principled"
    wind: float = 3.0
    telemetry_s: float = 0.2
    loss: float = 0.05
    slow: float = 0.3


@scenario("swarm2023-localisation", tags=("paper", "air", "follow"))
def localisation(cfg: Localisation) -> Description:
    """A drone follows another along a hairpin by the Bezier curve of its trail; satellites are seen all the time."""
    return _localisation(cfg, [])


@scenario("swarm2023-blocked", tags=("paper", "air", "follow"))
def blocked(cfg: Localisation) -> Description:
    """As swarm2023-localisation, but the follower's receiver is blocked for four seconds at the corner."""
    return _localisation(cfg, [{"type": "faulty", "sensor": "gnss", "start_s": OUTAGE_S[0], "end_s": OUTAGE_S[1]}])


def _localisation(cfg: Localisation, faults: list[dict[str, Any]]) -> Description:
    follows = {"far": "bezier", "far_speed": cfg.speed, "degree": 2, "zones": ALONE, "aim": "points"}
    if cfg.preset == "principled":
        follows |= {"aim": "end", "zones": {"danger": R_D, "zone": HAIRPIN}, "target_turn_deg": 180.0}
    return {
        "duration_s": 30.0,
        "world": FIELD,
        "team": {
            "target": _target(7.0, 0.0, [[9.0, 10.0], [25.0, 13.0], [1.0, 15.0]], cfg.preset, 1.0, cfg.latency_s),
            "follower": _follower(7.173, -3.0608, cfg.preset, follows, 1.0, cfg.latency_s, cfg.tau_s, "own", faults),
        },
    }


@scenario("swarm2023-rendezvous", tags=("paper", "air", "follow"))
def rendezvous(cfg: Flight) -> Description:
    """From inside the rendezvous zone a drone closes up behind another that flies straight on."""
    return {
        "duration_s": 45.0,
        "world": FIELD,
        "team": {
            "target": _target(7.0, 0.0, [[100.0, 0.0]], cfg.preset, cfg.rate_hz, cfg.latency_s),
            "follower": _follower(
                7.0, -5.0, cfg.preset, {"zones": _zones(cfg.preset)}, cfg.rate_hz, cfg.latency_s, cfg.tau_s,
                cfg.physics,
            ),
        },
    }  # fmt: skip


@scenario("swarm2023-mission", tags=("paper", "air", "follow"))
def mission(cfg: Flight) -> Description:
    """From 20 m away a drone comes up with another, closes up, and follows it round a corner of 90 degrees."""
    follows: dict[str, Any] = {"zones": _zones(cfg.preset), "far_speed": 3.0}
    if cfg.preset == "paper":
        follows |= {"far": "bezier", "degree": 3, "aim": "end"}
    return {
        "duration_s": 118.0,
        "world": FIELD,
        "team": {
            "target": _target(7.0, 0.0, [[150.0, 0.0], [150.0, -100.0]], cfg.preset, cfg.rate_hz, cfg.latency_s),
            "follower": _follower(
                7.0, 20.0, cfg.preset, follows, cfg.rate_hz, cfg.latency_s, cfg.tau_s, cfg.physics
            ),
        },
    }  # fmt: skip


@scenario("swarm2023-flight", tags=("paper", "air", "follow"))
def flight(cfg: Real) -> Description:
    """Two drones outdoors: both fly on estimates of an autopilot's kind, in wind, and their telemetry is late."""
    imu = {"type": "imu", "rate_hz": 100.0}
    height = [{"type": "baro"}, {"type": "heading", "sigma_deg": 2.0}]
    gnss = {"type": "gnss", "rate_hz": 5.0, "sigma": 0.1, "sigma_up": 0.2, "latency_s": 0.12}
    velocity = {"type": "gnss_velocity", "rate_hz": 5.0, "latency_s": 0.12}
    drift = {"gnss_sigma": cfg.slow, "gnss_sigma_up": 1.5 * cfg.slow}
    craft = {"type": "multirotor", "latency_s": 0.05, "drag": 0.2}
    follows: dict[str, Any] = {"zones": _zones(cfg.preset), "wind": 1.0}
    target = {
        "vehicle": craft,
        "start": {"x": 0.0, "y": 0.0, "z": HEIGHT},
        "drift": drift,
        "sensors": [imu, gnss, velocity, *height],
        "mission": {"type": "lead", "waypoints": [[40.0, 0.0], [40.0, 30.0], [0.0, 30.0], [0.0, 5.0]],
                    "speed": V_TARGET},
    }  # fmt: skip
    follower = {
        "vehicle": craft,
        "start": {"x": -12.0, "y": -4.0, "z": HEIGHT},
        "drift": drift,
        "sensors": [gnss, velocity, *height[1:]],
        "mission": {"type": "follow", "leader": "target", **_laws(cfg.preset), **follows},
    }
    w = cfg.wind * 0.5**0.5
    return {
        "duration_s": 75.0,
        "world": {**FIELD, "wind": {"mean": [w, w, 0.0], "sigma": [0.2 * cfg.wind] * 2 + [0.1 * cfg.wind]}},
        "radio": {"latency_s": cfg.telemetry_s, "jitter_s": 0.05, "loss": cfg.loss},
        "team": {"target": target, "follower": follower},
    }


def _zones(preset: Preset) -> dict[str, float]:
    """The paper's; for ours the rendezvous zone is as wide as a safe set-point asks for."""
    return {"danger": R_D, "zone": ZONE if preset == "paper" else WIDE}


def _receiver(preset: Preset, rate_hz: float, latency_s: float) -> list[dict[str, Any]]:
    """Fixes; the principled preset also hears the velocity that receivers tell with them."""
    when = {"rate_hz": rate_hz, "latency_s": latency_s}
    fixes = {"type": "gnss", "sigma": NOISE, "sigma_up": NOISE, **when}
    return [fixes] if preset == "paper" else [fixes, {"type": "gnss_velocity", "sigma_up": 0.05, **when}]


def _target(
    x: float, y: float, way: list[list[float]], preset: Preset, rate_hz: float, latency_s: float
) -> dict[str, Any]:
    """One that is carried exactly along its way, as the paper's was by the simulator."""
    return {
        "start": {"x": x, "y": y, "z": HEIGHT},
        "sensors": _receiver(preset, rate_hz, latency_s),
        "mission": {"type": "lead", "waypoints": way, "speed": V_TARGET, "corner": 0.3},
    }


def _follower(
    x: float, y: float, preset: Preset, follows: dict[str, Any], rate_hz: float, latency_s: float, tau_s: float,
    physics: str, faults: list[dict[str, Any]] | None = None,
) -> dict[str, Any]:  # fmt: skip
    craft: dict[str, Any] = {"type": "multirotor", "tau_s": tau_s}
    if physics == "mujoco":
        craft = {"type": "rotorcraft", "tau_s": tau_s}
    return {
        "vehicle": craft,
        "physics": physics,
        "start": {"x": x, "y": y, "z": HEIGHT, "yaw_deg": 90.0},
        "sensors": [*_receiver(preset, rate_hz, latency_s), {"type": "heading", "rate_hz": rate_hz, "sigma": 0.1}],
        "faults": faults or [],
        "mission": {"type": "follow", "leader": "target", **_laws(preset), **follows},
    }


def _laws(preset: Preset) -> dict[str, Any]:
    if preset == "principled":
        return {"speed": V_M}
    if preset != "paper":
        raise ConfigError(f"no preset '{preset}'", where="preset", fix="paper or principled")
    return {
        "speed": V_M, "far": "los", "near": "zone", "guides_on": "gps", "safety": False, "distance": R_D,
        "target_speed": V_TARGET, "command_s": 1.0, "heading": "heading",
    }  # fmt: skip
