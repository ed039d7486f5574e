"""Configuration of `outrider fuse`: nested, typed, checked on load, saved with every run.

Everything has a default; a short file says only what the log itself cannot tell (mounts, lever arms, beacons).
"""

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from outrider.io.checked import Flag, Number, Whole


def _no_zero(gain: float) -> float:
    if gain == 0.0:
        raise ValueError("leaves nothing of it (write `use: ignore`)")
    return gain


# Limits are far beyond any use, and keep what follows from a slip of the keyboard finite.
Length = Annotated[Number, Field(ge=-1e6, le=1e6)]
Angle = Annotated[Number, Field(ge=-360, le=360)]
Positive = Annotated[Number, Field(gt=0, le=1e6)]
Walk = Annotated[Number, Field(ge=0, le=1e6)]
Deviation = Annotated[Number, Field(ge=1e-9, le=1e9)]
Gain = Annotated[Number, Field(ge=-1e4, le=1e4), AfterValidator(_no_zero)]
Gained = Annotated[Number, Field(ge=-1e3, le=1e3)]
Second = Annotated[Number, Field(ge=-1e9, le=1e9)]


Strength = Annotated[Number, Field(ge=-1e9, le=1e9)]
Nine = tuple[Gained, Gained, Gained, Gained, Gained, Gained, Gained, Gained, Gained]


def _regular(m: Nine) -> Nine:
    a, b, c, d, e, f, g, h, i = m
    if abs(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)) < 1e-6:
        raise ValueError("leaves no direction of the field (write a matrix near 1 0 0, 0 1 0, 0 0 1)")
    return m


def _forward(window: tuple[float, float]) -> tuple[float, float]:
    if window[1] <= window[0]:
        raise ValueError("ends before it starts (write [start, end])")
    return window


Window = Annotated[tuple[Second, Second], AfterValidator(_forward)]


class Section(BaseModel):
    """A part of the configuration: unknown keys are errors, values are frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True)


class MountSection(Section):
    """Where a sensor frame sits on the body."""

    xyz_m: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)
    """Forward, left, up of the body origin."""
    rpy_deg: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw of the sensor frame in the body frame: R_body_sensor = Rz Ry Rx."""


class DatumSection(Section):
    """Origin of the site frame. Without it the first good fix is the origin."""

    lat_deg: Annotated[Number, Field(ge=-90, le=90)]
    lon_deg: Annotated[Number, Field(ge=-180, le=360)]
    alt_m: Length = 0.0


class SourceSection(Section):
    """How one source is used. `fuse`: into the estimate; `score`: compared, never fused; `ignore`: not read."""

    use: Literal["auto", "fuse", "score", "ignore"] = "auto"
    sigma: Deviation | tuple[Deviation, ...] | None = None
    """Standard deviation per row of the measurement (SI), instead of what the log states and of our defaults."""
    rows: Annotated[str, Field(pattern=r"^[01]{1,7}$")] | None = None
    """Which of its columns count, one digit each, e.g. "110001" of a TWIST or an IMU; those that the vehicle knows."""
    scale: Annotated[Number, Field(ge=1e-3, le=1e3)] = 1.0
    """Multiplies every standard deviation of this source."""
    gate: Annotated[Number, Field(gt=0.5, le=1.0)] = 0.999
    """Probability of the chi-square gate; 1 switches it off."""
    mount: MountSection | None = None
    """Instead of the mount of the source's frame."""
    delay_s: Annotated[Number, Field(ge=-3600, le=3600)] = 0.0
    """How much older the measurement is than its stamp."""
    rate_gain: Gain = 1.0
    """Multiplies angular rates (IMU, TWIST): 0.0174533 makes rad/s of deg/s, -1 turns their sense."""
    force_gain: Gain = 1.0
    """Multiplies the accelerations of an IMU: 9.80665 makes m/s^2 of g, -1 for one that tells gravity's pull."""
    speed_gain: Gain = 1.0
    """Multiplies speeds (TWIST, WHEELS, ACKERMANN): 0.277778 makes m/s of km/h."""
    range_gain: Annotated[Number, Field(gt=0, le=1e4)] = 1.0
    """Multiplies ranges to beacons (RANGE, RANGE_BEARING): 0.935 for a radio that reads 7 % long."""
    track_m: Positive | None = None
    """Distance between left and right wheels (WHEELS)."""
    wheel_base_m: Positive | None = None
    """Distance between axles (ACKERMANN)."""
    steering_zero_deg: Angle = 0.0
    """What an ACKERMANN source tells when the robot drives straight on: taken off."""
    hard_iron: tuple[Strength, Strength, Strength] = (0.0, 0.0, 0.0)
    """Taken off the records of a magnetometer (MAG), in its axes and its unit."""
    soft_iron: Annotated[Nine, AfterValidator(_regular)] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    """Multiplies them then: a 3 x 3 matrix, row by row."""
    mecanum_xy_m: tuple[Positive, Positive] | None = None
    """Half length and half width of a mecanum base (WHEELS with four columns)."""


class BeaconSection(Section):
    """A range beacon in the site frame."""

    id: Number
    xyz_m: tuple[Length, Length, Length]


class StartSection(Section):
    """Where a robot starts."""

    xy_m: tuple[Length, Length]
    heading_deg: Angle
    sigma_m: Positive = 0.1
    sigma_deg: Positive = 3.0


class TeamSection(Section):
    """A team whose robots see landmarks and one another: how they share what they know."""

    cooperation: Literal["none", "naive", "ci", "split_ci", "distributed", "joint"] = "joint"
    """`none`: every robot by itself; `naive`: unsafe, for comparison; `ci`, `split_ci`, `distributed`: only the two
    that meet talk; `joint`: one filter for all."""
    start: Literal["landmarks", "groundtruth"] = "landmarks"
    """`landmarks`: found from what is seen; `groundtruth`: the first pose of the log's ground truth."""
    starts: dict[str, StartSection] = {}
    """By robot, instead."""
    ids: dict[str, Annotated[Whole, Field(ge=0, le=10**6)]] = {}
    """By robot: the number by which others see it, where the log does not tell."""
    landmarks_for: tuple[str, ...] | None = None
    """Only these robots use landmarks; all by default."""
    without: tuple[str, ...] = ()
    """These robots are left out."""
    range_sigma_m: Deviation | None = None
    """Of ranges; by default found from the data, as is that of bearings."""
    bearing_sigma_deg: Deviation | None = None
    gate: Annotated[Number, Field(gt=0.5, lt=1.0)] = 0.999
    """Share of good sightings that pass the chi-square gate."""
    compare: Flag = True
    """Also run every robot by itself, to tell what the exchange is worth."""


class PlanarSection(Section):
    """Overrides of `PlanarRobot`, by its field names."""

    acceleration: Positive | None = None
    lateral: Positive | None = None
    lateral_time: Positive | None = None
    yaw_acceleration: Positive | None = None
    heading_walk: Walk | None = None
    position_walk: Walk | None = None


class StrapdownSection(Section):
    """Overrides of `StrapdownIns`, by its field names."""

    gyro_noise: Positive | None = None
    """rad/s per sqrt(Hz), with what vibration adds."""
    accel_noise: Positive | None = None
    """m/s^2 per sqrt(Hz), with what vibration adds."""


class FuseConfig(Section):
    """Everything `outrider fuse` can be told."""

    preset: Literal["default", "amr2025", "robot_localization"] = "default"
    """`amr2025`: the paper's own choice (RTK x, y; odometry v_x, v_y; IMU yaw, v_x, v_y). `robot_localization`: its
    upstream profile for a base with an IMU (attitude and yaw of the IMU trusted)."""
    robot: Annotated[str, Field(min_length=1, max_length=100)] = "robot"
    motion: Literal["auto", "planar", "strapdown", "omnidirectional", "follower"] = "auto"
    datum: DatumSection | None = None
    mounts: dict[str, MountSection] = {}
    """By frame name as the log gives it."""
    sources: dict[str, SourceSection] = {}
    """By source name as `outrider fuse` lists them; `*` is not a wildcard."""
    beacons: tuple[BeaconSection, ...] = ()
    team: TeamSection | None = None
    """Of a recording of several robots: fuse them together."""
    planar: PlanarSection = PlanarSection()
    process_noise: Annotated[tuple[Walk, ...], Field(min_length=15, max_length=15)] | None = None
    """Of an omnidirectional vehicle: variances per second of its fifteen states, in robot_localization's order."""
    strapdown: StrapdownSection = StrapdownSection()
    diagnose: Flag = True
    """Find mounts, units, senses and clock offsets that nobody gave from the log itself, and use them."""
    output_period_s: Annotated[Number, Field(ge=1e-3, le=3600)] = 0.05
    history_s: Annotated[Number, Field(gt=0, le=3600)] = 2.0
    """How late a record may arrive and still be put in its place."""
    local: Flag = True
    """Also estimate the smooth odom frame from wheels and IMU alone."""
    withhold: dict[str, Annotated[Whole, Field(ge=2)]] = {}
    """By source: fuse only every n-th record and score the others, e.g. {/fix: 5}."""
    outages_s: dict[str, tuple[Window, ...]] = {}
    """By source: windows (start, end) in seconds from the log's first event that are withheld and scored."""
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = 1
