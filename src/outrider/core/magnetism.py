"""The Earth's magnetic field from the World Magnetic Model: what a compass needs to know, never typed in by a user.

The only module that knows pygeomag, which carries the models since 2010, each good for five years. A date outside all
of them is moved to the nearest covered one; `covers` says whether that happened. Dates are decimal years (2026.9) or
nanoseconds since 1970: a number of 10000 or more is taken for nanoseconds.
"""

from functools import cache, lru_cache
from importlib import import_module
from math import cos, degrees, isfinite, pi, radians, sin
from typing import Any, cast

import numpy as np
import pygeomag  # type: ignore[import-untyped]

from outrider.core.attitudes import wrap_all
from outrider.errors import DataError
from outrider.typing import Floats, Nanoseconds

_MODELS = {2010: "WMM_2010", 2015: "WMM_2015v2", 2020: "WMM_2020", 2025: "WMM_2025"}
FIRST_YEAR = 2010.0
LAST_YEAR = 2030.0

# The mean Gregorian year: good to two days, in which no declination moves by 0.01 degrees.
_NS_PER_YEAR = 365.2425 * 86400e9


def decimal_year(when: float | Nanoseconds) -> float:
    """A decimal year from nanoseconds since 1970, or from a decimal year.

    >>> round(decimal_year(1_796_000_000_000_000_000), 1), decimal_year(2026.9)
    (2026.9, 2026.9)
    """
    return when if abs(when) < 10_000 else 1970.0 + when / _NS_PER_YEAR


def covers(when: float | Nanoseconds) -> bool:
    """Whether a bundled model is valid on this date; if not, the answers are those of the nearest date that is."""
    return FIRST_YEAR <= decimal_year(when) <= LAST_YEAR


def model_name(when: float | Nanoseconds) -> str:
    """The model that answers for this date.

    >>> model_name(2026.9), model_name(1999.0)
    ('WMM-2025', 'WMM-2010')
    """
    return str(_model(_epoch(_clamped(when))).model)


def _clamped(when: float | Nanoseconds) -> float:
    return min(max(decimal_year(when), FIRST_YEAR), LAST_YEAR)


def _epoch(year: float) -> int:
    return max(start for start in _MODELS if start <= year)


@cache
def _model(epoch: int) -> Any:
    name = _MODELS[epoch]
    coefficients = getattr(import_module(f"pygeomag.wmm.{name.lower()}"), name)
    return cast("Any", pygeomag).GeoMag(coefficients_data=coefficients)


@lru_cache(maxsize=4096)
def _field(lat: float, lon: float, alt: float, year: float) -> tuple[float, float, float]:
    """Declination [rad], inclination [rad], intensity [T] at a covered date."""
    if not (isfinite(lat) and isfinite(lon) and isfinite(alt) and abs(lat) <= 0.5 * pi):
        raise DataError(
            f"no such place: latitude {lat:g} rad, longitude {lon:g} rad, height {alt:g} m",
            where="magnetic model",
            fix="latitude must lie in [-pi/2, pi/2] and all three be finite; degrees given for radians?",
        )
    field = _model(_epoch(year)).calculate(
        glat=degrees(lat), glon=degrees(float(wrap_all(lon))), alt=alt / 1000.0, time=year
    )
    return radians(field.d), radians(field.i), float(field.f) * 1e-9


def declination(lat: float, lon: float, alt: float, when: float | Nanoseconds) -> float:
    """Magnetic north from true north [rad], east positive: true azimuth = magnetic azimuth + declination.

    lat, lon : geodetic [rad];  alt : height [m];  when : decimal year or nanoseconds since 1970.

    >>> round(degrees(declination(radians(53.55), radians(10.0), 0.0, 2026.9)), 1)
    4.3
    """
    return _field(lat, lon, alt, _clamped(when))[0]


def intensity(lat: float, lon: float, alt: float, when: float | Nanoseconds) -> float:
    """Total strength of the field [T]: what a calibrated magnetometer's length should be."""
    return _field(lat, lon, alt, _clamped(when))[2]


def field_enu(lat: float, lon: float, alt: float, when: float | Nanoseconds) -> tuple[Floats, float]:
    """Direction of the field, a unit vector (3,) in ENU, and its inclination [rad], positive below the horizon."""
    dec, inc, _ = _field(lat, lon, alt, _clamped(when))
    return np.array([sin(dec) * cos(inc), cos(dec) * cos(inc), -sin(inc)]), inc
