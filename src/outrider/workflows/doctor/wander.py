"""The scale of wheels by the whole path, for a receiver whose error wanders.

A filter takes the errors of positions as white. Those of a receiver that filters for itself are not: they are smooth,
and wander by metres within seconds. White noise then lets pieces of the path decide in which the error is as large as
the way. Here the error e_k = p_k - path (`whole_path`) is a Gaussian process, white noise beside a correlation of
Matern's class with nu = 1/2 (Gauss and Markov's) or 3/2 (Rasmussen & Williams 2006, 4.14 and 4.17). The answer is the
mean over correlation times and shares of white noise, weighted by their restricted likelihoods (Harville 1974). What
turns the path otherwise than bias and gain of the gyro say counts as error of the positions.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from outrider.data import Finding
from outrider.data.evidence import POINTS, Curve, Evidence
from outrider.typing import Floats
from outrider.workflows.doctor.signals import Path, Signal
from outrider.workflows.doctor.whole_path import PRIOR, Complexes, Piece, Values, ahead, pieces, reached, summed
from outrider.workflows.findings.say import info
from outrider.workflows.sandwich import SURE

TAUS: Final = (1.5, 300.0, 12)  # s: correlation times tried, from, to, how many
SHARES: Final = tuple(np.geomspace(0.01, 1.0, 9).tolist())  # white noise over the deviation of what wanders
TURN: Final = 0.4  # rad by which a bias may turn the path and still be told by small steps
ROUNDS: Final = 4
NEAR: Final = 0.1  # of a deviation: a step as small as this ends the search
LIKELY: Final = 3.0  # times as long, or as short: no wheel is so wrong
FEW: Final = 30  # positions
WHITE: Final = 0.2  # of what a receiver states: less is an error that wanders
EXACT: Final = 1e-3  # m: no receiver is better
WIDE: Final = 3.0  # m: deviation of the points of a path that tells a scale
OFF: Final = 0.01  # departure from one worth a line


@final
@dataclass(frozen=True, slots=True, eq=False)
class Whole:
    """True over told speed, +- sd.  sigma, tau : deviation [m] and time [s] of the wandering error that fits best;
    met, reckoned : (k,) positions and path, east + i north [m]."""

    scale: float
    sd: float
    sigma: float
    tau: float
    met: Complexes
    reckoned: Complexes

    @property
    def half(self) -> float:
        """Of the 95 % interval."""
        return SURE * self.sd


@final
@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """One correlation's answer. likelihood : log, restricted, to a constant;  step : (8,);  sd : of log s;  sigma : m;
    tau : s."""

    likelihood: float
    step: Floats
    sd: float
    sigma: float
    tau: float


def wanders(way: Path, stated: Floats) -> bool:
    """Whether successive positions scatter far less than their stated deviations (m,) [m]: by third differences, in
    which a vehicle's own motion hardly shows."""
    steps = np.diff(way.t)
    even = np.abs(steps - np.median(steps)) < 0.2 * np.median(steps)
    third = np.diff(way.p[:, :2], n=3, axis=0)[even[:-2] & even[1:-1] & even[2:]]
    if len(third) < FEW or not np.isfinite(stated).any():
        return False
    white = float(np.median(np.abs(third))) / 0.6745 / np.sqrt(20.0)  # 1 + 9 + 9 + 1
    return white < WHITE * float(np.nanmedian(stated))


def scale_by_path(way: Path, speed: Signal, turn: Signal) -> Whole | None:
    """The scale of wheels that tell a speed, with an upright gyro's turn rate; None if it cannot be told."""
    try:
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            found = [one for piece in pieces(way, speed, turn) if (one := whole(piece)) is not None]
    except np.linalg.LinAlgError:  # a path that tells nothing
        return None
    if not found:
        return None
    weight = np.array([f.sd**-2 for f in found])
    scale = float(weight @ [f.scale for f in found] / weight.sum())
    return replace(found[int(np.argmax(weight))], scale=scale, sd=float(weight.sum() ** -0.5))


def whole(piece: Piece) -> Whole | None:
    """The scale of one piece."""
    at = begun(piece)
    if np.std(piece.mean(reached(piece.v * ahead(summed(piece.w - at.bias))))) < WIDE:
        return None
    for _ in range(ROUNDS):
        fits = [f for f in tried(piece, at) if np.isfinite(f.likelihood) and f.sd > 0.0]
        if not fits:
            return None
        best = max(fits, key=lambda f: f.likelihood)
        before, at = at, at.plus(best.step)
        if not 1.0 / LIKELY < abs(at.a) < LIKELY:
            return None
        if np.linalg.norm(best.step[2:4]) < NEAR * best.sd:
            break
    else:
        return None
    weight = np.exp([f.likelihood - best.likelihood for f in fits])
    logs = np.log(abs(before.a)) + np.array([f.step[2] for f in fits])
    mean = float(weight @ logs / weight.sum())
    variance = float(weight @ [f.sd**2 + (x - mean) ** 2 for f, x in zip(fits, logs.tolist(), strict=True)])
    scale, sd = float(np.exp(mean)), float(np.sqrt(variance / weight.sum()))
    reckoned = piece.p - piece.residual(at)[0] + complex(best.step[0], best.step[1])
    return Whole(scale, scale * sd, best.sigma, best.tau, piece.p, reckoned)


def begun(piece: Piece) -> Values:
    """The similarity and the bias of least squares, of all biases that the prior allows."""
    span = float(piece.t[-1] - piece.t[0])
    most = int(np.ceil(2.0 * PRIOR[2] * span / TURN))
    p = piece.p - piece.p.mean()

    def fitted(bias: float) -> tuple[float, complex]:
        path = piece.mean(reached(piece.v * ahead(summed(piece.w - bias))))
        path = path - path.mean()
        a = np.vdot(path, p) / max(np.vdot(path, path).real, 1e-9)
        return float(np.sum(np.abs(p - a * path) ** 2)), complex(a)

    biases = (np.arange(-most, most + 1) * TURN / span).tolist()
    best = min(biases, key=lambda b: fitted(b)[0])
    return Values(fitted(best)[1], 0.0, best)


def tried(piece: Piece, at: Values) -> Iterator[Fit]:
    """The step from some values by every correlation: its eigenvectors whiten it with any share of white noise."""
    r, J = piece.residual(at)
    far = np.abs(piece.when[:, None] - piece.when)
    for tau in np.geomspace(*TAUS).tolist():
        x = far / tau
        for correlation in (np.exp(-x), (1.0 + x) * np.exp(-x)):
            values, Q = np.linalg.eigh(correlation)
            u, M = Q.T @ r, Q.T @ J
            for share in SHARES:
                yield solved(u, M, np.maximum(values, 0.0) + share**2, at, tau)


def solved(r: Complexes, J: Complexes, spread: Floats, at: Values, tau: float) -> Fit:
    """Generalized least squares with residuals of independent variances, known to a factor that is estimated too."""
    dof, s2 = 2 * len(r) - J.shape[1], 1.0
    prior = np.diag(np.concatenate([np.zeros(4), 1.0 / np.square(PRIOR)]))
    held = np.concatenate([np.zeros(4), at.unlikely / PRIOR])
    JJ, Jr = (J.conj().T / spread @ J).real, (J.conj().T / spread @ r).real
    rr = float(np.sum(np.abs(r) ** 2 / spread))
    x = np.zeros(len(Jr))
    for _ in range(3):  # the prior weighs as much as the factor makes it
        x = np.asarray(np.linalg.solve(JJ + s2 * prior, Jr - s2 * held), np.float64)
        s2 = max(rr - 2.0 * float(Jr @ x) + float(x @ JJ @ x), EXACT**2 * dof) / dof
    A = JJ + s2 * prior
    likelihood = -0.5 * dof * np.log(s2) - float(np.log(spread).sum()) - 0.5 * float(np.linalg.slogdet(A)[1])
    likelihood -= 0.5 * float(x @ prior @ x + 2.0 * x @ held)
    size = np.sqrt(np.diag(A))
    sd = float(np.sqrt(s2 * np.linalg.inv(A / np.outer(size, size))[2, 2])) / float(size[2])
    return Fit(float(likelihood), x, sd, float(np.sqrt(s2)), tau)


def told(found: Whole, wheels: str, receiver: str) -> Finding | None:
    """In words, with both paths; None for wheels that are right as far as can be told."""
    off = found.scale - 1.0
    if abs(off) < max(OFF, found.half):
        return None
    word = "long" if off < 0.0 else "short"
    text = f"{wheels} measures {100 * abs(off):.1f} % too {word} (+-{100 * found.half:.1f} %) by the whole path; the "
    text += f"estimate corrects it, less surely: the error of {receiver} is not white but wanders by "
    text += f"{found.sigma:.1f} m within {found.tau:.0f} s"
    shown = Evidence(
        x_label="east [m]", y_label="north [m]", square=True,
        curves=(
            Curve(x=found.met.real, y=found.met.imag, name=receiver, drawn=POINTS),
            Curve(x=found.reckoned.real, y=found.reckoned.imag, name=f"wheels and gyro, times {found.scale:.3f}"),
        ),
        text="The path by wheels and gyro alone, moved, turned and scaled as a whole to the positions.",
    )  # fmt: skip
    said = info("wheel-scale", text, wheels, f"sources: {{{wheels}: {{speed_gain: {found.scale:.4g}}}}}")
    return replace(said, evidence=shown)


__all__ = ["Whole", "scale_by_path", "told", "wanders"]
