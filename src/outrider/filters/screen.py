"""Screening: what can be refused before any filter sees it, each with its reason.

Works on whole streams and, through `Memory`, on pieces of them with the same result.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import floor, isfinite, pi, sqrt
from typing import Final, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from outrider._kernel import inlined, kernel
from outrider.data import Fix, Kind, Stream, Verdict
from outrider.filters.stamps import CLOCK_JUMP, LATEST, earliest, lag, usable
from outrider.typing import Bools, Floats, Ints

# Largest magnitude per column that a working sensor of this kind can report.
LIMITS: Final = {
    Kind.IMU: (60.0, 60.0, 60.0, 500.0, 500.0, 500.0),
    Kind.GNSS_VELOCITY: (300.0, 300.0, 100.0),
    Kind.TWIST: (100.0, 100.0, 100.0, 60.0, 60.0, 60.0),
    Kind.WHEELS: (100.0,),
    Kind.ACKERMANN: (100.0, 1.5),
    Kind.BODY_VELOCITY: (300.0, 300.0, 300.0),
    Kind.FLOW: (60.0, 60.0),
    Kind.RANGE_FINDER: (1e4,),
    Kind.BARO: (3e4,),
    Kind.POSITION: (1e7, 1e7, 1e5),
    Kind.POSE: (1e7, 1e7, 1e5, 2.0, 2.0, 2.0, 2.0),
    Kind.RANGE: (np.inf, 1e5),
    Kind.RANGE_BEARING: (np.inf, 1e5, 10.0),
    Kind.ATTITUDE: (2.0, 2.0, 2.0, 2.0),
}
# Kinds whose noise never repeats: the same bits for this long mean a frozen driver [s].
# GNSS below the time that earns a reset, or the estimate would jump to where the receiver froze.
FROZEN_AFTER: Final = {Kind.IMU: 0.5, Kind.MAG: 5.0, Kind.ATTITUDE: 2.0, Kind.GNSS: 2.5}
FROZEN_RECORDS: Final = 5
FIX_CODES: Final = np.array([f.value for f in Fix])
_LEAST_FIX, _MOST_FIX, _NO_FIX_CODE = int(FIX_CODES.min()), int(FIX_CODES.max()), Fix.NONE.value
STALE_AFTER: Final = 5.0  # s between a fix and its arrival, beyond the stream's usual latency
ABSURD_VARIANCE: Final = 1e30
STUCK_CHANGE: Final = 0.15  # rad/s: a change of the turn rate that turning wheels cannot miss
STUCK_SMOOTH: Final = 0.5  # s over which that rate is averaged: bumps are shorter
AHEAD: Final = 2.0  # s that a stamp may be too new by the same measure: more would make all other sources late

MOVING_SPEED: Final = 0.3  # m/s
MOVING_RATE: Final = 0.1  # rad/s

_USED, _ASTRAY, _BAD_STAMP, _DUPLICATE = (
    int(v) for v in (Verdict.USED, Verdict.ASTRAY, Verdict.BAD_STAMP, Verdict.DUPLICATE)
)
_NO_FIX, _UNKNOWN_FIX, _FEW_SATELLITES = (int(v) for v in (Verdict.NO_FIX, Verdict.UNKNOWN_FIX, Verdict.FEW_SATELLITES))
_NOT_FINITE, _NULL_POSITION, _IMPLAUSIBLE = (
    int(v) for v in (Verdict.NOT_FINITE, Verdict.NULL_POSITION, Verdict.IMPLAUSIBLE)
)
_STALE, _FROZEN, _BAD_COVARIANCE, _DECLARED_INVALID = (
    int(v) for v in (Verdict.STALE, Verdict.FROZEN, Verdict.BAD_COVARIANCE, Verdict.DECLARED_INVALID)
)
NONE: Final = np.empty(0)
NO_STAMPS: Final = np.empty(0, np.int64)
NO_STRAYS: Final = np.empty(0, np.uint8)


def motion_stamps(streams: Iterable[Stream]) -> Ints:
    """Sorted stamps [ns] at which a source felt motion: a speed or a turn rate above `MOVING_*`."""
    found = [np.zeros(0, np.int64)]
    for s in streams:
        if s.kind is Kind.IMU:
            moving = (np.abs(s.z[:, :3]) > MOVING_RATE).any(axis=1)
        elif s.kind in (Kind.TWIST, Kind.WHEELS, Kind.GNSS_VELOCITY, Kind.BODY_VELOCITY):
            moving = (np.abs(s.z[:, :2]) > MOVING_SPEED).any(axis=1)
        else:
            continue
        found.append(s.t[moving])
    return np.sort(np.concatenate(found))


@final
@dataclass(slots=True)
class Memory:
    """What screening remembers of a stream between pieces. run : (3,) stamp of the last record [ns], when its value was
    first seen, how many records have had it."""

    z: Floats = field(default_factory=lambda: np.zeros(0))
    run: Ints = field(default_factory=lambda: np.zeros(3, np.int64))
    offset: float = float("nan")  # ns, usual arrival - stamp


def screen(s: Stream, memory: Memory | None = None, motion: Ints | None = None, stray: Bools | None = None) -> Ints:
    """(n,) a `Verdict` per record: USED for those that pass.

    stray : (n,) records whose stamps the other sources contradict, see `outrider.filters.stamps.astray`
    motion : sorted stamps [ns] at which any source felt the robot move. A value that repeats while nothing moves is a
    coarse sensor at rest, not a frozen one. Without it every stretch counts as motion.
    """
    m = memory if memory is not None else Memory()
    n = len(s)
    verdict = np.full(n, _USED, np.int64)
    if n == 0:
        return verdict
    learn_offset(s, m)
    before = m.z if m.z.size == s.z.shape[1] else NONE
    felt = NO_STAMPS if motion is None else motion
    t, arrival = np.ascontiguousarray(s.t), np.ascontiguousarray(s.t_arrival)
    moves = motion is not None
    examine(RULES[s.kind], t, arrival, _told(s, stray), earliest(s), m.offset, before, m.run, felt, moves, verdict)
    m.z = s.z[-1].copy()
    return verdict


class Rules(NamedTuple):
    """What a kind of record must keep to."""

    place: bool  # of latitude, longitude, altitude
    empty: bool  # infinite values mean that nothing came back
    positive: int  # the column that is above zero, -1 for none
    rotation: bool  # the last four columns are a quaternion
    frozen: float  # ns that a value may repeat
    limits: Floats  # (columns,), (1,) for all of them, or (0,) for none


class Told(NamedTuple):
    """What records say; arrays of size zero where they do not."""

    z: Floats  # (n, m)
    var: Floats  # (n, k)
    fix: Floats
    satellites: Floats
    valid: Floats
    stray: NDArray[np.uint8]


def _rules(kind: Kind) -> Rules:
    return Rules(
        place=kind is Kind.GNSS,
        empty=kind is Kind.SCAN,
        positive={Kind.RANGE: 1, Kind.RANGE_BEARING: 1, Kind.RANGE_FINDER: 0}.get(kind, -1),
        rotation=kind in (Kind.ATTITUDE, Kind.POSE),
        frozen=FROZEN_AFTER.get(kind, np.inf) * 1e9,
        limits=np.array(LIMITS.get(kind, ()), np.float64),
    )


RULES: Final[Mapping[Kind, Rules]] = {kind: _rules(kind) for kind in Kind}


def _told(s: Stream, stray: Bools | None) -> Told:
    def column(name: str) -> Floats:
        return np.ascontiguousarray(s.extra[name], np.float64) if name in s.extra else NONE

    receiver = s.kind in (Kind.GNSS, Kind.GNSS_VELOCITY)
    return Told(
        z=np.ascontiguousarray(s.z), var=np.ascontiguousarray(s.var),
        fix=column("fix") if receiver else NONE, satellites=column("satellites") if receiver else NONE,
        valid=column("valid"), stray=NO_STRAYS if stray is None else stray.view(np.uint8),
    )  # fmt: skip


@kernel
def examine(
    rules: Rules, t: Ints, arrival: Ints, told: Told, begin: int, offset: float, before: Floats, run: Ints,
    motion: Ints, moves: bool, verdict: Ints,
) -> None:  # fmt: skip
    """verdict (n,) <- the first reason against each record; begin : the least stamp [ns], run as in `Memory`,
    before (m,) the last one's values."""
    n, width = told.z.shape
    z, last, since, count = told.z, run[0], run[1], run[2]
    for i in range(n):
        late = float(min(max(arrival[i], -LATEST), LATEST) - min(max(t[i], -LATEST), LATEST)) - offset
        wrong = late > CLOCK_JUMP * 1e9 or -late > AHEAD * 1e9
        verdict[i] = _BAD_STAMP if t[i] < begin or t[i] >= LATEST or wrong else refusal(rules, told, i, late)
        # repeats: duplicates (same stamp) and frozen values (stamps go on)
        same = i > 0 or before.size == width
        for j in range(width):
            was = z[i - 1, j] if i > 0 else before[j] if same else np.inf
            same = same and (z[i, j] == was or (np.isnan(z[i, j]) and np.isnan(was)))
        if same:
            count += 1
        else:
            since, count = t[i], 1
        if verdict[i] == _USED and same and t[i] == last:
            verdict[i] = _DUPLICATE
        if verdict[i] == _USED and t[i] - since > rules.frozen and count > FROZEN_RECORDS:
            felt = not moves or up_to(motion, t[i]) > up_to(motion, since)
            verdict[i] = _FROZEN if felt else _USED
        last = t[i]
    run[0], run[1], run[2] = last, since, count


@inlined
def refusal(rules: Rules, told: Told, i: int, late: float) -> int:
    """The first reason against the values of record i, `_USED` for none. late : ns, beyond the usual delay."""
    z = told.z[i]
    finite, infinite, beyond, absurd = False, False, False, False
    for j in range(z.size):
        finite = finite or np.isfinite(z[j])
        infinite = infinite or np.isinf(z[j])
        if rules.limits.size > 0:
            beyond = beyond or abs(z[j]) > rules.limits[j if rules.limits.size > 1 else 0]
    for j in range(told.var.shape[1]):
        absurd = absurd or told.var[i, j] < 0.0 or told.var[i, j] > ABSURD_VARIANCE
    if told.stray.size > 0 and told.stray[i]:
        return _ASTRAY
    if told.fix.size > 0 and told.fix[i] == _NO_FIX_CODE:  # without a fix the fields are often blank
        return _NO_FIX
    if not finite or (infinite and not rules.empty):
        return _NOT_FINITE
    if told.fix.size > 0:
        fix = told.fix[i]
        if fix < _LEAST_FIX or fix > _MOST_FIX or (not np.isnan(fix) and fix != floor(fix)):
            return _UNKNOWN_FIX
    if told.satellites.size > 0 and 0.0 <= told.satellites[i] < 4.0:
        return _FEW_SATELLITES
    if rules.place:
        if np.isnan(z[0]) or np.isnan(z[1]):
            return _NOT_FINITE
        if abs(z[0]) < 1e-7 and abs(z[1]) < 1e-7:
            return _NULL_POSITION
        if abs(z[0]) > 0.5 * pi or abs(z[1]) > 2.0 * pi or abs(z[2]) > 1e5:
            return _IMPLAUSIBLE
        if late > STALE_AFTER * 1e9:
            return _STALE
    if beyond or (rules.positive >= 0 and z[rules.positive] <= 0.0):
        return _IMPLAUSIBLE
    if rules.rotation:
        norm2 = 0.0
        for j in range(z.size - 4, z.size):
            norm2 += min(z[j] * z[j], 81.0) if z[j] == z[j] else z[j]
        if not abs(sqrt(norm2) - 1.0) < 0.1:
            return _IMPLAUSIBLE
    if absurd:
        return _BAD_COVARIANCE
    return _DECLARED_INVALID if told.valid.size > 0 and told.valid[i] == 0.0 else _USED


@inlined
def up_to(sorted_: Ints, value: int) -> int:
    """How many of them are at most a value."""
    low, high = 0, sorted_.size
    while low < high:
        middle = (low + high) // 2
        if sorted_[middle] <= value:
            low = middle + 1
        else:
            high = middle
    return low


def learn_offset(s: Stream, m: Memory) -> None:
    """The usual arrival - stamp of a stream, from its first stamps that are some."""
    if not isfinite(m.offset) and (good := usable(s)).any():
        m.offset = float(np.median(lag(s)[good]))


def bad_stamps(s: Stream, m: Memory) -> Bools:
    """Stamps of zero, before zero, or too far off the usual offset from the recorder's clock."""
    learn_offset(s, m)
    late = lag(s) - m.offset
    return ~usable(s) | (late > CLOCK_JUMP * 1e9) | (-late > AHEAD * 1e9)


def turn_rate(imu: Stream) -> tuple[Ints, Floats]:
    """Stamps [ns] and the rate about the vertical [rad/s], smoothed; the vertical is where gravity has been felt."""
    good = np.isfinite(imu.z).all(axis=1) & (np.abs(imu.z) <= np.array(LIMITS[Kind.IMU])).all(axis=1)
    t, z = imu.t[good], imu.z[good]
    if not len(z) or not z[:, 3:].any():
        return t[:0], np.zeros(0)
    up = np.median(z[:, 3:], axis=0)
    rate = z[:, :3] @ (up / max(float(np.linalg.norm(up)), 1e-9))
    width = max(1, round(STUCK_SMOOTH * imu.rate)) if np.isfinite(imu.rate) else 1
    total = np.concatenate([[0.0], np.cumsum(rate)])
    return t[width - 1 :], (total[width:] - total[:-width]) / width


def stuck(s: Stream, turning: tuple[Ints, Floats]) -> Bools:
    """(n,) which records of wheels repeat the same bits, not at rest, while the turn rate changes.

    At rest wheels repeat zeros, and quantised ones repeat at constant speed: neither is a fault. Looks ahead: once a
    stretch of repeats is known to be stuck, all of it is.
    """
    t, rate = turning
    out = np.zeros(len(s), np.bool_)
    same = (s.z[1:] == s.z[:-1]).all(axis=1)
    ends = np.append(np.flatnonzero(~same) + 1, len(s))
    for a, b in zip(np.append(0, ends[:-1]), ends, strict=True):
        if b - a <= FROZEN_RECORDS or not s.z[a].any():
            continue
        first, last = np.searchsorted(t, s.t[[a, b - 1]])
        if last > first and np.ptp(rate[first:last]) > STUCK_CHANGE:
            out[a + 1 : b] = True
    return out
