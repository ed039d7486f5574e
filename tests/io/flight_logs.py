"""Small logs of one known flight in every format, written byte by byte from the format's definition.

The vehicle flies north-east at (3 north, 4 east, -1 down) m/s from 47.4 N, 8.5 E, 500 m, turned 90 degrees to the right
of north, level, at 50 Hz for two seconds; its accelerometer feels 1 m/s^2 forward and gravity, its gyroscope yaws
0.5 rad/s to the right.
"""

import struct
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import ClassVar

import numpy as np

RATE, N = 50, 100
LAT, LON, ALT = 47.4, 8.5, 500.0
NORTH, EAST, DOWN = 3.0, 4.0, -1.0
METRES_PER_DEGREE = 111_180.0  # near enough for what the tests ask
BOOT = 7_000_000  # us at the first record
UNIX = 1_700_000_000_000_000


def place(k: int) -> tuple[float, float, float]:
    """Latitude, longitude [deg], height after k records."""
    s = k / RATE
    lon = LON + EAST * s / (METRES_PER_DEGREE * np.cos(np.radians(LAT)))
    return LAT + NORTH * s / METRES_PER_DEGREE, lon, ALT - DOWN * s


class Ulog:
    """Writes the definitions and data sections of a ULog."""

    SIZES: ClassVar = {"uint64_t": "Q", "float": "f", "double": "d", "uint8_t": "B", "int32_t": "i", "uint32_t": "I"}

    def __init__(self) -> None:
        self.head, self.body, self.ids = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", BOOT)), bytearray(), {}
        self.head += self.record(b"B", bytes(40))

    @staticmethod
    def record(kind: bytes, payload: bytes) -> bytes:
        return struct.pack("<H", len(payload)) + kind + payload

    def parameter(self, name: str, value: float) -> None:
        key = f"float {name}".encode()
        self.head += self.record(b"P", bytes([len(key)]) + key + struct.pack("<f", value))

    def topic(self, name: str, fields: str, instance: int = 0) -> Callable[..., None]:
        """Declare a topic; the result writes one record of it."""
        form = "<"
        for f in fields.split(";"):
            kind = f.split()[0]
            count = int(kind[kind.index("[") + 1 : -1]) if "[" in kind else 1
            form += self.SIZES[kind.split("[")[0]] * count
        if instance == 0:
            self.head += self.record(b"F", f"{name}:{fields};".encode())
        number = len(self.ids)
        self.ids[name, instance] = number
        self.body += self.record(b"A", struct.pack("<BH", instance, number) + name.encode())
        return lambda *v: self.body.extend(self.record(b"D", struct.pack("<H", number) + struct.pack(form, *v)))

    def dropout(self, ms: int) -> None:
        self.body += self.record(b"O", struct.pack("<H", ms))

    def bytes(self) -> bytes:
        return bytes(self.head + self.body)


def ulog(*, old: bool = False) -> bytes:
    """The flight as PX4 logs it, in today's spelling or in that of 2018."""
    log = Ulog()
    log.parameter("EKF2_GPS_DELAY", 100.0)
    imu = log.topic("sensor_combined", "uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2")
    gps_tail = (
        "float eph;float epv;float s_variance_m_s;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;uint8_t fix_type"
    )
    gps_tail += ";uint8_t vel_ned_valid;uint8_t satellites_used"
    where = "int32_t lat;int32_t lon;int32_t alt;int32_t alt_ellipsoid"
    if not old:
        where = "double latitude_deg;double longitude_deg;double altitude_msl_m;double altitude_ellipsoid_m"
    gps = log.topic("vehicle_gps_position", f"uint64_t timestamp;{where};{gps_tail}")
    baro = log.topic("vehicle_air_data", "uint64_t timestamp;float baro_alt_meter")
    mag = log.topic("vehicle_magnetometer", "uint64_t timestamp;float[3] magnetometer_ga")
    attitude = log.topic("vehicle_attitude", "uint64_t timestamp;float[4] q")
    local = log.topic(
        "vehicle_local_position",
        "uint64_t timestamp;uint64_t ref_timestamp;double ref_lat;double ref_lon;float x;float y;float z;float vx"
        ";float vy;float vz;float ref_alt;uint8_t xy_valid;uint8_t z_valid;uint8_t v_xy_valid",
    )
    down = log.topic(
        "distance_sensor",
        "uint64_t timestamp;float min_distance;float max_distance;float current_distance;float covariance"
        ";uint8_t orientation",
    )
    for k in range(N):
        us, s = BOOT + k * 1_000_000 // RATE, k / RATE
        imu(us, 0.01, 0.02, 0.5, 1.0, 0.25, -9.81)
        lat, lon, alt = place(k)
        if k % 5 == 0:
            at = (round(lat * 1e7), round(lon * 1e7), round(alt * 1e3), round(alt * 1e3) + 47_000)
            at = at if old else (lat, lon, alt, alt + 47.0)
            gps(us, *at, 0.5, 0.8, 0.2, NORTH, EAST, DOWN, 3, 1, 14)
            baro(us, alt + 2.0)
            mag(us, 0.2, 0.05, 0.4)
            half = np.sqrt(0.5)
            attitude(us, half, 0.0, 0.0, half)  # yaw 90 degrees to the right of north: facing east
            local(us, BOOT, LAT, LON, NORTH * s, EAST * s, DOWN * s, NORTH, EAST, DOWN, ALT, 1, 1, 1)
            down(us, 0.2, 10.0, 1.5 if k else 20.0, 0.01, 25)
    log.dropout(120)
    return log.bytes()


def tlog(*, start: int = 0, system: int = 1, latency: int = 4000, boot: int = BOOT, gps_stamp: bool = True) -> bytes:
    """The flight as ArduPilot sends it, recorded `latency` us later on the clock of a ground station."""
    from pymavlink.dialects.v20 import ardupilotmega as m

    mav = m.MAVLink(BytesIO(), srcSystem=system, srcComponent=1)
    out = bytearray()

    def put(us: int, message: object) -> None:
        out.extend(struct.pack(">Q", UNIX + start + us - boot + latency) + message.pack(mav))  # type: ignore[attr-defined]

    for k in range(N):
        us = boot + k * 1_000_000 // RATE
        lat, lon, alt = place(k)
        ms, la, lo, mm = us // 1000, round(lat * 1e7), round(lon * 1e7), round(alt * 1e3)
        put(us, m.MAVLink_raw_imu_message(us, 102, 25, -1000, 10, 20, 500, 200, 50, 400))
        if k % 5 == 0:
            flags = 831 if k < 50 else 831 & ~16
            put(us, m.MAVLink_ekf_status_report_message(flags, 0.1, 0.2, 0.3, 0.4, 0.5))
            put(us, m.MAVLink_attitude_message(ms, 0.0, 0.0, np.pi / 2, 0.0, 0.0, 0.5))
            put(us, m.MAVLink_global_position_int_message(ms, la, lo, mm, 0, 300, 400, -100, 9000))
            put(us, m.MAVLink_scaled_pressure_message(ms, 954.6, 0.0, 2500))
            speed, course = round(100 * np.hypot(NORTH, EAST)), round(np.degrees(np.arctan2(EAST, NORTH)) * 100)
            fix = (us if gps_stamp else 0, 6, la, lo, mm, 90, 120, speed, course, 14, mm + 47_000, 500, 800, 200)
            put(us, m.MAVLink_gps_raw_int_message(*fix))
            put(us, m.MAVLink_sim_state_message(*(np.sqrt(0.5), 0, 0, np.sqrt(0.5)), *([0.0] * 9), lat, lon, alt,
                                                *(0.0, 0.0, NORTH, EAST, DOWN), la, lo))  # fmt: skip
    return bytes(out)


class Dataflash:
    """Writes FMT records and what they declare."""

    CODES: ClassVar = {
        "Q": "Q",
        "B": "B",
        "f": "f",
        "L": "i",
        "e": "i",
        "I": "I",
        "H": "H",
        "C": "H",
        "c": "h",
        "h": "h",
    }

    def __init__(self) -> None:
        self.out, self.kinds = bytearray(), {}
        self.format("FMT", "BBnNZ", "Type,Length,Name,Format,Columns", 0x80, 89)

    def format(self, name: str, form: str, columns: str, kind: int = 0, length: int = 0) -> None:
        kind = kind or 0x81 + len(self.kinds)
        self.kinds[name] = (kind, "<" + "".join(self.CODES.get(c, "") for c in form))
        length = length or 3 + struct.calcsize(self.kinds[name][1])
        self.out += struct.pack("<BBBBB4s16s64s", 0xA3, 0x95, 0x80, kind, length, *(
            s.encode() for s in (name, form, columns)))  # fmt: skip

    def put(self, name: str, *values: float) -> None:
        kind, form = self.kinds[name]
        self.out += bytes((0xA3, 0x95, kind)) + struct.pack(form, *values)


def dataflash() -> bytes:
    """The flight as ArduPilot writes it on board."""
    log = Dataflash()
    log.format("IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")
    log.format("GPS", "QBBIHBcLLeffff", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw")
    log.format("GPA", "QBCCCCI", "TimeUS,I,VDop,HAcc,VAcc,SAcc,SMS")
    log.format("BARO", "QBff", "TimeUS,I,Alt,Press")
    log.format("MAG", "QBhhh", "TimeUS,I,MagX,MagY,MagZ")
    log.format("XKF1", "QBccCfff", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD")
    log.format("XKF4", "QBI", "TimeUS,C,SS")
    log.format("POS", "QLLf", "TimeUS,Lat,Lng,Alt")
    log.format("SIM", "QLLf", "TimeUS,Lat,Lng,Alt")
    for k in range(N):
        us = BOOT + k * 1_000_000 // RATE
        lat, lon, alt = place(k)
        for instance in range(2):
            log.put("IMU", us, instance, 0.01, 0.02, 0.5, 1.0, 0.25, -9.81)
        if k % 5 == 0:
            at = (round(lat * 1e7), round(lon * 1e7))
            log.put("GPA", us - 10, 0, 120, 50, 80, 20, us // 1000 - 60)
            course = np.degrees(np.arctan2(EAST, NORTH))
            log.put("GPS", us, 0, 6, 345_600_000, 2280, 14, 90, *at, round(alt * 100), 5.0, course, DOWN, 0.0)
            log.put("BARO", us, 0, alt - ALT, 95_460.0)
            log.put("MAG", us, 0, 200, 50, 400)
            log.put("XKF4", us, 0, 831 if k < 50 else 831 & ~16)
            for core in range(2):
                log.put("XKF1", us, core, 0, 0, 9000 if core == 0 else 0, NORTH, EAST, DOWN)
            log.put("POS", us, *at, alt)
            log.put("SIM", us, *at, alt)
    return bytes(log.out)


def replay() -> bytes:
    """The flight as EKF2's replay tool reads it."""
    rows: list[str] = []
    for k in range(N):
        us = BOOT + k * 1_000_000 // RATE
        lat, lon, alt = place(k)
        rows.append(f"{us},imu,1.0,0.25,-9.81,0.01,0.02,0.5")
        if k % 5 == 0:
            rows.append(f"{us},gps,{alt * 1e3:.1f},{lon * 1e7:.1f},{lat * 1e7:.1f},{NORTH},{EAST},{DOWN}")
            rows += [f"{us},baro,{alt + 2.0}", f"{us},mag,0.2,0.05,0.4", f"{us},airspeed,5.0,4.9", f"{us},landed,0.0"]
    return "\r\n".join([*rows, ""]).encode()


CSV_MAPPING = """
time: {column: us, unit: us}
streams:
  imu:
    kind: imu
    frame: frd
    columns: {gyro_x: wx, gyro_y: wy, gyro_z: wz, accel_x: ax, accel_y: ay, accel_z: az}
    units: {gyro_x: deg/s, gyro_y: deg/s, gyro_z: deg/s, accel_x: g, accel_y: g, accel_z: g}
    where: {sensor: imu}
  fix:
    kind: GNSS
    columns: {lat: latitude, lon: longitude, alt: height}
    units: {lat: deg, lon: deg}
    sigma: [0.5, 0.5, 0.8]
    altitude: MSL
    extra: {fix: quality, satellites: ns}
    values: {fix: {1: 5, 2: 4, 5: 1}}
    where: {sensor: gps}
"""


def table() -> bytes:
    """The flight as somebody's own CSV, in degrees and g."""
    rows = ["us,sensor,wx,wy,wz,ax,ay,az,latitude,longitude,height,quality,ns"]
    for k in range(N):
        us = BOOT + k * 1_000_000 // RATE
        w, f = np.degrees([0.01, 0.02, 0.5]), np.array([1.0, 0.25, -9.81]) / 9.80665
        rows.append(f"{us},imu,{','.join(repr(float(v)) for v in (*w, *f))},,,,,")
        if k % 5 == 0:
            lat, lon, alt = (float(v) for v in place(k))
            rows.append(f"{us},gps,,,,,,,{lat!r},{lon!r},{alt!r},5,14")
    return "\n".join([*rows, ""]).encode()


def write(folder: Path, name: str, data: bytes) -> Path:
    """A file with these bytes."""
    path = folder / name
    path.write_bytes(data)
    return path


def cuts(data: bytes, rng: np.random.Generator, n: int) -> Sequence[bytes]:
    """Truncations at random places, and at both ends of the file."""
    places = [1, 2, 7, 16, 17, len(data) - 1, *rng.integers(1, len(data), n).tolist()]
    return [data[:k] for k in places]


def damages(data: bytes, rng: np.random.Generator, n: int) -> list[bytes]:
    """Copies with bytes flipped, stretches cut out and stretches repeated."""
    out: list[bytes] = []
    for _ in range(n):
        d = bytearray(data)
        for i in rng.integers(0, len(d), rng.integers(1, 40)):
            d[i] = rng.integers(0, 256)
        a, b = sorted(rng.integers(0, len(d), 2).tolist())
        b = min(b, a + 300)
        out.append(bytes(d if rng.random() < 0.5 else d[:a] + d[b:] if rng.random() < 0.5 else d[:b] + d[a:]))
    return out
