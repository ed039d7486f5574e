"""Damaged time stamps, one stream at a time: what bit flips, stuck clocks and mixed clocks leave in a log."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from outrider.data import Stream

SECOND = 1_000_000_000
HOUR, DAY, YEAR = 3600 * SECOND, 86_400 * SECOND, 365 * 86_400 * SECOND

Damage = Callable[[Stream, Generator], Stream]


def share(s: Stream, rng: Generator, part: float) -> np.ndarray:
    """A random part of the rows, one at least."""
    hit = rng.random(len(s)) < part
    hit[rng.integers(len(s))] |= len(s) > 0
    return hit


def block(s: Stream, rng: Generator, part: float) -> slice:
    """Consecutive rows."""
    n = max(1, round(part * len(s)))
    first = int(rng.integers(len(s) - n + 1))
    return slice(first, first + n)


def years_off(s: Stream, rng: Generator) -> Stream:
    hit = share(s, rng, 0.01)
    return replace(s, t=s.t + np.where(hit, rng.integers(-5 * YEAR, 30 * YEAR, len(s)), 0))


def hours_off(s: Stream, rng: Generator) -> Stream:
    hit = share(s, rng, 0.01)
    return replace(s, t=s.t + np.where(hit, rng.integers(-2 * HOUR, 2 * HOUR, len(s)), 0))


def flipped_bits(s: Stream, rng: Generator) -> Stream:
    bits = np.int64(1) << rng.integers(36, 61, len(s))
    return replace(s, t=np.where(share(s, rng, 0.02), s.t ^ bits, s.t))


def same_wrong_value(s: Stream, rng: Generator) -> Stream:
    t = s.t.copy()
    rows = block(s, rng, 0.05)
    t[rows] = t[rows][0] + int(rng.choice([-HOUR, HOUR, 20 * YEAR]))
    return replace(s, t=t)


def half_an_hour_ahead(s: Stream, rng: Generator) -> Stream:
    return replace(s, t=s.t + np.where(share(s, rng, 0.5), HOUR, 0))


def second_half_ahead(s: Stream, rng: Generator) -> Stream:
    after = np.arange(len(s)) >= len(s) // 2
    return replace(s, t=s.t + np.where(after, HOUR, 0))


def since_power_on(s: Stream, rng: Generator) -> Stream:
    return replace(s, t=s.t - s.t.min(initial=2**62) + 20 * SECOND)


def zero(s: Stream, rng: Generator) -> Stream:
    return replace(s, t=np.where(share(s, rng, 0.1), 0, s.t))


def a_day_later(s: Stream, rng: Generator) -> Stream:
    after = np.arange(len(s)) >= int(rng.integers(len(s) // 4, 3 * len(s) // 4 + 1))
    return replace(s, t=s.t + np.where(after, DAY, 0))


DAMAGE: Mapping[str, Damage] = {
    f.__name__: f
    for f in (
        years_off, hours_off, flipped_bits, same_wrong_value, half_an_hour_ahead, second_half_ahead, since_power_on,
        zero, a_day_later,
    )
}  # fmt: skip


def damaged(s: Stream, name: str, rng: Generator, *, arrival_too: bool) -> Stream:
    """The stream with damaged stamps; with `arrival_too` as from a file that holds nothing else."""
    out = DAMAGE[name](s, rng)
    return replace(out, t_arrival=out.t.copy()) if arrival_too else out
