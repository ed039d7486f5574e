"""Sensors that look at things: lidar, cameras, stereo, radio ranges. All need the world, some the other robots."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf
from typing import Final, final
from zlib import crc32

import numpy as np
from numpy.random import Generator

from outrider.core.rotations import quats_conjugate, quats_exp, quats_multiply
from outrider.data import Kind, Stream
from outrider.errors import ConfigError
from outrider.sim.noise import white
from outrider.sim.sensors.base import STRAIGHT, Device, Quaternion, Setting, Vector, nothing, record, sampled
from outrider.sim.truth import Truth, rotate
from outrider.typing import Bools, Floats

ROUNDING: Final = 1e-6  # more than that of a rotation, as a share


def number_of(robot: str) -> float:
    """The number that stands for a robot's name in a record."""
    return float(crc32(robot.encode()) % 65536)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Lidar:
    """A 2-D scan: `beams` ranges [m] over `field` [rad] about forward, inf where nothing returns.

    It sees the world, the ground if it tilts, and the other robots as the cylinders that collide."""

    name: str = "scan"
    rate_hz: float = 10.0
    beams: int = 360
    field: float = 2 * np.pi
    max_range: float = 30.0
    sigma: float = 0.02  # m
    drop: float = 0.0  # share of beams that return nothing
    lever: Vector = (0.0, 0.0, 0.3)
    mount: Quaternion = STRAIGHT

    def __post_init__(self) -> None:
        if not 0.0 < self.field <= 2.0 * np.pi + 1e-9:
            fix = "more than 0, and 2 pi (360 deg) at most"
            raise ConfigError(f"a field of {self.field:g} rad", where=self.name, fix=fix)

    def angles(self) -> Floats:
        """(beams,) rad, from the sensor's x towards its y."""
        step = self.field / (self.beams if self.field >= 2 * np.pi else max(self.beams - 1, 1))
        return -0.5 * self.field + step * np.arange(self.beams, dtype=np.float64)

    def device(self, setting: Setting, rng: Generator) -> Device:
        angles = self.angles()

        def sense(own: Truth, others: Mapping[str, Truth]) -> Stream:
            here = sampled(own, self.rate_hz)
            origin = here.p + rotate(here.q, np.array(self.lever))
            q = quats_multiply(here.q, np.tile(self.mount, (len(here), 1)))
            seconds = setting.seconds(here.t)
            seen = [(others[k].at(here.t).p, h.radius, h.height) for k, h in setting.hulls.items() if k in others]
            z = setting.world.scan(origin, q, angles, self.max_range, seconds, seen)
            noise, luck = white(rng, len(here), self.beams, self.sigma), rng.random((len(here), self.beams))
            z = np.where(luck < self.drop, inf, np.maximum(z + noise, 0.0))
            columns = {"angle_min": angles[0], "angle_step": angles[1] - angles[0], "range_max": self.max_range}
            extra = {name: np.full(len(here), value) for name, value in columns.items()}
            return record(self, Kind.SCAN, here, z, np.full(self.beams, self.sigma**2), frame=self.name, extra=extra)

        return sense


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectPose:
    """Own pose from a known object in the world, as a lidar matched to its shape gives it.

    Only within `reach` [m] of the object, in sight of two of its features at least (the legs of an airliner), and not
    while two of them stand one behind the other: closer together than `apart` [rad].
    """

    name: str = "lidar_pose"
    object: str
    rate_hz: float = 1.0
    sigma: float = 0.05  # m
    sigma_angle: float = 0.04  # rad
    reach: float = 60.0
    apart: float = 0.02
    height: float = 0.5  # m, of the sensor above the body origin
    latency_s: float = 0.0

    def device(self, setting: Setting, rng: Generator) -> Device:
        if self.object not in setting.world.objects:
            known = ", ".join(setting.world.objects) or "none"
            raise ConfigError(f"knows no object '{self.object}'", where=self.name, fix=f"the world has {known}")
        body = setting.world.objects[self.object]
        points = np.array([body.feature(name) for name in sorted(body.features)])

        def sense(own: Truth, others: Mapping[str, Truth]) -> Stream:
            here = sampled(own, self.rate_hz)
            if not len(here):
                return nothing(self, Kind.POSE, own)
            z, keep = np.hstack([here.p, here.q]), self._matched(here, points)
            draws = white(rng, len(here), 6, np.repeat([self.sigma, self.sigma_angle], 3))
            z[:, :3] += draws[:, :3]
            z[:, 3:] = quats_multiply(here.q, quats_exp(draws[:, 3:]))
            variance = np.repeat([self.sigma, self.sigma_angle], 3) ** 2
            return record(self, Kind.POSE, here, z, variance, latency_s=self.latency_s).select(keep)

        return sense

    def _matched(self, here: Truth, points: Floats) -> Bools:
        eye = here.p + np.array([0.0, 0.0, self.height])
        d = points[None, :, :2] - eye[:, None, :2]
        azimuth = np.sort(np.arctan2(d[..., 1], d[..., 0]), axis=1)
        gaps = np.diff(np.hstack([azimuth, azimuth[:, :1] + 2 * np.pi]), axis=1)
        near = np.linalg.norm(d, axis=2).min(axis=1) < self.reach
        return near & (gaps.min(axis=1) > self.apart)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RobotCamera:
    """Pose of another robot in this camera's axes, while it is in the field of view, near enough and in sight.

    The camera looks along its x axis: `mount` (q_body_camera) turns it up or down.  half_angle [rad] of its cone.
    """

    name: str = "camera"
    rate_hz: float = 5.0
    reach: float = 15.0
    half_angle: float = 1.2
    sigma: float = 0.15  # m
    sigma_angle: float = 0.06  # rad
    lever: Vector = (0.0, 0.0, 0.0)
    mount: Quaternion = STRAIGHT
    latency_s: float = 0.0

    def device(self, setting: Setting, rng: Generator) -> Device:
        lever, axis = np.array(self.lever), rotate(np.array([self.mount]), np.array([1.0, 0.0, 0.0]))[0]

        def sense(own: Truth, others: Mapping[str, Truth]) -> Stream:
            here = sampled(own, self.rate_hz)
            eye = here.p + rotate(here.q, lever)
            back: Floats | None = None
            rows: list[Floats] = []
            keep: list[Bools] = []
            for name in sorted(others):
                draws = white(rng, len(here), 6, 1.0)
                apart = others[name].places(here.t) - eye
                if not self._perhaps(rotate(here.q, axis), apart).any():
                    continue
                there = others[name].at(here.t)
                if back is None:
                    back = quats_conjugate(quats_multiply(here.q, np.tile(self.mount, (len(here), 1))))
                p = rotate(back, there.p - eye)
                distance = np.linalg.norm(p, axis=1)
                seen = (distance < self.reach) & (p[:, 0] > np.cos(self.half_angle) * distance)
                if seen.any():
                    seen[seen] &= setting.world.sees(eye[seen], there.p[seen], setting.seconds(here.t)[seen])
                if seen.any():
                    q = quats_multiply(quats_multiply(back, there.q), quats_exp(draws[:, 3:] * self.sigma_angle))
                    p = p + draws[:, :3] * self.sigma
                    rows.append(np.column_stack([np.full(len(here), number_of(name)), p, q]))
                    keep.append(seen)
            if not rows:
                return nothing(self, Kind.RELATIVE_POSE, own)
            made = _interleaved(self, Kind.RELATIVE_POSE, here, rows, keep, self._variance(), self.latency_s)
            return replace(made, frame=self.name)

        return sense

    def _perhaps(self, axis: Floats, apart: Floats) -> Bools:
        """Whether places `apart` (n, 3) from the camera might be in its view along axes (n, 3), up to rounding."""
        distance = np.sqrt(np.add.reduce(apart * apart, axis=1))
        ahead = np.add.reduce(axis * apart, axis=1) + ROUNDING * (1.0 + distance)
        return (distance < self.reach * (1.0 + ROUNDING)) & (ahead > np.cos(self.half_angle) * distance)

    def _variance(self) -> Floats:
        return np.repeat([self.sigma, self.sigma_angle], 3) ** 2


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class StereoVelocity:
    """Body velocity from a stereo camera, while some surface is within `reach` [m]."""

    name: str = "stereo"
    rate_hz: float = 2.0
    reach: float = 4.0
    sigma: float = 0.2  # m/s
    latency_s: float = 0.0

    def device(self, setting: Setting, rng: Generator) -> Device:
        def sense(own: Truth, others: Mapping[str, Truth]) -> Stream:
            here = sampled(own, self.rate_hz)
            if not len(here):
                return nothing(self, Kind.BODY_VELOCITY, own)
            seconds = setting.seconds(here.t)
            near = setting.world.clearance(here.p, seconds) < self.reach
            z = rotate(quats_conjugate(here.q), here.v) + white(rng, len(here), 3, self.sigma)
            made = record(self, Kind.BODY_VELOCITY, here, z, np.full(3, self.sigma**2), latency_s=self.latency_s)
            return made.select(near)

        return sense


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Uwb:
    """Ranges to anchors (by number, in the site frame) and to the other robots, too long by `blocked` [m] without a
    line of sight, and by `offset` always."""

    name: str = "uwb"
    rate_hz: float = 10.0
    anchors: Mapping[int, Vector] = field(default_factory=dict[int, Vector])
    robots: bool = True
    reach: float = 80.0
    sigma: float = 0.1  # m
    offset: float = 0.0
    blocked: float = 0.5
    lever: Vector = (0.0, 0.0, 0.0)

    def device(self, setting: Setting, rng: Generator) -> Device:
        def sense(own: Truth, others: Mapping[str, Truth]) -> Stream:
            here = sampled(own, self.rate_hz)
            eye = here.p + rotate(here.q, np.array(self.lever))
            seconds = setting.seconds(here.t)
            ends = {float(k): np.tile(p, (len(here), 1)) for k, p in sorted(self.anchors.items())}
            if self.robots:
                ends |= {number_of(name): others[name].at(here.t).p for name in sorted(others)}
            rows: list[Floats] = []
            keep: list[Bools] = []
            for number, end in ends.items():
                distance = np.linalg.norm(end - eye, axis=1)
                hidden = ~setting.world.sees(eye, end, seconds)
                z = distance + self.offset + self.blocked * hidden + white(rng, len(here), 1, self.sigma)[:, 0]
                rows.append(np.column_stack([np.full(len(here), number), z]))
                keep.append(distance < self.reach)
            return _interleaved(self, Kind.RANGE, here, rows, keep, np.array([np.nan, self.sigma**2]), 0.0)

        return sense


def _interleaved(
    sensor: "RobotCamera | Uwb",
    kind: Kind,
    here: Truth,
    rows: list[Floats],
    keep: list[Bools],
    variance: Floats,
    late: float,
) -> Stream:
    """The records of several partners as one stream in time order."""
    if len(rows) == 1:
        alone = record(sensor, kind, here, rows[0], variance, latency_s=late)
        return alone if keep[0].all() else alone.select(keep[0])
    width = len(kind.columns)
    z = np.stack(rows, axis=1).reshape(-1, width) if rows else np.zeros((0, width))
    index = np.repeat(np.arange(len(here)), len(rows))
    every = record(sensor, kind, here.select(index), z, variance, latency_s=late)
    return every.select(np.stack(keep, axis=1).ravel() if keep else np.zeros(0, np.bool_))
