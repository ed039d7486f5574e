"""What the records themselves show, whatever the estimate: mounts, units, noise, clocks."""

from collections.abc import Mapping
from typing import Final, cast

import numpy as np

from outrider.data import Finding, Kind, Run, Stream
from outrider.filters.align import Alignment
from outrider.filters.channels import Channel
from outrider.models.sensors import Sensor
from outrider.typing import Floats
from outrider.workflows.clocks import WRONG_STAMPS
from outrider.workflows.draft import Plan
from outrider.workflows.findings.say import error, info, warning

GRAVITY: Final = 9.81  # m/s^2
GRAVITY_BAND: Final = 1.5  # m/s^2 around it that a working accelerometer's median stays in
G_BAND: Final = (0.9, 1.1)  # m/s^2: more like one g
TILT: Final = 30.0  # deg between the mean specific force and the body's up axis: no slope, a wrong mount
FASTEST_TURN: Final = 12.0  # rad/s that 95 % of all rates stay below on any vehicle
ENOUGH: Final = 10  # records that a median is worth something
SAMPLE: Final = 20_000  # records of a stream that such a median is taken over
LAG: Final = (0.3, 3600.0)  # s between stamp and arrival worth a line; more is another clock, not a delay


def gravity_and_mounts(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Mounts nobody gave, and mounts that gravity contradicts."""
    out: list[Finding] = []
    for channel in chosen.whole.channels:
        s = chosen.log.streams[channel.stream]
        if s.kind is not Kind.IMU or channel.sensor is Sensor.SPECIFIC_FORCE:
            continue
        f = mean_force(s)
        if f is not None and abs(np.linalg.norm(f) - GRAVITY) < GRAVITY_BAND:  # else `unit_of_force` has a word on it
            out += mount(channel, s, f, s.name in chosen.mounted)
    return out


def mount(channel: Channel, s: Stream, f: Floats, told: bool) -> list[Finding]:
    """Whether gravity, f in the sensor's axes, points up in the body's."""
    body = channel.mount.reshape(3, 3) @ f
    tilt = np.degrees(np.arccos(np.clip(body[2] / np.linalg.norm(body), -1, 1)))
    frame = s.frame or s.name
    if tilt > TILT:
        i = int(np.argmax(np.abs(f)))
        axis, why = f"{'+' if f[i] > 0 else '-'}{'xyz'[i]}", "the mount given for it is wrong"
        text = f"gravity lies along the {axis} axis of {frame}, {tilt:.0f} deg from the body's up axis: "
        text += why if told else "no mount was given for it"
        return [error("mount-conflict", text, s.name, f"give its rotation: {mount_line(s)}")]
    if not told:
        text = f"no mount is known for {frame}: taken as straight, at the body origin"
        return [info("mount-assumed", text, s.name, f"if it is turned or elsewhere: {mount_line(s)}")]
    return []


def mount_line(s: Stream) -> str:
    """The configuration that gives a source its mount."""
    angles = "rpy_deg: [roll, pitch, yaw]"
    return f"mounts: {{{s.frame}: {{{angles}}}}}" if s.frame else f"sources: {{{s.name}: {{mount: {{{angles}}}}}}}"


def mean_force(s: Stream) -> Floats | None:
    """Median specific force of an IMU in its own axes, None without an accelerometer."""
    f = s.z[np.isfinite(s.z[:, 3:6]).all(axis=1), 3:6]
    if len(f) < ENOUGH or not np.abs(f).any():
        return None
    return np.median(f[:: max(1, len(f) // SAMPLE)], axis=0)


def unit_of_force(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Accelerations in g or without gravity: named, not guessed away."""
    out: list[Finding] = []
    for s in chosen.log.of(Kind.IMU):
        f = mean_force(s)
        if len(s) >= ENOUGH and not s.z[:, 3:6].any():
            text = f"the accelerations of {s.name} are all 0: no gravity in them"
            fix = "if it has none leave them out of the log; else mend the driver. What is up, none can tell"
            out.append(warning("no-gravity", text, s.name, fix))
        norm = GRAVITY if f is None else float(np.linalg.norm(f))
        if G_BAND[0] < norm < G_BAND[1]:
            text = f"{s.name} reports accelerations in g, not m/s^2 (median {norm:.2f})"
            out.append(error("unit-g", text, s.name, "convert them with a CSV mapping, or mend the driver"))
        elif abs(norm - GRAVITY) > GRAVITY_BAND:
            text = f"the accelerations of {s.name} have a median of {norm:.1f} m/s^2, not 9.8"
            out.append(warning("no-gravity", text, s.name, "gravity may be removed already, or the unit another"))
    return out


def unit_of_rates(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Rates in degrees."""
    out: list[Finding] = []
    for s in chosen.log.of(Kind.IMU):
        rates = np.abs(s.z[np.isfinite(s.z[:, :3]).all(axis=1), :3])
        top = float(np.percentile(rates, 95)) if len(rates) >= ENOUGH else 0.0
        if top > FASTEST_TURN:
            text = f"the rates of {s.name} look like degrees per second (95 % below {top:.0f})"
            out.append(error("unit-deg", text, s.name, "they must be rad/s"))
    return out


def unstated_noise(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Fused sources that state no noise, so that ours was taken."""
    silent = sorted(
        {
            c.stream
            for c in chosen.whole.channels
            if c.sensor is not None
            and not c.scored
            and c.trust_stated
            and not states_noise(chosen.log.streams[c.stream])
        }
    )
    if not silent:
        return []
    text = f"no noise is stated by {', '.join(silent)}: default values were taken"
    return [info("unstated-noise", text, fix="give `sigma` if you know it")]


def states_noise(s: Stream) -> bool:
    """Whether a source says anything about its own accuracy."""
    told = (s.extra[name] for name in ("hacc", "hdop") if name in s.extra)
    return bool(np.isfinite(s.var).any() or any(np.isfinite(column).any() for column in told))


def clocks(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Stamps that run backwards or lag behind their arrival."""
    out: list[Finding] = []
    for source in chosen.log:
        s = source.select(~np.isin(chosen.verdicts[source.name], WRONG_STAMPS))  # those have a line of their own
        if len(s) < 3:
            continue
        backwards = int((np.diff(s.t) < 0).sum())
        if backwards:
            text = f"{s.name}: {backwards} stamps step back in time; the records were put in their place"
            out.append(warning("stamps-backwards", text, s.name))
        lag = float(np.median(s.t_arrival - s.t)) * 1e-9 - set_back(run, s.name)
        if LAG[0] < abs(lag) < LAG[1]:
            when = "after" if lag > 0 else "before"
            out.append(info("latency", f"{s.name} arrives {abs(lag):.2f} s {when} its stamps", s.name))
    return out


def set_back(run: Run, source: str) -> float:
    """Seconds by which the configuration set a source's stamps back: no delay of the log's."""
    sections = cast("Mapping[str, Mapping[str, float]]", run.config.get("sources", {}))
    return float(sections.get(source, {}).get("delay_s", 0.0))
