"""The plan of a job, and the draft in which it comes about: every stream gets a role, some get channels."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, final

import numpy as np

from outrider.data import Datum, EventLog, Finding, Kind, Stream, Verdict
from outrider.errors import ConfigError
from outrider.filters.channels import Channel, default_sigma
from outrider.filters.engine import Filter
from outrider.models.motion import LAYOUTS, Motion
from outrider.models.sensors import Mount, Sensor
from outrider.typing import Floats, Ints
from outrider.workflows.config import FuseConfig, MountSection, SourceSection


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What will be done: the filters, the verdicts of screening, and the roles of all streams.

    spread : standard deviations of blocks that the first records do not tell;  mounted : streams whose mount is known
    """

    whole: Filter
    local: Filter | None
    datum: Datum | None
    verdicts: Mapping[str, Ints]
    roles: Mapping[str, str]
    spread: Mapping[str, float]
    mounted: frozenset[str]
    findings: tuple[Finding, ...]
    log: EventLog


@final
@dataclass(slots=True)
class Draft:
    """What is known while the plan is being made."""

    log: EventLog
    cfg: FuseConfig
    motion: Motion
    datum: Datum | None
    verdicts: dict[str, Ints]
    channels: list[Channel] = field(default_factory=list[Channel])
    roles: dict[str, str] = field(default_factory=dict[str, str])
    findings: list[Finding] = field(default_factory=list[Finding])

    def section(self, s: Stream) -> SourceSection:
        """What the configuration says of a source."""
        return self.cfg.sources.get(s.name, SourceSection())

    def usable(self, s: Stream) -> bool:
        """Whether a source is switched on and has a record that passed screening."""
        return self.section(s).use != "ignore" and bool((self.verdicts[s.name] == Verdict.USED).any())

    def passed(self, name: str) -> Stream:
        """The records of a source that passed screening."""
        return self.log.streams[name].select(self.verdicts[name] == Verdict.USED)

    def mount(self, s: Stream) -> Mount:
        """Mount of a source: its own, its frame's in the configuration, its frame's in the log, else straight."""
        own = self.section(s).mount or self.cfg.mounts.get(s.frame)
        if own is not None:
            return mount_of(own)
        if s.frame in self.log.mounts:
            return Mount.from_matrix(self.log.mounts[s.frame])
        return Mount()

    def mounted(self, s: Stream) -> bool:
        """Whether anybody told the mount of a source."""
        return self.section(s).mount is not None or s.frame in self.cfg.mounts or s.frame in self.log.mounts

    def error_row(self, block: str) -> int:
        """First error row of a block of the process model."""
        return LAYOUTS[self.motion].error(block).start

    def add(
        self,
        s: Stream,
        sensor: Sensor | None,
        rows: str,
        *,
        name: str = "",
        role: str = "fused",
        theta: Floats | None = None,
        sigma: tuple[float, ...] = (),
        floor: tuple[float, ...] = (),
        trust_stated: bool = True,
        gated: bool = True,
        reset: tuple[int, int] = (0, 0),
        fixes: frozenset[int] = frozenset(),
        beacon: float | None = None,
        still: bool = False,
    ) -> None:
        """Add a channel for a stream; `rows` has 1 for each row that is used, the rest is as in `Channel`."""
        section = self.section(s)
        if section.rows is not None and sensor is not None:
            rows = known_rows(section.rows, s, sensor, rows, self.motion)
            if "1" not in rows:
                self.roles.setdefault(s.name, "not used: all its rows are switched off")
                return
        usual = default_sigma(sensor)[: len(rows)] if sensor is not None else np.ones(len(rows))
        given = None if still else given_sigma(section, s.name, len(rows))  # standing still is no reading
        if section.use == "score":
            role = "scored: on request"
        elif section.use == "fuse" and role.startswith("scored"):
            role = "fused"
        self.channels.append(
            Channel(
                name=name or s.name,
                stream=s.name,
                sensor=sensor,
                theta=self.mount(s).theta() if theta is None else theta,
                sigma=given if given is not None else np.array(sigma) if sigma else usual,
                floor=np.array(floor) if floor and given is None else np.zeros(len(rows)),
                rows=np.array([c == "1" for c in rows]),
                role=role,
                probability=section.gate if gated else 1.0,
                reset=reset,
                fixes=fixes,
                beacon=beacon,
                still=still,
                trust_stated=trust_stated and given is None,
                scale=section.scale,
            )
        )
        self.roles.setdefault(s.name, role)

    def skip(self, s: Stream, why: str) -> None:
        """Not used, with the reason that the user reads."""
        self.roles[s.name] = f"not used: {why}"

    def note(self, severity: str, code: str, text: str, source: str = "", fix: str = "") -> None:
        """Something the user should know."""
        self.findings.append(Finding(severity=severity, code=code, text=text, source=source, fix=fix))


KNOWN: Final = {Sensor.TWIST: "110001", Sensor.GYRO: "001", Sensor.POSE: "110001", Sensor.POSITION: "110"}  # in a plane


def known_rows(asked: str, s: Stream, sensor: Sensor, usual: str, motion: Motion) -> str:
    """Rows of a sensor that a configuration asks for, of those that the vehicle knows anything about."""
    of = asked[3:] if s.kind is Kind.IMU and sensor is Sensor.SPECIFIC_FORCE else asked
    if sensor is Sensor.YAW_OF_ATTITUDE:
        of = asked[2:]
    known = KNOWN.get(sensor, usual) if motion is Motion.PLANAR else "1" * len(usual)
    return "".join("1" if a == k == "1" else "0" for a, k in zip(of.ljust(len(usual), "0"), known, strict=False))


def first_stamp(of: Plan | Draft) -> int:
    """Stamp of the first usable record of any stream [ns]."""
    firsts = [
        int(s.t[good].min())
        for s in of.log
        if (good := of.verdicts[s.name] == Verdict.USED).any()  # a stamp of zero is none
    ]
    return min(firsts)


def given_sigma(section: SourceSection, name: str, rows: int) -> Floats | None:
    """(rows,) standard deviations from the configuration, None if it gives none."""
    if section.sigma is None:
        return None
    given = np.atleast_1d(np.array(section.sigma, np.float64))
    if given.size not in (1, rows):
        raise ConfigError(
            f"{given.size} standard deviations for a source of {rows} rows",
            where=f"sources.{name}.sigma",
            fix=f"give one, or {rows}",
        )
    return np.broadcast_to(given, (rows,)).copy()


def mount_of(section: MountSection) -> Mount:
    """A mount from its configuration (degrees to radians)."""
    roll, pitch, yaw = np.radians(section.rpy_deg)
    return Mount.from_rpy(section.xyz_m, float(roll), float(pitch), float(yaw))


__all__ = ["Draft", "Plan", "first_stamp", "given_sigma", "mount_of"]
