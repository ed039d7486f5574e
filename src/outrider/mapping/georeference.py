"""An image that is a map, laid on the ground by points whose places are known."""

from dataclasses import dataclass
from math import atan2, hypot
from typing import final

import numpy as np

from outrider.errors import DataError
from outrider.typing import Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Georeference:
    """A similarity from an image to the site frame.

    resolution : m per pixel;  heading : rad, of the image's rows, counter-clockwise from the site's x axis;
    origin : (2,) m, the outer corner of the lowest leftmost pixel;  residuals : (n,) m, how far each control point is
    from where the fit puts it;  rmse : m.
    """

    resolution: float
    heading: float
    origin: Floats
    residuals: Floats

    @property
    def rmse(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def suspects(self) -> list[int]:
        """Control points that fit far worse than the others do: mistyped, most likely."""
        if len(self.residuals) < 4:
            return []
        others = [float(np.median(np.delete(self.residuals, k))) for k in range(len(self.residuals))]
        bound = [max(3.0 * m, 2.0 * self.resolution) for m in others]
        return [k for k, r in enumerate(self.residuals.tolist()) if r > bound[k]]


def fit(pixels: Floats, places: Floats, rows: int) -> Georeference:
    """The similarity that fits best, in the sense of least squares, in closed form.

    pixels : (n, 2) column and row of points, from the outer corner of the upper left pixel;  places : (n, 2) m;
    rows : of the image.

    With w = column + i (rows - row) and z = x + i y:  z = a w + b,  a = sum conj(w - <w>) (z - <z>) / sum |w - <w>|^2.
    Raises DataError for less than two points, or all in one place.
    """
    if len(pixels) < 2:
        raise DataError(f"{len(pixels)} control points", where="georeference", fix="two at least, better four")
    w = pixels[:, 0] + 1j * (rows - pixels[:, 1])
    z = places[:, 0] + 1j * places[:, 1]
    dw, dz = w - w.mean(), z - z.mean()
    spread = float(np.sum(np.abs(dw) ** 2))
    if not spread > 0.0 or not np.any(np.abs(dz) > 0.0):
        raise DataError("all control points are in one place", where="georeference", fix="choose them far apart")
    a = complex(np.sum(np.conj(dw) * dz) / spread)
    b = complex(z.mean() - a * w.mean())
    return Georeference(
        resolution=hypot(a.real, a.imag),
        heading=atan2(a.imag, a.real),
        origin=np.array([b.real, b.imag]),
        residuals=np.abs(z - a * w - b),
    )
