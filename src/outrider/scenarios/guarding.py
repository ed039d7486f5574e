"""Scenarios of a guarded site: robots on their rounds, and alerts."""

from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from outrider.errors import ConfigError
from outrider.scenarios.ground import WHEELS
from outrider.scenarios.registry import Description, scenario

DRAWING: Final[dict[str, Any]] = {
    "name": "works",
    "anchor": {"lat_deg": 52.514, "lon_deg": 13.35, "alt_m": 34.0},
    "roads": [
        {"name": "south road", "line": [[-3.5, 0], [83.5, 0]], "width": 7},
        {"name": "north road", "line": [[-3.5, 50], [83.5, 50]], "width": 7},
        {"name": "west road", "line": [[0, -3.5], [0, 53.5]], "width": 7},
        {"name": "middle road", "line": [[40, -3.5], [40, 53.5]], "width": 7},
        {"name": "east road", "line": [[80, -3.5], [80, 53.5]], "width": 7},
        {"name": "passage", "line": [[3, 25], [37, 25]], "width": 2.4},
        {"name": "bays", "area": [[43, 12], [48, 12], [48, 38], [43, 38]]},
    ],
    "buildings": [
        {"name": "hall 1", "area": [[5, 5], [35, 5], [35, 23.8], [5, 23.8]]},
        {"name": "hall 2", "area": [[5, 26.2], [35, 26.2], [35, 45], [5, 45]]},
        {"name": "store", "area": [[52, 6], [74, 6], [74, 44], [52, 44]]},
    ],
    "obstacles": [{"name": "lamp", "disc": [82.6, 25, 0.15]}, {"name": "hydrant", "disc": [20, -3.0, 0.2]}],
    "routes": {
        "nodes": {
            "sw": [0, 0], "s": [40, 0], "se": [80, 0], "e": [80, 25], "ne": [80, 50], "n": [40, 50], "nw": [0, 50],
            "w": [0, 25], "m": [40, 25],
        },
        "ways": [
            {"way": ["sw", "s", "se", "e", "ne", "n", "nw", "w", "sw"], "width": 7},
            {"way": ["s", "m", "n"], "width": 7},
            {"way": ["w", "m"], "width": 2.4},
        ],
    },
    "docks": [{"name": f"bay {k + 1}", "at": [45.5, 15.0 + 5.0 * k], "heading_deg": 180.0} for k in range(5)],
}  # fmt: skip
ROUNDS: Final = (
    ("m", "s", "sw", "w", "nw", "n"),
    ("s", "se", "e", "ne", "n", "m"),
    ("w", "m", "n", "nw"),
    ("ne", "e", "se", "s", "sw", "w", "nw", "n"),
    ("sw", "s", "m", "w"),
)
ROADS: Final = ((-2, 82, -2, 2), (-2, 82, 48, 52), (-2, 2, -2, 52), (38, 42, -2, 52), (78, 82, -2, 52))  # m


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """minutes : of the run;  at_s : when the alert is raised;  sigma : m, of its place."""

    minutes: float = 3.0
    at_s: float = 30.0
    sigma: float = 1.0


@scenario("site-patrol", tags=("ground", "closed loop", "mission"))
def site_patrol(cfg: Site) -> Description:
    """A robot goes round a drawn site; an alert sends it to look, and it goes on with its round."""
    alert = {"id": 1, "at": [20.0, 1.0], "t_s": cfg.at_s, "sigma": cfg.sigma, "source": "fence 4"}
    return _description(cfg.minutes, 1, [alert])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Fleet:
    """minutes : of the run;  robots : 1 to 5;  alerts : at random places and times, the last one 5 minutes before the
    end or half way;  draw : seed of places and times."""

    minutes: float = 60.0
    robots: int = 5
    alerts: int = 20
    draw: int = 1


@scenario("site-fleet", tags=("ground", "closed loop", "mission", "several"))
def site_fleet(cfg: Fleet) -> Description:
    """Five robots go round a drawn site with a passage for one at a time; the nearest goes to each of twenty alerts."""
    if not 1 <= cfg.robots <= len(ROUNDS):
        raise ConfigError(f"{cfg.robots} robots", where="site-fleet", fix=f"1 to {len(ROUNDS)}")
    if not 0.0 < cfg.minutes < np.inf or cfg.alerts < 0 or cfg.draw < 0:
        what = f"{cfg.minutes:g} minutes, {cfg.alerts} alerts, draw {cfg.draw}"
        raise ConfigError(what, where="site-fleet", fix="more than no time, and no number below zero")
    rng = np.random.default_rng(cfg.draw)
    last = max(60.0 * cfg.minutes - 300.0, 30.0 * cfg.minutes)
    times = np.sort(rng.uniform(min(10.0, last), last, cfg.alerts))
    alerts: list[dict[str, Any]] = []
    for k, t in enumerate(times.tolist()):
        west, east, south, north = ROADS[int(rng.integers(len(ROADS)))]
        p = np.round(rng.uniform((west, south), (east, north)), 1).tolist()
        sigma = round(float(rng.uniform(0.3, 1.5)), 1)
        alerts.append({"id": k + 1, "at": p, "t_s": round(t, 1), "sigma": sigma, "source": f"fence {rng.integers(9)}"})
    return _description(cfg.minutes, cfg.robots, alerts)


def _description(minutes: float, robots: int, alerts: list[dict[str, Any]]) -> Description:
    mast = {"start": {"x": 48.0, "y": 40.0, "z": 6.0}, "size": {"radius": 0.1, "height": 0.3}}
    station = {**mast, "mission": {"type": "station", "alerts": alerts}}
    return {
        "duration_s": 60.0 * minutes,
        "world": {"place": {"type": "site", "drawing": DRAWING}},
        "team": {"station": station, **{f"r{k + 1}": _robot(k) for k in range(robots)}},
    }


def _robot(k: int) -> dict[str, Any]:
    dock = DRAWING["docks"][k]
    return {
        "vehicle": {"type": "mecanum", "wheels": WHEELS, "radius": 0.45, "height": 0.6, "latency_s": 0.05},
        "start": {"x": dock["at"][0], "y": dock["at"][1], "yaw_deg": dock["heading_deg"]},
        "sensors": [
            {"type": "imu", "rate_hz": 25.0},
            {"type": "body_twist", "name": "wheels", "rate_hz": 10.0, "rolling": False},
            {"type": "gnss_receiver", "lever": [0.1, 0.0, 0.7], "latency_s": 0.1},
            {"type": "lidar", "rate_hz": 5.0, "beams": 180, "max_range": 12.0},
        ],
        "mission": {
            "type": "patrol",
            "stops": list(ROUNDS[k]),
            "dock": dock["name"],
            "drive": {
                "forward": 0.8, "sideways": 0.4, "acceleration": 0.8, "driver": {"patience_s": 90.0},
                "local": {"type": "teb", "reach": 6.0, "ways": 2},
            },
            "period_s": 0.2,
        },
    }  # fmt: skip
