"""Any log by one call: the format is told by the first bytes, then by the name; each reader is imported when needed."""

import re
from collections.abc import Callable, Sequence
from importlib import import_module
from math import isfinite
from pathlib import Path

from outrider.data import EventLog
from outrider.errors import DataError, UsageError
from outrider.io.files import Progress, ensure_readable, is_directory

READERS = {  # format -> module and function
    "ros1 bag": ("rosbags", "read_rosbag"),
    "ros2 bag": ("rosbags", "read_rosbag"),
    "mcap": ("rosbags", "read_rosbag"),
    "ulog": ("ulog", "read_ulog"),
    "dataflash": ("dataflash", "read_dataflash"),
    "tlog": ("mavlink", "read_tlog"),
    "ekf2 replay": ("replay", "read_replay"),
    "rtklib solution": ("rtklib", "read_pos"),
    "gnss receiver": ("receivers", "read_receiver"),
    "remote id": ("remote_id", "read_remote_id"),
    "carmen log": ("carmen", "read_carmen"),
    "kitti drive": ("kitti", "read_kitti"),
    "euroc sequence": ("euroc", "read_euroc"),
    "mrclam folder": ("mrclam", "read_mrclam"),
    "team folder": ("teams", "read_team"),
}
SUPPORTED = (
    "ROS 1 .bag, ROS 2 bag (directory, .db3, .mcap), PX4 .ulg, ArduPilot .bin and .tlog, EKF2 replay .csv, "
    "GNSS receivers (NMEA, UBX), RTKLIB .pos, Open Drone ID .pcap, CARMEN .clf, "
    "raw drives of KITTI, EuRoC sequences, UTIAS MRCLAM folders, folders of one log per robot; "
    ".csv, .npy, .npz and .mat with a mapping"
)
PACKED = (b"BZh", b"\x1f\x8b")
ARRAYS = (b"\x93NUMPY", b"MATLAB 5.0", b"MATLAB 7.3", b"\x89HDF")
MAGIC = (
    (b"#ROSBAG V2.0", "ros1 bag"),
    (b"\x89MCAP0\r\n", "mcap"),
    (b"SQLite format 3\0", "ros2 bag"),
    (b"ULog\x01\x12\x35", "ulog"),
    (b"\xa3\x95", "dataflash"),
)
ENDINGS = {
    ".bag": "ros1 bag", ".mcap": "mcap", ".db3": "ros2 bag", ".ulg": "ulog", ".bin": "dataflash", ".tlog": "tlog",
    ".pos": "rtklib solution", ".nmea": "gnss receiver", ".ubx": "gnss receiver",
}  # fmt: skip
CAPTURES = (
    b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\xa1\xb2\x3c\x4d", b"\x0a\x0d\x0d\x0a",
)  # fmt: skip
REPLAY_ROW = re.compile(rb"\A\d+,(imu|gps|mag|baro|airspeed|range|flow|vio|landed),[-+0-9.e]")
PATTERNS = (  # in the first 4 KiB
    (REPLAY_ROW, "ekf2 replay"),
    (
        re.compile(rb"^(# CARMEN Logfile|(ODOM|[FR]LASER|(RAW|ROBOT)LASER\d) -?\d|PARAM robot_)", re.MULTILINE),
        "carmen log",
    ),
    (re.compile(rb"^%[^\n]*(latitude\((deg|d'\")\)|x-ecef\(m\)|e-baseline\(m\))", re.MULTILINE), "rtklib solution"),
)


def detect(path: Path, *, teams: bool = True) -> str:
    """The format of a log: a key of `READERS`, or `csv` or `arrays` for what needs a mapping.

    teams : whether a folder of logs is one
    """
    if is_directory(path):
        return _folder(path, teams)
    with ensure_readable(path).open("rb") as f:
        head = f.read(4096)
    if head.startswith(ARRAYS) or (path.suffix.lower() in (".mat", ".npz") and b"$" not in head[:1]):
        return "arrays"
    if head.startswith(PACKED):
        return _packed(path)
    if head.startswith(b"PK\x03\x04"):
        raise DataError("is a zip archive", where=str(path), fix="unpack it, and name the folder or the log inside")
    for magic, name in (*MAGIC, *((c, "remote id") for c in CAPTURES)):
        if head.startswith(magic):
            return name
    if len(head) > 16 and head[8] in (0xFD, 0xFE) and 0 < int.from_bytes(head[:8], "big") < 2**52:
        return "tlog"
    for pattern, name in PATTERNS:
        if pattern.search(head):
            return name
    if b"$" in head or b"\xb5\x62" in head:
        from outrider.io.receivers import is_receiver_log

        if is_receiver_log(head):
            return "gnss receiver"
    ending = path.suffix.lower()
    if ending in ENDINGS:
        return ENDINGS[ending]
    if ending in (".csv", ".tsv", ".txt") and b"\0" not in head:
        return "csv"
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise DataError("is text in UTF-16", where=str(path), fix="save it as UTF-8")
    raise DataError("not a log format that is known here", where=str(path), fix=f"supported: {SUPPORTED}")


def _folder(path: Path, teams: bool) -> str:
    """The format of a folder."""
    from outrider.io.euroc import euroc_root
    from outrider.io.kitti import is_kitti
    from outrider.io.mrclam import mrclam_root
    from outrider.io.teams import logs_in

    try:
        names = [p.name for p in path.iterdir()]
        pieces = {re.sub(r"(_\d+)?\.(db3|mcap)$", "", n) for n in names if n.endswith((".db3", ".mcap"))}
        if "metadata.yaml" in names or len(pieces) == 1 or (pieces and not teams):
            return "ros2 bag"
        if is_kitti(path):
            return "kitti drive"
        if euroc_root(path) is not None:
            return "euroc sequence"
        if mrclam_root(path) is not None:
            return "mrclam folder"
        if teams and len(logs_in(path)) > 1:
            return "team folder"
    except OSError as e:
        raise DataError(f"cannot be read: {(e.strerror or str(e)).lower()}", where=str(path)) from None
    what = "is a directory, but not a ROS 2 bag, a drive of KITTI, an EuRoC sequence or a folder of logs"
    raise DataError(what, where=str(path), fix="name the log file inside it; a mapping makes a folder of .npy readable")


def _packed(path: Path) -> str:
    """The format of a compressed file: CARMEN logs are read as they are."""
    from outrider.io.carmen import opened, up_to_damage

    with path.open("rb") as f, opened(f) as unpacked:
        head = b"".join(line for _, line in zip(range(200), up_to_damage(unpacked), strict=False))
    if any(name == "carmen log" and pattern.search(head) for pattern, name in PATTERNS):
        return "carmen log"
    raise DataError("is compressed, and holds no CARMEN log", where=str(path), fix=f"unpack it; supported: {SUPPORTED}")


def check_input(
    path: Path, *, start_s: float | None = None, end_s: float | None = None, mapping: Path | None = None
) -> str:
    """The format of a log, told at once; raises what `read_log` would without looking further into it."""
    if any(s is not None and not isfinite(s) for s in (start_s, end_s)):
        raise UsageError("no finite number of seconds", where=f"--start {start_s} --end {end_s}")
    if end_s is not None and end_s <= (start_s or 0.0):
        told = f"--start {start_s:g} " if start_s is not None else ""
        what = "ends before it starts" if start_s is not None else "is before the log begins"
        raise UsageError(what, where=f"{told}--end {end_s:g}", fix="both count from the log's first event, in seconds")
    name = "arrays" if mapping is not None and is_directory(path) else detect(path)
    if mapping is None:
        if name == "csv" and _columns(path).startswith("its columns are Timestamp, state[0]"):
            raise DataError("is an estimate of EKF2, not its log", where=str(path), fix="`outrider eval` reads it")
        if name == "csv":
            what = "a CSV needs a mapping that says what its columns are"
            raise DataError(what, where=str(path), fix=_columns(path))
        if name == "arrays":
            raise DataError("arrays need a mapping that says what they are", where=str(path), fix=_arrays(path))
        return name
    if name not in ("csv", "ekf2 replay", "arrays"):
        raise UsageError(f"a mapping is for tables, this is {name}", where=str(path), fix="leave the mapping out")
    from outrider.io.csv import load_mapping

    load_mapping(mapping)
    return name


def read_log(
    path: Path | str,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
    mapping: Path | None = None,
) -> EventLog:
    """Read a log of any supported format.

    robot : name given to the records;  topics : stream names or patterns, all by default;  start_s, end_s : seconds
    since the log's first event;  progress : called with (bytes done, bytes in all);  mapping : makes tables and arrays
    readable.

    Raises `DataError` if the file is missing, empty, of no known kind, damaged beyond reading, or without any record.
    """
    path = Path(path)
    name = check_input(path, start_s=start_s, end_s=end_s, mapping=mapping)
    if mapping is not None:
        from outrider.io.arrays import read_arrays
        from outrider.io.csv import read_csv

        read = read_arrays if name == "arrays" else read_csv
        return read(path, mapping, robot=robot, topics=topics, start_s=start_s, end_s=end_s, progress=progress)
    module, function = READERS[name]
    reader: Callable[..., EventLog] = getattr(import_module(f"outrider.io.{module}"), function)
    return reader(path, robot=robot, topics=topics, start_s=start_s, end_s=end_s, progress=progress)


def _arrays(path: Path) -> str:
    from outrider.io.arrays import Arrays

    names = Arrays.of(path).names()
    return f"it holds {', '.join(names[:12])}{', ...' if len(names) > 12 else ''}" if names else "it holds none"


def _columns(path: Path) -> str:
    from outrider.io._table import header_of

    names = header_of(path, ",", None).names
    return f"its columns are {', '.join(names[:12])}{', ...' if len(names) > 12 else ''}"
