"""Hard and soft iron of a magnetometer: the ellipsoid on which its records lie.

    |W (z - b)| = 1 + noise,  W symmetric:  b is the hard iron, W / W_00 the soft iron's correction.

Attitudes play no part, and so neither do their errors; a rotation of the sensor shows in nothing, and the strength of
the field, which nothing uses, is left open (Renaudin, Afzal & Lachapelle, Journal of Sensors 2010, with least squares
on the deviations instead of the algebraic distance, for the sake of the covariance). A robot that only yaws draws an
ellipse: its horizontal part is found, and that is all that a heading needs.
"""

from dataclasses import dataclass, replace
from typing import Any, Final, final

import numpy as np

from outrider.data import Kind, Stream
from outrider.typing import Floats, Ints
from outrider.workflows.calibration.row import Row, row_of
from outrider.workflows.config import FuseConfig, SourceSection
from outrider.workflows.doctor.examine import Patient, told_mount
from outrider.workflows.doctor.signals import seconds
from outrider.workflows.sandwich import SURE, sandwich

NAMES: Final = ("forward", "left", "up")
WIDEST: Final = 0.1  # of the field: half of the widest interval that still says something
ROUNDS: Final = 30
DONE: Final = 1e-9
UNSEEN: Final = (float("nan"), float("inf"))
ANY: Final = 1e300  # width of an interval: that of all of them is judged together
FEW: Final = 100  # records
ROUND: Final = 5.0  # largest over smallest axis of an ellipsoid that iron still makes


@final
@dataclass(frozen=True, slots=True)
class Iron:
    """b (d,) hard iron, S (d, d) symmetric with S_00 = 1, both in body axes;  strength : of the field;  half : of the
    95 % intervals of b, then of the upper triangle of S but its first."""

    b: Floats
    S: Floats
    strength: float
    half: Floats

    @property
    def clear(self) -> bool:
        """Whether all of it is known well enough to be used."""
        n = self.b.size
        wide = np.concatenate([self.half[:n] / self.strength, self.half[n:]])
        return bool(np.all(wide < WIDEST))


def iron_rows(p: Patient, cfg: FuseConfig, *, ground: bool) -> list[Row]:
    """Rows of every magnetometer. ground : whether the robot stays level, and so draws an ellipse."""
    out: list[Row] = []
    for s in p.usable(Kind.MAG):
        told = told_mount(p, s)
        R = told if told is not None else np.eye(3)
        section = cfg.sources.get(s.name, SourceSection())
        raw = np.linalg.solve(np.reshape(section.soft_iron, (3, 3)), s.z.T).T + section.hard_iron
        z, t = raw @ R.T, seconds(p.log, s)
        found = None if len(z) < FEW else ellipsoid(z, t)
        if found is None or not found.clear:
            found = ellipsoid(z[:, :2], t) if ground and len(z) >= FEW else None
        out += rows_of(cfg, s, R, found if found is not None and found.clear else None)
    return out


def rows_of(cfg: FuseConfig, s: Stream, R: Floats, found: Iron | None) -> list[Row]:
    """A magnetometer's rows: three of hard and five of soft iron."""
    told_b, told_S = told_iron(cfg, s, R)
    n = 0 if found is None else found.b.size
    i, j = triangle(n)
    b = {k: (float(found.b[k]), float(found.half[k])) for k in range(n)} if found is not None else {}
    S = (
        {(i[k], j[k]): (float(found.S[i[k], j[k]]), float(found.half[n + k])) for k in range(len(i))}
        if found is not None
        else {}
    )
    out = [
        row_of(
            s.name,
            f"hard iron, {NAMES[k]}",
            "as logged",
            told_b[k],
            *b.get(k, (np.nan, np.inf)),
            np.finfo(np.float64).max,
        )
        for k in range(3)
    ]
    for k, m in zip(*triangle(3), strict=True):
        name = f"soft iron, {NAMES[m]} over forward" if k == m else f"soft iron, {NAMES[k]} with {NAMES[m]}"
        out.append(row_of(s.name, name, "", float(told_S[k, m]), *S.get((k, m), UNSEEN), ANY))
    section = {} if found is None else section_of(s, R, found)
    return [replace(r, section=section) if r.differs else r for r in out]


def told_iron(cfg: FuseConfig, s: Stream, R: Floats) -> tuple[Floats, Floats]:
    """What the configuration says, in body axes."""
    section = cfg.sources.get(s.name, SourceSection())
    S = R @ np.reshape(section.soft_iron, (3, 3)) @ R.T
    return R @ np.array(section.hard_iron), S / S[0, 0]


def section_of(s: Stream, R: Floats, found: Iron) -> dict[str, Any]:
    """The correction in the sensor's axes, as the configuration wants it."""
    n = found.b.size
    body = np.zeros(3), np.eye(3)
    body[0][:n], body[1][:n, :n] = found.b, found.S
    b, S = R.T @ body[0], R.T @ body[1] @ R
    hard = [float(f"{x:.5g}") for x in b]
    return {"sources": {s.name: {"hard_iron": hard, "soft_iron": [round(float(x), 5) for x in S.ravel()]}}}


def triangle(n: int) -> tuple[Ints, Ints]:
    """Rows and columns of a symmetric matrix's upper triangle but its first."""
    i, j = np.triu_indices(n)
    return i[1:], j[1:]


def ellipsoid(z: Floats, t: Floats) -> Iron | None:
    """Of records (m, d) at times (m,) [s]; None where they lie on none."""
    n = z.shape[1]
    i, j = np.triu_indices(n)
    scale = float(np.median(np.abs(z - np.median(z, axis=0)).max(axis=1)))
    if not scale > 0.0:
        return None
    x = sphere(z / scale)
    for _ in range(ROUNDS):
        r, J = deviations(x, z / scale)
        A = J.T @ J
        if not np.all(np.isfinite(A)) or np.linalg.cond(A) > 1e14:
            return None
        step = np.linalg.solve(A, -J.T @ r)
        step *= min(1.0, 0.5 / np.abs(step).max())
        x = x + step
        if np.abs(step).max() < DONE:
            break
    else:
        return None
    b, W = x[:n] * scale, symmetric(x[n:], n)
    axes = np.abs(np.linalg.eigvalsh(W))
    if axes.max() > ROUND * axes.min():
        return None
    cov = sandwich(A, J * r[:, None], t, float(np.mean(r**2)))
    w = W[i, j]
    G = np.zeros((n + w.size - 1, n + w.size))  # of b and w / w_0
    G[:n, :n] = scale * np.eye(n)
    G[n:, n], G[n:, n + 1 :] = -w[1:] / w[0] ** 2, np.eye(w.size - 1) / w[0]
    half = SURE * np.sqrt(np.diag(G @ cov @ G.T))
    return Iron(b, W / w[0], scale / float(np.linalg.det(W)) ** (1.0 / n), half)


def sphere(z: Floats) -> Floats:
    """b and W of the sphere |z|^2 = 2 b z + c, by linear least squares."""
    n = z.shape[1]
    a = np.linalg.lstsq(np.column_stack([2.0 * z, np.ones(len(z))]), np.sum(z**2, axis=1), rcond=None)[0]
    radius = np.sqrt(max(float(a[n] + a[:n] @ a[:n]), 1e-12))
    return np.concatenate([a[:n], np.eye(n)[np.triu_indices(n)] / radius])


def symmetric(w: Floats, n: int) -> Floats:
    """From its upper triangle."""
    W = np.zeros((n, n))
    W[np.triu_indices(n)] = w
    return W + W.T - np.diag(np.diag(W))


def deviations(x: Floats, z: Floats) -> tuple[Floats, Floats]:
    """r (m,) = |W (z - b)| - 1 and its Jacobian by b and the upper triangle of W."""
    n = z.shape[1]
    i, j = np.triu_indices(n)
    W, d = symmetric(x[n:], n), z - x[:n]
    u = d @ W
    size = np.sqrt(np.sum(u**2, axis=1))
    e = u / size[:, None]
    by_w = e[:, i] * d[:, j] + np.where(i == j, 0.0, e[:, j] * d[:, i])
    return size - 1.0, np.hstack([-e @ W, by_w])


__all__ = ["Iron", "ellipsoid", "iron_rows"]
