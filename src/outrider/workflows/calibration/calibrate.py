"""`calibrate`: what a log tells of where its sensors sit, how they count and when they stamp, and how sure that is."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final, final

import numpy as np

from outrider.data import EventLog, Finding, Kind
from outrider.io.config import merged
from outrider.workflows.calibration.comparison import motion_rows
from outrider.workflows.calibration.iron import iron_rows
from outrider.workflows.calibration.rolling import AGAINST_GYRO, BASE, TRACK, rolling_rows
from outrider.workflows.calibration.row import Row, row_of
from outrider.workflows.calibration.tune import Tuned, tune
from outrider.workflows.config import FuseConfig
from outrider.workflows.discover import delayed, find_datum, scaled, screened
from outrider.workflows.doctor.examine import Patient, paths, whole_paths
from outrider.workflows.doctor.prescribe import prescribed, starter
from outrider.workflows.doctor.signals import MOVING, Signal, speed
from outrider.workflows.findings.say import error
from outrider.workflows.parameters import WIDEST, What
from outrider.workflows.sandwich import SURE

SCHEMA: Final = "outrider.calibration/1"
UNDER_WAY_S: Final = 10.0  # s in motion, at least
STILL: Final = error(
    "no-motion",
    "this log has no motion: nothing tells lever arms, scales, delays and headings",
    fix="record some minutes of driving with turns and stops",
)
Progress = Callable[[str, float], None]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """What was found. rows : every parameter that was looked for;  config : what was given, what the doctor prescribes,
    and what differs from it;  findings : of the doctor, and what stood in the way;  tuned : what was done to noise."""

    log: EventLog
    rows: tuple[Row, ...]
    config: FuseConfig
    findings: tuple[Finding, ...]
    tuned: Tuned | None = None

    @property
    def complete(self) -> bool:
        """Whether the log moves and tells anything at all."""
        return STILL not in self.findings and any(r.found for r in self.rows)

    @property
    def yaml(self) -> str:
        """A configuration to start from."""
        return starter(self.config, self.findings)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "schema": SCHEMA,
            "log": {"path": self.log.path, "sha256": self.log.sha256, "duration_s": self.log.duration},
            "parameters": [r.as_dict() for r in self.rows],
            "tuned": self.tuned.as_dict() if self.tuned is not None else None,
            "findings": [{"severity": f.severity, "code": f.code, "text": f.text, "fix": f.fix} for f in self.findings],
            "configuration": self.config.model_dump(mode="json", exclude_unset=True),
        }


def calibrate(log: EventLog, cfg: FuseConfig, *, noise: bool = False, progress: Progress | None = None) -> Calibration:
    """Find the parameters of the sensors of a log, each with its 95 % interval or with why it cannot be told.

    noise : whether to tune the noise of sources and motion afterwards, with what was found

    Raises DataError when nothing in the log can be fused, ConfigError when the configuration does not fit it.
    """
    cfg, remarks = prescribed(log, cfg)
    p = patient(log, cfg)
    iron = iron_rows(p, cfg, ground=bool(p.log.of(Kind.TWIST, Kind.WHEELS, Kind.ACKERMANN)))
    if not moves(p):  # a compass may have been turned about in one place
        told = any(r.found for r in iron)
        rows, more = (tuple(iron), ()) if told else ((), (STILL,))
        return Calibration(log=log, rows=rows, config=with_rows(cfg, list(rows)), findings=(*remarks, *more))
    rows = rolling_rows(p, cfg) + iron
    clocks = {r.source: r.half / SURE for r in rows if r.what == What.DELAY.value and r.found}
    rows += motion_rows(log, with_rows(cfg, rows), progress or (lambda _, __: None), clocks)  # clocks and mounts fit
    rows = by_whole_path(rows, p)
    rows = [against_truth(r, rows) for r in rows]
    better, tuned = with_rows(cfg, rows), None
    if noise:
        tuned, better = tune(log, better, progress or (lambda _, __: None))
    return Calibration(log=log, rows=tuple(rows), config=better, findings=remarks, tuned=tuned)


def patient(log: EventLog, cfg: FuseConfig) -> Patient:
    """The log as it is used with a configuration."""
    corrected = log.with_streams(*(delayed(scaled(s, cfg), cfg) for s in log))
    verdicts = screened(corrected)
    return Patient(corrected, cfg, verdicts, find_datum(corrected, cfg, verdicts))


def moves(p: Patient) -> bool:
    """Whether any source tells that the vehicle was under way for long enough."""
    kinds = (Kind.TWIST, Kind.ACKERMANN, Kind.WHEELS, Kind.GNSS_VELOCITY)
    told = [speed(p.log, s) for s in p.usable(*kinds)] + [way.speed() for way in paths(p)]
    return any(under_way(s) > UNDER_WAY_S for s in told if s is not None)


def under_way(s: Signal) -> float:
    """Seconds that a speed is above `MOVING`, averaged over two seconds: a fix that jitters does not move."""
    at = np.arange(s.t[0], s.t[-1], 1.0)
    return float(np.sum(np.abs(s.mean(at, 2.0)) > 2.0 * MOVING))


def by_whole_path(rows: list[Row], p: Patient) -> list[Row]:
    """Speed scales by the whole path instead, where a receiver's error wanders, which no filter here expects."""
    found = {name: one for name, _, one in whole_paths(p)}

    def better(r: Row) -> Row:
        if r.what != What.SPEED.value or r.source not in found:
            return r
        one = found[r.source]
        value, half = r.told * one.scale, abs(r.told) * one.half
        made = row_of(r.source, r.what, r.unit, r.told, value, half, WIDEST[What.SPEED])
        section = {"sources": {r.source: {"speed_gain": round(value, 5)}}}
        return replace(made, section=section) if made.differs else made

    return [better(r) for r in rows]


def against_truth(r: Row, rows: list[Row]) -> Row:
    """What was found against a gyro as the configuration wants it, if the gyro's scale, or the wheels', is wrong: a
    turn rate scale against the truth, and lengths between wheels as they are."""
    gyro = scale_of(rows, What.RATE)
    if r.what == AGAINST_GYRO and r.found and gyro[0] != 1.0:
        return replace(r, section={"sources": {r.source: {"rate_gain": round(r.value * gyro[0], 5)}}})
    if r.what not in (BASE, TRACK) or not r.found:
        return r
    wheels = scale_of(rows, What.SPEED, r.source)
    value = r.value * wheels[0] / gyro[0]
    half = float(np.hypot(r.half, value * np.hypot(wheels[1], gyro[1])))
    made = row_of(r.source, r.what, r.unit, r.told, value, half, np.inf)
    key = "wheel_base_m" if r.what == BASE else "track_m"
    return replace(made, section={"sources": {r.source: {key: round(value, 4)}}}) if made.differs else made


def scale_of(rows: list[Row], what: What, source: str | None = None) -> tuple[float, float]:
    """Found over told of a scale, and half its interval; 1 where it is not found, or not wrong."""
    r = next((g for g in rows if g.what == what.value and g.found and source in (None, g.source)), None)
    if r is None:
        return 1.0, 0.0
    return (r.value / r.told if r.differs else 1.0), r.half / abs(r.told)


def with_rows(cfg: FuseConfig, rows: list[Row]) -> FuseConfig:
    """The configuration with what differs from what was told."""
    out: dict[str, Any] = cfg.model_dump(exclude_unset=True)
    for r in rows:
        out = merged(out, r.section) if r.section else out
    return FuseConfig.model_validate(out)


__all__ = ["Calibration", "calibrate"]
