"""Multirotors: EKF2's replays, an ArduCopter through a GPS outage, PX4 logs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from evidence_table import Table

from outrider.data import EventLog, Fix, Run, Trajectory
from outrider.eval.metrics import position_errors, velocity_errors
from outrider.io.mavlink import read_sim_truth
from outrider.io.replay import read_change_indication
from outrider.workflows.fuse import fuse
from recorded import COPTER, FLIGHT, REPLAYS, STATES, against, at, recording, rms, spans

pytestmark = pytest.mark.evidence
OTHER_FLIGHTS = (
    "px4-ulog-rs/tests/fixtures/6ba1abc7-b433-4029-b8f5-3b2bb12d3b6c.ulg",
    "pyulog/test/sample_px4_events.ulg",
)


@pytest.mark.parametrize(("name", "bound"), [("iris_gps", 0.1), ("ekf_gsf_reset", None)])
def test_velocity_beside_ekf2(recordings: Path, table: Table, name: str, bound: float | None):
    run = fuse(recording(recordings / REPLAYS / f"{name}.csv"))
    pairs = against(run, read_change_indication(recordings / STATES / f"{name}.csv"))
    assert len(pairs) > 300
    off = rms(velocity_errors(pairs))
    told = "" if bound is None else f"<= {bound} m/s"
    what = f"velocity beside EKF2, 3-D RMS of {len(pairs)} epochs"
    table.add("replay", f"{name}.csv", what, f"{off:.3f} m/s", told, f"outrider fuse {name}.csv")
    if bound is not None:
        assert off <= bound
    else:
        settled = (pairs.reference.t - pairs.reference.t[0]) * 1e-9 > 10.0
        late = rms(velocity_errors(pairs)[settled])
        table.add("replay", f"{name}.csv", "the same after 10 s (EKF2 climbs at rest before)", f"{late:.3f} m/s")


def test_a_copter_through_a_gps_outage(recordings: Path, table: Table):
    path = recordings / COPTER
    log = recording(path)
    run = fuse(log)
    start = log.span[0]
    theirs = log.streams["autopilot"]
    said = theirs.extra["valid"] > 0
    airborne = int(theirs.t[np.argmax(said)])  # the first position that the autopilot stands by
    gps = log.streams["GPS_RAW_INT"]
    none = gps.extra["fix"] == Fix.NONE.value
    lost = int(gps.t_arrival[np.flatnonzero(none & (gps.t_arrival > airborne))[0]])
    back = int(gps.t[np.flatnonzero(~none & (gps.t_arrival > lost))[0]])

    pose = run.fused.pose
    flight = (theirs.t >= airborne) & (theirs.t <= pose.t[-1])
    t, flagged = theirs.t[flight], ~said[flight]
    ours = at(pose.t, t, pose.valid)
    without = flagged & (t < back)
    invalid = [f"{a:.1f} to {b:.1f} s" for a, b in spans((t - start) * 1e-9, ~ours)]
    flags = [f"{a:.1f} to {b:.1f} s" for a, b in spans((t - start) * 1e-9, flagged)]
    name, command = path.name, f"outrider fuse {path.name}"
    agree = f"{100 * np.mean(ours == ~flagged):.1f} % of the flight"
    table.add("copter", name, "position declared invalid", f"{', '.join(invalid)} (autopilot: {', '.join(flags)})",
              "throughout the autopilot's, until the first fix", command)  # fmt: skip
    table.add("copter", name, "agreement with the autopilot's flags", agree, "", command)
    assert without.sum() > 100
    assert not ours[without].any()
    assert ours[t < lost].all()  # never falsely, before
    assert ours[t > back].all()  # nor after

    truth = read_sim_truth(path)
    pairs = against(run, truth)
    error = np.linalg.norm(position_errors(pairs), axis=1)
    when = pairs.reference.t
    valid = at(pose.t, when, pose.valid)
    back_in_use = int(theirs.t[flight][np.flatnonzero(flagged)[-1]])
    after, before = when > back_in_use, (when > airborne) & (when < lost)
    table.add("copter", name, "largest 3-D error after recovery", f"{error[after].max():.2f} m", "< 0.5 m", command)
    table.add(
        "copter", name, "largest 3-D error in flight before the outage", f"{error[before].max():.2f} m", "", command
    )
    worst = (
        f"{error[valid].max():.2f} m, against {error[~valid & (when > airborne)].max():.0f} m while declared invalid"
    )
    table.add("copter", name, "largest 3-D error while declared valid", worst, "", command)
    assert after.sum() > 100
    assert error[after].max() < 0.5
    assert not run.resets or all(r.t > lost for r in run.resets)


def receiver(run: Run, log: EventLog, *, delayed: bool = False) -> Trajectory:
    """The receiver's own track, optionally stamped when its records arrived."""
    track = run.tracks["vehicle_gps_position"]
    s = log.streams["vehicle_gps_position"]
    lag = int(np.median(s.t_arrival - s.t)) if delayed else 0
    return replace(track, t=track.t + lag)


def horizontal(track: Trajectory, reference: Trajectory) -> float:
    from outrider.eval.associate import associate

    always = np.zeros(0, np.bool_)
    return rms(position_errors(associate(replace(track, valid=always), reference), 2))


@pytest.mark.parametrize("path", [FLIGHT, *OTHER_FLIGHTS])
def test_px4_flights_beside_their_receivers(recordings: Path, table: Table, path: str):
    log = recording(recordings / path)
    run = fuse(log)
    name, command = Path(path).name, f"outrider fuse {Path(path).name}"
    fix = receiver(run, log)
    ours, theirs = horizontal(run.fused.pose, fix), horizontal(run.tracks["ekf2"], fix)
    late = receiver(run, log, delayed=True)
    at_arrival = horizontal(run.tracks["ekf2"], late)
    figure = f"{ours:.3f} m (EKF2 itself {theirs:.3f}; {at_arrival:.3f} if fixes are dated when they arrived)"
    bound = "<= 0.30 m" if path == FLIGHT else ""
    table.add("flights", name, f"position beside GPS, horizontal RMS of {len(fix)} fixes", figure, bound, command)
    assert len(fix) > 100
    if path == FLIGHT:
        assert ours <= 0.30
