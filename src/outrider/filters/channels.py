"""Channels: how the records of one stream become measurements of the filter.

A stream may feed several channels (an IMU its gyro and its accelerometer, a receiver its fixed and its plain fixes).
A channel screens nothing: `screen` has given every record of the stream a verdict before.
"""

from dataclasses import dataclass, field, fields
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.core.geodesy import geodetic_to_enu
from outrider.data import Datum, Fix, Kind, Stream, Verdict
from outrider.filters.step import INPUT_SENSOR, ROWS
from outrider.models.sensors import SPECS, Sensor
from outrider.models.sensors.layout import OWN, THETA_SIZE
from outrider.typing import Bools, Floats, Ints

_USED, _WITHHELD, _NOT_FINITE = int(Verdict.USED), int(Verdict.WITHHELD), int(Verdict.NOT_FINITE)
STRAIGHT_THETA: Final = np.concatenate([np.zeros(3), np.eye(3).ravel(), np.zeros(THETA_SIZE - OWN)])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """One way of using one stream.

    sensor : `Sensor` code, or None when the stream drives the prediction;  theta : (THETA_SIZE,);  sigma : (m,) where a
    record states none;  floor : (m,) smallest standard deviation believed;  rows : (m,) which rows are used;
    fixes : GNSS fix codes it takes, empty for all;  beacon : the one it ranges to;  still : only records at
    standstill;  trust_stated : whether stated variances are used;  scale : multiplies every standard deviation;
    reset : first error row that a reset may move, and how many.
    """

    name: str
    stream: str
    sensor: Sensor | None
    theta: Floats
    sigma: Floats
    floor: Floats
    rows: Bools
    role: str = "fused"
    probability: float = 0.999
    reset: tuple[int, int] = (0, 0)
    fixes: frozenset[int] = frozenset()
    beacon: float | None = None
    still: bool = False
    trust_stated: bool = True
    scale: float = 1.0
    mount: Floats = field(default_factory=lambda: np.eye(3).ravel())
    """(9,) rotation into body axes that an IMU's records go through here; theta then holds none."""

    @property
    def code(self) -> int:
        """Sensor code for the kernels."""
        return INPUT_SENSOR if self.sensor is None else int(self.sensor)

    @property
    def scored(self) -> bool:
        """Whether the channel is compared with the estimate but never fused."""
        return self.role.startswith("scored")


@final
@dataclass(frozen=True, slots=True)
class Records:
    """One channel's records as its stream has them: z, r (n, ROWS), flag (n,) `Verdict`, row (n,) in the stream."""

    t: Ints
    t_arrival: Ints
    z: Floats
    r: Floats
    flag: Ints
    row: Ints = field(default_factory=lambda: np.zeros(0, np.int64))

    def select(self, keep: Bools | Ints) -> "Records":
        """Only the given ones."""
        return Records(*(getattr(self, f.name)[keep] for f in fields(self)))


@final
@dataclass(slots=True)
class Rest:
    """What a channel remembers between pieces of a stream: since when [ns] the wheels stand, None before any record."""

    since: int | None = None


def records(channel: Channel, stream: Stream, verdict: Ints, datum: Datum | None, rest: Rest | None = None) -> Records:
    """The stream's records as the channel's measurements; `verdict` is what screening said of each.

    rest : of the pieces before, where a stream comes in pieces; the result is the same as of the whole.
    """
    row = _taken(channel, stream, rest)
    whole = row.size == len(stream)
    part = stream if whole else stream.select(row)
    z, stated = measurement(channel, part, datum)
    flag = verdict.copy() if whole else verdict[row]
    out, var = np.empty((row.size, ROWS)), np.empty((row.size, ROWS))
    by_row = channel.sensor is not None and _row_is_column(channel)
    limits: Floats = np.square(
        np.stack([channel.sigma, channel.floor, channel.rows.astype(np.float64)]), dtype=np.float64
    )
    trust, scale2 = channel.trust_stated, channel.scale**2
    fill(np.ascontiguousarray(z), stated, limits, scale2, trust, by_row, channel.scored, out, var, flag)
    return Records(part.t, part.t_arrival, out, var, flag, row)


def _taken(channel: Channel, stream: Stream, rest: Rest | None) -> Ints:
    """Rows of the stream that are the channel's."""
    row = np.arange(len(stream), dtype=np.int64)
    if channel.fixes and "fix" in stream.extra:
        row = row[np.isin(stream.extra["fix"], np.array(sorted(channel.fixes)))]
    if channel.beacon is not None:
        row = row[stream.z[row, 0] == channel.beacon]
    if channel.still:
        row = row[standstill(stream, rest)[row]]
    return row


@kernel
def fill(
    z: Floats, stated: Floats, limits: Floats, scale2: float, trust: bool, by_row: bool, scored: bool, out: Floats,
    var: Floats, flag: Ints,
) -> None:  # fmt: skip
    """out, var (n, ROWS) <- the records z (n, k) and their variances, and what is wrong with them to flag (n,).

    stated (n, m) : variances as the records claim;  limits (3, m) : the variance where they claim none, the least one
    believed, 1 for a row that is used;  by_row : row i of the innovation reads column i of z only.
    """
    n, m = stated.shape
    for i in range(n):
        some, all_ = False, True
        for j in range(z.shape[1]):
            all_ = all_ and np.isfinite(z[i, j])
        for j in range(ROWS):
            out[i, j] = z[i, j] if j < z.shape[1] else 0.0  # an estimate holds a velocity as well
            var[i, j] = np.inf
            if j < m and limits[2, j] > 0.0:
                claim = stated[i, j]
                v = claim if trust and np.isfinite(claim) and claim > 0.0 else limits[0, j]
                var[i, j] = (limits[1, j] if v < limits[1, j] else v) * scale2
                some = some or np.isfinite(out[i, j])
        if flag[i] == _USED and not (some if by_row else all_):
            flag[i] = _NOT_FINITE
        if flag[i] == _USED and scored:
            flag[i] = _WITHHELD


def _row_is_column(channel: Channel) -> bool:
    """Whether row i of the innovation reads column i of z, so that one missing column costs one row only."""
    return channel.sensor in {
        Sensor.GNSS_POSITION, Sensor.POSITION, Sensor.GNSS_VELOCITY, Sensor.TWIST, Sensor.BODY_VELOCITY,
        Sensor.WHEELS_DIFFERENTIAL, Sensor.WHEELS_MECANUM, Sensor.NONHOLONOMIC, Sensor.ZERO_VELOCITY,
    }  # fmt: skip


def measurement(channel: Channel, s: Stream, datum: Datum | None) -> tuple[Floats, Floats]:
    """z as the sensor kernel reads it and the stated variances per innovation row (NaN where unstated)."""
    n, m = len(s), channel.sigma.size
    unstated = np.full((n, m), np.nan)
    if s.kind is Kind.GNSS:
        return site_position(s, datum), gnss_variance(s)
    if s.kind is Kind.IMU:
        R = channel.mount.reshape(3, 3)
        part = slice(3, 6) if channel.sensor is Sensor.SPECIFIC_FORCE else slice(0, 3)
        with np.errstate(invalid="ignore", over="ignore"):  # such records have been refused
            if channel.sensor is None:
                return np.concatenate([s.z[:, :3] @ R.T, s.z[:, 3:] @ R.T], axis=1), unstated
            return s.z[:, part] @ R.T, s.var[:, part] @ (R.T**2)
    columns = SPECS[channel.sensor].variances if channel.sensor is not None else ()
    for row, column in enumerate(columns[:m]):
        if 0 <= column < s.var.shape[1]:
            unstated[:, row] = s.var[:, column]
    return s.z, unstated


def site_position(s: Stream, datum: Datum | None) -> Floats:
    """(n, 3) positions in the site frame [m]; NaN where a coordinate is impossible or there is no datum."""
    lat, lon, alt = s.z.T
    z = np.full((len(s), 3), np.nan)
    good = np.isfinite(lat) & np.isfinite(lon) & (np.abs(lat) <= np.pi / 2) & (np.abs(lon) <= 2 * np.pi)
    if datum is None or not good.any():
        return z
    height = np.where(np.isfinite(alt), alt, datum.alt)
    z[good] = geodetic_to_enu(lat[good], lon[good], height[good], datum.lat, datum.lon, datum.alt).reshape(-1, 3)
    z[~np.isfinite(alt), 2] = np.nan
    return z


# Standard deviations [m] that a receiver's own claim is never believed below, and those taken where it claims nothing.
GNSS_FLOOR: Final = {
    Fix.FIXED: (0.02, 0.04),
    Fix.FLOAT: (0.4, 0.8),
    Fix.DGNSS: (0.3, 0.6),
    Fix.SBAS: (0.4, 0.8),
    Fix.SINGLE: (0.5, 1.0),
    Fix.UNKNOWN: (0.02, 0.04),
}
GNSS_DEFAULT: Final = {
    Fix.FIXED: (0.03, 0.06),
    Fix.FLOAT: (0.6, 1.2),
    Fix.DGNSS: (1.0, 2.0),
    Fix.SBAS: (1.5, 3.0),
    Fix.SINGLE: (2.5, 5.0),
    Fix.UNKNOWN: (2.5, 5.0),
}
FLOAT_OVERCONFIDENCE: Final = 10.0  # float solutions claim far less than they err
RANGE_ERROR: Final = 1.5  # m of position error per unit of DOP, where only a DOP is given
ABSURD: Final = 1e10  # m^2


def gnss_variance(s: Stream) -> Floats:
    """(n, 3) variances east, north, up [m^2] from the receiver's claim, its DOP and its fix type, with floors."""
    n = len(s)
    fix = s.extra.get("fix", np.full(n, float(Fix.UNKNOWN.value)))
    var = np.where((s.var > 0.0) & (s.var < ABSURD), s.var, np.nan)
    for name, columns in (("hacc", slice(0, 2)), ("vacc", slice(2, 3))):
        if name in s.extra:
            claim = s.extra[name]
            stated = np.where((claim > 0.0) & (claim < ABSURD**0.5), claim, np.nan) ** 2
            var[:, columns] = np.where(np.isfinite(var[:, columns]), var[:, columns], stated[:, None])
    for name, columns in (("hdop", slice(0, 2)), ("vdop", slice(2, 3))):
        if name in s.extra:
            dop = np.where((s.extra[name] > 0.0) & (s.extra[name] < 50.0), s.extra[name], np.nan)
            stated = (dop * RANGE_ERROR) ** 2
            plain = (fix < Fix.FLOAT.value)[:, None]
            guess = np.where(plain, stated[:, None], np.nan)
            var[:, columns] = np.where(np.isfinite(var[:, columns]), var[:, columns], guess)
    for kind in Fix:
        here = fix == kind.value
        if kind is Fix.NONE or not here.any():
            continue
        (fh, fv), (dh, dv) = GNSS_FLOOR[kind], GNSS_DEFAULT[kind]
        boost = FLOAT_OVERCONFIDENCE**2 if kind is Fix.FLOAT else 1.0
        claimed = var[here] * boost
        claimed = np.where(np.isfinite(claimed), claimed, np.array([dh, dh, dv]) ** 2)
        var[here] = np.maximum(claimed, np.array([fh, fh, fv]) ** 2)
    return var


STILL_SPEED: Final = 0.01  # m/s
STILL_RATE: Final = 0.01  # rad/s
STILL_TIME: Final = 0.5  # s of standstill before it counts


def standstill(s: Stream, rest: Rest | None = None) -> Bools:
    """(n,) whether the wheels have stood still for `STILL_TIME` up to each record; rest : of the pieces before."""
    n = len(s)
    if n == 0:
        return np.zeros(0, np.bool_)
    memory = rest or Rest()
    moving = ~((np.abs(s.z[:, :2]) < STILL_SPEED).all(axis=1) & (np.abs(s.z[:, -1]) < STILL_RATE))
    last_moving = np.maximum.accumulate(np.where(moving, s.t, np.iinfo(np.int64).min // 2))
    since = np.maximum(last_moving, s.t[0] if memory.since is None else memory.since)
    memory.since = int(since[-1])
    return ~moving & (s.t - since >= int(STILL_TIME * 1e9))


def default_sigma(sensor: Sensor) -> Floats:
    """(m,) the sensor's own default standard deviations."""
    return SPECS[sensor].usual.sigmas()
