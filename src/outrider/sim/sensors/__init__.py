"""Simulated sensors: frozen parameters that a run turns into devices."""

from outrider.sim.sensors.base import Device, Plain, Sensor, Setting, make_device
from outrider.sim.sensors.field import Baro, Heading, Magnetometer
from outrider.sim.sensors.gnss import Gnss, GnssVelocity
from outrider.sim.sensors.inertial import Attitude, Imu
from outrider.sim.sensors.wheels import BodyTwist

__all__ = [
    "Attitude", "Baro", "BodyTwist", "Device", "Gnss", "GnssVelocity", "Heading", "Imu", "Magnetometer", "Plain",
    "Sensor", "Setting", "make_device",
]  # fmt: skip
