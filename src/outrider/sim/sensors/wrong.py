"""What can be wrong with any sensor: its clock, its silence, its values. Each wraps a sensor and is one itself."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import final

import numpy as np
from numpy.random import Generator

from outrider.data import Stream
from outrider.errors import ConfigError
from outrider.sim.sensors.base import Device, Plain, Sensor, Setting, make_device
from outrider.sim.truth import Truth


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Clocked:
    """A sensor whose device has a clock of its own: stamp = true + offset + drift (true - start)."""

    sensor: Sensor | Plain
    offset_s: float = 0.0
    drift: float = 0.0  # s/s

    @property
    def name(self) -> str:
        return self.sensor.name

    def device(self, setting: Setting, rng: Generator) -> Device:
        inner = make_device(self.sensor, setting, rng)

        def sense(own: Truth, others: Mapping[str, Truth]) -> Stream:
            s = inner(own, others)
            off = self.offset_s * 1e9 + self.drift * (s.t - setting.start)
            return replace(s, t=s.t + np.rint(off).astype(np.int64))

        return sense


class Wrong(Enum):
    """How the records of a spell are spoilt."""

    SILENT = "no record"
    FROZEN = "the last good value again and again"
    NAN = "not a number"
    SHIFTED = "a constant is added to every column"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Faulty:
    """A sensor that fails between two times [s since the start]."""

    sensor: Sensor | Plain
    start_s: float
    end_s: float
    how: Wrong = Wrong.SILENT
    by: float = 0.0

    def __post_init__(self) -> None:
        if not self.start_s < self.end_s:
            raise ConfigError(
                f"from {self.start_s} to {self.end_s} s", where=self.name, fix="it must end after it starts"
            )

    @property
    def name(self) -> str:
        return self.sensor.name

    def device(self, setting: Setting, rng: Generator) -> Device:
        inner = make_device(self.sensor, setting, rng)
        last: list[Stream] = []

        def sense(own: Truth, others: Mapping[str, Truth]) -> Stream:
            s = inner(own, others)
            since = setting.seconds(s.t)
            hit = (since >= self.start_s) & (since < self.end_s)
            before = np.flatnonzero(since < self.start_s)
            if before.size:
                last[:] = [s.select(before[-1:])]
            if self.how is Wrong.SILENT:
                return s.select(~hit)
            z = s.z.copy()
            if self.how is Wrong.NAN:
                z[hit] = np.nan
            elif self.how is Wrong.SHIFTED:
                z[hit] += self.by
            elif last:
                z[hit] = last[0].z
            return replace(s, z=z)

        return sense
