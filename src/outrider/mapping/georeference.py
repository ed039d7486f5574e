"""An image that is a map, laid on the ground by points whose places are known."""

from dataclasses import dataclass
from math import atan2, hypot
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from outrider.errors import DataError
from outrider.typing import Floats

MIRRORED: Final = 5.0  # times better the points fit a mirrored image that is one
LARGEST: Final = 100_000.0  # m, of an image that is a site


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Georeference:
    """A similarity from an image to the site frame.

    resolution : m per pixel;  heading : rad, of the image's rows, counter-clockwise from the site's x axis;
    origin : (2,) m, the outer corner of the lowest leftmost pixel;  residuals : (n,) m, how far each control point is
    from where the fit puts it;  rmse : m;  without : (n,) m, RMSE of the others fitted alone, from four on.
    """

    resolution: float
    heading: float
    origin: Floats
    residuals: Floats
    without: tuple[float, ...] = ()

    @property
    def rmse(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def suspects(self) -> list[int]:
        """Control points that fit far worse than the others do: mistyped, most likely."""
        if len(self.residuals) < 4:
            return []
        bound = [max(3.0 * m, 2.0 * self.resolution) for m in self.without]
        return [k for k in range(len(bound)) if self.rmse > bound[k] and self.without[k] == min(self.without)]


def fit(pixels: Floats, places: Floats, rows: int) -> Georeference:
    """The similarity that fits best, in the sense of least squares, in closed form.

    pixels : (n, 2) column and row of points, from the outer corner of the upper left pixel;  places : (n, 2) m;
    rows : of the image.

    With w = column + i (rows - row) and z = x + i y:  z = a w + b,  a = sum conj(w - <w>) (z - <z>) / sum |w - <w>|^2.
    Raises DataError for less than two points, all in one place, a mirrored image, or one larger than `LARGEST`.
    """
    if len(pixels) < 2:
        raise DataError(f"{len(pixels)} control points", where="georeference", fix="two at least, better four")
    w = pixels[:, 0] + 1j * (rows - pixels[:, 1])
    z = places[:, 0] + 1j * places[:, 1]
    if not np.ptp(np.abs(w - w[0])) > 0.0 or not np.any(np.abs(z - z[0]) > 0.0):
        raise DataError("all control points are in one place", where="georeference", fix="choose them far apart")
    a, b = _similarity(w, z)
    residuals = np.abs(z - a * w - b)
    resolution = hypot(a.real, a.imag)
    _check(w, z, residuals, resolution, rows)
    keep = ~np.eye(len(w), dtype=np.bool_)
    without = tuple(_rms(_left(w[k], z[k])) for k in keep) if len(w) >= 4 else ()
    return Georeference(
        resolution=resolution, heading=atan2(a.imag, a.real), origin=np.array([b.real, b.imag]), residuals=residuals,
        without=without,
    )  # fmt: skip


def _similarity(w: NDArray[np.complex128], z: NDArray[np.complex128]) -> tuple[complex, complex]:
    dw, dz = w - w.mean(), z - z.mean()
    a = complex(np.sum(np.conj(dw) * dz) / max(float(np.sum(np.abs(dw) ** 2)), 1e-300))
    return a, complex(z.mean() - a * w.mean())


def _left(w: NDArray[np.complex128], z: NDArray[np.complex128]) -> Floats:
    a, b = _similarity(w, z)
    return np.abs(z - a * w - b)


def _rms(x: Floats) -> float:
    return float(np.sqrt(np.mean(x**2)))


def _check(
    w: NDArray[np.complex128], z: NDArray[np.complex128], residuals: Floats, resolution: float, rows: int
) -> None:
    """Refuse what can only be a slip: rows counted upwards, or degrees in the wrong order."""
    if _rms(residuals) > max(2.0 * resolution, MIRRORED * _rms(_left(np.conj(w), z))) and len(w) > 2:
        text = (
            f"the image lies mirrored: the points fit to {_rms(residuals):.3g} m, with rows counted the other way to "
        )
        text += f"{_rms(_left(np.conj(w), z)):.3g} m"
        raise DataError(text, where="georeference", fix="pixel: [column, row], rows counted from the top")
    if rows * resolution > LARGEST:
        text = f"the image would be {rows * resolution / 1000:.0f} km high, {resolution:.3g} m a pixel"
        raise DataError(text, where="georeference", fix="look for a latitude and a longitude that are swapped")
