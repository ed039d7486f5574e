"""A configuration of robot_localization as one of ours, and what became of each of its flags."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any, Final, cast, final

import numpy as np
from scipy.special import chdtr

from outrider.data import EventLog, Finding, Kind, Stream
from outrider.errors import ConfigError
from outrider.io.checked import remedy
from outrider.io.config import merged
from outrider.io.robot_localization import STATES, Input, Upstream, is_positive
from outrider.workflows.config import FuseConfig
from outrider.workflows.findings.say import error, info
from outrider.workflows.settings import parse_config

USUAL_HZ: Final = 30.0
POSES: Final = (Kind.POSE, Kind.POSITION, Kind.ODOMETRY_POSE)
IGNORED: Final[Mapping[str, tuple[str, str]]] = {  # what it means there, and why it does nothing here
    "sensor_timeout": ("predict when nothing came for so long", "every output is a prediction to its own time"),
    "map_frame": ("name of the map frame", "frames are not named: the result is map -> base, and odom -> base"),
    "odom_frame": ("name of the odometry frame", "as map_frame"),
    "base_link_frame": ("name of the body frame", "as map_frame"),
    "base_link_output_frame": ("frame of the output", "as map_frame"),
    "world_frame": ("whether it is the map's or the odometry's filter", "both are estimated"),
    "publish_tf": ("publish the transform", "nothing is published"),
    "publish_acceleration": ("publish accelerations", "nothing is published; all states are in estimates.parquet"),
    "print_diagnostics": ("publish diagnostics", "the report has them"),
    "debug": ("write a log of the filter", "the report and innovations.parquet have it"),
    "debug_out_file": ("where to", "as debug"),
    "transform_time_offset": ("date transforms ahead", "nothing is published"),
    "transform_timeout": ("wait for transforms", "those of the log are known from the start"),
    "silent_tf_failure": ("do not complain of missing transforms", "what is missing is a finding"),
    "reset_on_time_jump": ("start anew when the clock jumps", "wrong stamps are refused and named"),
    "predict_to_current_time": ("predict to the clock's time", "a recording has no later time than its own"),
    "permit_corrected_publication": ("publish corrected states again", "late records are always put in their place"),
    "use_sim_time": ("take time from /clock", "stamps count"),
    "dynamic_process_noise_covariance": ("noise grows with speed", "ours does not"),
    "initial_estimate_covariance": ("how sure it is at the start", "it starts at the origin, sure of it"),
    "initial_state": ("where it starts", "it starts at the origin, with the IMU's attitude"),
    "use_control": ("predict with commands", "commands are no sensor"),
    "stamped_control": ("commands have stamps", "as use_control"),
    "control_timeout": ("forget commands after", "as use_control"),
    "control_config": ("which commands", "as use_control"),
    "acceleration_limits": ("of commands", "as use_control"),
    "acceleration_gains": ("of commands", "as use_control"),
    "deceleration_limits": ("of commands", "as use_control"),
    "deceleration_gains": ("of commands", "as use_control"),
    "gravitational_acceleration": ("how strong gravity is", "9.80665 m/s^2"),
    "alpha": ("sigma points of the UKF", "an EKF runs"), "beta": ("sigma points of the UKF", "an EKF runs"),
    "kappa": ("sigma points of the UKF", "an EKF runs"),
}  # fmt: skip
OF_INPUTS: Final[Mapping[str, tuple[str, str]]] = {
    "queue_size": ("messages kept", "no record is lost here"),
    "pose_queue_size": ("messages kept", "no record is lost here"),
    "twist_queue_size": ("messages kept", "no record is lost here"),
    "nodelay": ("TCP option", "a recording has no network"),
    "pose_use_child_frame": ("the pose is that of the child frame", "mounts say where a sensor sits"),
}  # fmt: skip
DONE: Final = (  # what `setting` does something with
    "frequency", "two_d_mode", "smooth_lagged_data", "history_length", "process_noise_covariance",
)  # fmt: skip
INPUT_DONE: Final = (  # and `of_input`
    "config", "differential", "relative", "remove_gravitational_acceleration", "rejection_threshold",
    "pose_rejection_threshold", "twist_rejection_threshold", "linear_acceleration_rejection_threshold",
)  # fmt: skip
ALIKE: Final = 0.5  # of difflib: how near a known name must be to be offered
UNDIAGNOSED: Final = (
    "nothing is diagnosed with a file of robot_localization: mounts, units, senses and clocks are as given"
)


@final
@dataclass(frozen=True, slots=True)
class Row:
    """One flag: what it means, and what was done with it. used : whether it has any effect."""

    flag: str
    value: str
    meaning: str
    done: str
    used: bool


@final
@dataclass(frozen=True, slots=True)
class Translated:
    """config : ours;  rows : what became of each flag, in the order of the file;  findings : what is wrong with it."""

    config: FuseConfig
    rows: tuple[Row, ...]
    findings: tuple[Finding, ...]


@final
@dataclass(slots=True)
class Translation:
    """What comes about while a file is gone through."""

    log: EventLog
    flat: bool
    out: dict[str, Any] = field(default_factory=dict[str, Any])
    rows: list[Row] = field(default_factory=list[Row])
    named: set[str] = field(default_factory=set[str])
    findings: list[Finding] = field(default_factory=list[Finding])

    def unknown(self, flag: str, value: object, known: Sequence[str], before: str = "") -> None:
        """A flag that robot_localization does not know either, with the known one that is nearest."""
        near = get_close_matches(flag.removeprefix(before), known, n=1, cutoff=ALIKE)
        asked = f": did you mean '{before}{near[0]}'?" if near else ""
        self.say(flag, value, "unknown", f"ignored{asked}", used=False)

    def say(self, flag: str, value: object, meaning: str, done: str, *, used: bool = True) -> None:
        """What became of a flag."""
        self.rows.append(Row(flag, shown(value), meaning, done, used))

    def source(self, name: str, **keys: object) -> None:
        """Keys of a source."""
        self.named.add(name)
        self.out = merged(self.out, {"sources": {name: keys}})


def translate(up: Upstream, log: EventLog, overrides: Mapping[str, object] | None = None) -> Translated:
    """Our configuration for a log, and a row for every flag; what the file does not name is not fused, as there.

    overrides : what the command line says instead. Raises `ConfigError` when the log has none of its inputs.
    """
    t = Translation(log, up.settings.get("two_d_mode") is True)
    for other in up.others:
        t.say(other, "", "another node", "left out: one filter is run; GNSS is read as it is", used=False)
    frame(t, up)
    for i in up.inputs:
        one_input(t, i)
    if not t.named:
        has, asked = ", ".join(sorted(log.streams)), ", ".join(i.topic for i in up.inputs)
        raise ConfigError(f"none of its inputs ({asked}) is in the log", where=up.path, fix=f"the log has {has}")
    for s in log:
        if s.name not in t.named:
            t.out = merged(t.out, {"sources": {s.name: {"use": "ignore"}}})
    config = parse_config(merged(t.out, overrides or {}), up.path)
    if not config.diagnose:
        t.findings.append(info("not-diagnosed", UNDIAGNOSED, fix="run `outrider doctor` without it to have them found"))
    return Translated(config, tuple(t.rows), tuple(t.findings))


@final
@dataclass(slots=True)
class Translator:
    """`translate` for whoever has the log later. rows, findings : of the translation, once it was called."""

    up: Upstream
    overrides: Mapping[str, object]
    rows: tuple[Row, ...] = ()
    findings: tuple[Finding, ...] = ()

    def __call__(self, log: EventLog) -> FuseConfig:
        done = translate(self.up, log, self.overrides)
        self.rows, self.findings = done.rows, done.findings
        return done.config


def frame(t: Translation, up: Upstream) -> None:
    """Everything that is about no input."""
    placed = any(any(i.uses[:3]) and i.kind in ("odom", "pose") for i in up.inputs)
    t.out = {"diagnose": False, "local": False, "output_period_s": 1.0 / USUAL_HZ}
    t.out |= (
        {"motion": "planar"}
        if t.flat
        else {"motion": "omnidirectional"}
        if placed
        else {"preset": "robot_localization"}
    )
    for flag, value in up.settings.items():
        setting(t, flag, value, up.path)


def setting(t: Translation, flag: str, value: object, path: str) -> None:
    """One flag that is about no input."""
    if flag == "frequency":
        if not is_positive(value) or not 1.0 / 3600.0 <= cast("float", value) <= 1000.0:
            raise ConfigError(f"frequency: {shown(value)} is no rate", where=path, fix="give hertz, like 30")
        t.out["output_period_s"] = 1.0 / cast("float", value)
        t.say(flag, value, "outputs per second", f"output_period_s {1.0 / cast('float', value):.4g}")
    elif flag == "two_d_mode":
        done = "planar vehicle" if t.flat else "fifteen states in space"
        t.say(flag, value, "leave out height, roll and pitch", done)
    elif flag == "smooth_lagged_data":
        t.say(flag, value, "put late records in their place", "always done, see history_length")
    elif flag == "history_length":
        usable = is_positive(value) and cast("float", value) <= 3600.0
        if usable:
            t.out["history_s"] = value
        t.say(flag, value, "how late a record may be", f"history_s {value}" if usable else "not a time", used=usable)
    elif flag == "process_noise_covariance":
        noise(t, value, path)
    elif flag in IGNORED:
        meaning, why = IGNORED[flag]
        t.say(flag, value, meaning, f"ignored: {why}", used=False)
    else:
        t.unknown(flag, value, (*DONE, *IGNORED))


def noise(t: Translation, value: object, path: str) -> None:
    """The diagonal of the process noise, which is that of our fifteen states too."""
    numbers = np.array(value, np.float64) if is_numbers(value) else np.zeros(0)
    if numbers.size not in (15, 225) or not np.isfinite(numbers).all():
        raise ConfigError("process_noise_covariance: is not 15 or 225 numbers", where=path, fix="give the diagonal")
    diagonal = numbers if numbers.size == 15 else np.diag(numbers.reshape(15, 15))
    if t.flat:
        t.say(
            "process_noise_covariance",
            "...",
            "noise of the model",
            "ignored: the planar vehicle has its own",
            used=False,
        )
        return
    t.out["process_noise"] = [float(q) for q in np.clip(diagonal, 0.0, 1e6)]
    beside = numbers.size == 225 and bool(np.any(np.abs(numbers.reshape(15, 15) - np.diag(diagonal)) > 0.0))
    done = "its diagonal is the noise of the fifteen states" + ("; the rest is left out" if beside else "")
    t.say("process_noise_covariance", "...", "noise of the model, variance per second", done)


def one_input(t: Translation, i: Input) -> None:
    """One input and all that is said of it."""
    base = next((s for s in t.log if same_topic(s.name, i.topic)), None)
    streams = [s for s in t.log if same_topic(s.name.partition("#")[0], i.topic)]
    if base is None and not streams:
        missing(t, i)
        return
    t.say(i.name, i.topic, f"an input of kind {i.kind}", f"read from {', '.join(s.name for s in streams)}")
    for s in streams:
        rows, why = rows_of(t, i, s)
        keys: dict[str, object] = {"gate": gate_of(i, s, rows), "rows": rows}
        if "1" not in rows:
            keys = {"use": "ignore"}
        elif s.kind is Kind.ATTITUDE:
            keys["use"] = "fuse"
        t.source(s.name, **keys)
        names = [n for n, c in zip(columns_of(s), rows, strict=False) if c == "1"]
        if not names and not why:
            continue
        t.say(f"{i.name}_config", wanted(i), "what is fused of it",
              f"{s.name}: {', '.join(names) or 'nothing'}{why}", used=bool(names))  # fmt: skip
    for key, value in i.rest.items():
        of_input(t, i, key, value)


def missing(t: Translation, i: Input) -> None:
    """An input that the log does not have: a sensor that was to be fused, and is not."""
    t.say(i.name, i.topic, f"an input of kind {i.kind}", "not in the log: left out", used=False)
    for key, value in i.rest.items():
        if key not in (*INPUT_DONE, *OF_INPUTS):
            t.unknown(f"{i.name}_{key}", value, (*INPUT_DONE, *OF_INPUTS), f"{i.name}_")
    text = f"{i.name}: '{i.topic}' is not in the log: it was to be fused, and nothing of it was"
    topics = sorted({s.name.partition("#")[0].strip("/") for s in t.log})
    t.findings.append(error("input-missing", text, "", remedy(i.topic.strip("/"), topics)))


def of_input(t: Translation, i: Input, key: str, value: object) -> None:
    """One flag of an input."""
    flag = f"{i.name}_{key}"
    if key == "differential":
        done = "its poses are left out, rates and speeds tell the same" if value else "its poses are poses"
        t.say(flag, value, "fuse differences of its poses as velocities", done, used=bool(value))
    elif key == "relative":
        done = "its yaw and position are left out" if value else "as they are"
        t.say(flag, value, "count its poses from the first", done, used=bool(value))
    elif key == "remove_gravitational_acceleration":
        done = "gravity is part of the model" if value else "accelerations are left out: ours are with gravity"
        t.say(flag, value, "its accelerations are with gravity", done)
    elif key in INPUT_DONE and key.endswith("rejection_threshold"):
        t.say(flag, value, "Mahalanobis distance beyond which it is refused", "a gate of that probability")
    elif key in OF_INPUTS:
        meaning, why = OF_INPUTS[key]
        t.say(flag, value, meaning, f"ignored: {why}", used=False)
    else:
        t.unknown(flag, value, (*INPUT_DONE, *OF_INPUTS), f"{i.name}_")


def rows_of(t: Translation, i: Input, s: Stream) -> tuple[str, str]:
    """Which columns of a stream are fused, and why not all that are asked for."""
    pose, velocity, force = i.uses[:6], i.uses[6:12], i.uses[12:]
    if s.kind is Kind.IMU:
        with_gravity = i.rest.get("remove_gravitational_acceleration", False) is True
        kept = force if with_gravity else (False,) * 3
        return bits((*velocity[3:], *kept)), "" if kept == force else "; accelerations without gravity are not modelled"
    if s.kind is Kind.ATTITUDE:
        if i.rest.get("differential") is True:
            return "000", "; its differences are the rates"
        relative = i.rest.get("relative") is True
        return bits(
            (*pose[3:5], pose[5] and not relative)
        ), "; yaw relative to its first is left out" if relative and pose[5] else ""
    if s.kind in (Kind.TWIST, Kind.BODY_VELOCITY):
        return bits(velocity), ""
    if s.kind in POSES:
        moving = i.rest.get("differential") is True or i.rest.get("relative") is True
        if s.kind is Kind.ODOMETRY_POSE:
            return "000000", "; an integrated pose drifts, its twist is fused" if any(pose) else ""
        return ("000000", "; its differences are not fused") if moving else (bits(pose), "")
    return "0", f"; {s.kind.value} is no input of robot_localization"


def columns_of(s: Stream) -> Sequence[str]:
    """Names of the rows of a stream."""
    if s.kind is Kind.IMU:
        return STATES[9:]
    if s.kind in (Kind.TWIST, Kind.BODY_VELOCITY):
        return STATES[6:12]
    return STATES[3:6] if s.kind is Kind.ATTITUDE else STATES[:6]


def gate_of(i: Input, s: Stream, rows: str) -> float:
    """The probability that a threshold on the Mahalanobis distance stands for; 1, no gate, without one."""
    word = {Kind.IMU: "twist", Kind.TWIST: "twist", Kind.BODY_VELOCITY: "twist"}.get(s.kind, "pose")
    d = i.rest.get(f"{word}_rejection_threshold", i.rest.get("rejection_threshold"))
    if not is_positive(d):
        return 1.0
    return float(np.clip(chdtr(max(rows.count("1"), 1), min(cast("float", d), 1e6) ** 2), 0.501, 1.0))


def same_topic(a: str, b: str) -> bool:
    """Whether two names are one topic, absolute or not."""
    return a.strip("/") == b.strip("/")


def bits(flags: Sequence[bool]) -> str:
    """Flags as zeros and ones."""
    return "".join("1" if f else "0" for f in flags)


def wanted(i: Input) -> str:
    """What an input's flags ask for."""
    return " ".join(n for n, f in zip(STATES, i.uses, strict=True) if f) or "nothing"


def is_numbers(value: object) -> bool:
    """Whether it is a list of numbers."""
    return isinstance(value, list) and all(
        isinstance(v, (int, float)) and not isinstance(v, bool) for v in cast("list[object]", value)
    )


def shown(value: object) -> str:
    """A value of the file, short."""
    text = str(value).lower() if isinstance(value, bool) else str(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


__all__ = ["Row", "Translated", "Translator", "translate"]
