"""Array aliases. Shapes stand in docstrings; these say the element type."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Codes: TypeAlias = NDArray[np.int16]
Bools: TypeAlias = NDArray[np.bool_]
Nanoseconds: TypeAlias = int
