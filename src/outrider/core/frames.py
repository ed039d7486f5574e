"""Between our frames and the others': ENU and NED worlds, FLU and FRD bodies, x y z w and w x y z quaternions.

Everything works on the last axis of arrays of any leading shape. Both changes of frame are half turns, so each is its
own inverse; the two names exist so that a reader sees which way a number goes.

>>> ned_to_enu([1.0, 2.0, 3.0]).tolist()
[2.0, 1.0, -3.0]
>>> frd_to_flu([1.0, 2.0, 3.0]).tolist()
[1.0, -2.0, -3.0]
"""

from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike

from outrider.core.attitudes import wrap_all
from outrider.typing import Floats

_SWAP = np.array([1, 0, 2])
_DOWN = np.array([1.0, 1.0, -1.0])
_RIGHT_DOWN = np.array([1.0, -1.0, -1.0])


def ned_to_enu(v: ArrayLike) -> Floats:
    """Vectors (..., 3): north, east, down -> east, north, up."""
    return np.asarray(v, dtype=np.float64)[..., _SWAP] * _DOWN


def enu_to_ned(v: ArrayLike) -> Floats:
    """Vectors (..., 3): east, north, up -> north, east, down."""
    return ned_to_enu(v)


def frd_to_flu(v: ArrayLike) -> Floats:
    """Vectors (..., 3): forward, right, down -> forward, left, up."""
    return np.asarray(v, dtype=np.float64) * _RIGHT_DOWN


def flu_to_frd(v: ArrayLike) -> Floats:
    """Vectors (..., 3): forward, left, up -> forward, right, down."""
    return frd_to_flu(v)


def cov_ned_to_enu(P3: ArrayLike) -> Floats:
    """Covariances (..., 3, 3) of vectors, from NED to ENU or back."""
    P = np.asarray(P3, dtype=np.float64)
    return P[..., _SWAP[:, None], _SWAP] * np.outer(_DOWN, _DOWN)


def cov_frd_to_flu(P3: ArrayLike) -> Floats:
    """Covariances (..., 3, 3) of vectors or body-side attitude errors, from FRD to FLU or back."""
    return np.asarray(P3, dtype=np.float64) * np.outer(_RIGHT_DOWN, _RIGHT_DOWN)


def quat_ned_frd_to_enu_flu(q: ArrayLike) -> Floats:
    """Attitudes (..., 4) xyzw of an FRD body in NED -> of the FLU body in ENU: half turns about (1 1 0) and x.

    A level vehicle that faces north has the identity in NED and a yaw of +90 degrees in ENU.

    >>> quat_ned_frd_to_enu_flu([0.0, 0.0, 0.0, 1.0]).round(4).tolist()
    [0.0, 0.0, 0.7071, 0.7071]
    """
    x, y, z, w = np.moveaxis(np.asarray(q, dtype=np.float64), -1, 0)
    return sqrt(0.5) * np.stack((x + y, x - y, w - z, w + z), axis=-1)


def quat_enu_flu_to_ned_frd(q: ArrayLike) -> Floats:
    """Attitudes (..., 4) xyzw of an FLU body in ENU -> of the FRD body in NED."""
    return quat_ned_frd_to_enu_flu(q)


def wxyz_to_xyzw(q: ArrayLike) -> Floats:
    """Quaternions (..., 4) from w first (ULog, MAVLink, EuRoC, MuJoCo) to w last (ROS and here)."""
    return np.roll(np.asarray(q, dtype=np.float64), -1, axis=-1)


def xyzw_to_wxyz(q: ArrayLike) -> Floats:
    """Quaternions (..., 4) from w last (ROS and here) to w first (ULog, MAVLink, EuRoC, MuJoCo)."""
    return np.roll(np.asarray(q, dtype=np.float64), 1, axis=-1)


def heading_from_azimuth(azimuth_cw_from_north: ArrayLike) -> Floats:
    """Compass azimuth [rad], clockwise from north -> heading [rad], counter-clockwise from east, in (-pi, pi]."""
    return wrap_all(0.5 * pi - np.asarray(azimuth_cw_from_north, dtype=np.float64))


def azimuth_from_heading(heading: ArrayLike) -> Floats:
    """Heading [rad], counter-clockwise from east -> compass azimuth [rad], clockwise from north, in (-pi, pi]."""
    return heading_from_azimuth(heading)
