"""Recordings written by rosbags and read back; hot message types against rosbags' own decoding; all kinds of damage."""

import shutil
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from outrider.core.attitudes import quats_to_matrices, rpy_to_quats
from outrider.data import Altitude, EventLog, Fix, Kind
from outrider.errors import DataError
from outrider.io._ros_messages import MESSAGES
from outrider.io._ros_wire import decode, layout, leaves
from outrider.io.rosbags import read_rosbag

T0 = 1_700_000_000_123_456_789
GPSFIX = """
std_msgs/Header header
GPSStatus status
float64 latitude
float64 longitude
float64 altitude
float64 track
float64 speed
float64 climb
float64 hdop
float64 vdop
float64 err_horz
float64 err_vert
float64 err_speed
float64[9] position_covariance
uint8 position_covariance_type
================================================================================
MSG: gps_msgs/GPSStatus
std_msgs/Header header
uint16 satellites_used
int32[] satellite_used_prn
int16 status
"""
GEOPOINT = """
std_msgs/Header header
geographic_msgs/GeoPoint position
================================================================================
MSG: geographic_msgs/GeoPoint
float64 latitude
float64 longitude
float64 altitude
"""
DEFINITIONS = {
    "gps_msgs/msg/GPSFix": GPSFIX,
    "geographic_msgs/msg/GeoPointStamped": GEOPOINT,
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
}


class Recorder:
    """Messages from plain dicts, and a bag of them in any of the three containers."""

    def __init__(self, kind: str) -> None:
        self.kind, self.ros1 = kind, kind == "ros1"
        self.store = get_typestore(Stores.ROS1_NOETIC if self.ros1 else Stores.ROS2_JAZZY)
        for name, text in DEFINITIONS.items():
            known = get_types_from_msg(text, name)
            self.store.register({n: f for n, f in known.items() if n not in self.store.fielddefs})

    def make(self, msgtype: str, given: dict[str, Any], prefix: str = "") -> Any:
        """A message that is zero except for the given dotted fields; a vector stands for its x, y, z (w)."""
        values: dict[str, Any] = {}
        for name, (node, what) in self.store.fielddefs[msgtype][1]:
            path = prefix + name
            if path in given and int(node) == 2 and not hasattr(given[path], "__msgtype__"):
                parts = [n for n, _ in self.store.fielddefs[what][1]]
                values[name] = self.store.types[what](*given[path][: len(parts)])
            elif path in given:
                values[name] = np.asarray(given[path], float) if int(node) == 3 else given[path]
            elif int(node) == 2:
                values[name] = self.make(what, given, f"{path}.")
            elif int(node) == 1:
                values[name] = "" if what[0] == "string" else 0
            else:
                values[name] = np.zeros(what[1], np.float64 if int(node) == 3 else np.int32)
        return self.store.types[msgtype](**values)

    def pack(self, msgtype: str, given: dict[str, Any]) -> bytes:
        message = self.make(msgtype, given)
        return bytes((self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr)(message, msgtype))

    def write(self, path: Path, rows: list[tuple[str, str, int, bytes]]) -> Path:
        """rows: topic, type, time of recording, serialized message."""
        path = path.with_suffix(".bag") if self.ros1 else path
        plugin = StoragePlugin.MCAP if self.kind == "mcap" else StoragePlugin.SQLITE3
        with Writer1(path) if self.ros1 else Writer2(path, version=9, storage_plugin=plugin) as writer:
            made = {(t, k): writer.add_connection(t, k, typestore=self.store) for t, k in {r[:2]: 0 for r in rows}}
            for topic, kind, t, raw in rows:
                writer.write(made[topic, kind], t, raw)
        return path


def stamped(t: int, frame: str = "sensor", **fields: Any) -> dict[str, Any]:
    """Header fields, and others with __ for the dots."""
    head = {"header.stamp.sec": t // 10**9, "header.stamp.nanosec": t % 10**9, "header.frame_id": frame}
    return head | {name.replace("__", "."): value for name, value in fields.items()}


@pytest.fixture(params=["ros1", "sqlite3", "mcap"])
def recorder(request: pytest.FixtureRequest) -> Recorder:
    return Recorder(request.param)


def log_of(recorder: Recorder, path: Path, rows: list[tuple[str, str, dict[str, Any]]], **options: Any) -> EventLog:
    """A log of messages recorded 10 ms apart, each arriving then."""
    packed = [(topic, kind, T0 + 10**7 * i, recorder.pack(kind, given)) for i, (topic, kind, given) in enumerate(rows)]
    return read_rosbag(recorder.write(path / "log", packed), **options)


IMU = "sensor_msgs/msg/Imu"
FIX = "sensor_msgs/msg/NavSatFix"
ODOMETRY = "nav_msgs/msg/Odometry"
EYE = np.eye(3).ravel()


def imu_row(t: int, **changes: Any) -> dict[str, Any]:
    fields = {
        "orientation": (0.0, 0.0, 0.6, 0.8), "orientation_covariance": 0.01 * EYE,
        "angular_velocity": (0.1, 0.2, 0.3), "angular_velocity_covariance": np.diag([1.0, 2.0, 3.0]).ravel(),
        "linear_acceleration": (1.0, 2.0, 9.8), "linear_acceleration_covariance": np.diag([4.0, 5.0, 6.0]).ravel(),
    }  # fmt: skip
    return stamped(t, "imu_link", **(fields | changes))


def test_imu_exact(recorder: Recorder, tmp_path: Path) -> None:
    log = log_of(recorder, tmp_path, [("/imu", IMU, imu_row(T0 + i)) for i in range(5)], robot="husky")
    s, q = log.streams["/imu"], log.streams["/imu#attitude"]
    assert (s.kind, q.kind, s.frame, s.robot) == (Kind.IMU, Kind.ATTITUDE, "imu_link", "husky")
    assert s.t.tolist() == [T0 + i for i in range(5)]
    assert s.t_arrival.tolist() == [T0 + 10**7 * i for i in range(5)]
    assert s.z[3].tolist() == [0.1, 0.2, 0.3, 1.0, 2.0, 9.8]
    assert s.var[3].tolist() == [1, 2, 3, 4, 5, 6]
    assert q.z[4].tolist() == [0.0, 0.0, 0.6, 0.8]
    np.testing.assert_allclose(q.var, 0.01)
    assert log.sha256 and s.malformed == 0


def test_imu_sentinels(recorder: Recorder, tmp_path: Path) -> None:
    """-1 in front of a covariance: no such data. All zeros: unknown. A zero quaternion is no attitude."""
    absent = np.r_[-1.0, np.zeros(8)]
    rows = [
        imu_row(T0, angular_velocity_covariance=absent, orientation_covariance=absent),
        imu_row(T0 + 1, linear_acceleration_covariance=absent, orientation=(0, 0, 0, 0)),
        imu_row(T0 + 2, angular_velocity_covariance=0 * EYE, linear_acceleration=(np.nan, 0.0, 1e308)),
    ]
    log = log_of(recorder, tmp_path, [("/imu", IMU, row) for row in rows])
    s = log.streams["/imu"]
    assert np.isnan(s.z[0, :3]).all() and np.isfinite(s.z[0, 3:]).all() and np.isnan(s.var[0, :3]).all()
    assert np.isnan(s.z[1, 3:]).all() and np.isfinite(s.z[1, :3]).all()
    assert np.isnan(s.var[2, :3]).all() and np.isfinite(s.var[2, 3:]).all()
    assert np.isnan(s.z[2, 3]) and s.z[2, 5] == 1e308
    assert log.streams["/imu#attitude"].t.tolist() == [T0 + 2]


def test_gnss(recorder: Recorder, tmp_path: Path) -> None:
    P = np.diag([1.0, 4.0, 9.0]).ravel()
    rows = [
        stamped(T0 + i, "/gps", latitude=42.0, longitude=-71.0, altitude=7.5, status__status=status,
                position_covariance=P, position_covariance_type=kind)
        for i, (status, kind) in enumerate([(-1, 0), (0, 1), (1, 2), (2, 3), (-2, 2)])
    ]  # fmt: skip
    s = log_of(recorder, tmp_path, [("/fix", FIX, row) for row in rows]).streams["/fix"]
    assert s.kind is Kind.GNSS and s.altitude is Altitude.ELLIPSOID and s.frame == "gps"
    np.testing.assert_allclose(s.z[0], [np.radians(42.0), np.radians(-71.0), 7.5], rtol=1e-15)
    assert np.isnan(s.var[0]).all() and s.var[1].tolist() == [1, 4, 9]  # east, north, up
    codes = [Fix(int(code)) for code in s.extra["fix"]]
    assert codes == [Fix.NONE, Fix.SINGLE, Fix.SBAS, Fix.DGNSS, Fix.UNKNOWN]
    assert s.extra["cov_type"].tolist() == [0, 1, 2, 3, 2]


def test_odometry_covariance_turns_to_body_axes(recorder: Recorder, tmp_path: Path) -> None:
    q = rpy_to_quats(np.array([0.3, -0.2, 1.1]))
    C = np.diag([0.1, 0.2, 0.3])
    P = np.zeros((6, 6))
    P[:3, :3], P[3:, 3:] = np.diag([1.0, 2.0, 3.0]), C
    twist = np.diag(np.arange(1.0, 7.0))
    row = stamped(
        T0, "odom", child_frame_id="base_link", pose__pose__position=(1.0, 2.0, 3.0), pose__pose__orientation=q,
        pose__covariance=P.ravel(), twist__twist__linear=(0.5, 0.0, 0.0), twist__twist__angular=(0.0, 0.0, 0.1),
        twist__covariance=twist.ravel(),
    )  # fmt: skip
    log = log_of(recorder, tmp_path, [("/odom", ODOMETRY, row), ("/odometry/filtered", ODOMETRY, row)])
    s, p = log.streams["/odom"], log.streams["/odom#pose"]
    assert (s.kind, s.frame, p.kind, p.frame) == (Kind.TWIST, "base_link", Kind.ODOMETRY_POSE, "odom")
    assert s.z[0].tolist() == [0.5, 0, 0, 0, 0, 0.1] and s.var[0].tolist() == [1, 2, 3, 4, 5, 6]
    np.testing.assert_allclose(p.z[0], [1, 2, 3, *q], rtol=1e-15)
    R = quats_to_matrices(q)
    np.testing.assert_allclose(p.var[0], [1, 2, 3, *np.diag(R.T @ C @ R)], rtol=1e-12)
    other = log.streams["/odometry/filtered"]
    assert other.kind is Kind.ESTIMATE
    np.testing.assert_allclose(other.z[0, 7:], R @ [0.5, 0, 0], rtol=1e-12)


def test_half_an_odometry(recorder: Recorder, tmp_path: Path) -> None:
    """navsat_transform sends poses with a zero twist: that must not become a zero velocity."""
    moving = [
        stamped(T0 + i, "odom", pose__pose__position=(i, 0, 0), pose__pose__orientation=(0, 0, 0, 1)) for i in (1, 2)
    ]
    still = [stamped(T0 + i, "odom", twist__twist__linear=(1.0, 0, 0)) for i in (1, 2)]
    rows = [("/odometry/gps", ODOMETRY, row) for row in moving] + [("/wheels", ODOMETRY, row) for row in still]
    log = log_of(recorder, tmp_path, rows)
    assert set(log.streams) == {"/odometry/gps#pose", "/wheels"}
    assert sum("not taken as a measurement" in note for note in log.notes) == 2


def test_other_sensors(recorder: Recorder, tmp_path: Path) -> None:
    twist = {"twist__linear": (1.0, 2.0, 3.0), "twist__angular": (0.0, 0.0, 0.5)}
    with_covariance = {f"twist__{name}": value for name, value in twist.items()} | {
        "twist__covariance": np.eye(6).ravel()
    }
    pose = {"pose__position": (1.0, 2.0, 3.0), "pose__orientation": (0.0, 0.0, 0.0, 1.0)}
    near, far = {"min_range": 0.2, "max_range": 8.0}, np.inf
    p = 101325.0 * (1 - 0.0065 * 500.0 / 288.15) ** (9.80665 / (287.05287 * 0.0065))
    log = log_of(recorder, tmp_path, [
        ("/wheel/twist", "geometry_msgs/msg/TwistStamped", stamped(T0, "base_link", **twist)),
        ("/vel", "geometry_msgs/msg/TwistStamped", stamped(T0, "x", **twist)),
        ("/cmd_vel", "geometry_msgs/msg/TwistStamped", stamped(T0, "base_link", **twist)),
        ("/ublox/fix_velocity", "geometry_msgs/msg/TwistWithCovarianceStamped", stamped(T0, "x", **with_covariance)),
        ("/visual", "geometry_msgs/msg/TwistWithCovarianceStamped", stamped(T0, "x", **with_covariance)),
        ("/gps/velocity", "geometry_msgs/msg/Vector3Stamped", stamped(T0, "x", vector=(1.0, 2.0, 3.0))),
        ("/euler", "geometry_msgs/msg/Vector3Stamped", stamped(T0, "x", vector=(1.0, 2.0, 3.0))),
        ("/lidar_pose", "geometry_msgs/msg/PoseStamped", stamped(T0, "map", **pose)),
        ("/mag", "sensor_msgs/msg/MagneticField", stamped(T0, "m", magnetic_field=(1e-5, 2e-5, -4e-5))),
        ("/baro", "sensor_msgs/msg/FluidPressure", stamped(T0, "b", fluid_pressure=p, variance=4.0)),
        ("/baro_hpa", "sensor_msgs/msg/FluidPressure", stamped(T0, "b", fluid_pressure=p / 100)),
        ("/sonar", "sensor_msgs/msg/Range", stamped(T0, "s", range=1.5, **near)),
        ("/sonar", "sensor_msgs/msg/Range", stamped(T0 + 1, "s", range=far, **near)),
        ("/sonar", "sensor_msgs/msg/Range", stamped(T0 + 2, "other", range=2.5, **near)),
    ])  # fmt: skip
    kinds = {s.name: s.kind for s in log}
    assert kinds == {
        "/wheel/twist": Kind.TWIST, "/vel": Kind.GNSS_VELOCITY, "/ublox/fix_velocity": Kind.GNSS_VELOCITY,
        "/visual": Kind.TWIST, "/gps/velocity": Kind.GNSS_VELOCITY, "/lidar_pose": Kind.POSE, "/mag": Kind.MAG,
        "/baro": Kind.BARO, "/baro_hpa": Kind.BARO, "/sonar": Kind.RANGE_FINDER, "/sonar@other": Kind.RANGE_FINDER,
    }  # fmt: skip
    assert log.streams["/visual"].var[0].tolist() == [1.0] * 6 and np.isnan(log.streams["/wheel/twist"].var).all()
    assert log.streams["/vel"].z.tolist() == [[1, 2, 3]]
    np.testing.assert_allclose(log.streams["/baro"].z, 500.0, rtol=1e-9)
    np.testing.assert_allclose(log.streams["/baro_hpa"].z, 500.0, rtol=1e-9)
    np.testing.assert_allclose(np.sqrt(log.streams["/baro"].var), 2.0 / (9.80665 * 1.1673), rtol=1e-3)  # 2 Pa, ISA air
    assert log.streams["/sonar"].z[0, 0] == 1.5 and np.isnan(log.streams["/sonar"].z[1, 0])
    assert any("hPa" in note for note in log.notes)


def test_gps_fix_and_geopoint(recorder: Recorder, tmp_path: Path) -> None:
    """Types of variable length, defined by the log itself."""
    fix = stamped(
        T0, "gps", latitude=50.0, longitude=8.0, altitude=100.0, track=90.0, speed=3.0, climb=0.5, hdop=0.9,
        err_horz=1.96, status__satellites_used=17, status__status=19,
        status__satellite_used_prn=np.arange(17, dtype=np.int32), position_covariance=EYE, position_covariance_type=2,
    )  # fmt: skip
    point = stamped(T0, "gps", position__latitude=50.0, position__longitude=8.0, position__altitude=1.0)
    log = log_of(
        recorder, tmp_path,
        [("/gpsfix", "gps_msgs/msg/GPSFix", fix), ("/point", "geographic_msgs/msg/GeoPointStamped", point)],
    )  # fmt: skip
    s, v = log.streams["/gpsfix"], log.streams["/gpsfix#velocity"]
    assert s.extra["fix"][0] == Fix.FIXED.value and s.extra["satellites"][0] == 17 and s.extra["hacc"][0] == 1.0
    assert np.isnan(s.extra["vacc"][0])
    np.testing.assert_allclose(v.z, [[3.0, 0.0, 0.5]], atol=1e-12)
    np.testing.assert_allclose(log.streams["/point"].z, [[np.radians(50.0), np.radians(8.0), 1.0]])


OF_ANY_LENGTH = {"sensor_msgs/msg/JointState", "sensor_msgs/msg/LaserScan"}  # decoded one by one, see test_record
PACKAGES = ("sensor_msgs", "nav_msgs", "geometry_msgs")
HOT = sorted(kind for kind in MESSAGES if kind.split("/")[0] in PACKAGES and kind not in OF_ANY_LENGTH)


def flat(store: Any, message: Any, prefix: str = "") -> dict[str, Any]:
    out: dict[str, Any] = {}
    for name, (node, _) in store.fielddefs[message.__msgtype__][1]:
        value = getattr(message, name)
        out |= flat(store, value, f"{prefix}{name}.") if int(node) == 2 else {prefix + name: value}
    return out


@pytest.mark.parametrize("kind", HOT)
@pytest.mark.parametrize("container", ["ros1", "mcap"])
@pytest.mark.parametrize("frame", ["", "a", "gps", "imu_link", "ü/base"])
def test_columns_equal_rosbags_own_decoding(kind: str, container: str, frame: str, rng: np.random.Generator) -> None:
    """Every alignment (frame names of different length), both wire formats, random bytes for the numbers."""
    r = Recorder(container)
    fields = leaves(r.store.fielddefs, kind)
    assert fields is not None
    template = r.pack(kind, {"header.frame_id": frame, "child_frame_id": frame + "x"})
    shape = layout(fields, template, not r.ros1)
    raws: list[bytes] = []
    for _ in range(3):
        raw = bytearray(template)
        for name in shape.dtype.names or ():
            sub, offset = shape.dtype.fields[name][:2]  # type: ignore[index]
            raw[offset : offset + sub.itemsize] = rng.bytes(sub.itemsize)
        raws.append(bytes(raw))
    assert all(shape.fits(raw) for raw in raws)
    columns = decode(shape, b"".join(raws))
    for i, raw in enumerate(raws):
        message = (r.store.deserialize_ros1 if r.ros1 else r.store.deserialize_cdr)(raw, kind)
        for name, value in flat(r.store, message).items():
            mine = shape.strings[name] if isinstance(value, str) else columns[name][i]
            np.testing.assert_array_equal(mine, value, err_msg=name)


def test_big_endian_and_padding() -> None:
    """CDR of the other byte order, and the padding that some middlewares leave behind a message."""
    r = Recorder("mcap")
    message = r.make(FIX, stamped(T0, "gps", latitude=1.25, position_covariance_type=2))
    fields = leaves(r.store.fielddefs, FIX)
    raw = bytes(r.store.serialize_cdr(message, FIX, little_endian=False))
    assert fields is not None
    assert decode(layout(fields, raw, True), raw)["latitude"][0] == 1.25
    padded = r.pack(FIX, stamped(T0, "gps", latitude=2.5)) + b"\0\0\0"
    assert decode(layout(fields, padded, True), padded)["latitude"][0] == 2.5
    with pytest.raises(ValueError, match="expected"):
        layout(fields, padded + b"\0", True)


def transforms(r: Recorder, links: list[tuple[str, str, tuple[float, ...], tuple[float, ...]]]) -> bytes:
    made = [
        r.make(
            "geometry_msgs/msg/TransformStamped",
            stamped(T0, parent, child_frame_id=child, transform__translation=p, transform__rotation=q),
        )
        for parent, child, p, q in links
    ]
    message = r.store.types["tf2_msgs/msg/TFMessage"](transforms=made)
    return bytes((r.store.serialize_ros1 if r.ros1 else r.store.serialize_cdr)(message, "tf2_msgs/msg/TFMessage"))


def test_mounts_are_composed_over_the_tree(recorder: Recorder, tmp_path: Path) -> None:
    half = np.sqrt(0.5)
    turn = (0.0, 0.0, half, half)  # yaw 90 degrees
    none = (0.0, 0.0, 0.0, 1.0)
    kind = "tf2_msgs/msg/TFMessage"
    static = [("base_footprint", "base_link", (0.0, 0.0, 0.2), none), ("base_link", "mast", (0.0, 0.0, 1.0), turn)]
    rows = [("/tf_static", kind, T0, transforms(recorder, static)),
            ("/imu", IMU, T0 + 10**9, recorder.pack(IMU, imu_row(T0)))]  # fmt: skip
    for i in range(4):
        moving = [("odom", "base_footprint", (float(i), 0.0, 0.0), none), ("mast", "camera", (0.0, 0.0, i * 0.1), none)]
        still = [("mast", "/gps", (0.5, 0.0, 0.0), none), ("map", "odom", (0.0, 0.0, 0.0), none)]
        rows.append(("/tf", kind, T0 + i, transforms(recorder, moving + still)))
    path = recorder.write(tmp_path / "log", rows)
    for options in ({}, {"start_s": 0.5}):  # static links count whenever they were sent
        mounts = read_rosbag(path, **options).mounts
        if options:
            assert set(mounts) == {"base_footprint", "mast"}
            continue
        assert set(mounts) == {"base_footprint", "mast", "gps"}
        np.testing.assert_allclose(mounts["gps"][:3, 3], [0.0, 0.5, 1.0], atol=1e-12)
        np.testing.assert_allclose(mounts["gps"][:3, :3] @ [1, 0, 0], [0, 1, 0], atol=1e-12)
        np.testing.assert_allclose(mounts["base_footprint"][:3, 3], [0, 0, -0.2], atol=1e-12)


def test_notes_topics_and_times(recorder: Recorder, tmp_path: Path) -> None:
    rows = [("/imu", IMU, T0 + i * 10**9, recorder.pack(IMU, imu_row(0 if i == 3 else T0 + i))) for i in range(10)]
    rows += [("/fix", FIX, T0 + i * 10**9, recorder.pack(FIX, stamped(T0 + i))) for i in range(10)]
    rows += [("/chat", "std_msgs/msg/String", T0, recorder.pack("std_msgs/msg/String", {"data": "hello"}))] * 3
    path = recorder.write(tmp_path / "log", sorted(rows, key=lambda row: row[2]))
    calls: list[tuple[int, int]] = []
    log = read_rosbag(path, progress=lambda done, total: calls.append((done, total)))
    assert "/chat std_msgs/String: not used by fusion, 3 messages" in log.notes
    assert log.streams["/imu"].t[3] == 0  # a stamp of zero is named later, not mended here
    assert calls[-1][0] == calls[-1][1] > 0 and [c[0] for c in calls] == sorted(c[0] for c in calls)
    part = read_rosbag(path, topics=["/fix"], start_s=2.0, end_s=5.0)
    assert set(part.streams) == {"/fix"} and part.streams["/fix"].t.tolist() == [T0 + i for i in (2, 3, 4, 5)]
    with pytest.raises(DataError, match=r"no topic '/imu/dta'.*there are|no topic.*did you mean '/imu'"):
        read_rosbag(path, topics=["/imu/dta"])
    with pytest.raises(DataError, match="did you mean '/fix'"):
        read_rosbag(path, topics=["/fx"])
    with pytest.raises(DataError, match="time span"):
        read_rosbag(path, start_s=100.0)


def test_undecodable_messages_are_counted(recorder: Recorder, tmp_path: Path) -> None:
    good = recorder.pack(IMU, imu_row(T0))
    gps = "gps_msgs/msg/GPSFix"
    rows = [("/imu", IMU, T0 + i, raw) for i, raw in enumerate([good, good[:50], b"", good + b"1234", good])]
    rows += [("/bad", IMU, T0, b"\xff" * 300), ("/gpsfix", gps, T0, b"\x00\x01\x00\x00" + b"\xff" * 200)]
    log = read_rosbag(recorder.write(tmp_path / "log", rows))
    assert len(log.streams["/imu"]) == 2 and log.streams["/imu"].malformed == 3
    assert len(log.streams["/bad"]) == 0 and log.streams["/bad"].malformed == 1
    assert log.streams["/gpsfix"].malformed == 1


def rows_of_imu(recorder: Recorder, n: int) -> list[tuple[str, str, int, bytes]]:
    return [("/imu", IMU, T0 + i * 10**7, recorder.pack(IMU, imu_row(T0 + i * 10**7))) for i in range(n)]


@pytest.mark.parametrize("bare", [True, False])
def test_bare_files_and_directories_without_metadata(tmp_path: Path, bare: bool) -> None:
    for kind in ("sqlite3", "mcap"):
        recorder = Recorder(kind)
        path = recorder.write(tmp_path / kind, rows_of_imu(recorder, 20))
        (path / "metadata.yaml").unlink()
        data = next(path.iterdir())
        assert len(read_rosbag(data if bare else path).streams["/imu"]) == 20


def test_different_recordings_in_one_directory_are_not_merged(tmp_path: Path) -> None:
    recorder = Recorder("mcap")
    day = tmp_path / "day"
    day.mkdir()
    for name in ("north", "south"):
        part = recorder.write(tmp_path / name, rows_of_imu(recorder, 5))
        shutil.copy(part / f"{name}.mcap", day)
    with pytest.raises(DataError, match="2 different recordings"):
        read_rosbag(day)


def test_split_and_compressed(tmp_path: Path) -> None:
    recorder = Recorder("mcap")
    rows = rows_of_imu(recorder, 30)
    whole = tmp_path / "split"
    whole.mkdir()
    for i in (0, 1, 2):  # part_10 comes after part_2
        part = recorder.write(tmp_path / f"p{i}", rows[10 * i : 10 * i + 10])
        shutil.copy(part / f"p{i}.mcap", whole / f"part_{(1, 2, 10)[i]}.mcap")
    s = read_rosbag(whole).streams["/imu"]
    assert s.t.tolist() == [row[2] for row in rows]
    for mode in (CompressionMode.FILE, CompressionMode.MESSAGE, CompressionMode.STORAGE):
        path = tmp_path / mode.name
        writer = Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(mode, CompressionFormat.ZSTD)
        with writer:
            connection = writer.add_connection("/imu", IMU, typestore=recorder.store)
            for _, _, t, raw in rows:
                writer.write(connection, t, raw)
        assert len(read_rosbag(path).streams["/imu"]) == 30


def test_sqlite_without_definitions(tmp_path: Path) -> None:
    """Recorders before ROS 2 Iron stored no message definitions."""
    import sqlite3

    recorder = Recorder("sqlite3")
    path = recorder.write(tmp_path / "old", rows_of_imu(recorder, 5))
    with sqlite3.connect(path / "old.db3") as db:
        db.execute("DROP TABLE message_definitions")
        db.execute("DROP TABLE schema")
    db.close()
    assert len(read_rosbag(path).streams["/imu"]) == 5


def readable(path: Path) -> int:
    """How many records a damaged file still gives; anything but a DataError is a failure."""
    try:
        log = read_rosbag(path)
    except DataError as e:
        assert "\n" not in str(e) and path.name in str(e)
        return -1
    assert all(np.isfinite(s.t).all() for s in log)
    return len(log.streams["/imu"])


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_truncated_anywhere(kind: str, tmp_path: Path) -> None:
    recorder = Recorder(kind)
    path = recorder.write(tmp_path / "log", rows_of_imu(recorder, 60))
    data = path if path.is_file() else next(p for p in path.iterdir() if p.suffix != ".yaml")
    whole = data.read_bytes()
    cut = tmp_path / f"cut{data.suffix}"
    counts: list[int] = []
    for size in [*range(40), *range(40, len(whole), 397), len(whole) - 1, len(whole)]:
        cut.write_bytes(whole[:size])
        counts.append(readable(cut))
    assert counts[0] == -1 and counts[-1] == 60 and max(counts) == 60
    if kind != "sqlite3":
        assert counts == sorted(counts)  # the longer the file, the more there is
        assert len(set(counts)) > 20  # most of what was recorded before the cut is rescued


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_flipped_bytes(kind: str, tmp_path: Path, rng: np.random.Generator) -> None:
    recorder = Recorder(kind)
    path = recorder.write(tmp_path / "log", rows_of_imu(recorder, 20))
    data = path if path.is_file() else next(p for p in path.iterdir() if p.suffix != ".yaml")
    whole = data.read_bytes()
    hurt = tmp_path / f"hurt{data.suffix}"
    for _ in range(60):
        damaged = bytearray(whole)
        for i in rng.integers(0, len(whole), 8):
            damaged[i] = rng.integers(0, 256)
        hurt.write_bytes(damaged)
        try:
            log = read_rosbag(hurt)
        except DataError as e:
            assert "\n" not in str(e)
        else:
            assert len(log) + sum(s.malformed for s in log) >= 0


def test_compressed_chunks_are_salvaged(tmp_path: Path) -> None:
    recorder = Recorder("ros1")
    for compression in ("BZ2", "LZ4"):
        path = tmp_path / f"{compression}.bag"
        writer = Writer1(path)
        writer.set_compression(Writer1.CompressionFormat[compression])
        with writer:
            connection = writer.add_connection("/imu", IMU, typestore=recorder.store)
            for _, _, t, raw in rows_of_imu(recorder, 4000):
                writer.write(connection, t, raw)
        raw = path.read_bytes()
        assert readable(path) == 4000
        path.write_bytes(raw[: len(raw) * 3 // 4])
        assert 0 < readable(path) < 4000


def test_unindexed_bag_is_salvaged_with_a_remedy(tmp_path: Path) -> None:
    recorder = Recorder("ros1")
    path = recorder.write(tmp_path / "log", rows_of_imu(recorder, 10))
    raw = path.read_bytes()
    at = raw.index(b"index_pos=") + len(b"index_pos=")
    path.write_bytes(raw[:at] + struct.pack("<Q", 0) + raw[at + 8 :])
    log = read_rosbag(path)
    assert len(log.streams["/imu"]) == 10
    assert any("rosbag reindex" in note for note in log.notes)


def test_not_a_recording(tmp_path: Path) -> None:
    cases = {"empty.bag": b"", "text.bag": b"hello", "old.bag": b"#ROSBAG V1.2\n", "noise.mcap": bytes(range(256)),
             "magic.mcap": b"\x89MCAP0\r\n", "magic.db3": b"SQLite format 3\0" + bytes(200)}  # fmt: skip
    for name, content in cases.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(DataError, match=name) as e:
            read_rosbag(tmp_path / name)
        assert "\n" not in str(e.value)
    with pytest.raises(DataError, match="no such file"):
        read_rosbag(tmp_path / "missing.bag")
    (tmp_path / "dir").mkdir()
    with pytest.raises(DataError, match="no recording"):
        read_rosbag(tmp_path / "dir")
    recorder = Recorder("mcap")
    text = ("/chat", "std_msgs/msg/String", T0, recorder.pack("std_msgs/msg/String", {"data": "hello"}))
    with pytest.raises(DataError, match="/chat std_msgs/String"):
        read_rosbag(recorder.write(tmp_path / "chat", [text]))


def test_husky(recordings: Path) -> None:
    """Counts and times as rosbags itself sees them."""
    path = recordings / "robot_localization" / "test" / "test1.bag"
    log = read_rosbag(path)
    counts = {s.name: len(s) for s in log}
    assert counts == {
        "/imu/data": 11865, "/imu/data#attitude": 11865, "/husky_velocity_controller/odom": 3952,
        "/husky_velocity_controller/odom#pose": 3952, "/fix": 989,
    }  # fmt: skip
    assert log.duration == pytest.approx(395, abs=1.0)
    with AnyReader([path]) as reader:
        for name in ("/imu/data", "/fix"):
            connections = [c for c in reader.connections if c.topic == name]
            for i, (connection, arrival, raw) in enumerate(reader.messages(connections)):
                if i % 97 == 0:
                    m: Any = reader.deserialize(raw, connection.msgtype)
                    s = log.streams[name]
                    assert s.t[i] == m.header.stamp.sec * 10**9 + m.header.stamp.nanosec
                    assert s.t_arrival[i] == arrival
                    if name == "/fix":
                        assert np.degrees(s.z[i, 0]) == pytest.approx(m.latitude, abs=1e-12)
                    else:
                        assert s.z[i, 2] == m.angular_velocity.z


def test_absurd_numbers_pass_through_without_a_warning(recorder: Recorder, tmp_path: Path) -> None:
    huge, nan = np.full(36, 1e308), np.nan
    rows = [
        (
            "/odom",
            ODOMETRY,
            stamped(T0, pose__pose__orientation=(1e308,) * 4, pose__covariance=huge, twist__covariance=huge),
        ),
        ("/odom", ODOMETRY, stamped(T0, pose__pose__position=(nan, -np.inf, np.inf), pose__covariance=huge * nan)),
        ("/baro", "sensor_msgs/msg/FluidPressure", stamped(T0, fluid_pressure=nan)),
        ("/baro", "sensor_msgs/msg/FluidPressure", stamped(T0, fluid_pressure=-1e308, variance=np.inf)),
    ]
    log = log_of(recorder, tmp_path, rows)
    assert len(log.streams["/odom#pose"]) == 2 and log.streams["/odom#pose"].z[0, 3] == 1e308
    assert np.isnan(log.streams["/baro"].z).all()
