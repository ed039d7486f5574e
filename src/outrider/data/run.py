"""What one estimation job leaves behind: estimates, innovations, accounts, health and where they came from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Final, final

import numpy as np

from outrider.data.belief import StateLayout
from outrider.data.evidence import Evidence
from outrider.data.trajectory import Datum, Trajectory
from outrider.typing import Floats, Ints


class Verdict(IntEnum):
    """What became of one record. The sentences in `REASONS` are what the user reads."""

    USED = 0
    WITHHELD = 1
    GATED = 2
    LATE = 3
    DUPLICATE = 4
    NOT_FINITE = 5
    NULL_POSITION = 6
    NO_FIX = 7
    FEW_SATELLITES = 8
    IMPLAUSIBLE = 9
    FROZEN = 10
    STALE = 11
    BAD_STAMP = 12
    FAULTED = 13
    NOT_OBSERVING = 14
    INPUT = 15
    RESET = 16
    NOT_ALIGNED = 17
    DECLARED_INVALID = 18
    BAD_COVARIANCE = 19
    DIVERGED = 20
    REDUNDANT = 21
    ASTRAY = 22
    UNKNOWN_FIX = 23


REASONS: Mapping[Verdict, str] = {
    Verdict.USED: "fused",
    Verdict.WITHHELD: "withheld on request, compared only",
    Verdict.GATED: "innovation outside its chi-square gate",
    Verdict.LATE: "arrived after the history it belongs to had been dropped",
    Verdict.DUPLICATE: "same stamp and same values as the record before",
    Verdict.NOT_FINITE: "NaN or infinite value",
    Verdict.NULL_POSITION: "null position (0, 0)",
    Verdict.NO_FIX: "the receiver reports no fix",
    Verdict.FEW_SATELLITES: "fewer than four satellites",
    Verdict.IMPLAUSIBLE: "value outside what the sensor can measure",
    Verdict.FROZEN: "values frozen while stamps go on",
    Verdict.STALE: "fix older than its stamp says",
    Verdict.BAD_STAMP: "stamp of zero, or off the log's clock",
    Verdict.FAULTED: "source is in the faulted state",
    Verdict.NOT_OBSERVING: "conditions not met (too slow, out of range, unknown beacon)",
    Verdict.INPUT: "drives the prediction",
    Verdict.RESET: "fused after a logged reset",
    Verdict.NOT_ALIGNED: "used for the initial alignment, or before it",
    Verdict.DECLARED_INVALID: "the sensor itself says it is not valid",
    Verdict.BAD_COVARIANCE: "stated covariance is zero, negative or absurd",
    Verdict.DIVERGED: "refused: it would have made the estimate non-finite",
    Verdict.REDUNDANT: "another source of the same quantity is in use",
    Verdict.ASTRAY: "stamp far from the time that most sources share",
    Verdict.UNKNOWN_FIX: "fix type that is none of those known",
}


SILENCE: Final = 60.0  # s without a usable record: a longer time is no part of the run, the job starts anew after it
HOLD: Final = 5.0  # s that an estimate says anything about


def reason(verdict: Verdict, role: str) -> str:
    """The sentence on a verdict for a source of this role: what we chose only to compare was not asked for."""
    chosen = verdict is Verdict.WITHHELD and role.startswith("scored")
    return "compared with the estimate, not fused" if chosen else REASONS[verdict]


class SensorState(IntEnum):
    """Health of one source."""

    WARMING = 0  # not yet believed
    HEALTHY = 1
    SUSPECT = 2  # some records rejected of late
    FAULTED = 3  # not believed until it agrees again for a while
    RECOVERING = 4  # agrees again, on probation
    SILENT = 5  # no record for much longer than its period


class Outcome(Enum):
    """How the job ended; the value says what to try."""

    OK = "finished; the estimate is valid"
    DEGRADED = "finished, with warnings: read the findings"
    FLAWED = "finished, but something is wrong with the data or its configuration: read the errors"
    PARTLY_VALID = "finished; the estimate is valid for a part of the time only, the report shows when"
    NOT_CREDIBLE = "finished, but the result is not credible: read the findings for the source or clock at fault"
    NEVER_ALIGNED = (
        "no initial position or heading could be found: give a longer log, a GNSS source, or an initial pose"
    )
    DIVERGED = "the filter diverged: read the findings for the source that disagreed first"
    NO_DATA = "no usable record: check the source table for the reason"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Account:
    """What became of the records of one source. received = sum of `by_verdict` + malformed."""

    source: str
    kind: str
    role: str  # what it is used for, or why not used at all
    received: int
    used: int
    malformed: int
    by_verdict: Mapping[Verdict, int]
    rate: float  # Hz
    first: float  # s since the log's first event
    last: float  # s
    nis: float  # mean normalised innovation squared per degree of freedom, of fused and gated records; NaN if none
    state: SensorState | None  # at the end; None for what is not fused: it has no health


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One plain statement about the data or the result. severity: "info" | "warning" | "error"."""

    severity: str
    code: str  # stable and short, e.g. "heading-conflict"
    text: str
    source: str = ""
    fix: str = ""
    evidence: Evidence | None = field(default=None, compare=False, repr=False)  # what shows it, to be drawn small


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Reset:
    """A deliberate jump. t [ns]; delta : how far the named state moved (position m, or heading rad)."""

    t: int
    source: str
    state: str
    delta: Floats
    reason: str


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Innovations:
    """Every scored record of one source.

    t : (n,) ns;  y, s : (n, m) innovation and its predicted standard deviation (NaN rows unused);  nis : (n,);
    dof : (n,);  verdict : (n,) `Verdict` codes;  columns, units : m names and SI units;  z : (n, m) the measurement in
    the site frame.
    """

    t: Ints
    y: Floats
    s: Floats
    nis: Floats
    dof: Ints
    verdict: Ints
    z: Floats
    columns: tuple[str, ...]
    units: tuple[str, ...]

    def nis_per_dof(self, *verdicts: Verdict) -> float:
        """Mean NIS per degree of freedom of the records of these verdicts, of all if none is given; NaN without one."""
        rows = np.isfinite(self.nis) & (np.isin(self.verdict, verdicts) if verdicts else True)
        dof = float(self.dof[rows].sum())
        return float(self.nis[rows].sum()) / dof if dof else float("nan")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Estimates:
    """The output of one filter, one row per output time.

    t : (n,) ns;  x : (n, layout.size);  sd : (n, layout.error_size) standard deviations;  P_pose : (n, 6, 6) covariance
    of position (site frame) and attitude (body frame);  valid : (n, 3) int8 flags position, velocity, heading;
    pose : poses, velocities and covariances of the body. Arrays may be memory-mapped files.
    """

    layout: StateLayout
    t: Ints
    x: Floats
    sd: Floats
    valid: Ints
    pose: Trajectory


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Trouble:
    """The worst that a source's health came to. first : s since the start;  times : how often it began."""

    state: SensorState
    first: float
    times: int


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One job, frozen: inputs, configuration, versions, results. `truth` is never part of it."""

    log_path: str
    log_sha256: str
    config: Mapping[str, object]
    seed: int
    versions: Mapping[str, str]
    robot: str
    start: int  # ns: stamp of the log's first event, zero of every time given in seconds
    datum: Datum | None
    fused: Estimates  # map -> base_link (all sources)
    local: Estimates | None  # odom -> base_link (wheels and IMU only: smooth, drifts)
    innovations: Mapping[str, Innovations]
    accounts: tuple[Account, ...]
    findings: tuple[Finding, ...]
    resets: tuple[Reset, ...]
    tracks: Mapping[str, Trajectory] = field(default_factory=dict[str, Trajectory])  # what each source alone says
    health: Mapping[str, Floats] = field(default_factory=dict[str, Floats])  # source -> (k, 2) time [s], SensorState
    outcome: Outcome = Outcome.OK
    wall_seconds: float = float("nan")  # of computing, without what compiling took
    compile_seconds: float = 0.0

    @property
    def silences(self) -> Floats:
        """(k, 2) seconds since `start` at which an estimate was the last for more than `SILENCE`, and for how long."""
        t = (self.fused.t - self.start) * 1e-9
        gaps = np.diff(t)
        long = gaps > SILENCE
        return np.column_stack([t[:-1][long], gaps[long]]).astype(np.float64)

    @property
    def duration(self) -> float:
        """Seconds from `start` to the last estimate without `silences`: what every share of time is a share of."""
        whole = float(self.fused.t[-1] - self.start) * 1e-9 if self.fused.t.size else 0.0
        return whole - float(self.silences[:, 1].sum())

    @property
    def valid_shares(self) -> tuple[float, float, float]:
        """Shares of `duration` in which position, velocity and heading were valid.

        What an estimate says holds until the next, for `HOLD` at most; before the first one nothing is valid.
        """
        t, valid = self.fused.t, self.fused.valid != 0
        if not t.size:
            return 0.0, 0.0, 0.0
        if self.duration <= 0.0:
            now = valid[-1]
            return float(now[0]), float(now[1]), float(now[2])
        gaps = np.diff(t) * 1e-9
        counts = np.where(gaps > SILENCE, 0.0, np.minimum(gaps, HOLD)) / self.duration
        p, v, h = np.minimum(counts @ valid[:-1], 1.0).tolist()
        return p, v, h

    @property
    def listed(self) -> tuple[Account, ...]:
        """Accounts worth a row: a further use of a source, "NAME (use)", that no record was for is none."""
        names = {a.source for a in self.accounts}
        return tuple(a for a in self.accounts if a.received or a.source.partition(" (")[0] not in names - {a.source})

    def fused_nis(self, source: str) -> float:
        """Mean NIS per degree of freedom of what was fused of a source; NaN if nothing was."""
        i = self.innovations.get(source)
        return i.nis_per_dof(Verdict.USED, Verdict.RESET) if i is not None else float("nan")

    def trouble(self, source: str) -> Trouble | None:
        """The worst state of a source, if it was ever suspect or faulted."""
        history = self.health.get(source, np.zeros((0, 2)))
        for state in (SensorState.FAULTED, SensorState.SUSPECT):
            began = history[history[:, 1] == state, 0]
            if began.size:
                return Trouble(state=state, first=float(began[0]), times=int(began.size))
        return None

    @property
    def used_nothing_of(self) -> tuple[str, ...]:
        """Sources that were meant to be fused and contributed nothing."""
        idle = {Verdict.USED, Verdict.INPUT, Verdict.RESET, Verdict.WITHHELD}
        return tuple(
            a.source for a in self.accounts if a.role.startswith("fused") and not any(a.by_verdict.get(v) for v in idle)
        )


def empty_estimates(layout: StateLayout) -> Estimates:
    """Estimates without a row."""
    none = np.zeros(0, np.int64)
    pose = Trajectory(t=none, p=np.zeros((0, 3)), q=np.zeros((0, 4)))
    return Estimates(
        layout=layout,
        t=none,
        x=np.zeros((0, layout.size)),
        sd=np.zeros((0, layout.error_size)),
        valid=np.zeros((0, 3), np.int64),
        pose=pose,
    )
