"""Geodesy: published points (EPSG Guidance Note 7-2), round trips at the hard places, gravity's defining values."""

from math import pi, radians

import numpy as np
import pymap3d  # type: ignore[import-untyped]
import pytest
from numpy.testing import assert_allclose

from outrider.core import geodesy as geo
from outrider.errors import DataError


def dms(d: float, m: float, s: float) -> float:
    return radians(d + m / 60 + s / 3600)


# EPSG Guidance Note 7-2, "Geographic/geocentric conversions" and "Geographic/topocentric conversions" (WGS 84)
POINT = (dms(53, 48, 33.820), dms(2, 7, 46.380), 73.0)
ORIGIN = (radians(55.0), radians(5.0), 200.0)


def test_published_points() -> None:
    assert_allclose(geo.geodetic_to_ecef(*POINT), [3771793.968, 140253.342, 5124304.349], rtol=0, atol=1e-3)
    enu = geo.geodetic_to_enu(*POINT, *ORIGIN)
    assert_allclose(enu, [-189013.869, -128642.040, -4220.171], rtol=0, atol=1e-3)
    assert_allclose(geo.geodetic_to_ned(*POINT, *ORIGIN), [enu[1], enu[0], -enu[2]])
    assert_allclose(geo.enu_to_geodetic(enu, *ORIGIN), POINT, rtol=0, atol=1e-8)
    assert_allclose(geo.ned_to_geodetic([enu[1], enu[0], -enu[2]], *ORIGIN), POINT, rtol=0, atol=1e-8)


LATITUDES = np.radians([-90, -89.999999999, -89.9999, -45, -1e-9, 0, 1e-7, 30, 45, 60, 89.99, 89.999999999, 90])
LONGITUDES = np.radians([-180, -179.9999999999, -90, 0, 1e-9, 100, 179.9999999999, 180])
HEIGHTS = np.array([-11000.0, -430.0, 0.0, 0.001, 250.0, 9000.0, 20000.0, 1e6])


def test_round_trips_at_poles_antimeridian_and_every_height() -> None:
    lat, lon, alt = (a.ravel() for a in np.meshgrid(LATITUDES, LONGITUDES, HEIGHTS))
    p = geo.geodetic_to_ecef(lat, lon, alt)
    lat2, lon2, alt2 = geo.ecef_to_geodetic(p)
    assert_allclose(geo.geodetic_to_ecef(lat2, lon2, alt2), p, rtol=0, atol=5e-9)
    assert_allclose(alt2, alt, rtol=0, atol=5e-9)
    assert_allclose(lat2, lat, rtol=0, atol=2e-15)
    assert (np.abs(lat2) <= pi / 2).all()
    assert (np.abs(lon2) <= pi).all()


@pytest.mark.parametrize("lat0", [-pi / 2, -0.6, 0.0, 0.9, pi / 2])
@pytest.mark.parametrize("lon0", [-pi, 0.2, pi - 1e-7, pi])
def test_a_site_goes_there_and_back(lat0: float, lon0: float, rng: np.random.Generator) -> None:
    p = np.vstack((np.zeros(3), rng.normal(size=(50, 3)) * [3000.0, 3000.0, 100.0]))
    lat, lon, alt = geo.enu_to_geodetic(p, lat0, lon0, 120.0)
    assert_allclose(geo.geodetic_to_enu(lat, lon, alt, lat0, lon0, 120.0), p, rtol=0, atol=1e-8)
    assert alt[0] == pytest.approx(120.0, abs=1e-8)


def test_a_metre_east_across_the_antimeridian_is_a_metre() -> None:
    step = 1.0 / 6378137.0
    p = geo.geodetic_to_enu([0.0, 0.0], [pi - step / 2, step / 2 - pi], 0.0, 0.0, pi - step / 2, 0.0)
    assert_allclose(p, [[0, 0, 0], [1, 0, 0]], rtol=0, atol=1e-6)


def test_the_rotation_is_the_tangent_planes() -> None:
    R = geo.rotation_enu_ecef(ORIGIN[0], ORIGIN[1])
    assert_allclose(R @ R.T, np.eye(3), rtol=0, atol=1e-15)
    assert np.linalg.det(R) == pytest.approx(1.0)
    difference = geo.geodetic_to_ecef(*POINT) - geo.geodetic_to_ecef(*ORIGIN)
    assert_allclose(R @ difference, geo.ecef_to_enu(geo.geodetic_to_ecef(*POINT), *ORIGIN), rtol=0, atol=1e-8)
    assert_allclose(geo.enu_to_ecef(R @ difference, *ORIGIN), geo.geodetic_to_ecef(*POINT), rtol=0, atol=1e-8)
    assert_allclose(R @ [0.0, 0.0, 1.0], [0.0, np.cos(ORIGIN[0]), np.sin(ORIGIN[0])])


@pytest.mark.parametrize("shape", [(), (1,), (4,), (0,), (2, 3)])
def test_any_leading_shape(shape: tuple[int, ...]) -> None:
    lat, lon, alt = np.full(shape, 0.8), np.full(shape, -0.3), np.full(shape, 50.0)
    p = geo.geodetic_to_enu(lat, lon, alt, 0.8, -0.3, 50.0)
    assert p.shape == (*shape, 3)
    assert_allclose(p, 0.0, rtol=0, atol=1e-9)
    for back, sent in zip(geo.enu_to_geodetic(p, 0.8, -0.3, 50.0), (lat, lon, alt), strict=True):
        assert back.shape == shape
        assert_allclose(back, sent, rtol=0, atol=5e-9)


def test_places_that_are_none_become_nan_and_harm_no_neighbour() -> None:
    lat = [0.8, 1.7, np.nan, 0.8, 1e308, 0.8]
    lon = [0.1, 0.1, 0.1, np.inf, 1e308, 0.1]
    p = geo.geodetic_to_enu(lat, lon, 0.0, 0.8, 0.1, 0.0)
    assert np.isnan(p[1:5]).all()
    assert_allclose(p[[0, 5]], 0.0, rtol=0, atol=1e-9)
    back = geo.enu_to_geodetic(p, 0.8, 0.1, 0.0)
    assert np.isnan(np.array(back)[:, 1:5]).all()
    assert np.isfinite(np.array(back)[:, [0, 5]]).all()


@pytest.mark.parametrize("spread", [30.0, 3e4, 1e7])
def test_the_closed_form_is_that_of_pymap3d_to_the_last_bit(spread: float, rng: np.random.Generator) -> None:
    for n in (1, 2, 7, 40):
        origin = rng.uniform([-1.5, -3.0, -400.0], [1.5, 3.0, 5000.0])
        x, y, z = (geo.geodetic_to_ecef(*origin) + rng.normal(size=(n, 3)) * spread).T
        ours, theirs = geo._closed_form(x, y, z, np.hypot(x, y)), pymap3d.ecef2geodetic(x, y, z, deg=False)
        for one, other in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(one, np.reshape(other, n))


def test_inputs_are_left_alone() -> None:
    lat = np.array([0.8, 9.0])
    geo.geodetic_to_ecef(lat, 0.0, 0.0)
    assert lat.tolist() == [0.8, 9.0]


@pytest.mark.parametrize("origin", [(51.2, 7.0, 100.0), (np.nan, 0.0, 0.0), (0.5, np.inf, 0.0)])
def test_an_impossible_origin_is_named(origin: tuple[float, float, float]) -> None:
    with pytest.raises(DataError, match=r"site origin.*no such place.*degrees given for radians"):
        geo.geodetic_to_enu(0.5, 0.1, 0.0, *origin)


def test_gravity_against_the_standard() -> None:
    assert geo.gravity(0.0, 0.0) == pytest.approx(9.7803253359, abs=1e-10)
    assert geo.gravity(pi / 2, 0.0) == pytest.approx(9.8321849378, abs=1e-10)
    assert geo.gravity(radians(45.0), 0.0) == pytest.approx(9.80620, abs=1e-5)
    assert geo.gravity(-0.7, 0.0) == geo.gravity(0.7, 0.0)
    per_metre = geo.gravity(radians(45.0), 1.0) - geo.gravity(radians(45.0), 0.0)
    assert per_metre == pytest.approx(-3.0855e-6, rel=1e-3)
