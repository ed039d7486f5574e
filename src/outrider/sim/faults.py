"""What goes wrong in real logs, done on purpose to one stream at a time. Times are seconds since the log's start.

Every function takes a log and returns another; none looks at truth. `FAULTS` holds one ready-made case of each by name.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from outrider.core.geodesy import enu_to_geodetic
from outrider.core.rotations import quats_exp, quats_multiply
from outrider.data import EventLog, Fix, Kind, Stream
from outrider.errors import ConfigError
from outrider.sim.noise import gauss_markov, white
from outrider.typing import Bools, Floats

NULL_FIX = np.zeros(3)


def within(log: EventLog, source: str, start_s: float, end_s: float) -> Bools:
    """Which records of a source were stamped in [start, end)."""
    since = (_of(log, source).t - log.span[0]) * 1e-9
    return (since >= start_s) & (since < end_s)


def outage(log: EventLog, source: str, start_s: float, end_s: float) -> EventLog:
    """The source falls silent."""
    return log.with_streams(_of(log, source).select(~within(log, source, start_s, end_s)))


def jump(log: EventLog, source: str, start_s: float, end_s: float, metres: tuple[float, float, float]) -> EventLog:
    """GNSS positions are off by a constant (east, north, up), as after a reflection; the stated variance stays."""
    hit = within(log, source, start_s, end_s)
    return _shift(log, source, hit, np.tile(metres, (int(hit.sum()), 1)))


def degrade(
    log: EventLog, source: str, start_s: float, end_s: float, fix: Fix, sigma: float, rng: Generator, told: float = 1.0
) -> EventLog:
    """A worse GNSS solution: `fix`, half its error white, half slow (20 s); the receiver states `told` times sigma."""
    hit, s = within(log, source, start_s, end_s), _of(log, source)
    n = int(hit.sum())
    if n == 0:
        return log
    share, up = sigma / np.sqrt(2.0), np.array([1.0, 1.0, 1.6])
    error = gauss_markov(rng, n, 3, 1.0 / s.rate, share, 20.0) + white(rng, n, 3, share)
    log = _shift(log, source, hit, error * up)
    worse = {"fix": float(fix.value), "satellites": 9.0, "hdop": 1.9, "hacc": told * sigma, "vacc": 1.6 * told * sigma}
    return _stating(log, source, hit, worse, np.square(told * sigma * up))


def null_fixes(log: EventLog, source: str, start_s: float, end_s: float) -> EventLog:
    """The receiver goes on sending latitude and longitude zero, without satellites, and calls them exact."""
    hit, s = within(log, source, start_s, end_s), _of(log, source)
    log = log.with_streams(replace(s, z=np.where(hit[:, None], NULL_FIX, s.z)))
    return _stating(log, source, hit, {"fix": float(Fix.NONE.value), "satellites": 0.0}, np.zeros(3))


def turn_heading(log: EventLog, source: str, angle: float, start_s: float = 0.0, end_s: float = np.inf) -> EventLog:
    """Claimed attitudes are turned about the vertical by `angle` [rad], as by a magnetic compass beside iron."""
    hit, s = within(log, source, start_s, end_s), _of(log, source)
    z = s.z.copy()
    z[hit] = quats_multiply(quats_exp(np.array([0.0, 0.0, angle])), z[hit])
    return log.with_streams(replace(s, z=z))


def scale(log: EventLog, source: str, factor: float, columns: slice = slice(0, 3)) -> EventLog:
    """Some columns (of a twist: the velocity) are multiplied."""
    s = _of(log, source)
    z = s.z.copy()
    z[:, columns] *= factor
    return log.with_streams(replace(s, z=z))


def freeze(log: EventLog, source: str, start_s: float, end_s: float) -> EventLog:
    """Values stand still while stamps go on."""
    hit, s = within(log, source, start_s, end_s), _of(log, source)
    z = s.z.copy()
    z[hit] = z[hit][:1]
    return log.with_streams(replace(s, z=z))


def nan_rows(log: EventLog, source: str, rng: Generator, share: float = 0.05) -> EventLog:
    """Some records hold NaN, infinity or 1e308."""
    s = _of(log, source)
    hit = rng.random(len(s)) < share
    z = s.z.copy()
    z[hit, rng.integers(0, z.shape[1], int(hit.sum()))] = rng.choice([np.nan, np.inf, 1e308], int(hit.sum()))
    return log.with_streams(replace(s, z=z))


def clock_jump(log: EventLog, source: str, start_s: float, seconds: float) -> EventLog:
    """From `start_s` on the source's clock is off; when records arrive is untouched."""
    hit, s = within(log, source, start_s, np.inf), _of(log, source)
    return log.with_streams(replace(s, t=s.t + np.where(hit, round(seconds * 1e9), 0)))


def duplicates(log: EventLog, source: str, rng: Generator, share: float = 0.1) -> EventLog:
    """Some records come twice."""
    s = _of(log, source)
    times = 1 + (rng.random(len(s)) < share).astype(np.int64)
    return log.with_streams(s.select(np.repeat(np.arange(len(s)), times)))


def shuffled(log: EventLog, source: str, rng: Generator, delay_s: float = 0.3) -> EventLog:
    """Each record is up to `delay_s` late, so that they overtake one another."""
    s = _of(log, source)
    arrival = s.t_arrival + np.rint(rng.random(len(s)) * delay_s * 1e9).astype(np.int64)
    order = np.argsort(arrival, kind="stable")
    return log.with_streams(replace(s, t_arrival=arrival).select(order))


Fault = Callable[[EventLog, str, float, Generator], EventLog]
"""(log, GNSS or other source, duration [s], random numbers) -> the spoiled log."""

FAULTS: Mapping[str, tuple[Kind, Fault]] = {
    "gnss-outage": (Kind.GNSS, lambda log, s, d, _: outage(log, s, 0.5 * d, 0.7 * d)),
    "gnss-jump": (Kind.GNSS, lambda log, s, d, _: jump(log, s, 0.4 * d, 0.45 * d, (15.0, -10.0, 5.0))),
    "gnss-float": (Kind.GNSS, lambda log, s, d, rng: degrade(log, s, 0.3 * d, 0.5 * d, Fix.FLOAT, 0.4, rng, 0.1)),
    "gnss-null": (Kind.GNSS, lambda log, s, d, _: null_fixes(log, s, 0.6 * d, 0.7 * d)),
    "gnss-nan": (Kind.GNSS, lambda log, s, _, rng: nan_rows(log, s, rng)),
    "gnss-frozen": (Kind.GNSS, lambda log, s, d, _: freeze(log, s, 0.5 * d, 0.7 * d)),
    "gnss-late": (Kind.GNSS, lambda log, s, _, rng: shuffled(log, s, rng, 0.8)),
    "heading-wrong": (Kind.ATTITUDE, lambda log, s, _d, _: turn_heading(log, s, np.deg2rad(40.0))),
    "wheels-scale": (Kind.TWIST, lambda log, s, _d, _: scale(log, s, 0.9)),
    "wheels-frozen": (Kind.TWIST, lambda log, s, d, _: freeze(log, s, 0.5 * d, 0.7 * d)),
    "wheels-nan": (Kind.TWIST, lambda log, s, _, rng: nan_rows(log, s, rng)),
    "wheels-clock": (Kind.TWIST, lambda log, s, d, _: clock_jump(log, s, 0.6 * d, 30.0)),
    "imu-duplicates": (Kind.IMU, lambda log, s, _, rng: duplicates(log, s, rng)),
    "imu-shuffled": (Kind.IMU, lambda log, s, _, rng: shuffled(log, s, rng, 0.05)),
    "imu-nan": (Kind.IMU, lambda log, s, _, rng: nan_rows(log, s, rng, 0.01)),
    "imu-gap": (Kind.IMU, lambda log, s, d, _: outage(log, s, 0.55 * d, 0.57 * d)),
}


def apply(log: EventLog, name: str, rng: Generator) -> EventLog:
    """The ready-made fault `name` on every stream of its kind."""
    if name not in FAULTS:
        raise ConfigError(f"no fault '{name}'", fix=f"the faults are {', '.join(FAULTS)}")
    kind, fault = FAULTS[name]
    duration = log.duration
    for s in log.of(kind):
        log = fault(log, s.name, duration, rng)
    return log


def _of(log: EventLog, source: str) -> Stream:
    if source not in log.streams:
        raise ConfigError(f"no stream '{source}'", fix=f"the streams are {', '.join(log.streams)}")
    return log.streams[source]


def _shift(log: EventLog, source: str, hit: Bools, enu: Floats) -> EventLog:
    """GNSS rows `hit` moved by (east, north, up) [m], each from where it stands."""
    s = _of(log, source)
    z = s.z.copy()
    for i, metres in zip(np.flatnonzero(hit), enu, strict=True):
        if np.all(np.abs(z[i]) < [0.5 * np.pi, np.pi, 1e5]):  # a place, not yet spoilt by another fault
            z[i] = np.ravel(enu_to_geodetic(metres[None], *z[i]))
    return log.with_streams(replace(s, z=z))


def _stating(log: EventLog, source: str, hit: Bools, extra: Mapping[str, float], variance: Floats) -> EventLog:
    """Rows `hit` with the given further columns and stated variance."""
    s = _of(log, source)
    columns = {name: np.where(hit, extra.get(name, np.nan), c) if name in extra else c for name, c in s.extra.items()}
    return log.with_streams(replace(s, extra=columns, var=np.where(hit[:, None], variance, s.var)))
