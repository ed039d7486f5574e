"""The path that wheels and a gyro reckon, as a model of all positions of a log.

    p_k = o + a (q(t_k) + l exp(i psi(t_k))),   a = s exp(i theta),   q = int v exp(i psi) dt,   psi = int g (w - b) dt,

p, o, q, l complex (east + i north; l, the lever arm of the receiver, forward + i left).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from outrider.typing import Floats, Ints
from outrider.workflows.doctor.signals import Path, Signal

Complexes: TypeAlias = NDArray[np.complex128]

PIECE_S: Final = 600.0  # s over which the bias of a gyro counts as constant
LEAST_S: Final = 60.0  # s that tell anything
STEP_S: Final = 2.0  # s over which positions are averaged
FINE_S: Final = 0.1  # s between the points of the path
SILENT_S: Final = 3.0  # s without wheels or gyro that end a piece
FEW: Final = 30  # positions
PRIOR: Final = (1.0, 1.0, 0.02, 0.01)  # deviations of the lever arm [m], twice, of the bias [rad/s], and of the gain


@final
@dataclass(frozen=True, slots=True)
class Values:
    """a : s exp(i theta);  lever : l;  bias, gain : b [rad/s] and g."""

    a: complex = 1.0
    lever: complex = 0.0
    bias: float = 0.0
    gain: float = 1.0

    def plus(self, x: Floats) -> "Values":
        """After a step (8,): of o, of log a, of the lever arm, of bias and gain."""
        return Values(
            self.a * np.exp(x[2] + 1j * x[3]), self.lever + complex(x[4], x[5]), self.bias + x[6], self.gain + x[7]
        )

    @property
    def unlikely(self) -> Floats:
        """(4,) what the prior holds against it, in deviations."""
        return np.array([self.lever.real, self.lever.imag, self.bias, self.gain - 1.0]) / PRIOR


@final
@dataclass(frozen=True, slots=True)
class Piece:
    """Speed v and turn rate w (n,) at times t (n,) [s], FINE_S apart;  at : (m,) s of the positions, `of` (m,) the step
    that each belongs to;  p : (k,) mean positions of the steps;  when : (k,) s."""

    t: Floats
    v: Floats
    w: Floats
    at: Floats
    of: Ints
    p: Complexes
    when: Floats

    def mean(self, x: Complexes) -> Complexes:
        """(k,) of something (n,) along the path, as the positions are averaged."""
        return averaged(np.interp(self.at, self.t, x.real) + 1j * np.interp(self.at, self.t, x.imag), self.of)

    def residual(self, x: Values) -> tuple[Complexes, Complexes]:
        """(k,) p minus the path but for the origin, and its slopes (k, 8), by the steps of `Values.plus`."""
        turn = ahead(x.gain * summed(self.w - x.bias))
        along = self.v * turn
        path = self.mean(reached(along) + x.lever * turn)

        def bent(by: Floats) -> Complexes:
            return x.a * self.mean(1j * (reached(along * by) + x.lever * turn * by))

        front, one = x.a * self.mean(turn), np.ones_like(path)
        since, turned = self.t - self.t[0], summed(self.w - x.bias)
        slopes = (one, 1j * one, x.a * path, 1j * x.a * path, front, 1j * front, bent(-x.gain * since), bent(turned))
        return self.p - x.a * path, np.column_stack(slopes)


def pieces(way: Path, speed: Signal, turn: Signal) -> Iterator[Piece]:
    """Stretches in which wheels and gyro are never silent, of `PIECE_S` at most."""
    first = max(s.t[0] for s in (way, speed, turn))
    last = min(s.t[-1] for s in (way, speed, turn))
    broken = np.concatenate([silences(s) for s in (speed, turn)])
    for begin, end in clear(first, last, broken):
        edges = np.linspace(begin, end, int(np.ceil((end - begin) / PIECE_S)) + 1)
        for a, b in pairwise(edges.tolist()):
            here = (way.t >= a) & (way.t <= b)
            at = way.t[here]
            if len(at) < FEW or at[-1] - at[0] < LEAST_S:
                continue
            t = np.arange(a, b + FINE_S, FINE_S)
            v, w = np.interp(t, speed.t, speed.y), np.interp(t, turn.t, turn.y)
            _, of = np.unique(np.floor(at / STEP_S), return_inverse=True)
            p = averaged(np.asarray(way.p[here, 0] + 1j * way.p[here, 1], np.complex128), of)
            yield Piece(t, v, w, at, of, p, averaged(np.asarray(at, np.complex128), of).real)


def silences(s: Signal) -> Floats:
    """(n, 2) s: from the last sample before to the first after."""
    k = np.flatnonzero(np.diff(s.t) > SILENT_S)
    return np.column_stack([s.t[k], s.t[k + 1]])


def clear(first: float, last: float, broken: Floats) -> Iterator[tuple[float, float]]:
    """What lies between (n, 2) breaks, and is long enough."""
    begin = first
    for a, b in broken[np.argsort(broken[:, 0])].tolist():
        if min(a, last) - begin >= LEAST_S:
            yield begin, min(a, last)
        begin = max(begin, b)
    if last - begin >= LEAST_S:
        yield begin, last


def averaged(x: Complexes, of: Ints) -> Complexes:
    """(k,) means of x (m,) over those that belong together, numbered by `of` (m,)."""
    return (np.bincount(of, x.real) + 1j * np.bincount(of, x.imag)) / np.bincount(of)


def summed(x: Floats) -> Floats:
    """(n,) the integral of something (n,) along the path, by trapezes."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (x[1:] + x[:-1])) * FINE_S])


def ahead(yaw: Floats) -> Complexes:
    """(n,) unit vectors forward."""
    return np.asarray(np.exp(1j * yaw), np.complex128)


def reached(x: Complexes) -> Complexes:
    """(n,) the same of a velocity."""
    return summed(x.real) + 1j * summed(x.imag)


__all__ = ["PRIOR", "Complexes", "Piece", "Values", "ahead", "pieces", "reached", "summed"]
