"""Screening: what can be refused before any filter sees it, each with its reason.

Works on whole streams and, through `Memory`, on pieces of them with the same result.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final, TypeAlias, final

import numpy as np

from outrider.data import Fix, Kind, Stream, Verdict
from outrider.filters.stamps import CLOCK_JUMP, lag, usable
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
STALE_AFTER: Final = 5.0  # s between a fix and its arrival, beyond the stream's usual latency
ABSURD_VARIANCE: Final = 1e30
STUCK_CHANGE: Final = 0.15  # rad/s: a change of the turn rate that turning wheels cannot miss
STUCK_SMOOTH: Final = 0.5  # s over which that rate is averaged: bumps are shorter
AHEAD: Final = 2.0  # s that a stamp may be too new by the same measure: more would make all other sources late


Refuse: TypeAlias = Callable[[Bools | np.bool_, Verdict], None]

MOVING_SPEED: Final = 0.3  # m/s
MOVING_RATE: Final = 0.1  # rad/s


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
    """What screening remembers of a stream between pieces."""

    z: Floats = field(default_factory=lambda: np.zeros(0))
    t: int = 0
    since: int = 0  # when the present value was first seen
    count: int = 0  # how many records have had it
    offset: float = float("nan")  # ns, usual arrival - stamp


def screen(s: Stream, memory: Memory | None = None, motion: Ints | None = None, stray: Bools | None = None) -> Ints:
    """(n,) a `Verdict` per record: USED for those that pass.

    stray : (n,) records whose stamps the other sources contradict, see `outrider.filters.stamps.astray`
    motion : sorted stamps [ns] at which any source felt the robot move. A value that repeats while nothing moves is a
    coarse sensor at rest, not a frozen one. Without it every stretch counts as motion.
    """
    m = memory if memory is not None else Memory()
    n = len(s)
    verdict = np.full(n, int(Verdict.USED), np.int64)
    if n == 0:
        return verdict

    def refuse(rows: Bools | np.bool_, reason: Verdict) -> None:
        verdict[rows & (verdict == Verdict.USED)] = int(reason)

    refuse(bad_stamps(s, m), Verdict.BAD_STAMP)
    if stray is not None:
        refuse(stray, Verdict.ASTRAY)
    if s.kind in (Kind.GNSS, Kind.GNSS_VELOCITY) and "fix" in s.extra:  # without a fix the fields are often blank
        refuse(s.extra["fix"] == Fix.NONE.value, Verdict.NO_FIX)
    refuse(~np.isfinite(s.z).any(axis=1), Verdict.NOT_FINITE)
    if s.kind is not Kind.SCAN:  # there it means that nothing came back
        refuse(np.isinf(s.z).any(axis=1), Verdict.NOT_FINITE)
    if s.kind in (Kind.GNSS, Kind.GNSS_VELOCITY):
        screen_fixes(s, m, refuse)
    if s.kind in LIMITS:
        limits = np.array(LIMITS[s.kind])
        refuse((np.abs(s.z) > (limits if limits.size == s.z.shape[1] else limits[0])).any(axis=1), Verdict.IMPLAUSIBLE)
    if s.kind in (Kind.RANGE, Kind.RANGE_BEARING):
        refuse(s.z[:, 1] <= 0.0, Verdict.IMPLAUSIBLE)
    if s.kind is Kind.RANGE_FINDER:
        refuse(s.z[:, 0] <= 0.0, Verdict.IMPLAUSIBLE)
    if s.kind in (Kind.ATTITUDE, Kind.POSE):
        norm = np.linalg.norm(np.clip(s.z[:, -4:], -9.0, 9.0), axis=1)
        refuse(~(np.abs(norm - 1.0) < 0.1), Verdict.IMPLAUSIBLE)
    refuse(((s.var < 0.0) | (s.var > ABSURD_VARIANCE)).any(axis=1), Verdict.BAD_COVARIANCE)
    if "valid" in s.extra:
        refuse(s.extra["valid"] == 0.0, Verdict.DECLARED_INVALID)
    repeats(s, m, refuse, motion)
    return verdict


def bad_stamps(s: Stream, m: Memory) -> Bools:
    """Stamps of zero, before zero, or too far off the usual offset from the recorder's clock."""
    bad = ~usable(s)
    if not bad.all():
        late = lag(s)
        if not np.isfinite(m.offset):
            m.offset = float(np.median(late[~bad]))
        bad |= (late - m.offset > CLOCK_JUMP * 1e9) | (m.offset - late > AHEAD * 1e9)
    return bad


def screen_fixes(s: Stream, m: Memory, refuse: Refuse) -> None:
    """Unheard-of fix types, too few satellites, null or impossible positions, stale fixes."""
    if "fix" in s.extra:
        refuse(~np.isin(s.extra["fix"], FIX_CODES) & ~np.isnan(s.extra["fix"]), Verdict.UNKNOWN_FIX)
    if "satellites" in s.extra:
        few = s.extra["satellites"]
        refuse((few >= 0) & (few < 4), Verdict.FEW_SATELLITES)
    if s.kind is not Kind.GNSS:
        return
    lat, lon, alt = s.z.T
    refuse(np.isnan(lat) | np.isnan(lon), Verdict.NOT_FINITE)
    refuse((np.abs(lat) < 1e-7) & (np.abs(lon) < 1e-7), Verdict.NULL_POSITION)
    refuse((np.abs(lat) > np.pi / 2) | (np.abs(lon) > 2 * np.pi) | (np.abs(alt) > 1e5), Verdict.IMPLAUSIBLE)
    refuse(lag(s) - m.offset > STALE_AFTER * 1e9, Verdict.STALE)


def repeats(s: Stream, m: Memory, refuse: Refuse, motion: Ints | None) -> None:
    """Records that repeat the one before: duplicates (same stamp) and frozen values (stamps go on)."""
    n = len(s)
    has_before = m.z.size == s.z.shape[1]
    z = np.vstack([m.z[None] if has_before else np.full((1, s.z.shape[1]), np.inf), s.z])
    t = np.concatenate([[m.t], s.t])
    same = ((z[1:] == z[:-1]) | (np.isnan(z[1:]) & np.isnan(z[:-1]))).all(axis=1)
    refuse(same & (t[1:] == t[:-1]), Verdict.DUPLICATE)
    # since[i], count[i]: first stamp and number of records of the run of equal values that record i stands in
    start = np.flatnonzero(~same)
    run = np.searchsorted(start, np.arange(n), side="right") - 1
    inside = run >= 0
    first = np.where(inside, start[np.maximum(run, 0)] if start.size else 0, 0)
    since = np.where(inside, s.t[first], m.since if has_before else s.t[0])
    count = np.where(inside, np.arange(n) - first, np.arange(n) + m.count) + 1
    if s.kind in FROZEN_AFTER:
        frozen = (s.t - since > FROZEN_AFTER[s.kind] * 1e9) & (count > FROZEN_RECORDS)
        if motion is not None:
            frozen &= np.searchsorted(motion, s.t, side="right") > np.searchsorted(motion, since, side="right")
        refuse(frozen, Verdict.FROZEN)
    m.z, m.t = s.z[-1].copy(), int(s.t[-1])
    m.since, m.count = int(since[-1]), int(count[-1])


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
