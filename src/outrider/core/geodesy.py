"""Positions on the WGS84 ellipsoid, in the Earth-fixed frame (ECEF) and in a site's tangent plane (ENU, NED).

The only module that knows pymap3d. Latitude and longitude in rad, heights in m above the ellipsoid (not above sea
level). Inputs broadcast; positions come back as (..., 3). A row with a latitude beyond +-90 degrees, or with anything
that is not finite, comes back as NaN: such records exist in logs and are refused, with a reason, where they are used.
An impossible site origin is an error at once.

>>> p = geodetic_to_enu(0.9, 0.2, 130.0, 0.9, 0.2, 100.0)
>>> [round(v, 6) + 0.0 for v in p.tolist()]
[0.0, 0.0, 30.0]
"""

from dataclasses import dataclass
from functools import lru_cache
from math import cos, isfinite, pi, sin, sqrt
from typing import Any, TypeAlias, cast, final

import numpy as np
import pymap3d  # type: ignore[import-untyped]
from numpy.typing import ArrayLike

from outrider.core.frames import enu_to_ned, ned_to_enu
from outrider.errors import DataError
from outrider.typing import Floats

Geodetic: TypeAlias = tuple[Floats, Floats, Floats]
"""Latitude [rad], longitude [rad] in (-pi, pi], height above the ellipsoid [m]."""

# WGS84: semi-major axis [m], flattening, GM [m^3/s^2], rotation rate [rad/s], gravity at equator and pole [m/s^2].
A = 6378137.0
F = 1.0 / 298.257223563
GM = 3.986004418e14
OMEGA = 7.292115e-5
_E2 = F * (2.0 - F)
B = 6356752.31424518  # m, semi-minor axis
_LINEAR = sqrt(A**2 - B**2)  # m, linear eccentricity
_GAMMA_E = 9.7803253359
_GAMMA_P = 9.8321849378

_pymap3d = cast("Any", pymap3d)


def _sane(lat: ArrayLike, lon: ArrayLike, alt: ArrayLike) -> Geodetic:
    """Broadcast float64 copies, with NaN in every row that is no place."""
    rows = np.empty((3, *np.broadcast(lat, lon, alt).shape))
    rows[0], rows[1], rows[2] = lat, lon, alt
    good = np.isfinite(rows).all(axis=0) & (np.abs(rows[0]) <= 0.5 * pi)
    if not good.all():
        rows[:, ~good] = np.nan
    return rows[0], rows[1], rows[2]


def _rows(parts: tuple[ArrayLike, ...]) -> Floats:
    """(..., 3) of three arrays (...)."""
    out = np.empty((*np.shape(parts[0]), len(parts)))
    for k, part in enumerate(parts):
        out[..., k] = part
    return out


def _check_origin(lat0: float, lon0: float, alt0: float) -> None:
    if not (isfinite(lat0) and isfinite(lon0) and isfinite(alt0) and abs(lat0) <= 0.5 * pi):
        raise DataError(
            f"no such place: latitude {lat0:g} rad, longitude {lon0:g} rad, height {alt0:g} m",
            where="site origin",
            fix="latitude must lie in [-pi/2, pi/2] and all three be finite; degrees given for radians?",
        )


@final
@dataclass(frozen=True, slots=True)
class _Origin:
    """A site's origin: ECEF [m], sines and cosines of its latitude and longitude."""

    p: tuple[float, float, float]
    sp: float
    cp: float
    sl: float
    cl: float


@lru_cache(maxsize=64)
def _origin(lat0: float, lon0: float, alt0: float) -> _Origin:
    """Raises DataError for one that cannot be."""
    _check_origin(lat0, lon0, alt0)
    p = _pymap3d.geodetic2ecef(lat0, lon0, alt0, deg=False)
    return _Origin(p, float(np.sin(lat0)), float(np.cos(lat0)), float(np.sin(lon0)), float(np.cos(lon0)))


def geodetic_to_ecef(lat: ArrayLike, lon: ArrayLike, alt: ArrayLike) -> Floats:
    """ECEF positions (..., 3) [m]."""
    return _rows(_xyz(*_sane(lat, lon, alt)))


def _xyz(lat: Floats, lon: Floats, alt: Floats) -> tuple[Floats, Floats, Floats]:
    s, c = np.sin(lat), np.cos(lat)
    N = A**2 / np.hypot(A * c, B * s)  # radius of curvature across the meridian
    flat = (N + alt) * c
    return flat * np.cos(lon), flat * np.sin(lon), (N * (B / A) ** 2 + alt) * s


def ecef_to_geodetic(p: ArrayLike) -> Geodetic:
    """Latitude, longitude, height of ECEF positions (..., 3) [m]; to 1e-8 m from the deep sea into orbit.

    The closed form is off by 6 mm at 1000 km height; one Newton step along north and up mends it.
    """
    xyz = np.asarray(p, dtype=np.float64)
    return _geodetic(xyz[..., 0], xyz[..., 1], xyz[..., 2])


def _geodetic(x: Floats, y: Floats, z: Floats) -> Geodetic:
    shape = np.shape(x)
    x, y, z = np.reshape(x, -1), np.reshape(y, -1), np.reshape(z, -1)
    flat = np.hypot(x, y)
    lat, lon, alt = _closed_form(x, y, z, flat)
    s, c = np.sin(lat), np.cos(lat)
    W2 = 1.0 - _E2 * s * s
    N = A / np.sqrt(W2)  # across the meridian; along it, M = N (1 - e^2) / W^2
    along, up = flat - (N + alt) * c, z - (N * (1.0 - _E2) + alt) * s
    lat = np.minimum(np.maximum(lat + (c * up - s * along) / (N * (1.0 - _E2) / W2 + alt), -0.5 * pi), 0.5 * pi)
    alt = alt + c * along + s * up
    return lat.reshape(shape), lon.reshape(shape), alt.reshape(shape)


def _closed_form(x: Floats, y: Floats, z: Floats, flat: Floats) -> Geodetic:
    """Of rows (n,), flat = hypot(x, y).  Source: You (2000), J. Surv. Eng. 126(3), equations 4a to 4c, 7 and 13.

    As pymap3d has it, operation by operation, but for its guards, which cost most of its time; what needs them, rows
    near the axis or the centre of the Earth or that are not finite, is left to it.
    """
    r2, e2 = np.sqrt(x**2 + y**2 + z**2) ** 2 - _LINEAR**2, 2 * _LINEAR * z
    u = np.sqrt(0.5 * r2 + 0.5 * np.hypot(r2, e2))  # m, semi-minor axis of the confocal ellipsoid through the place
    if not bool(((u > 1.0) & (flat > 1.0)).all()):
        lat, lon, alt = (np.reshape(a, x.shape) for a in _pymap3d.ecef2geodetic(x, y, z, deg=False))
        return lat, lon, alt
    v = np.hypot(u, _LINEAR)
    beta = np.arctan(v / u * z / flat)
    c, Av = np.cos(beta), A * v
    beta += ((B * u - Av + _LINEAR**2) * np.sin(beta)) / (Av / c - _LINEAR**2 * c)
    alt = np.hypot(z - B * np.sin(beta), flat - A * np.cos(beta))
    if not (u > B + 1.0).all():
        alt = np.where(x**2 / A**2 + y**2 / A**2 + z**2 / B**2 < 1, -alt, alt)  # inside
    return np.arctan(A / B * np.tan(beta)), np.arctan2(y, x), alt


def rotation_enu_ecef(lat: float, lon: float) -> Floats:
    """R_enu_ecef (3, 3): Earth-fixed vectors -> east, north, up at a place."""
    sp, cp, sl, cl = sin(lat), cos(lat), sin(lon), cos(lon)
    return np.array([[-sl, cl, 0.0], [-sp * cl, -sp * sl, cp], [cp * cl, cp * sl, sp]])


def ecef_to_enu(p: ArrayLike, lat0: float, lon0: float, alt0: float) -> Floats:
    """Positions (..., 3) [m] from ECEF to the tangent plane at the origin."""
    xyz = np.asarray(p, dtype=np.float64)
    return _to_plane(_origin(lat0, lon0, alt0), xyz[..., 0], xyz[..., 1], xyz[..., 2])


def _to_plane(o: _Origin, x: Floats, y: Floats, z: Floats) -> Floats:
    u, v, w = x - o.p[0], y - o.p[1], z - o.p[2]
    t = o.cl * u + o.sl * v
    return _rows((-o.sl * u + o.cl * v, -o.sp * t + o.cp * w, o.cp * t + o.sp * w))


def enu_to_ecef(p: ArrayLike, lat0: float, lon0: float, alt0: float) -> Floats:
    """Positions (..., 3) [m] from the tangent plane at the origin to ECEF."""
    return _rows(_from_plane(_origin(lat0, lon0, alt0), p))


def _from_plane(o: _Origin, p: ArrayLike) -> tuple[Floats, Floats, Floats]:
    enu = np.asarray(p, dtype=np.float64)
    e, n, u = enu[..., 0], enu[..., 1], enu[..., 2]
    t = o.cp * u - o.sp * n
    return o.p[0] + (o.cl * t - o.sl * e), o.p[1] + (o.sl * t + o.cl * e), o.p[2] + (o.sp * u + o.cp * n)


def geodetic_to_enu(lat: ArrayLike, lon: ArrayLike, alt: ArrayLike, lat0: float, lon0: float, alt0: float) -> Floats:
    """Positions (..., 3) [m] east, north, up in the tangent plane at the origin."""
    return _to_plane(_origin(lat0, lon0, alt0), *_xyz(*_sane(lat, lon, alt)))


def enu_to_geodetic(p: ArrayLike, lat0: float, lon0: float, alt0: float) -> Geodetic:
    """Latitude, longitude, height of tangent-plane positions (..., 3) [m]."""
    return _geodetic(*_from_plane(_origin(lat0, lon0, alt0), p))


def geodetic_to_ned(lat: ArrayLike, lon: ArrayLike, alt: ArrayLike, lat0: float, lon0: float, alt0: float) -> Floats:
    """Positions (..., 3) [m] north, east, down in the tangent plane at the origin."""
    return enu_to_ned(geodetic_to_enu(lat, lon, alt, lat0, lon0, alt0))


def ned_to_geodetic(p: ArrayLike, lat0: float, lon0: float, alt0: float) -> Geodetic:
    """Latitude, longitude, height of north, east, down positions (..., 3) [m]."""
    return enu_to_geodetic(ned_to_enu(p), lat0, lon0, alt0)


def gravity(lat: float, alt: float) -> float:
    """Normal gravity [m/s^2] at a latitude [rad] and ellipsoidal height [m]: Somigliana, free air to second order.

    Source: NGA.STND.0036 (WGS84), equations 4-1 and 4-3.

    >>> round(gravity(0.0, 0.0), 5), round(gravity(pi / 2, 0.0), 5)
    (9.78033, 9.83218)
    """
    s2 = sin(lat) ** 2
    k = (1.0 - F) * _GAMMA_P / _GAMMA_E - 1.0
    surface = _GAMMA_E * (1.0 + k * s2) / sqrt(1.0 - _E2 * s2)
    m = OMEGA**2 * A**3 * (1.0 - F) / GM
    return surface * (1.0 - 2.0 / A * (1.0 + F + m - 2.0 * F * s2) * alt + 3.0 * (alt / A) ** 2)
