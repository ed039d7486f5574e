"""Numbers as the papers print them, digit by digit; rows in the order of their tables."""

from typing import NamedTuple

import numpy as np

from outrider.typing import Floats


class Goal(NamedTuple):
    """amr2025, table 2: a navigation goal, where the robot ended, and the printed distance between them [m]."""

    place: str
    target: tuple[float, float]
    actual: tuple[float, float]
    d: float


GOALS = (
    Goal("simulation", (-2.78, -7.42), (-2.74, -7.41), 0.04),
    Goal("simulation", (-3.38, -14.59), (-3.41, -14.59), 0.03),
    Goal("map 1", (-3.00, -7.00), (-2.90, -7.27), 0.29),
    Goal("map 1", (-3.00, -14.00), (-3.34, -13.99), 0.34),
    Goal("map 2", (15.29, 17.01), (15.42, 16.72), 0.32),
    Goal("map 2", (0.10, 18.28), (-0.18, 18.08), 0.34),
    Goal("map 3", (15.00, 85.00), (15.14, 84.98), 0.14),
    Goal("map 3", (4.00, 80.00), (3.83, 79.72), 0.33),
    Goal("map 3", (0.00, 0.00), (-0.68, 0.06), 0.68),
)

# amr2025, table 3: heading estimated, measured by protractor, printed absolute error [deg]
HEADINGS: Floats = np.array(
    [
        [44.0, 44.2, 0.2],
        [74.5, 73.9, 0.6],
        [108.0, 106.2, 1.8],
        [128.0, 126.9, 1.1],
        [158.5, 157.8, 0.7],
        [228.5, 228.2, 0.3],
        [271.5, 270.7, 0.8],
        [312.0, 312.5, 0.5],
        [341.0, 342.3, 1.3],
    ]
)


class Path(NamedTuple):
    """amr2025, table 4: smoothness coefficient and length [m], planned and driven."""

    place: str
    smc_planned: str
    smc_driven: str
    length_planned: str
    length_driven: str


PATHS = (
    Path("simulation", "0.9452", "0.8749", "89.64", "91.59"),
    Path("map 1", "0.9326", "0.8286", "90.1", "97.79"),
    Path("map 2", "0.9741", "0.7912", "46.44", "56.83"),
    Path("map 3", "0.9982", "0.8991", "199.98", "202.26"),
)


class Control(NamedTuple):
    """amr2025, table 5: driven against commanded speed, MAE and RMSE [m/s], Pearson's r."""

    place: str
    mae: str
    rmse: str
    r: str


CONTROL = (
    Control("simulation", "0.0182", "0.028", "0.9076"),
    Control("map 1", "0.0123", "0.0264", "0.9739"),
    Control("map 2", "0.0368", "0.0736", "0.9648"),
    Control("map 3", "0.0138", "0.0322", "0.9269"),
)

DEGRADED, FUSED_DEGRADED = "2.93", "1.67"  # amr2025, text to figure 16: RMSE without and with fusion [m]


class Error(NamedTuple):
    """coop2024, text to figures 3 to 8: mean and standard deviation over time of an error's size."""

    robot: str
    quantity: str
    unit: str
    alone: tuple[str, str]
    together: tuple[str, str]


NOT_PRINTED = ("", "")
COOPERATION = (
    Error("UGV", "position", "m", ("0.51", "0.11"), ("0.27", "0.11")),
    Error("UAV", "position", "m", ("0.53", "0.03"), ("0.27", "0.04")),
    Error("UGV", "orientation", "deg", ("1.55", "1.4"), ("0.76", "0.73")),
    Error("UAV", "orientation", "deg", ("1.26", "0.54"), ("0.4", "0.15")),
    Error("UGV", "velocity", "m/s", NOT_PRINTED, ("0.04", "0.03")),
    Error("UAV", "velocity", "m/s", NOT_PRINTED, ("0.21", "0.13")),
    Error("UGV", "angular rate", "deg/s", NOT_PRINTED, ("0.45", "0.31")),
    Error("UAV", "angular rate", "deg/s", NOT_PRINTED, ("0.89", "0.61")),
)

METHODS = ("GPS", "EKF", "UKF", "EnKF")

# swarm2023, table 1: RMSE [m] of x, y, xy, xyz for each method
LOCALISATION = {
    "full signal": (
        ("0.15901", "0.21535", "0.26769", "0.27158"),
        ("0.15636", "0.21379", "0.26487", "0.26880"),
        ("0.14964", "0.19272", "0.24399", "0.24823"),
        ("0.13742", "0.16083", "0.21155", "0.21686"),
    ),
    "blocked signal": (
        ("0.94677", "0.57575", "1.10809", "1.10903"),
        ("0.28312", "0.34127", "0.44342", "0.44581"),
        ("0.29380", "0.24207", "0.38068", "0.38341"),
        ("0.22031", "0.18997", "0.29091", "0.29538"),
    ),
}

# swarm2023, table 2: after approach, by method
RENDEZVOUS_RMSE = ("0.65385", "0.65179", "0.60513", "0.53544")  # xyz, m
RENDEZVOUS_TIME = ("12", "12", "12", "11")  # s

# swarm2023, table 3, by method
MISSION_OUTSIDE = ("0.71376", "0.69982", "0.65594", "0.51319")  # xyz RMSE outside the rendezvous zone, m
MISSION_INSIDE = ("0.76316", "0.76243", "0.75740", "0.75051")  # inside, m
MISSION_TIME = ("22", "22", "22", "22")  # s

# swarm2023, elsewhere: what abstract and text say of the EnKF's RMSE [m]
ABSTRACT_FULL, ABSTRACT_BLOCKED, ABSTRACT_RENDEZVOUS = "0.21477", "0.25842", "0.5112414"
TEXT_RENDEZVOUS, TEXT_INSIDE, TEXT_OUTSIDE = "3.00275", "0.51319", "0.75051"
