"""What really happened: poses, rates, specific force and slow sensor errors of one robot at the rate of its IMU.

World ENU, body FLU, flat and not rotating: the Earth's rate and its curvature are left out.
"""

from dataclasses import dataclass, field, fields, replace
from typing import final

import numpy as np
from numpy.random import Generator

from outrider._kernel import kernel
from outrider.core import rotations
from outrider.core.rotations import slerp
from outrider.data import Datum, Trajectory
from outrider.errors import ConfigError
from outrider.models.motion.planar import PlanarRobot
from outrider.models.motion.strapdown import StrapdownIns
from outrider.sim.noise import gauss_markov, random_walk
from outrider.typing import Bools, Floats, Ints

EPOCH = 1_750_000_000_000_000_000  # ns: 15 June 2025, within the bundled magnetic model
SITE = Datum(lat=np.deg2rad(45.0), lon=np.deg2rad(7.6), alt=240.0)
STANDARD_GRAVITY = 9.80665  # m/s^2


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where, when and who: gravity [m/s^2], the datum of the site frame, the first stamp [ns], the robot's name."""

    gravity: float = STANDARD_GRAVITY
    datum: Datum = SITE
    t0: int = EPOCH
    robot: str = "robot"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Biases:
    """Slow errors of the sensors. gyro (n, 3) rad/s, accel (n, 3) m/s^2, gnss (n, 3) m in the world, baro (n,) m,
    wheels (n,): true speed = (1 + wheels) measured speed."""

    gyro: Floats
    accel: Floats
    gnss: Floats
    baro: Floats
    wheels: Floats

    @classmethod
    def none(cls, n: int) -> "Biases":
        """Perfect sensors."""
        three, one = np.zeros((n, 3)), np.zeros(n)
        return cls(gyro=three, accel=three, gnss=three, baro=one, wheels=one)

    def select(self, keep: Bools | Ints | slice) -> "Biases":
        """Only the given rows."""
        return Biases(
            gyro=self.gyro[keep], accel=self.accel[keep], gnss=self.gnss[keep], baro=self.baro[keep],
            wheels=self.wheels[keep],
        )  # fmt: skip


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """One robot's true motion.

    t : (n,) int64 ns, evenly spaced;  p, v : (n, 3) m and m/s, site frame;  q : (n, 4) x y z w, R_site_body;
    w, f : (n, 3) body rate [rad/s] and specific force [m/s^2] at the body origin, in the body;  gravity [m/s^2], down.
    actuators : (n, k) wheels' rim speeds [m/s] and steering angles [rad], or rotor speeds [rad/s]; none of them: k = 0.
    start : ns, first stamp of the whole run. Of a run, a piece begins with the last row of the piece before.
    """

    t: Ints
    p: Floats
    q: Floats
    v: Floats
    w: Floats
    f: Floats
    bias: Biases
    actuators: Floats
    start: int
    gravity: float = STANDARD_GRAVITY
    datum: Datum = SITE
    robot: str = "robot"
    samples: dict[tuple[float, float], "Truth"] = field(
        default_factory=dict[tuple[float, float], "Truth"], init=False, repr=False, compare=False
    )
    """What sensors of one rate and phase take of it."""

    def __len__(self) -> int:
        return self.t.shape[0]

    @property
    def dt(self) -> float:
        """Step [s]."""
        return float(self.t[-1] - self.t[0]) * 1e-9 / (self.t.size - 1)

    def trajectory(self) -> Trajectory:
        """The poses and velocities alone."""
        return Trajectory(t=self.t, p=self.p, q=self.q, v=self.v, datum=self.datum, name="truth")

    def select(self, keep: Bools | Ints | slice) -> "Truth":
        """The same truth with only the given rows."""
        return Truth(
            t=self.t[keep], p=self.p[keep], q=self.q[keep], v=self.v[keep], w=self.w[keep], f=self.f[keep],
            bias=self.bias.select(keep), actuators=self.actuators[keep], start=self.start, gravity=self.gravity,
            datum=self.datum, robot=self.robot,
        )  # fmt: skip

    def at(self, t: Ints) -> "Truth":
        """The truth at other stamps [ns] within its span: cubic in position, SLERP in attitude, linear in the rest."""
        if t.size == 1 and (rows := self.rows_at(t)) is not None:  # of most sensors in most steps
            return self.select(rows)
        if t.size and (t.min() < self.t[0] or t.max() > self.t[-1]):
            raise ConfigError("truth is not extrapolated", where=self.robot, fix="ask for stamps within its span")
        if (rows := self.rows_at(t)) is not None:
            return self.select(rows)
        i = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, self.t.size - 2)
        u = ((t - self.t[i]) / (self.t[i + 1] - self.t[i]))[:, None]

        def line(x: Floats) -> Floats:
            part = u if x.ndim == 2 else u[:, 0]
            return x[i] + part * (x[i + 1] - x[i])

        a, b, h = self.v[i] * self.dt, self.v[i + 1] * self.dt, self.p[i + 1] - self.p[i]
        p = self.p[i] + u * (a + u * (3 * h - 2 * a - b + u * (a + b - 2 * h)))  # cubic Hermite
        bias = Biases(**{f.name: line(getattr(self.bias, f.name)) for f in fields(Biases)})
        q = slerp(t, self.t, self.q)
        others = {name: line(getattr(self, name)) for name in ("v", "w", "f", "actuators")}
        return replace(self, t=t, p=p, q=q, bias=bias, **others)

    def places(self, t: Ints) -> Floats:
        """(n, 3) the positions alone at other stamps."""
        rows = self.rows_at(t) if t.size else slice(0, 0)
        return self.at(t).p if rows is None else self.p[rows]

    def rows_at(self, t: Ints) -> Ints | slice | None:
        """The rows with just these stamps, as a slice if they are evenly spaced; None if some lie between rows."""
        spacing = max(int(self.t[1] - self.t[0]), 1) if len(self) > 1 else 1
        if t.size == 1:
            k = max(min(int(t[0] - self.t[0]) // spacing, len(self) - 1), 0)
            return slice(k, k + 1, 1) if self.t[k] == t[0] else None
        i = np.minimum((t - self.t[0]) // spacing, len(self) - 1)
        if not np.array_equal(self.t[i], t):
            return None
        step = int(i[1] - i[0]) if i.size > 1 else 1
        even = i.size and step > 0 and bool((np.diff(i) == step).all())
        return slice(int(i[0]), int(i[-1]) + 1, step) if even else i


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """How slow errors start (one sigma) and walk; random walks as densities [unit/s/sqrt(Hz)]."""

    gyro_start: float = 2e-3  # rad/s
    gyro_walk: float = 2e-5
    accel_start: float = 0.03  # m/s^2
    accel_walk: float = 3e-4
    gnss_sigma: float = 0.0  # m, east and north, Gauss-Markov
    gnss_sigma_up: float = 0.0
    gnss_tau_s: float = 60.0
    baro_start: float = 0.0  # m
    baro_walk: float = 0.0
    wheels_start: float = 0.02
    wheels_walk: float = 0.0  # per sqrt(m) travelled

    @classmethod
    def of(cls, model: PlanarRobot | StrapdownIns) -> "Drift":
        """What a process model expects."""
        if isinstance(model, StrapdownIns):
            return cls(
                gyro_start=model.initial_gyro_bias,
                gyro_walk=model.gyro_bias_walk,
                accel_start=model.initial_accel_bias,
                accel_walk=model.accel_bias_walk,
                gnss_sigma=model.gnss_bias,
                gnss_sigma_up=model.gnss_bias_up,
                gnss_tau_s=model.gnss_time,
                baro_start=model.initial_baro_bias,
                baro_walk=model.baro_walk,
                wheels_start=0.0,
            )
        return cls(
            gyro_start=model.initial_gyro_bias,
            gyro_walk=model.gyro_bias_walk,
            gnss_sigma=model.gnss_bias,
            gnss_tau_s=model.gnss_time,
            wheels_start=model.initial_scale,
            wheels_walk=model.scale_walk,
        )


def drift(truth: Truth, rng: Generator, how: Drift = Drift()) -> Truth:
    """The same motion with slow sensor errors drawn anew."""
    n, dt = len(truth), truth.dt
    gyro, accel, gnss, baro, wheels = rng.spawn(5)  # so that changing one leaves the others alone
    bias = Biases(
        gyro=random_walk(gyro, n, 3, dt, how.gyro_walk, how.gyro_start),
        accel=random_walk(accel, n, 3, dt, how.accel_walk, how.accel_start),
        gnss=gauss_markov(gnss, n, 3, dt, (how.gnss_sigma, how.gnss_sigma, how.gnss_sigma_up), how.gnss_tau_s),
        baro=random_walk(baro, n, 1, dt, how.baro_walk, how.baro_start)[:, 0],
        wheels=_wheel_scale(wheels, truth, how),
    )
    return replace(truth, bias=bias)


def _wheel_scale(rng: Generator, truth: Truth, how: Drift) -> Floats:
    """(n,) a constant, and a walk over the way travelled; a motion still to come counts as none."""
    constant = rng.standard_normal() * how.wheels_start
    if how.wheels_walk == 0.0:
        return np.full(len(truth), constant)
    travelled = np.linalg.norm(np.nan_to_num(truth.v), axis=1) * truth.dt
    return constant + np.cumsum(rng.standard_normal(len(truth)) * how.wheels_walk * np.sqrt(travelled))


def rotate(q: Floats, v: Floats) -> Floats:
    """R(q) v for rows of unit quaternions q (n, 4) and v (n, 3) or (3,)."""
    out = np.empty((q.shape[0], 3))
    if v.ndim == 1:
        _rotate_one(np.ascontiguousarray(q), v, out)
    else:
        _rotate_rows(np.ascontiguousarray(q), np.ascontiguousarray(np.broadcast_to(v, out.shape)), out)
    return out


@kernel
def _rotate_rows(q: Floats, v: Floats, out: Floats) -> None:
    for i in range(q.shape[0]):
        rotations.rotate(q[i], v[i], out[i])


@kernel
def _rotate_one(q: Floats, v: Floats, out: Floats) -> None:
    for i in range(q.shape[0]):
        rotations.rotate(q[i], v, out[i])
