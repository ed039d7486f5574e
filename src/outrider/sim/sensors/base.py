"""What a sensor is to the simulator, and what all of them share.

A sensor is frozen parameters; its *device* is that sensor in one run: a function from the newest piece of the truth to
the records that fall into it. Slow errors (biases, fix states, outages) are drawn for the whole run when the device is
made, white noise row by row: one call over a whole run and many over its pieces give the same records, to rounding.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Protocol, TypeAlias, final, runtime_checkable

import numpy as np
from numpy.random import Generator

from outrider.data import Kind, Stream, stream
from outrider.errors import ConfigError
from outrider.sim.monitor import Hull
from outrider.sim.truth import Truth
from outrider.sim.world import World
from outrider.typing import Floats, Ints

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]
STRAIGHT: Quaternion = (0.0, 0.0, 0.0, 1.0)

Device: TypeAlias = Callable[[Truth, Mapping[str, Truth]], Stream]
"""(own piece of truth, the other robots' pieces) -> the records stamped within that piece."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """The run that a device is made for. start, end : ns;  hulls : of every robot, by name."""

    world: World
    robot: str
    start: int
    end: int
    seed: int
    hulls: Mapping[str, Hull] = field(default_factory=dict[str, Hull])

    def seconds(self, t: Ints) -> Floats:
        """(n,) since the start."""
        return np.asarray((t - self.start) * 1e-9, np.float64)

    @property
    def duration_s(self) -> float:
        """Of the longest possible run."""
        return (self.end - self.start) * 1e-9


@runtime_checkable
class Sensor(Protocol):
    """Anything that can be made into a device."""

    @property
    def name(self) -> str:
        """Of its stream; also the key of its random numbers."""
        ...

    def device(self, setting: Setting, rng: Generator) -> Device:
        """The sensor in one run."""
        ...


@runtime_checkable
class Plain(Protocol):
    """A sensor of nothing but the robot's own truth, with white noise."""

    @property
    def name(self) -> str:
        """Of its stream; also the key of its random numbers."""
        ...

    def sample(self, truth: Truth, rng: Generator) -> Stream:
        """What it records along a piece of the truth."""
        ...


def make_device(sensor: Sensor | Plain, setting: Setting, rng: Generator) -> Device:
    """The device of any sensor. Raises ConfigError for one that would never record."""
    rate = getattr(sensor, "rate_hz", 1.0)
    if not 0.0 < rate < np.inf:
        raise ConfigError(f"a rate of {rate} Hz", where=f"robot {setting.robot}: {sensor.name}", fix="more than zero")
    if isinstance(sensor, Sensor):
        return sensor.device(setting, rng)
    return lambda own, others: sensor.sample(own, rng)


def stamps(piece: Truth, rate_hz: float, phase_s: float = 0.0) -> Ints:
    """Stamps [ns] phase + k / rate after the run's start that fall into a piece.

    A piece begins with the last row of the one before, which therefore belongs to it only where the run begins.
    """
    first, last = int(piece.t[0]) - piece.start, int(piece.t[-1]) - piece.start
    k = np.arange(max(int((first * 1e-9 - phase_s) * rate_hz) - 1, 0), int((last * 1e-9 - phase_s) * rate_hz) + 2)
    t = np.rint((phase_s + k / rate_hz) * 1e9).astype(np.int64)
    return piece.start + t[((t > first) | (first == 0)) & (t <= last)]


def sampled(piece: Truth, rate_hz: float, phase_s: float = 0.0) -> Truth:
    """A piece at its `stamps`, which sensors of one rate share."""
    key = (rate_hz, phase_s)
    here = piece.samples.get(key)
    if here is None:
        rows = _on_rows(piece, rate_hz, phase_s)
        here = piece.at(stamps(piece, rate_hz, phase_s)) if rows is None else piece.select(rows)
        piece.samples[key] = here
    return here


def _on_rows(piece: Truth, rate_hz: float, phase_s: float) -> slice | None:
    """The rows at which a sensor's `stamps` fall; None unless all of them fall on rows for certain."""
    n = len(piece)
    if n < 2:
        return None
    begins, second, last = int(piece.t[0]), int(piece.t[1]), int(piece.t[-1])
    step, every, phase, first = second - begins, 1e9 / rate_hz, phase_s * 1e9, begins - piece.start
    if step <= 0 or last - begins != step * (n - 1) or every % step or phase % step or first % step:
        return None
    row = max(int(phase) - first, 0 if first == 0 else step) // step
    row += (int(phase) - first - row * step) % int(every) // step
    return slice(row, n, int(every) // step)


def nothing(sensor: Sensor | Plain, kind: Kind, truth: Truth) -> Stream:
    """No record of this sensor."""
    return _nothing(sensor.name, kind, truth.robot)


@cache
def _nothing(name: str, kind: Kind, robot: str) -> Stream:
    return stream(name, kind, np.zeros(0, np.int64), np.zeros((0, len(kind.columns))), robot=robot)


def record(
    sensor: Sensor | Plain, kind: Kind, truth: Truth, z: Floats, variance: Floats, *, latency_s: float = 0.0,
    **more: object,
) -> Stream:  # fmt: skip
    """A stream with one variance for all rows; `latency_s` says how much later it arrives."""
    var = np.empty((truth.t.size, variance.size))
    var[:] = variance
    arrival = truth.t + round(latency_s * 1e9) if latency_s else truth.t
    return stream(sensor.name, kind, truth.t, z, var=var, t_arrival=arrival, robot=truth.robot, **more)
