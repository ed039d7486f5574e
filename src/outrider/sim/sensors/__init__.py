"""Simulated sensors: frozen parameters that a run turns into devices."""

from outrider.sim.sensors.base import Device, Plain, Sensor, Setting, make_device
from outrider.sim.sensors.field import Baro, Heading, Magnetometer
from outrider.sim.sensors.gnss import Gnss, GnssVelocity
from outrider.sim.sensors.inertial import Attitude, Imu
from outrider.sim.sensors.receiver import GnssReceiver, Quality, Spell
from outrider.sim.sensors.sight import Lidar, ObjectPose, RobotCamera, StereoVelocity, Uwb
from outrider.sim.sensors.wheels import BodyTwist, SteeringEncoder, WheelEncoders
from outrider.sim.sensors.wrong import Clocked, Faulty, Wrong

__all__ = [
    "Attitude", "Baro", "BodyTwist", "Clocked", "Device", "Faulty", "Gnss", "GnssReceiver", "GnssVelocity", "Heading",
    "Imu", "Lidar", "Magnetometer", "ObjectPose", "Plain", "Quality", "RobotCamera", "Sensor", "Setting", "Spell",
    "SteeringEncoder", "StereoVelocity", "Uwb", "WheelEncoders", "Wrong", "make_device",
]  # fmt: skip
