"""From a log and a configuration to a plan: which stream is used for what, and why the rest is not."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import chain
from typing import Final

import numpy as np

from outrider.data import REASONS, Datum, EventLog, Fix, Kind, Stream, Verdict
from outrider.errors import ConfigError, DataError
from outrider.filters.channels import site_position
from outrider.filters.screen import FIX_CODES, Memory, bad_stamps, motion_stamps, screen, stuck, turn_rate
from outrider.filters.stamps import astray, usual_lags
from outrider.models.motion import Motion
from outrider.typing import Bools, Ints
from outrider.workflows.assembly import assemble
from outrider.workflows.clocks import note_stamps
from outrider.workflows.config import FuseConfig, SourceSection
from outrider.workflows.draft import Draft, Plan, first_stamp
from outrider.workflows.rules import RULES, unused

WHEELED: Final = frozenset({Kind.TWIST, Kind.WHEELS, Kind.ACKERMANN})
GAINS: Final = {
    Kind.IMU: ("rate",) * 3 + ("force",) * 3, Kind.TWIST: ("speed",) * 3 + ("rate",) * 3,
    Kind.RANGE: ("id", "range"), Kind.RANGE_BEARING: ("id", "range", "angle"),
    Kind.WHEELS: ("speed",), Kind.ACKERMANN: ("speed", "angle"),
}  # fmt: skip
SETTINGS: Final[Mapping[str, tuple[str, tuple[Kind, ...]]]] = {  # of a source: what it is for
    "rate_gain": ("angular rates", tuple(k for k, columns in GAINS.items() if "rate" in columns)),
    "force_gain": ("accelerations", tuple(k for k, columns in GAINS.items() if "force" in columns)),
    "speed_gain": ("speeds", tuple(k for k, columns in GAINS.items() if "speed" in columns)),
    "range_gain": ("ranges", tuple(k for k, columns in GAINS.items() if "range" in columns)),
    "track_m": ("speeds of wheels", (Kind.WHEELS,)), "mecanum_xy_m": ("speeds of wheels", (Kind.WHEELS,)),
    "wheel_base_m": ("steering", (Kind.ACKERMANN,)), "steering_zero_deg": ("steering", (Kind.ACKERMANN,)),
    "hard_iron": ("magnetometers", (Kind.MAG,)), "soft_iron": ("magnetometers", (Kind.MAG,)),
}  # fmt: skip
FAR: Final = 50_000.0  # m from the datum: its up is by then half a degree off the local one


def plan(log: EventLog, cfg: FuseConfig) -> Plan:
    """Decide what every stream is used for.

    Raises `DataError` when nothing can be fused and `ConfigError` for a configuration that names unknown sources or
    contradicts itself.
    """
    check_names(log, cfg)
    check_sense(cfg)
    log = replace(log, streams={s.name: stated_fixes(delayed(scaled(s, cfg), cfg)) for s in log})
    verdicts = screened(log)
    log = replace(log, streams={s.name: known_fixes(s) for s in log})
    d = Draft(log, cfg, choose_motion(log, cfg, verdicts), find_datum(log, cfg, verdicts), verdicts)
    for s in sorted(log, key=lambda s: (s.kind is not Kind.IMU, s.name)):
        if d.section(s).use == "ignore":
            d.skip(s, "switched off in the configuration")
        elif not len(s):
            d.skip(s, "no record")
        elif not d.usable(s):
            d.skip(s, "no usable record")
        else:
            RULES[d.motion].get(s.kind, unused)(d, s)
    note_stamps(d)
    check_draft(d)
    return assemble(d)


def screened(log: EventLog) -> dict[str, Ints]:
    """The verdict of every record by stream, as far as the records themselves tell it."""
    lags = usual_lags(log)
    memories = {s.name: Memory(offset=lags.get(s.name, float("nan"))) for s in log}
    stray = astray(log, {s.name: bad_stamps(s, memories[s.name]) for s in log})
    moving = motion_stamps(log)
    verdicts = {s.name: screen(s, memories[s.name], moving, stray[s.name]) for s in log}
    refuse_stuck_wheels(log, verdicts)
    return verdicts


def check_names(log: EventLog, cfg: FuseConfig) -> None:
    """Every source named in the configuration must exist."""
    for section, names in (("sources", cfg.sources), ("withhold", cfg.withhold), ("outages_s", cfg.outages_s)):
        for name in names:
            if name not in log.streams:
                known = ", ".join(sorted(log.streams)) or "none"
                raise ConfigError(f"no source '{name}' in the log", where=section, fix=f"it has {known}")


def check_sense(cfg: FuseConfig) -> None:
    """What contradicts itself whatever the log."""
    fixed = {"amr2025": "planar", "robot_localization": "omnidirectional"}.get(cfg.preset)
    if fixed is not None and cfg.motion not in ("auto", fixed):
        text = f"the preset {cfg.preset} moves as {fixed}, not as {cfg.motion}"
        raise ConfigError(text, where="motion", fix="leave one of them out")
    for name in chain(cfg.withhold, cfg.outages_s):
        if name in cfg.sources and cfg.sources[name].use == "ignore":
            text = f"records of {name} cannot be withheld: it is switched off"
            raise ConfigError(text, where=f"sources.{name}.use", fix="leave it on `auto`")
    ids = [b.id for b in cfg.beacons]
    if len(ids) > len(set(ids)):
        raise ConfigError("two beacons have one id", where="beacons", fix="give each its own")


def check_draft(d: Draft) -> None:
    """Whether there is anything to fuse, and what was told in vain."""
    if not any(not c.scored for c in d.channels):
        off = [name for name, section in d.cfg.sources.items() if section.use in ("ignore", "score")]
        if off:
            text = f"nothing is left to fuse: {', '.join(off)} switched off or only scored"
            raise ConfigError(text, where="sources", fix="leave one that gives motion or position on `auto`")
        refused = "; ".join(why for s in d.log if (why := all_refused(d, s)))
        raise DataError(
            "nothing in this log can be fused" + (f": {refused}" if refused else ""),
            where=d.log.path,
            fix="it needs wheel odometry, an IMU, GNSS or another position; `outrider sources` lists what was found",
        )
    if d.motion is Motion.STRAPDOWN and not any(c.sensor is None for c in d.channels):
        raise ConfigError("a strapdown vehicle needs an IMU", where="motion", fix="choose another motion model")
    away = distance_to_datum(d)
    if away > FAR:
        text = f"the first fix lies {away / 1000:.0f} km from the datum: a flat site frame bends there"
        d.note("warning", "datum-far", text, fix="give a `datum` within the site, or none")
    check_withheld(d)
    check_settings(d)
    frames = {s.frame for s in d.log}
    for frame in sorted(set(d.cfg.mounts) - frames):
        known = ", ".join(sorted(frames - {""})) or "none"
        d.note("warning", "mount-unused", f"no source has the frame '{frame}'", fix=f"the frames are {known}")


def all_refused(d: Draft, s: Stream) -> str:
    """Why none of a source's records passes, by what most of them lack; nothing where one does."""
    verdicts = d.verdicts[s.name]
    if not len(s) or (verdicts == Verdict.USED).any():
        return ""
    kinds, counts = np.unique(verdicts, return_counts=True)
    most = int(np.argmax(counts))
    return f"{s.name}: {counts[most]} of {len(s)} records refused: {REASONS[Verdict(int(kinds[most]))]}"


def check_withheld(d: Draft) -> None:
    """Say where nothing, or all but one record, is withheld: a slip of the unit or of the source."""
    for name, n in d.cfg.withhold.items():
        count = len(d.log.streams[name])
        if n >= count > 1:
            text = f"only the first of {count} records of {name} is fused: every {n}th was asked for"
            d.note("warning", "withhold-all", text, name, fix="withhold fewer")
    for name, windows in d.cfg.outages_s.items():
        s = (d.passed(name).t - first_stamp(d)) * 1e-9
        for begin, end in windows:
            if not ((s >= begin) & (s < end)).any():
                text = f"no record of {name} between {begin:g} and {end:g} s, nothing was withheld there"
                span = f"its records are from {s.min():.1f} to {s.max():.1f} s" if s.size else "it has no usable record"
                d.note("warning", "outage-empty", text, name, fix=span)


def check_settings(d: Draft) -> None:
    """Say which settings a source has that are for sources of other kinds."""
    usual = SourceSection()
    for name, section in d.cfg.sources.items():
        kind = d.log.streams[name].kind
        for key, (what, kinds) in SETTINGS.items():
            if kind in kinds or section.use == "ignore" or getattr(section, key) == getattr(usual, key):
                continue
            text = f"`{key}` of {name} changes nothing: it is for {what} ({', '.join(k.name for k in kinds)})"
            d.note("warning", "setting-unused", text, name, fix=f"leave it out: {name} is of kind {kind.name}")


def refuse_stuck_wheels(log: EventLog, verdicts: Mapping[str, Ints]) -> None:
    """Mark records of wheels that repeat themselves while an IMU turns. In place."""
    for imu in sorted(log.of(Kind.IMU), key=len)[-1:]:
        turning = turn_rate(imu)
        for s in log.of(*WHEELED):
            v = verdicts[s.name]
            v[stuck(s, turning) & (v == Verdict.USED)] = Verdict.FROZEN


def scaled(s: Stream, cfg: FuseConfig) -> Stream:
    """The stream with its columns multiplied by the configured gains, its stated variances by their squares, without
    its iron and without the zero of its steering."""
    section = cfg.sources.get(s.name)
    if section is None:
        return s
    if s.kind is Kind.MAG:
        return without_iron(s, section)
    if s.kind not in GAINS:
        return s
    told = {
        "rate": section.rate_gain, "force": section.force_gain, "speed": section.speed_gain,
        "range": section.range_gain,
    }  # fmt: skip
    gains = np.array([told.get(what, 1.0) for what in GAINS[s.kind]])
    if len(gains) != s.z.shape[1]:
        gains = np.full(s.z.shape[1], gains[0])
    zero = np.radians(section.steering_zero_deg) if s.kind is Kind.ACKERMANN else 0.0
    z = s.z - [0.0, zero] if zero else s.z
    return s if (gains == 1.0).all() and not zero else replace(s, z=z * gains, var=s.var * gains**2)


def without_iron(s: Stream, section: SourceSection) -> Stream:
    """A magnetometer's records z as S (z - b), b the hard iron and S the soft iron's correction."""
    b, S = np.array(section.hard_iron), np.reshape(section.soft_iron, (3, 3))
    return s if not b.any() and (np.eye(3) == S).all() else replace(s, z=(s.z - b) @ S.T, var=s.var @ (S.T**2))


def delayed(s: Stream, cfg: FuseConfig) -> Stream:
    """The stream with its stamps set back by the configured delay."""
    delay = cfg.sources[s.name].delay_s if s.name in cfg.sources else 0.0
    return replace(s, t=s.t - round(delay * 1e9)) if delay else s


def stated_fixes(s: Stream) -> Stream:
    """The stream with a fix type that a record leaves out as unknown."""
    return with_fixes(s, np.isnan(s.extra["fix"]), Fix.UNKNOWN) if "fix" in s.extra else s


def known_fixes(s: Stream) -> Stream:
    """The stream with unheard-of fix types as none, so that a channel takes and counts those records."""
    return with_fixes(s, ~np.isin(s.extra["fix"], FIX_CODES), Fix.NONE) if "fix" in s.extra else s


def with_fixes(s: Stream, rows: Bools, fix: Fix) -> Stream:
    """The stream with another fix type in some rows."""
    return replace(s, extra={**s.extra, "fix": np.where(rows, fix.value, s.extra["fix"])}) if rows.any() else s


def choose_motion(log: EventLog, cfg: FuseConfig, verdicts: Mapping[str, Ints]) -> Motion:
    """Process model by what the vehicle carries, as far as it works."""
    if cfg.preset == "robot_localization":
        return Motion.OMNIDIRECTIONAL
    if cfg.preset == "amr2025":
        return Motion.PLANAR
    if cfg.motion != "auto":
        return Motion[cfg.motion.upper()]
    works = [s for s in log if (verdicts[s.name] == Verdict.USED).any()]
    kinds = {s.kind for s in works if s.name not in cfg.sources or cfg.sources[s.name].use != "ignore"}
    if kinds & WHEELED:
        return Motion.PLANAR
    if Kind.IMU in kinds:
        return Motion.STRAPDOWN
    return Motion.FOLLOWER


def find_datum(log: EventLog, cfg: FuseConfig, verdicts: Mapping[str, Ints]) -> Datum | None:
    """The configured origin, else the first usable fix of the receiver with the best fixes."""
    found = [(s, good) for s in log.of(Kind.GNSS) if (good := np.flatnonzero(verdicts[s.name] == Verdict.USED)).size]
    first = max(found, key=lambda f: best_fix(*f), default=None)  # of equals the first by name
    if cfg.datum is not None:
        lat, lon = np.radians([cfg.datum.lat_deg, cfg.datum.lon_deg])
        reference = {"altitude": first[0].altitude.name} if first is not None else {}
        return Datum(lat=float(lat), lon=float(lon), alt=cfg.datum.alt_m, **reference)
    if first is None:
        return None
    s, good = first
    lat, lon, alt = s.z[good[np.argmin(s.t[good])]]
    height = float(alt) if np.isfinite(alt) else 0.0
    return Datum(lat=float(lat), lon=float(lon), alt=height, altitude=s.altitude.name)


def distance_to_datum(d: Draft) -> float:
    """From the datum to the first usable fix [m]; 0 without one."""
    for s in d.log.of(Kind.GNSS):
        if d.datum is not None and d.usable(s):
            p = site_position(d.passed(s.name).select(slice(0, 1)), d.datum)
            return float(np.linalg.norm(p[0, :2]))
    return 0.0


def best_fix(s: Stream, good: Ints) -> float:
    """The best fix type of a receiver's usable records."""
    return float(s.extra["fix"][good].max()) if "fix" in s.extra else float(Fix.UNKNOWN.value)


__all__ = ["Plan", "plan"]
