"""Smooth motion through points, for a robot that is carried."""

from dataclasses import replace

import numpy as np

from outrider.errors import ConfigError
from outrider.scenarios.navigation import Put
from outrider.scenarios.parts import TrackMission
from outrider.sim.motion import glide
from outrider.sim.truth import EPOCH, Place, Truth
from outrider.sim.world import World
from outrider.typing import Floats

STANDING = 6  # control points that a quintic spline needs to stand exactly
STANDING_HZ = 20.0


def track(mission: TrackMission, put: Put, duration_s: float, world: World, robot: str) -> Truth:
    """From the start through the points at `speed`, corners rounded; it stands before and after."""
    corners = np.array([put[:3], *mission.points])
    legs = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    if not legs.any():
        raise ConfigError("all points of the track are one", fix="give at least two places")
    control = _control(corners, legs, mission, put[3])
    place = Place(gravity=world.gravity, datum=world.datum, t0=EPOCH, robot=robot)
    return glide(control, mission.spacing_s, duration_s, mission.rate_hz, leans=mission.flies, place=place)


def _control(corners: Floats, legs: Floats, mission: TrackMission, yaw: float) -> Floats:
    """(m, 4) east, north, up [m] and heading [rad] every `spacing_s`: standing, along the legs, standing."""
    way = np.concatenate([[0.0], np.cumsum(legs)])
    s = np.arange(0.0, way[-1], mission.speed * mission.spacing_s)
    p = np.column_stack([np.interp(s, way, corners[:, i]) for i in range(3)])
    d = np.diff(corners[:, :2], axis=0)
    moving = np.hypot(d[:, 0], d[:, 1]) > 1e-6
    course = np.unwrap(np.arctan2(d[moving, 1], d[moving, 0])) if moving.any() else np.array([yaw])
    first = np.round((yaw - course[0]) / (2 * np.pi)) * 2 * np.pi  # the turns that the start has already made
    leg = np.clip(np.searchsorted(way, s, side="right") - 1, 0, len(legs) - 1)
    heading = (course + first)[np.maximum(np.cumsum(moving)[leg] - 1, 0)]
    still = STANDING + round(mission.wait_s / mission.spacing_s)
    before = np.tile([*corners[0], yaw], (still, 1))
    after = np.tile([*corners[-1], heading[-1]], (STANDING, 1))
    return np.vstack([before, np.column_stack([p, heading]), after])


def standing(put: Put, duration_s: float, world: World, robot: str) -> Truth:
    """Stays where it was put."""
    place = Place(gravity=world.gravity, datum=world.datum, t0=EPOCH, robot=robot)
    truth = glide(np.tile(put, (STANDING + 2, 1)), 1.0, duration_s, STANDING_HZ, place=place)
    return replace(truth, p=np.tile(put[:3], (len(truth), 1)), v=np.zeros_like(truth.v))
