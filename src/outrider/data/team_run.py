"""What came of a team's recording: estimates of everybody, what became of every sighting, and how good it was."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, final

import numpy as np

from outrider.data.trajectory import Trajectory
from outrider.typing import Bools, Floats, Ints


class Sighting(Enum):
    """What became of one sighting; the values are what a report says of it."""

    USED = "fused"
    GATED = "outside its gate: a misread barcode, or somebody is wrong"
    START = "told where the robot starts"
    EARLY = "before it was known where the robot, or who it saw, is"
    NOT_SHARED = "of another robot, and robots do not share"
    UNKNOWN = "barcode of nobody"
    ITSELF = "barcode of the robot itself"
    UNMAPPED = "landmark whose place nobody knows"
    WITHHELD = "landmark, which this robot is told not to use"
    REPEATED = "same values as in the frame before"
    IMPLAUSIBLE = "range or bearing that no camera can measure"
    DISBELIEVED = "by a robot that is not believed: what it says it sees, nobody else finds there"
    ABSENT = "robot that is not part of the team"
    REFUSED = "no use: too close, or nothing would be gained"


REASONS: Mapping[int, Sighting] = dict(enumerate(Sighting))
CODES: Mapping[Sighting, int] = {s: k for k, s in REASONS.items()}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Sightings:
    """Everything that the robots of a team saw. t : (n,) ns;  robot : (n,) index;  subject : (n,) number, negative: a
    barcode of nobody;  z : (n, 2) range [m], bearing [rad];  what : (n,) code;  nis : (n,), NaN where not compared"""

    t: Ints
    robot: Ints
    subject: Ints
    z: Floats
    what: Ints
    nis: Floats

    def counts(self, rows: Bools | None = None) -> dict[str, int]:
        """How many came to what, by name; only what there is."""
        what = self.what if rows is None else self.what[rows]
        return {s.name.lower(): int((what == k).sum()) for k, s in REASONS.items() if (what == k).any()}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Against ground truth, which the estimator never saw. rmse [m], heading [rad];  nees per degree of freedom;
    inside : share of the time in which the NEES is in its 95 % band;  n : poses compared"""

    n: int
    rmse: float
    largest: float
    heading: float
    nees: float
    inside: float

    def as_dict(self) -> dict[str, float | int]:
        """With the units in the names."""
        return {
            "compared": self.n, "rmse_m": self.rmse, "largest_m": self.largest,
            "heading_rmse_deg": float(np.degrees(self.heading)), "nees_per_dof": self.nees,
            "share_in_band": self.inside,
        }  # fmt: skip


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RobotEstimate:
    """One robot. start : how its start was found;  pose : where it was, from then on, with x, y and heading in x (k, 3)
    and P (k, 3, 3);  states, sigmas : all states by name (k,);  truth : its ground truth;  score, alone : of this run,
    and of the robot by itself"""

    name: str
    number: int
    start: str
    started: int  # ns
    t: Ints
    x: Floats
    P: Floats
    states: Mapping[str, Floats]
    sigmas: Mapping[str, Floats]
    odometry: Trajectory
    truth: Trajectory | None = None
    score: Score | None = None
    alone: Score | None = None


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TeamRun:
    """A team's recording, fused. absent : robot -> why it is not part of it;  noise : of sightings, as used"""

    log_path: str
    log_sha256: str
    config: Mapping[str, Any]
    versions: Mapping[str, str]
    cooperation: str
    about: str
    start: int  # ns
    names: tuple[str, ...]  # of all robots with odometry, which `Sightings.robot` counts
    robots: tuple[RobotEstimate, ...]
    absent: Mapping[str, str]
    landmarks: Mapping[int, tuple[float, float]]
    sightings: Sightings
    noise: Mapping[str, float]
    score: Score | None = None
    alone: Score | None = None
    notes: tuple[str, ...] = field(default=())
    wall_seconds: float = 0.0
    compile_seconds: float = 0.0
