"""One compiled entry for all sensors, chosen by code: a function passed as an argument would not be cached on disk."""

import numpy as np

from outrider._kernel import kernel
from outrider.models.kinematics import T_SIZE
from outrider.models.sensors import as_printed
from outrider.models.sensors.attitude import attitude, heading, sensor_attitude, yaw_of_attitude
from outrider.models.sensors.beacons import beacon_range, bearing, range_bearing
from outrider.models.sensors.geometry import triple
from outrider.models.sensors.gnss import gnss_position, gnss_velocity, position
from outrider.models.sensors.ground import baro, flow, range_finder
from outrider.models.sensors.inertial import gyro, specific_force, zero_rate
from outrider.models.sensors.layout import MAX_ROWS, OWN, Sensor
from outrider.models.sensors.magnetic import field_of, mag_heading, mag_vector, simulate_mag
from outrider.models.sensors.pose import (
    map_pose,
    pose,
    relative_pose,
    simulate_map_pose,
    simulate_pose,
    simulate_relative_pose,
)
from outrider.models.sensors.velocity import airspeed, body_velocity, nonholonomic, zero_velocity
from outrider.models.sensors.wheels import ackermann, simulate_ackermann, twist, wheels_differential, wheels_mecanum
from outrider.typing import Floats


@kernel
def evaluate(code: int, k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """y (m,) = z [-] h(k) and D (m, T_SIZE) = -dy/dk; returns m, or 0 where the sensor sees nothing.

    k (K_SIZE,) kinematics;  z one record, in the columns of its Kind (GNSS already in site metres, an IMU in halves:
    z[0:3] for GYRO and for SPECIFIC_FORCE);  theta (THETA_SIZE,);  y and D may be longer than m: only m rows are
    written. After a return of 0 both are meaningless.
    """
    if code == Sensor.GNSS_POSITION:
        return gnss_position(k, z, theta, y, D)
    if code == Sensor.GNSS_VELOCITY:
        return gnss_velocity(k, z, theta, y, D)
    if code == Sensor.GYRO:
        return gyro(k, z, theta, y, D)
    if code == Sensor.SPECIFIC_FORCE:
        return specific_force(k, z, theta, y, D)
    if code == Sensor.TWIST:
        return twist(k, z, theta, y, D)
    if code == Sensor.WHEELS_DIFFERENTIAL:
        return wheels_differential(k, z, theta, y, D)
    if code == Sensor.WHEELS_MECANUM:
        return wheels_mecanum(k, z, theta, y, D)
    if code == Sensor.ACKERMANN:
        return ackermann(k, z, theta, y, D)
    if code == Sensor.NONHOLONOMIC:
        return nonholonomic(k, z, theta, y, D)
    if code == Sensor.ZERO_VELOCITY:
        return zero_velocity(k, z, theta, y, D)
    if code == Sensor.ZERO_RATE:
        return zero_rate(k, z, theta, y, D)
    if code == Sensor.BARO:
        return baro(k, z, theta, y, D)
    if code == Sensor.MAG_HEADING:
        return mag_heading(k, z, theta, y, D)
    if code == Sensor.MAG_VECTOR:
        return mag_vector(k, z, theta, y, D)
    if code == Sensor.HEADING:
        return heading(k, z, theta, y, D)
    if code == Sensor.ATTITUDE:
        return attitude(k, z, theta, y, D)
    if code == Sensor.YAW_OF_ATTITUDE:
        return yaw_of_attitude(k, z, theta, y, D)
    if code == Sensor.POSE:
        return pose(k, z, theta, y, D)
    if code == Sensor.POSITION:
        return position(k, z, theta, y, D)
    if code == Sensor.BODY_VELOCITY:
        return body_velocity(k, z, theta, y, D)
    if code == Sensor.FLOW:
        return flow(k, z, theta, y, D)
    if code == Sensor.RANGE_FINDER:
        return range_finder(k, z, theta, y, D)
    if code == Sensor.RANGE:
        return beacon_range(k, z, theta, y, D)
    if code == Sensor.RANGE_BEARING:
        return range_bearing(k, z, theta, y, D)
    if code == Sensor.RELATIVE_POSE:
        return relative_pose(k, z, theta, y, D)
    if code == Sensor.AIRSPEED:
        return airspeed(k, z, theta, y, D)
    if code == Sensor.BEARING:
        return bearing(k, z, theta, y, D)
    if code == Sensor.MAP_POSE:
        return map_pose(k, z, theta, y, D)
    return printed(code, k, z, theta, y, D)


@kernel
def printed(code: int, k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """The sensors of `as_printed`."""
    if code == Sensor.PRINTED_ODOMETRY:
        return as_printed.odometry(k, z, theta, y, D)
    if code == Sensor.PRINTED_GNSS_POSITION:
        return as_printed.gnss_position(k, z, theta, y, D)
    if code == Sensor.PRINTED_GNSS_VELOCITY_GROUND:
        return as_printed.gnss_velocity_ground(k, z, theta, y, D)
    if code == Sensor.PRINTED_GNSS_VELOCITY_AIR:
        return as_printed.gnss_velocity_air(k, z, theta, y, D)
    if code == Sensor.PRINTED_GYRO:
        return as_printed.gyro(k, z, theta, y, D)
    if code == Sensor.PRINTED_ACCELEROMETER:
        return as_printed.accelerometer(k, z, theta, y, D)
    return 0


@kernel
def first_column(code: int) -> int:
    """Where in z the sensor's own columns begin: behind the name of a beacon or robot."""
    if code == Sensor.RANGE or code == Sensor.RANGE_BEARING or code == Sensor.RELATIVE_POSE:
        return 1
    if code == Sensor.BEARING:
        return 2
    return 0


def simulate(code: int, k: Floats, theta: Floats, z: Floats) -> int:
    """z <- h(k), the record without noise whose innovation is zero; returns m, or 0 where the sensor sees nothing.

    Only the sensor's own columns are written: names of beacons and robots stay. The constraints (NONHOLONOMIC,
    ZERO_VELOCITY) have no record and write nothing.
    """
    return fill(code, k, theta, z, np.zeros(2 * MAX_ROWS), np.zeros(MAX_ROWS), np.zeros((MAX_ROWS, T_SIZE)))


@kernel
def fill(code: int, k: Floats, theta: Floats, z: Floats, nothing: Floats, y: Floats, D: Floats) -> int:
    """As `simulate`, with its scratch; `nothing` is a record of zeros."""
    if code == Sensor.ACKERMANN:
        simulate_ackermann(k, theta, y, D, z)
    elif code == Sensor.MAG_HEADING:
        simulate_mag(k, theta, field_of(theta), z)
    elif code == Sensor.MAG_VECTOR:
        simulate_mag(k, theta, triple(theta, OWN), z)
    elif code == Sensor.ATTITUDE or code == Sensor.YAW_OF_ATTITUDE:
        sensor_attitude(k, theta, D, z[0:4])
    elif code == Sensor.POSE:
        simulate_pose(k, theta, D, z)
    elif code == Sensor.MAP_POSE:
        simulate_map_pose(k, theta, D, z)
    elif code == Sensor.RELATIVE_POSE:
        simulate_relative_pose(k, theta, D, z)
    else:  # z enters by a plain difference: the innovation of a record of zeros is -h
        m = evaluate(code, k, nothing, theta, y, D)
        if code != Sensor.NONHOLONOMIC and code != Sensor.ZERO_VELOCITY:
            for i in range(m):
                z[first_column(code) + i] = -y[i]
        return m
    return evaluate(code, k, z, theta, y, D)
