"""A mower among range beacons and a car on a highway: recordings without a reader, made into logs here."""

from pathlib import Path

import numpy as np
import pytest
from evidence_table import Table
from scipy.io import loadmat  # type: ignore[import-untyped]

from outrider.core.frames import frd_to_flu
from outrider.core.geodesy import ecef_to_geodetic, geodetic_to_enu
from outrider.data import Datum, EventLog, Kind, Trajectory, stream
from outrider.eval.metrics import position_errors
from outrider.typing import Floats, Ints
from outrider.workflows.config import BeaconSection, FuseConfig
from outrider.workflows.fuse import fuse
from recorded import against, rms

pytestmark = pytest.mark.evidence
PLAZA = "gtsam/examples/Data/Plaza1_.mat"
RANGE_SCALE = 1.07  # what these radios measure too long, in proportion, by the truth; not a constant, as often said
HIGHWAY = "comma2k19/Example_1"
REAR_TRACK = 1.57  # m


def ns(seconds: Floats) -> Ints:
    return np.round(np.asarray(seconds) * 1e9).astype(np.int64)


def path_of(t: Floats, p: Floats) -> Trajectory:
    """Positions whose heading is not known."""
    return Trajectory(t=ns(t), p=p, q=np.full((len(p), 4), np.nan), name="truth")


# ----------------------------------------------------------------------------------------------------- CMU Plaza, mower


def plaza(root: Path, *, ranges: bool, shorter: float = 1.0) -> tuple[EventLog, FuseConfig, Trajectory]:
    """Odometry in increments of way and heading, one pose to start from, ranges to four beacons; truth by RTK."""
    data = loadmat(root / PLAZA)
    way, truth, radio, places = data["DR"], data["GT"], data["TD"], data["TL"]
    dt = np.maximum(np.diff(way[:, 0], prepend=truth[0, 0]), 0.01)
    v, w, none = way[:, 1] / dt, way[:, 2] / dt, np.zeros(len(way))
    middle, unknown = ns(way[:, 0] - dt / 2), np.full((len(way), 3), np.nan)
    start, begin = np.array([[*truth[0, 1:3], 0.0]]), ns(truth[:1, 0])
    streams = [
        stream("odometry", Kind.TWIST, middle, np.column_stack([v, none, none, none, none, w])),
        stream("gyro", Kind.IMU, middle, np.column_stack([none, none, w, unknown])),
        stream("start", Kind.POSITION, begin, start, var=np.full((1, 3), 0.01)),
        stream("start heading", Kind.HEADING, begin, truth[:1, 3:4], var=np.full((1, 1), 1e-4)),
    ]
    if ranges:
        measured = radio[:, 2:4] / np.array([1.0, shorter])
        streams.append(stream("ranges", Kind.RANGE, ns(radio[:, 0]), measured))
    log = EventLog(streams={s.name: s for s in streams}, path="Plaza1")
    beacons = tuple(BeaconSection(id=i, xyz_m=(x, y, 0.0)) for i, x, y in places)
    reference = path_of(truth[:, 0], np.column_stack([truth[:, 1:3], np.zeros(len(truth))]))
    return log, FuseConfig(local=False, beacons=beacons), reference


@pytest.mark.parametrize(
    ("what", "ranges", "shorter", "bound"),
    [
        ("odometry and gyro alone", False, 1.0, 1.94),
        ("with ranges as recorded: 7 % long, which the wheel scale takes up", True, 1.0, None),
        ("with those 7 % taken off", True, RANGE_SCALE, 1.02),
    ],
)
def test_a_mower_among_beacons(
    recordings: Path, table: Table, what: str, ranges: bool, shorter: float, bound: float | None
):
    log, config, reference = plaza(recordings, ranges=ranges, shorter=shorter)
    run = fuse(log, config)
    pairs = against(run, reference)
    error = position_errors(pairs, 2)
    told = "" if bound is None else f"<= {bound} m"
    figure = f"{rms(error):.2f} m, worst {np.linalg.norm(error, axis=1).max():.1f} m"
    table.add("plaza", "Plaza1", f"position RMSE, {what}", figure, told)
    assert len(pairs) > 9000
    assert np.isfinite(run.fused.x).all()
    if bound is not None:
        assert rms(error) <= bound
    else:
        assert rms(error) < 3.0
        assert any(f.code == "wheel-scale" for f in run.findings)


# ------------------------------------------------------------------------------------------------------- comma2k19, car


def highway(root: Path) -> tuple[EventLog, Floats, Floats]:
    """Rear wheels, phone IMU, u-blox; the reference's stamps [s] and positions in ECEF [m]."""
    (segment,) = (root / HIGHWAY).glob("*/*")
    load = {f.relative_to(segment).as_posix(): np.load(f) for f in segment.rglob("*") if f.is_file()}
    can, imu, gnss = (f"processed_log/{part}" for part in ("CAN/wheel_speed", "IMU", "GNSS/live_gnss_ublox"))
    rear = load[f"{can}/value"][:, 2:]
    none, t_gyro = np.zeros(len(rear)), load[f"{imu}/gyro/t"]
    force = np.column_stack(
        [np.interp(t_gyro, load[f"{imu}/accelerometer/t"], a) for a in load[f"{imu}/accelerometer/value"].T]
    )
    turn = (rear[:, 1] - rear[:, 0]) / REAR_TRACK
    fix = load[f"{gnss}/value"]
    streams = [
        stream("wheels", Kind.TWIST, ns(load[f"{can}/t"]), np.column_stack([rear.mean(axis=1), *[none] * 4, turn])),
        stream("imu", Kind.IMU, ns(t_gyro), np.hstack([frd_to_flu(load[f"{imu}/gyro/value"]), frd_to_flu(force)])),
        stream("ublox", Kind.GNSS, ns(load[f"{gnss}/t"]), np.column_stack([np.radians(fix[:, :2]), fix[:, 4]])),
    ]
    reference = load["global_pose/frame_times"], load["global_pose/frame_positions"]
    return EventLog(streams={s.name: s for s in streams}, path="comma2k19"), *reference


def in_site(ecef: Floats, d: Datum) -> Floats:
    lat, lon, alt = ecef_to_geodetic(ecef)
    return geodetic_to_enu(lat, lon, alt, d.lat, d.lon, d.alt).reshape(-1, 3)


def test_a_car_without_its_receiver(recordings: Path, table: Table):
    log, t_ref, ecef = highway(recordings)
    off: list[float] = []
    for begin in range(10, 30):
        run = fuse(log, FuseConfig(local=False, outages_s={"ublox": ((begin, begin + 30.0),)}))
        assert run.datum is not None
        pairs = against(run, path_of(t_ref, in_site(ecef, run.datum)))
        error, t = position_errors(pairs, 2), (pairs.reference.t - run.start) * 1e-9
        offset = error[(t > begin - 5.0) & (t < begin)].mean(axis=0)  # u-blox stands 1.5 m off all the time
        off.append(float(np.linalg.norm(error[np.searchsorted(t, begin + 29.9)] - offset)))
    what = f"drift after 30 s without GNSS, median of {len(off)} starts"
    table.add("highway", "comma2k19", what, f"{np.median(off):.1f} m (worst {max(off):.1f})", "<= 6.7 m")
    whole = fuse(log, FuseConfig(local=False))
    assert whole.datum is not None
    error = position_errors(against(whole, path_of(t_ref, in_site(ecef, whole.datum))), 2)
    spread = rms(error - error.mean(axis=0))
    table.add("highway", "comma2k19", "with u-blox: RMSE, and without its constant offset",
              f"{rms(error):.2f} m, {spread:.2f} m")  # fmt: skip
    assert np.median(off) <= 6.7
