"""A log small enough to be fused as plain Python."""

import numpy as np

from outrider.data import EventLog
from outrider.sim import Attitude, BodyTwist, Gnss, Imu, follow, sense
from outrider.sim.logs import ANTENNA, antenna


def small_patrol(*, mount: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)) -> EventLog:
    """Eight seconds of a wheeled robot with IMU, wheels and RTK: little enough for the plain Python pass."""
    sensors = (Imu(rate_hz=10.0, mount=mount), BodyTwist(rate_hz=5.0), Gnss(lever=ANTENNA), Attitude(rate_hz=5.0))
    truth = follow(np.tile([1.5, 0.0, 0.15], (10, 1)), 1.0, 8.0, 20.0)
    return sense(truth, sensors, 1, antenna())
