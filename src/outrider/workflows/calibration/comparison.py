"""Lever arms, delays and scales by the innovations of the whole filter: which of them a log has, and their rows."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

from outrider.data import EventLog, Kind
from outrider.io.config import merged
from outrider.models.motion import Motion
from outrider.models.sensors import Sensor
from outrider.models.sensors.layout import LEVER
from outrider.workflows.bench import SPREAD, Bench
from outrider.workflows.calibration.fit import Fit, fit
from outrider.workflows.calibration.noise import SOFTEST, knobs, loudness
from outrider.workflows.calibration.row import LEVEL, UNSETTLED, Row, row_of
from outrider.workflows.config import FuseConfig, SourceSection
from outrider.workflows.parameters import LEVERS, UNITS, WIDEST, Noise, Parameter, What
from outrider.workflows.sandwich import SURE

SPEEDS: Final = frozenset({Sensor.TWIST, Sensor.ACKERMANN, Sensor.WHEELS_DIFFERENTIAL})
NOT_YET: Final = Fit({}, {}, 0, settled=False)
ROUGHLY: Final = 2  # rounds of a first fit, at which noise is then weighed
LOUD_S: Final = 75.0  # of the log that do so
GAINS: Final = {What.SPEED: "speed_gain", What.RATE: "rate_gain"}


def motion_rows(
    log: EventLog, cfg: FuseConfig, progress: Callable[[str, float], None], clocks: Mapping[str, float]
) -> list[Row]:  # fmt: skip
    """Rows of everything that shows in the innovations of positions. A compass beside iron has no say in it.

    clocks : deviations [s] of the delays that were found before
    """
    mute = {"sources": {s.name: {"use": "ignore"} for s in log.of(Kind.MAG)}}
    bench = Bench(log, FuseConfig.model_validate(merged(cfg.model_dump(exclude_unset=True), mute)), frozen=True)
    asked = parameters(bench)
    if not asked:
        return []
    held = {Parameter(What.DELAY, (c.stream,)): clocks[c.stream] for c in bench.channels if c.stream in clocks}
    last = min(bench.aligned.t_start + LOUD_S, log.duration)
    rough = fit(bench, asked, lambda done: progress("calibrating", done), most=ROUGHLY, until=last).value
    louder = loudness(bench, knobs(bench, bench.start + int(0.5 * last * 1e9)), rough, last)
    found = NOT_YET
    smooth = any(louder.get(Noise(name), 1.0) <= SOFTEST for group in bench.receivers() for name in group)
    if not smooth:
        found = fit(bench.noisy(louder), asked, lambda done: progress("refining", done), start=rough, held=held)
    if not found.settled:  # errors that stay: no noise makes these innovations white, so by what is stated
        found = fit(bench, asked, lambda done: progress("refining", done), held=held)
    rows = [row(bench, cfg, p, found) for p in asked]
    return rows + ([flat(bench, cfg, group) for group in bench.receivers()] if bench.motion is Motion.PLANAR else [])


def flat(bench: Bench, cfg: FuseConfig, group: tuple[str, ...]) -> Row:
    """What a robot that stays level does not show."""
    up = Parameter(What.LEVER_Z, group)
    told = told_value(bench, cfg, up)
    return Row(source=up.source, what=up.what.value, unit="m", told=told, verdict=LEVEL)


def parameters(bench: Bench) -> list[Parameter]:
    """What the log may tell: nothing without a position to compare with."""
    used = [c for c in bench.channels if not c.scored]
    places = bench.receivers()
    if not places or bench.motion not in (Motion.PLANAR, Motion.STRAPDOWN):
        return []
    clock = any(c.sensor in (None, Sensor.GYRO) for c in used)
    out: list[Parameter] = []
    level = bench.motion is Motion.PLANAR
    for group in places:
        out += [Parameter(what, group) for what in (LEVERS[:2] if level else LEVERS)]
        out += [Parameter(What.DELAY, group)] if clock else []
    if bench.motion is Motion.PLANAR:
        wheels = dict.fromkeys(c.stream for c in used if c.sensor in SPEEDS and not c.still)
        out += [Parameter(What.SPEED, (name,)) for name in wheels]
        apart = dict.fromkeys(c.stream for c in used if c.sensor in SPREAD)
        gyros = dict.fromkeys(c.stream for c in used if c.sensor is Sensor.GYRO)
        out += [Parameter(What.RATE, (name, *apart)) for name in gyros]
    return out


def row(bench: Bench, cfg: FuseConfig, p: Parameter, found: Fit) -> Row:
    """A parameter in the words of the configuration."""
    told = told_value(bench, cfg, p)
    gain = p.what in GAINS
    value = told * (1.0 + found.value[p]) if gain else told + found.value[p]
    half = SURE * found.sd[p] * (abs(told) if gain else 1.0)
    name, unit = p.what.value, UNITS[p.what]
    if not found.settled:
        return Row(source=p.source, what=name, unit=unit, told=told, verdict=UNSETTLED)
    made = row_of(p.source, name, unit, told, value, half, WIDEST[p.what])
    return replace(made, section=section_of(bench, p, value, found)) if made.differs else made


def told_value(bench: Bench, cfg: FuseConfig, p: Parameter) -> float:
    """What configuration, log or default say of a parameter."""
    section = cfg.sources.get(p.source, SourceSection())
    if p.moves:
        return float(next(c.theta for c in bench.channels if c.stream == p.source)[LEVER + p.axis])
    return float(getattr(section, GAINS.get(p.what, "delay_s")))


def section_of(bench: Bench, p: Parameter, value: float, found: Fit) -> dict[str, Any]:
    """Where a value stands in a configuration. A lever arm stands there whole."""
    if not p.moves:
        key, whose = GAINS.get(p.what, "delay_s"), p.streams if p.what is What.DELAY else p.streams[:1]
        return {"sources": {name: {key: round(value, 5)} for name in whose}}
    xyz = next(c.theta for c in bench.channels if c.stream == p.source)[LEVER : LEVER + 3].copy()
    for q, off in found.value.items():
        if q.moves and q.streams == p.streams and SURE * found.sd[q] <= WIDEST[q.what]:
            xyz[q.axis] += off
    return {"sources": {name: {"mount": {"xyz_m": [round(float(a), 3) for a in xyz]}} for name in p.streams}}
