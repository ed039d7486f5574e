"""A small robot with three sensors, and what navigates it."""

from dataclasses import replace

import numpy as np

from outrider.data import Gaussian
from outrider.filters.channels import Channel
from outrider.filters.engine import Filter
from outrider.models.motion import LAYOUTS, Motion, PlanarRobot
from outrider.models.sensors.gnss import GnssPosition
from outrider.models.sensors.inertial import Gyro
from outrider.models.sensors.layout import Mount
from outrider.models.sensors.wheels import Twist
from outrider.models.vehicles import Mecanum
from outrider.sim.sensors import BodyTwist, Gnss, Imu
from outrider.sim.team import Robot
from outrider.sim.truth import EPOCH, SITE
from outrider.team import Navigator

GNSS = Gnss(lever=(0.2, 0.0, 0.5), latency_s=0.08)
SENSORS = (Imu(rate_hz=50.0), BodyTwist(), GNSS)


def rover(name: str = "robot", **changes) -> Robot:
    return replace(Robot(name=name, vehicle=Mecanum(), sensors=SENSORS), **changes)


def channel(name: str, model, rows: tuple[int, ...], **changes) -> Channel:
    sigma = model.sigmas()
    use = np.isin(np.arange(sigma.size), rows)
    basis = Channel(
        name=name,
        stream=name,
        sensor=model.code,
        theta=model.theta(),
        sigma=sigma,
        floor=np.zeros(sigma.size),
        rows=use,
    )
    return replace(basis, **changes)


def navigator() -> Navigator:
    model = PlanarRobot(acceleration=0.5, yaw_acceleration=0.5)
    channels = (
        channel("gnss", GnssPosition(mount=Mount(lever_arm=(0.2, 0.0, 0.5))), (0, 1), reset=(0, 2)),
        channel("wheels", Twist(), (0, 5)),
        channel("imu", Gyro(), (2,)),
    )
    f = Filter(motion=Motion.PLANAR, theta=model.theta(), coasting=model.theta(), channels=channels)
    layout = LAYOUTS[Motion.PLANAR]
    sd = np.full(layout.error_size, 0.3)
    for name, value in {"heading": 0.05, "gyro_bias": 0.01, "wheel_scale": 0.03, "gnss_bias": 0.0}.items():
        sd[layout.error(name)] = value
    return Navigator(f, Gaussian(layout.zeros(), np.diag(sd**2), layout), EPOCH, SITE)
