"""What the autopilot logs have in common: pairing by time, positions in a site frame, pressure altitude."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from outrider.core.geodesy import geodetic_to_enu
from outrider.data import Fix
from outrider.typing import Bools, Floats, Ints

FIX_OF_CODE = {3: Fix.SINGLE, 4: Fix.DGNSS, 5: Fix.FLOAT, 6: Fix.FIXED, 7: Fix.FIXED}
"""PX4's and MAVLink's fix_type. 0 and 1 are no fix; 2 is two-dimensional, its altitude a guess, and is not used."""


def fix_codes(codes: Floats, table: dict[int, Fix]) -> Floats:
    """(n,) `Fix` codes of a receiver's own codes: NONE where the table has none, UNKNOWN where the code is NaN."""
    out = np.full(codes.shape, float(Fix.NONE.value))
    for code, fix in table.items():
        out[codes == code] = fix.value
    out[np.isnan(codes)] = Fix.UNKNOWN.value
    return out


def as_floats(column: NDArray[Any]) -> Floats:
    """A column of any number type as float64; bit patterns that are no quiet NaN become one without complaint."""
    with np.errstate(invalid="ignore"):
        return column.astype(np.float64)


def nearest(stamps: Ints, wanted: Ints, within: int) -> tuple[Ints, Bools]:
    """Index of the stamp nearest to each wanted one, and whether it is no further than `within`."""
    if stamps.size == 0:
        return np.zeros(wanted.size, np.int64), np.zeros(wanted.size, np.bool_)
    order = np.argsort(stamps, kind="stable")
    ordered = stamps[order]
    right = np.minimum(np.searchsorted(ordered, wanted), stamps.size - 1)
    left = np.maximum(right - 1, 0)
    index = np.where(np.abs(wanted - ordered[left]) <= np.abs(ordered[right] - wanted), left, right)
    return order[index], np.abs(ordered[index] - wanted) <= within


def last_before(stamps: Ints, wanted: Ints) -> tuple[Ints, Bools]:
    """Index of the last stamp not after each wanted one, and whether there is one; `stamps` ascending."""
    index = np.searchsorted(stamps, wanted, side="right") - 1
    return np.maximum(index, 0), index >= 0


def site_positions(lat: Floats, lon: Floats, alt: Floats) -> Floats:
    """(n, 3) east-north-up [m] in the tangent plane at the first known position; NaN where not known."""
    p, known = np.full((lat.size, 3), np.nan), np.isfinite(lat + lon + alt)
    if known.any():
        first = int(np.argmax(known))
        p[known] = geodetic_to_enu(lat[known], lon[known], alt[known], lat[first], lon[first], alt[first])
    return p


def pressure_altitude(pascal: Floats) -> Floats:
    """(n,) height [m] of a static pressure [Pa] in the standard atmosphere below 11 km; NaN for no pressure.

    h = T0/L (1 - (p/p0)^(R L / g)),  T0 = 288.15 K, L = 6.5 K/km, p0 = 101325 Pa
    """
    return 44330.77 * (1.0 - (np.where(pascal > 0, pascal, np.nan) / 101325.0) ** 0.1902632)
