"""The magnetic field: NOAA's own test values, published declinations, and dates no model covers."""

from datetime import UTC, datetime
from math import cos, degrees, pi, radians

import numpy as np
import pytest
from numpy.testing import assert_allclose

from outrider.core import magnetism as mag
from outrider.errors import DataError

# WMM2020 test values (NOAA NCEI): date, height [km], lat, lon [deg] -> declination, inclination [deg], intensity [nT]
WMM2020 = [
    (2020.0, 0.0, 80.0, 0.0, -1.28, 83.14, 55000.1),
    (2020.0, 0.0, 0.0, 120.0, 0.16, -15.42, 41104.9),
    (2020.0, 0.0, -80.0, 240.0, 69.36, -72.20, 55120.6),
]


@pytest.mark.parametrize(("year", "height", "lat", "lon", "dec", "inc", "total"), WMM2020)
def test_published_test_values(
    year: float, height: float, lat: float, lon: float, dec: float, inc: float, total: float
) -> None:
    place = radians(lat), radians(lon), height * 1000.0, year
    assert degrees(mag.declination(*place)) == pytest.approx(dec, abs=0.006)
    unit, inclination = mag.field_enu(*place)
    assert degrees(inclination) == pytest.approx(inc, abs=0.006)
    assert mag.intensity(*place) == pytest.approx(total * 1e-9, abs=0.1e-9)
    assert np.linalg.norm(unit) == pytest.approx(1.0)
    assert_allclose(unit[2], -np.sin(inclination))
    assert_allclose(np.arctan2(unit[0], unit[1]), mag.declination(*place), rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("city", "lat", "lon", "expected"),
    [("Hamburg", 53.55, 10.0, 4.3), ("Sao Paulo", -23.55, -46.63, -21.9), ("Seattle", 47.6205, -122.3493, 14.9)],
)
def test_cities_in_late_2026(city: str, lat: float, lon: float, expected: float) -> None:
    assert degrees(mag.declination(radians(lat), radians(lon), 0.0, 2026.9)) == pytest.approx(expected, abs=0.1), city


def test_stamps_and_years_say_the_same() -> None:
    for year in (2011, 2020, 2026, 2029):
        stamp = int(datetime(year, 1, 1, tzinfo=UTC).timestamp()) * 1_000_000_000
        assert mag.decimal_year(stamp) == pytest.approx(year, abs=0.006)
        place = radians(53.55), radians(10.0), 0.0
        assert mag.declination(*place, stamp + 10**15) == pytest.approx(mag.declination(*place, year + 0.032), abs=2e-5)


@pytest.mark.parametrize(
    ("when", "covered", "model"),
    [
        (2010.0, True, "WMM-2010"),
        (2019.99, True, "WMM-2015v2"),
        (2020.0, True, "WMM-2020"),
        (2024.99, True, "WMM-2020"),
        (2025.0, True, "WMM-2025"),
        (2030.0, True, "WMM-2025"),
        (2030.01, False, "WMM-2025"),
        (1999.0, False, "WMM-2010"),
        (0, False, "WMM-2010"),  # a clock that counts from boot
        (2_500_000_000_000_000_000, False, "WMM-2025"),  # nanoseconds in 2049
    ],
)
def test_which_model_answers_and_whether_it_may(when: float, covered: bool, model: str) -> None:
    assert mag.covers(when) is covered
    assert mag.model_name(when) == model
    place = 0.9, 0.2, 100.0
    nearest = min(max(mag.decimal_year(when), 2010.0), 2030.0)
    assert mag.declination(*place, when) == mag.declination(*place, nearest)


def test_neighbouring_models_agree_where_they_meet() -> None:
    for year in (2015.0, 2020.0, 2025.0):
        before, after = (mag.declination(0.9, 0.2, 0.0, y) for y in (year - 1e-6, year))
        assert before != after
        assert abs(before - after) < radians(0.3)


@pytest.mark.parametrize("lat", [-pi / 2, 1e-9 - pi / 2, pi / 2 - 1e-6, pi / 2])
@pytest.mark.parametrize("lon", [-pi, 0.0, pi, 5.0])
def test_poles_and_antimeridian(lat: float, lon: float) -> None:
    unit, inclination = mag.field_enu(lat, lon, 0.0, 2026.0)
    assert np.isfinite(unit).all()
    assert abs(inclination) > 1.0
    assert mag.intensity(lat, lon, 0.0, 2026.0) == pytest.approx(mag.intensity(lat, lon - 2 * pi, 0.0, 2026.0))
    assert 2e-5 < mag.intensity(lat, lon, 0.0, 2026.0) < 7e-5


def test_the_field_weakens_with_the_cube_of_the_radius() -> None:
    ground, high = (mag.intensity(0.9, 0.2, alt, 2026.0) for alt in (0.0, 100e3))
    assert high / ground == pytest.approx((6371.0 / 6471.0) ** 3, abs=0.003)


def test_east_is_positive() -> None:
    """Where the needle points east of north, its east component is positive."""
    unit, inclination = mag.field_enu(radians(47.6), radians(-122.3), 0.0, 2026.0)
    assert unit[0] > 0.2 * cos(inclination)


@pytest.mark.parametrize("place", [(51.2, 0.1, 0.0), (float("nan"), 0.1, 0.0), (0.5, float("inf"), 0.0)])
def test_no_such_place(place: tuple[float, float, float]) -> None:
    with pytest.raises(DataError, match=r"magnetic model.*no such place.*degrees given for radians"):
        mag.declination(*place, 2026.0)
