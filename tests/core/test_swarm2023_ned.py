"""swarm2023 section 3.2: local coordinates from geodetic ones, and what its rotation by the wrong latitude does."""

import numpy as np
import pytest

from outrider.core import geodesy as geo

ORIGIN = (np.radians(40.544289), np.radians(-4.012101), 122.0)


def test_north_east_down_and_back_within_a_kilometre() -> None:
    rng = np.random.default_rng(1)
    p = rng.uniform(-1000.0, 1000.0, (200, 3)) * [1.0, 1.0, 0.1]
    back = geo.geodetic_to_ned(*geo.ned_to_geodetic(p, *ORIGIN), *ORIGIN)
    np.testing.assert_allclose(back, p, rtol=0, atol=1e-6)


def test_the_printed_rotation_tilts_the_plane() -> None:
    """By tan^-1(Z / sqrt(X^2 + Y^2)), the geocentric latitude: 0.19 deg, 0.33 m of false height per 100 m north."""
    p = geo.geodetic_to_ecef(*ORIGIN)
    geocentric = float(np.arctan2(p[2], np.hypot(p[0], p[1])))
    assert np.degrees(ORIGIN[0] - geocentric) == pytest.approx(0.190, abs=5e-4)
    north = np.array([[100.0, 0.0, 0.0]])
    offset = geo.geodetic_to_ecef(*geo.ned_to_geodetic(north, *ORIGIN))[0] - p
    up = geo.rotation_enu_ecef(geocentric, ORIGIN[1])[2] @ offset
    assert abs(up) == pytest.approx(0.33, abs=0.01)
    assert abs(geo.rotation_enu_ecef(*ORIGIN[:2])[2] @ offset) < 1e-3
