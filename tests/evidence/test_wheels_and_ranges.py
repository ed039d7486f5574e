"""A mower among range beacons, a UWB tag and a car on a highway: recordings without a reader, made into logs here."""

from pathlib import Path

import numpy as np
import pytest
from evidence_table import Table
from scipy.io import loadmat  # type: ignore[import-untyped]

from outrider.core.frames import frd_to_flu
from outrider.core.geodesy import ecef_to_geodetic, geodetic_to_enu
from outrider.data import Datum, EventLog, Kind, Trajectory, stream
from outrider.eval.associate import associate
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
UWB = "uwb-outdoor/Dynamic_measurements"
ANCHORS = (3, 5, 9, 12)


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
        ("with ranges as recorded, 7 % long", True, 1.0, 1.02),
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
    assert rms(error) <= (bound or 3.0)
    found = [f for f in run.findings if f.code == "range-scale"]
    assert bool(found) == (ranges and shorter == 1.0)
    if found:
        gain = run.config["sources"]["ranges"]["range_gain"]  # type: ignore[index]
        assert gain == pytest.approx(1.0 / RANGE_SCALE, rel=0.01)


# ------------------------------------------------------------------------------------------------- UWB tag, its anchors


def table_of(path: Path) -> tuple[Ints, Floats]:
    """Stamps (n,) ns, exactly, by the second column of a rostopic dump and by the first of others; all columns."""
    lines = path.read_text(encoding="utf-8").splitlines()
    column = int(lines[0].startswith("%"))
    t = np.array([round(float(v)) if "e" in (v := line.split(",")[column]) else int(v) for line in lines[1:]], np.int64)
    return t, np.genfromtxt(path, delimiter=",", skip_header=1)


def by_authors(path: Path) -> Trajectory:
    """A solution of theirs; of two at one stamp the last."""
    t, columns = table_of(path)
    last = np.append(np.diff(t) > 0, True)
    return Trajectory(t=t[last], p=columns[last, 1:4], q=np.full((int(last.sum()), 4), np.nan), name=path.stem)


def tag(folder: Path) -> tuple[EventLog, FuseConfig]:
    """Nothing but the ranges to four anchors, and where those stand."""
    told = {k: table_of(folder / f"A{k}.csv") for k in ANCHORS}
    t = np.concatenate([stamps for stamps, _ in told.values()])
    z = np.concatenate([np.column_stack([np.full(len(c), k), c[:, 6]]) for k, (_, c) in told.items()])
    order = np.argsort(t, kind="stable")
    log = EventLog(streams={"uwb": stream("uwb", Kind.RANGE, t[order], z[order].astype(np.float64))}, path="uwb")
    beacons = tuple(BeaconSection(id=k, xyz_m=tuple(c[0, 3:6])) for k, (_, c) in told.items())
    return log, FuseConfig(local=False, beacons=beacons)


@pytest.mark.parametrize("name", ["LOS/Trajectory_A/Case_1", "NLOS/Trajectory_B/Case_4"])
def test_a_tag_by_its_ranges_alone(recordings: Path, table: Table, name: str):
    """All three at the same stamps of the reference, at which each has a position; nothing is aligned."""
    folder = recordings / UWB / name
    run = fuse(*tag(folder))
    truth = by_authors(folder / "trajectory.csv")
    least_squares, eskf = by_authors(folder / "LS.csv"), by_authors(folder / "ESKF.csv")
    common = against(run, associate(eskf, associate(least_squares, truth).reference).reference).reference
    assert len(common) > 0.9 * len(truth)
    ours = against(run, common)
    error = {"ours": rms(position_errors(ours, 2))}
    error |= {t.name: rms(position_errors(associate(t, common), 2)) for t in (least_squares, eskf)}
    worst = np.linalg.norm(position_errors(ours, 2), axis=1).max()
    figure = f"{error['ours']:.3f} m, worst {worst:.1f} m (their LS {error['LS']:.3f} m, ESKF {error['ESKF']:.3f} m)"
    what = f"horizontal RMSE by ranges alone, {len(common)} epochs"
    table.add("uwb", f"UWB {name}", what, figure, "the better of theirs")
    assert not [f.code for f in run.findings if f.severity != "info"]
    assert error["ours"] <= min(error["LS"], error["ESKF"])


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
