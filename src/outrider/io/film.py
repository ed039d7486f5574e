"""Moving pictures."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def write_film(frames: Iterable[NDArray[np.uint8]], path: Path, rate_hz: float) -> int:
    """Write pictures (height, width, 3), one at least, as an animated GIF that repeats; how many there were."""
    from PIL import Image  # slow to import

    palettes: list[Any] = [Image.fromarray(f).quantize(128) for f in frames]
    first, *rest = palettes
    first.save(path, save_all=True, append_images=rest, duration=round(1000.0 / rate_hz), loop=0)
    return len(palettes)
