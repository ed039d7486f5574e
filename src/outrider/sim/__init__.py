"""Truth and sensors: small worlds that give filters something to be measured against.

`drive` and `fly` make a `Truth`; `drift` gives it slow sensor errors; sensors sample it; `faults` spoil a log;
`wheeled_log`, `drone_log` and `demo_log` do all of it at once. Estimators see the `EventLog`, never the `Truth`.
"""

from outrider.sim.faults import FAULTS
from outrider.sim.logs import demo_log, drone_log, sense, wheeled_log
from outrider.sim.motion import GENTLE, drive, fly, follow, glide
from outrider.sim.noise import generator
from outrider.sim.sensors import (
    Attitude,
    Baro,
    BodyTwist,
    Gnss,
    GnssVelocity,
    Heading,
    Imu,
    Magnetometer,
    Plain,
    Sensor,
)
from outrider.sim.truth import Biases, Drift, Place, Truth, drift

__all__ = [
    "FAULTS", "GENTLE", "Attitude", "Baro", "Biases", "BodyTwist", "Drift", "Gnss", "GnssVelocity", "Heading", "Imu",
    "Magnetometer", "Place", "Plain", "Sensor", "Truth", "demo_log", "drift", "drive", "drone_log", "fly",
    "follow", "generator", "glide", "sense", "wheeled_log",
]  # fmt: skip
