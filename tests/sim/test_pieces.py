"""A run cut into pieces is the same run, but for rounding: vector instructions round the ends of arrays otherwise."""

import itertools

import numpy as np
import pytest
from devices import NOWHERE

from outrider.data import joined
from outrider.sim import Attitude, Baro, BodyTwist, Gnss, GnssVelocity, Heading, Imu, Plain, Sensor, drone_log
from outrider.sim.noise import generator
from outrider.sim.sensors import Setting, make_device
from outrider.sim.sensors.base import sampled, stamps

SENSORS: tuple[Sensor | Plain, ...] = (
    Imu(), Imu(name="odd", rate_hz=33.0), Attitude(), BodyTwist(), Gnss(phase_s=0.013, latency_s=0.1), GnssVelocity(),
    Baro(rate_hz=7.0), Heading(),
)  # fmt: skip


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda s: s.name)
@pytest.mark.parametrize("cuts", [(1,), (200, 201, 777), tuple(range(50, 1000, 50))], ids=len)
def test_pieces_are_the_whole(sensor: Sensor | Plain, cuts: tuple[int, ...]) -> None:
    truth = drone_log(3, 5.0, sensors=())[1]
    setting = Setting(world=NOWHERE, robot="drone", start=truth.start, end=int(truth.t[-1]), seed=3)

    def device():
        return make_device(sensor, setting, generator(3, "drone", sensor.name))

    whole, in_pieces = device()(truth, {}), device()
    edges = [0, *cuts, len(truth) - 1]
    parts = [in_pieces(truth.select(slice(a, b + 1)), {}) for a, b in itertools.pairwise(edges)]
    again = joined(parts)
    assert len(whole) > 10
    for name in ("t", "t_arrival"):
        np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
    for name in ("z", "var"):
        np.testing.assert_allclose(getattr(again, name), getattr(whole, name), rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("rate_hz", [1.0, 2.5, 10.0, 33.0, 100.0, 200.0, 400.0])
@pytest.mark.parametrize("phase_s", [0.0, 0.013, 0.02, 0.4, 3.0])
def test_a_piece_is_sampled_at_its_stamps(rate_hz: float, phase_s: float) -> None:
    """Where all of them fall on rows, those are taken without a search."""
    truth = drone_log(3, 2.0, sensors=())[1]
    for a, b in ((0, 1), (0, 40), (1, 41), (37, 38), (40, 300), (399, 400)):
        piece = truth.select(slice(a, b + 1))
        expected = piece.at(stamps(piece, rate_hz, phase_s))
        here = sampled(piece, rate_hz, phase_s)
        np.testing.assert_array_equal(here.t, expected.t)
        np.testing.assert_array_equal(here.p, expected.p)
        np.testing.assert_array_equal(here.q, expected.q)
