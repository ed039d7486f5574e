"""Stamps as text: exact to the nanosecond, which a float64 of Unix seconds is not (it steps by 238 ns)."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from decimal import Decimal, InvalidOperation

import numpy as np

from outrider.typing import Bools, Ints

UNITS_NS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_LIMIT = 2**62  # ns, the year 2116: what is beyond is no stamp


def to_nanoseconds(texts: Sequence[str], unit: str) -> tuple[Ints, Bools]:
    """(n,) ns of decimal numbers in a unit of `UNITS_NS`, or of ISO 8601 times (`iso`); and which could be read."""
    t, good = np.zeros(len(texts), np.int64), np.zeros(len(texts), np.bool_)
    for i, text in enumerate(texts):
        try:
            value = _iso(text) if unit == "iso" else _decimal(text, UNITS_NS[unit])
        except (ValueError, InvalidOperation, OverflowError):
            continue
        if -_LIMIT < value < _LIMIT:
            t[i], good[i] = value, True
    return t, good


def _decimal(text: str, unit: int) -> int:
    whole, _, fraction = text.partition(".")
    if fraction.isdecimal() and len(fraction) <= 9 and whole.isdecimal():  # the usual case, without Decimal
        return int(whole) * unit + round(int(fraction) * unit / 10 ** len(fraction))
    value = Decimal(text)
    if not -40 < value.adjusted() < 40:
        raise ValueError(text)
    return int((value * unit).to_integral_value())


def _iso(text: str) -> int:
    stamp = datetime.fromisoformat(text)
    since = (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)) - _EPOCH
    return since // timedelta(microseconds=1) * 1000


def seconds_text(t: int) -> str:
    """A stamp [ns] as decimal seconds with nine decimals, exactly."""
    sign, t = ("-", -t) if t < 0 else ("", t)
    return f"{sign}{t // 10**9}.{t % 10**9:09d}"


LEAPS = (  # days since 1970 on which one more second lay between GPS time and UTC
    4199, 4564, 4929, 5660, 6574, 7305, 7670, 8217, 8582, 8947, 9496, 10043, 10592, 13149, 14245, 15522, 16617, 17167,
)  # fmt: skip
GPS_EPOCH = 315_964_800 * 10**9  # ns: 1980-01-06
DAY = 86_400 * 10**9  # ns


def gps_to_unix(t: Ints) -> Ints:
    """(n,) Unix time [ns] of GPS time since its epoch [ns]; leap seconds as known until 2026, none inserted since 2017.

    Source: IERS Bulletin C.
    """
    plain = t + GPS_EPOCH
    steps = np.array([day * DAY + k * 10**9 for k, day in enumerate(LEAPS, start=1)], np.int64)
    return plain - np.searchsorted(steps, plain, side="right") * 10**9
