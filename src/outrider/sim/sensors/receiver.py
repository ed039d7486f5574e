"""A GNSS receiver with what real ones do: solution types that come and go, slow errors of their own or common to a
region, reflections near walls, a sky that buildings hide, outages, jumps, null fixes and claims that are not true."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, final

import numpy as np
from numpy.random import Generator

from outrider.core.geodesy import enu_to_geodetic
from outrider.data import Altitude, Fix, Kind, Stream
from outrider.errors import ConfigError
from outrider.sim.noise import gauss_markov, generator, white
from outrider.sim.sensors.base import Device, Setting, Vector, record, stamps
from outrider.sim.truth import Truth, rotate
from outrider.typing import Bools, Floats, Ints


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Quality:
    """Errors of one solution type [m], horizontal: white and slow (Gauss-Markov); vertical ones are 1.6 times those."""

    white: float
    slow: float
    tau_s: float


QUALITIES: Final[Mapping[Fix, Quality]] = {
    Fix.FIXED: Quality(white=0.01, slow=0.01, tau_s=60.0),
    Fix.FLOAT: Quality(white=0.1, slow=0.35, tau_s=40.0),
    Fix.DGNSS: Quality(white=0.3, slow=0.5, tau_s=100.0),
    Fix.SINGLE: Quality(white=0.5, slow=1.5, tau_s=120.0),
}
VERTICAL = np.array([1.0, 1.0, 1.6])
NEEDED = 4  # satellites for a solution
GRID_HZ = 2.0  # slow errors are drawn so often and interpolated


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Spell:
    """What happens between two times [s since the start]: another solution type, or a constant offset (m, ENU), or null
    fixes that the receiver calls perfect."""

    start_s: float
    end_s: float
    fix: Fix | None = None
    offset: Vector = (0.0, 0.0, 0.0)
    null: bool = False

    def __post_init__(self) -> None:
        if not self.start_s < self.end_s:
            raise ConfigError(
                f"from {self.start_s} to {self.end_s} s", where="spell", fix="it must end after it starts"
            )

    def covers(self, seconds: Floats) -> Bools:
        return (seconds >= self.start_s) & (seconds < self.end_s)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class GnssReceiver:
    """Position of an antenna at `lever` [m, body].

    dwell_s : mean stay in each solution type, the first one is the type it starts in; it then changes to any of the
    others.  common : name of a region whose slow error all its receivers share, "" for one of its own.  multipath [m]:
    error right at a surface, falling off over `multipath_reach` [m].  satellites : how many stand in the sky; those
    behind something do not count (`obstructed`), and with fewer than four there is no fix.  claims : stated over true
    standard deviation.
    """

    name: str = "gnss"
    rate_hz: float = 5.0
    lever: Vector = (0.0, 0.0, 0.0)
    latency_s: float = 0.0
    phase_s: float = 0.0
    dwell_s: Mapping[Fix, float] = field(default_factory=lambda: {Fix.FIXED: float("inf")})
    qualities: Mapping[Fix, Quality] = field(default_factory=lambda: QUALITIES)
    common: str = ""
    multipath: float = 0.0
    multipath_reach: float = 2.0
    satellites: int = 16
    obstructed: bool = False
    claims: float = 1.0
    spells: tuple[Spell, ...] = ()

    def device(self, setting: Setting, rng: Generator) -> Device:
        chain, sky, *slow = rng.spawn(2 + len(self.qualities) + 1)
        changes, types = self._chain(setting, chain)
        drifts = {fix: self._drift(setting, slow[k], q) for k, (fix, q) in enumerate(self.qualities.items())}
        reflections = self._drift(setting, slow[-1], Quality(white=0.0, slow=1.0, tau_s=15.0))
        directions = _sky(sky, self.satellites)
        site = setting.world.datum

        silence: Stream | None = None  # what it records of a piece without a stamp

        def sense(own: Truth, others: Mapping[str, Truth]) -> Stream:
            nonlocal silence
            t = stamps(own, self.rate_hz, self.phase_s)
            if not t.size and silence is not None:
                return silence
            made = receive(own.at(t))
            silence = made.select(slice(0)) if silence is None else silence
            return made

        def receive(here: Truth) -> Stream:
            seconds = setting.seconds(here.t)
            antenna = here.p + rotate(here.q, np.array(self.lever))
            fix = types[np.searchsorted(changes, seconds, side="right") - 1]
            for spell in self.spells:
                fix = np.where(spell.covers(seconds) & (spell.fix is not None), (spell.fix or Fix.NONE).value, fix)
            seen = self._seen(setting, antenna, directions, seconds)
            fix = np.where(seen < NEEDED, Fix.NONE.value, fix)
            p, sigma = antenna + here.bias.gnss, np.zeros(len(here))
            noise = white(rng, len(here), 3, 1.0)
            for kind, quality in self.qualities.items():
                rows = fix == kind.value
                p[rows] += VERTICAL * (quality.white * noise[rows] + _at(drifts[kind], seconds[rows]))
                sigma[rows] = np.hypot(quality.white, quality.slow)
            if self.multipath:
                gap = setting.world.clearance(antenna, seconds)
                p += (self.multipath * np.exp(-np.maximum(gap, 0.0) / self.multipath_reach))[:, None] * _at(
                    reflections, seconds
                )
            for spell in self.spells:
                p[spell.covers(seconds)] += spell.offset
            z = np.column_stack(enu_to_geodetic(p, site.lat, site.lon, site.alt))
            told = np.maximum(self.claims * sigma, 1e-3)
            null = np.zeros(len(here), np.bool_)
            for spell in self.spells:
                null |= spell.covers(seconds) & spell.null
            z[null], fix, seen = 0.0, np.where(null, Fix.NONE.value, fix), np.where(null, 0, seen)
            kept = (fix != Fix.NONE.value) | null  # without a solution a receiver is silent
            extra = {"fix": fix, "satellites": seen, "hdop": 0.6 + 4.0 / np.maximum(seen, 1), "hacc": told}
            extra["vacc"] = 1.6 * told
            columns = {name: np.asarray(column, np.float64) for name, column in extra.items()}
            made = record(
                self, Kind.GNSS, here, z, np.zeros(3), frame=self.name, latency_s=self.latency_s,
                altitude=Altitude.ELLIPSOID, extra=columns,
            )  # fmt: skip
            made.var[:] = np.where(null[:, None], 0.0, (told[:, None] * VERTICAL) ** 2)
            return made.select(kept)

        return sense

    def _chain(self, setting: Setting, rng: Generator) -> tuple[Floats, Ints]:
        """Times [s] of changes of the solution type, the first one 0, and the type from each on."""
        kinds = list(self.dwell_s)
        unknown = [k.name for k in kinds if k not in self.qualities and k is not Fix.NONE]
        if not kinds or unknown:
            known = ", ".join(k.name.lower() for k in self.qualities)
            raise ConfigError(f"no errors known of {unknown}", where=f"{self.name} dwell_s", fix=f"it knows {known}")
        times, types, end = [0.0], [kinds[0].value], setting.duration_s
        while times[-1] < end and len(kinds) > 1:
            stay = self.dwell_s[Fix(types[-1])]
            wait, turn = rng.exponential(), int(rng.integers(len(kinds) - 1))
            if not np.isfinite(stay):
                break
            times.append(times[-1] + wait * stay)
            types.append([k.value for k in kinds if k.value != types[-1]][turn])
        return np.array(times), np.array(types, np.int64)

    def _drift(self, setting: Setting, rng: Generator, quality: Quality) -> Floats:
        """(n, 3) the slow error of one solution type over the whole run, `GRID_HZ`."""
        if self.common:
            rng = generator(setting.seed, "region", f"{self.common} {quality.slow} {quality.tau_s}")
        n = int(setting.duration_s * GRID_HZ) + 3
        return gauss_markov(rng, n, 3, 1.0 / GRID_HZ, quality.slow, quality.tau_s)

    def _seen(self, setting: Setting, antenna: Floats, directions: Floats, seconds: Floats) -> Ints:
        """(n,) satellites in sight."""
        n, m = len(antenna), len(directions)
        if not self.obstructed:
            return np.full(n, m, np.int64)
        a = np.repeat(antenna, m, axis=0)
        free = setting.world.sees(a, a + np.tile(directions, (n, 1)) * 300.0, np.repeat(seconds, m))
        return free.reshape(n, m).sum(axis=1)


def _sky(rng: Generator, n: int) -> Floats:
    """(n, 3) directions of satellites, evenly over the sky above ten degrees."""
    azimuth, height = rng.uniform(0.0, 2 * np.pi, n), rng.uniform(np.sin(np.deg2rad(10.0)), 1.0, n)
    flat = np.sqrt(1.0 - height**2)
    return np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), height])


def _at(grid: Floats, seconds: Floats) -> Floats:
    """Rows of a process on the grid at other times, linear in between."""
    at = seconds * GRID_HZ
    i = np.clip(at.astype(np.int64), 0, len(grid) - 2)
    u = (at - i)[:, None]
    return grid[i] * (1.0 - u) + grid[i + 1] * u
