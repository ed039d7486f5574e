"""Every recording opens, or is refused with the right reason; the page docs/evidence/formats.md says which and how."""

import re
from pathlib import Path

import pytest

from outrider.data import EventLog
from outrider.errors import OutriderError
from outrider.io.registry import read_log

pytestmark = pytest.mark.evidence

PAGE = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "formats.md"
COMMA = "comma2k19/Example_1/b0c9d2329ad1606b_2018-08-02--08-34-47/40"
LOGS = (
    "robot_localization/test/test1.bag", "px4-ecl/test/replay_data/iris_gps.csv",
    "px4-ecl/test/replay_data/ekf_gsf_reset.csv", "px4-ulog-rs/tests/fixtures/esc_status_log.ulg",
    "px4-ulog-rs/tests/fixtures/6ba1abc7-b433-4029-b8f5-3b2bb12d3b6c.ulg", "pyulog/test/sample_px4_events.ulg",
    "autopilot/copter_gps_outage_wind.tlog", "rtklib-py/data/u-blox/demo5_b34f_f.pos",
    "rtklib-py/data/u-blox/py_0315f.pos", "pyubx2/tests/pygpsdata-MIXED.log", "remoteid/odid_wifi_bcn_sample.pcap",
    "remoteid/odid_wifi_sample.pcap", "remoteid/odid_bt5_lr_sample.pcapng", "mola/datasets/radish/aces.clf.bz2",
    "mola/datasets/radish/fr079.clf.bz2", "rtklib-py/data/u-blox",
)  # fmt: skip
ANSFL = """time: {column: time}
streams:
  imu:
    kind: IMU
    columns: {gyro_x: Gyr_X, gyro_y: Gyr_Y, gyro_z: Gyr_Z, accel_x: Acc_X, accel_y: Acc_Y, accel_z: Acc_Z}
    units: {gyro_x: deg/s, gyro_y: deg/s, gyro_z: deg/s}
"""
RTK = "time: {column: time}\nstreams: {rtk: {kind: POSITION, frame: ned, columns: {x: North, y: East, z: Down}}}\n"
UWB = """time: {column: field.header.stamp, unit: ns, arrival: time}
streams:
  fix: {kind: GNSS, columns: {lat: field.latitude, lon: field.longitude, alt: field.altitude},
        units: {lat: deg, lon: deg}}
"""
PLAZA = """streams:
  odometry: {kind: TWIST, time: {column: "DR[0]"}, increments: true, columns: {v_x: "DR[1]", w_z: "DR[2]"}}
  ranges: {kind: RANGE, time: {column: "TD[0]"}, columns: {beacon: "TD[2]", range: "TD[3]"}}
"""
LIBRSF = """delimiter: " "
names: [kind, t, a, b, c, d, e, f, g]
time: {column: t}
streams:
  uwb: {kind: RANGE, columns: {beacon: e, range: a}, where: {kind: range2}}
  wheels: {kind: WHEELS, columns: {left: b, right: a}, where: {kind: odom2diff}}
"""
CAN = "processed_log/CAN/wheel_speed"
HIGHWAY = f"""streams:
  wheels: {{kind: WHEELS, time: {{column: "{CAN}/t"}}, columns: {{fl: "{CAN}/value[0]", fr: "{CAN}/value[1]"}}}}
"""
MAPPED = (
    ("ansfl-quad/Horizontal/path_4/IMU_1.csv", ANSFL), ("ansfl-quad/Horizontal/path_4/GT.csv", RTK),
    ("ansfl-quad/Horizontal/path_7/IMU_avg.csv", ANSFL), ("ansfl-quad/StraightLine/path_1/IMU_1.csv", ANSFL),
    ("uwb-outdoor/Dynamic_measurements/LOS/Trajectory_A/Case_1/gnss.csv", UWB),
    ("uwb-outdoor/Dynamic_measurements/NLOS/Trajectory_B/Case_4/gnss.csv", UWB),
    ("gtsam/examples/Data/Plaza1_.mat", PLAZA), ("librsf/datasets/Indoor_UWB/Indoor_UWB_Input.txt", LIBRSF),
    (COMMA, HIGHWAY),
)  # fmt: skip
REFUSED = (
    ("ansfl-quad/Horizontal/path_4/GT.csv", "needs a mapping"), ("gtsam/examples/Data/Plaza1_.mat", "need a mapping"),
    (f"{COMMA}/processed_log/IMU/gyro/value", "need a mapping"), (COMMA, "a mapping makes a folder of .npy readable"),
    ("librsf/datasets/Indoor_UWB/Indoor_UWB_Input.txt", "needs a mapping"),
    ("mola/datasets/radish/aces.rawlog", "is compressed, and holds no CARMEN log"),
    ("mola/datasets/radish/aces.relations", "not a log format that is known"),
    ("px4-ecl/test/change_indication/iris_gps.csv", "is an estimate of EKF2, not its log"),
    ("hog2/maps/cities/Berlin_0_256.map", "not a log format that is known"),
    ("nav2/nav2_bringup/maps/depot.pgm", "not a log format that is known"),
)  # fmt: skip


def row(name: str, log: EventLog) -> str:
    sources = ", ".join(
        f"{s.name} {len(s)}" + (f" at {s.rate:.3g} Hz" if s.rate == s.rate else "")
        for s in sorted(log, key=lambda s: s.name)
    )
    notes = "; ".join(log.notes)
    return f"| {name} | {log.duration:.1f} | {len(log)} | {sources} | {notes} |".replace("\n", " ")


def test_every_recording_opens_or_says_why(recordings: Path, tmp_path: Path) -> None:
    lines = ["# How the recordings open", "", "Written by `make evidence`. Stamps are sorted; rates are medians.", ""]
    lines += ["| recording | s | records | sources | remarks of the reader |", "|---|---|---|---|---|"]
    lines += [row(name, read_log(recordings / name)) for name in LOGS]
    for name, mapping in MAPPED:
        (tmp_path / "m.yaml").write_text(mapping, encoding="utf-8")
        lines.append(row(f"{name}, with a mapping", read_log(recordings / name, mapping=tmp_path / "m.yaml")))
    lines += ["", "| refused | reason |", "|---|---|"]
    for name, reason in REFUSED:
        with pytest.raises(OutriderError, match=re.escape(reason)) as e:
            read_log(recordings / name)
        said = str(e.value).partition(": ")[2].partition(" (supported")[0].partition("; supported")[0]
        lines.append(f"| {name} | {' '.join(said.split())} |")
    PAGE.write_text("\n".join([*lines, ""]), encoding="utf-8")
