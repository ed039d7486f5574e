"""By how much ranges to beacons at known places are too long in proportion, from the places and from dead reckoning.

The range bias of a filter is a constant; a scale would go into the wheel scale instead and stretch the path until it
fits the ranges. The places of three or more beacons fix the scale: over some seconds, in which dead reckoning is good
to centimetres, position, heading, offset and scale are fitted to the ranges alone.
"""

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from outrider.data import Finding
from outrider.data.evidence import POINTS, Curve, Evidence
from outrider.typing import Floats
from outrider.workflows.doctor.signals import Signal
from outrider.workflows.findings.say import warning

WINDOW: Final = 25.0  # s of one fit
WINDOWS: Final = 24  # fits of a log at most
LEAST: Final = 24  # ranges of a fit, to three beacons or more
ENOUGH: Final = 4  # fits
STARTS: Final = 8  # headings from which a fit begins
STEPS: Final = 25
NOISE: Final = 0.5  # m, of ranges for the weights
PRIOR: Final = (0.1, 1.0)  # of the scale, and of the offset [m]
HUBER: Final = 1.5  # deviations beyond which a residual counts linearly
WORST: Final = 2.0  # m of residuals beyond which a fit is none


@final
@dataclass(frozen=True, slots=True)
class Long:
    """Ranges tell `scale` times the distance, +- sd.  fits : (3, n) times [s], scales and deviations of the fits."""

    scale: float
    sd: float
    fits: Floats


def range_scale(t: Floats, r: Floats, beacons: Floats, speed: Signal, turn: Signal) -> Long | None:
    """The scale of ranges r (n,) [m] at t (n,) [s] to beacons (n, 3); None if it cannot be told."""
    walked = path_of(t, speed, turn)
    begins = np.arange(t[0], t[-1] - 0.5 * WINDOW, WINDOW)
    chosen = begins[np.linspace(0, len(begins) - 1, min(len(begins), WINDOWS)).astype(int)] if len(begins) else begins
    fits: list[tuple[float, float, float]] = []
    for begin in chosen:
        rows = np.flatnonzero((t >= begin) & (t < begin + WINDOW) & np.isfinite(walked).all(axis=1))
        if len(rows) < LEAST or len(np.unique(beacons[rows], axis=0)) < 3:
            continue
        found = fitted(walked[rows, :2] - walked[rows[0], :2], beacons[rows], r[rows])
        if found is not None:
            fits.append((float(begin), *found))
    if len(fits) < ENOUGH:
        return None
    at, k, sd = np.array(fits).T
    weight = 1.0 / sd**2
    mean = float(np.sum(weight * k) / np.sum(weight))
    spread = float(np.sqrt(np.sum(weight * (k - mean) ** 2) / np.sum(weight) / len(k)))
    return Long(mean, max(float(1.0 / np.sqrt(np.sum(weight))), spread), np.stack([at, k, sd]))


def path_of(t: Floats, speed: Signal, turn: Signal) -> Floats:
    """(n, 2) m: dead reckoning at times [s], NaN outside of what is known."""
    u = np.unique(np.concatenate([speed.t, turn.t]))
    dt, w, v = np.diff(u), np.interp(u, turn.t, turn.y), np.interp(u, speed.t, speed.y)
    psi = np.concatenate([[0.0], np.cumsum(0.5 * dt * (w[1:] + w[:-1]))])
    out: list[Floats] = []
    for rate in (v * np.cos(psi), v * np.sin(psi)):
        way = np.concatenate([[0.0], np.cumsum(0.5 * dt * (rate[1:] + rate[:-1]))])
        out.append(np.interp(t, u, way, left=np.nan, right=np.nan))
    return np.column_stack(out)


def fitted(d: Floats, beacons: Floats, r: Floats) -> tuple[float, float] | None:
    """Scale and its deviation, of ranges along a path d (n, 2) of unknown place and heading."""
    middle = beacons[:, :2].mean(axis=0)
    starts = (np.array([*middle, yaw, 1.0, 0.0]) for yaw in np.arange(STARTS) * (2.0 * np.pi / STARTS))
    x = min((descended(x, d, beacons, r) for x in starts), key=lambda x: loss(residuals(x, d, beacons, r)[0]))
    e, J = residuals(x, d, beacons, r)
    off = float(np.median(np.abs(e[: len(r)]))) * NOISE / 0.6745
    if off > WORST:
        return None
    return float(x[3]), float(np.sqrt(np.linalg.inv(normal(e, J)[0])[3, 3])) * max(1.0, off / NOISE)


def descended(x: Floats, d: Floats, beacons: Floats, r: Floats) -> Floats:
    """x after Levenberg's and Marquardt's descent."""
    damping, here = 1e-2, residuals(x, d, beacons, r)
    for _ in range(STEPS):
        A, g = normal(*here)
        y = x - np.linalg.solve(A + damping * np.diag(np.diag(A)), g)
        there = residuals(y, d, beacons, r)
        if loss(there[0]) < loss(here[0]):
            x, here, damping = y, there, damping / 3.0
        else:
            damping *= 5.0
    return x


def normal(e: Floats, J: Floats) -> tuple[Floats, Floats]:
    """Matrix (5, 5) and gradient (5,) of the weighted squares, weights by Huber."""
    weighted = J * (1.0 / np.fmax(1.0, np.abs(e) / HUBER))[:, None]
    return weighted.T @ J, weighted.T @ e


def residuals(x: Floats, d: Floats, beacons: Floats, r: Floats) -> tuple[Floats, Floats]:
    """(n + 2,) residuals over their deviations, of the ranges and of the priors, with their Jacobian by x (5,)."""
    c, s = np.cos(x[2]), np.sin(x[2])
    turned = np.column_stack([c * d[:, 0] - s * d[:, 1], s * d[:, 0] + c * d[:, 1]])
    to = np.column_stack([x[:2] + turned - beacons[:, :2], -beacons[:, 2]])
    far = np.fmax(np.linalg.norm(to, axis=1), 1e-6)
    unit = to[:, :2] / far[:, None]
    J = np.zeros((len(r) + 2, 5))
    J[:-2, :2] = x[3] * unit
    J[:-2, 2] = x[3] * (unit[:, 1] * turned[:, 0] - unit[:, 0] * turned[:, 1])
    J[:-2, 3], J[:-2, 4] = far, 1.0
    J[:-2] /= NOISE
    J[-2, 3], J[-1, 4] = 1.0 / PRIOR[0], 1.0 / PRIOR[1]
    e = np.concatenate([(x[3] * far + x[4] - r) / NOISE, [(x[3] - 1.0) / PRIOR[0], x[4] / PRIOR[1]]])
    return e, J


def loss(e: Floats) -> float:
    """Huber's, summed."""
    a = np.abs(e)
    return float(np.sum(np.where(a < HUBER, 0.5 * a * a, HUBER * (a - 0.5 * HUBER))))


def told(found: Long, name: str) -> Finding:
    """In words, with the fits."""
    gain = round(1.0 / found.scale, 4)
    way = "long" if found.scale > 1.0 else "short"
    text = f"the ranges of {name} read {100 * abs(found.scale - 1.0):.1f} % (+-{200 * found.sd:.1f}) too {way}, by "
    text += f"the places of the beacons: taken times {gain:g}"
    at, k, _ = found.fits
    shown = Evidence(
        x_label="time from start [s]", y_label="range told / distance", curves=(Curve(x=at, y=k, drawn=POINTS),),
        text=f"Each dot is {WINDOW:g} s of ranges, fitted to the places of the beacons along the way of the wheels.",
        levels=((1.0, "right"), (found.scale, "found")),
    )  # fmt: skip
    said = warning("range-scale", text, name, f"sources: {{{name}: {{range_gain: {gain:g}}}}}")
    return replace(said, evidence=shown)


__all__ = ["Long", "range_scale", "told"]
