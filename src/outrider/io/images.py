"""Grey images as arrays: PGM, PNG and what else Pillow reads."""

import warnings
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from outrider.errors import DataError
from outrider.io.files import ensure_readable
from outrider.typing import Floats

LARGEST: Final = 1 << 27  # pixels, as many as a drawing may become


def read_image(path: Path) -> NDArray[np.uint8]:
    """(rows, cols, channels) uint8, top row first: grey, grey and alpha, RGB or RGBA, as the file has them.

    Raises DataError for what is no image, cut short, or of more pixels than a map may have.
    """
    from PIL import Image, UnidentifiedImageError

    ensure_readable(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of sizes: we have a limit of our own
            image: Any = Image.open(path)
        with image:
            wide, high = image.size
            if wide * high > LARGEST:
                raise Image.DecompressionBombError
            if image.mode in ("I;16", "I;16B", "I"):
                return np.rint(np.asarray(image, np.float64) / 257.0).astype(np.uint8)[:, :, None]
            alpha = image.mode in ("LA", "PA", "RGBA", "La", "RGBa") or "transparency" in image.info
            mode = ("LA" if alpha else "L") if image.mode in ("1", "L", "LA") else ("RGBA" if alpha else "RGB")
            pixels = np.array(image.convert(mode), np.uint8)
    except Image.DecompressionBombError:
        what = f"has more than {LARGEST / 1e6:.0f} million pixels"
        raise DataError(what, where=str(path), fix="cut out the part that is driven on, or make it coarser") from None
    except UnidentifiedImageError:
        raise DataError("is no image that can be read", where=str(path), fix="PGM or PNG") from None
    except (OSError, ValueError, SyntaxError, EOFError) as e:
        raise DataError(f"is damaged: {str(e).lower()}", where=str(path)) from None
    return pixels.reshape(*pixels.shape[:2], -1)


def brightness(pixels: NDArray[np.uint8], *, with_alpha: bool = False) -> Floats:
    """(rows, cols) mean of the colour channels, 0..255; `with_alpha` counts it as one of them."""
    channels = pixels.shape[2] if with_alpha else pixels.shape[2] - has_alpha(pixels)
    return cast("Floats", pixels[:, :, :channels].mean(axis=2, dtype=np.float64))


def has_alpha(pixels: NDArray[np.uint8]) -> bool:
    """Whether the last channel is one of opacity."""
    return pixels.shape[2] in (2, 4)


def write_pgm(path: Path, grey: NDArray[np.uint8]) -> None:
    """(rows, cols), top row first, as binary PGM."""
    rows, cols = grey.shape
    path.write_bytes(b"P5\n%d %d\n255\n" % (cols, rows) + np.ascontiguousarray(grey).tobytes())


def write_png(path: Path, pixels: NDArray[np.uint8]) -> None:
    """(rows, cols) grey or (rows, cols, 2) grey and alpha, top row first, as PNG."""
    from PIL import Image

    Image.fromarray(pixels).save(path, format="PNG")
