"""Open Drone ID and CARMEN by their printed layouts, written byte by byte."""

import struct
from collections.abc import Sequence

import numpy as np

UNIX = 1_700_000_040  # 14 minutes past the hour, 0 s
ID = b"TEST1234567890"


def basic_id(text: bytes = ID) -> bytes:
    return bytes([0x02, 0x12]) + text.ljust(20, b"\0") + bytes(3)


def location(
    place: tuple[float, float] = (0.0, 0.0), direction: float = 361.0, speed: float = 255.0, climb: float = 63.0,
    alt: float = -1000.0, tenths: int = 0xFFFF, accuracy: int = 0, status: int = 2,
) -> bytes:  # fmt: skip
    """A Location message as the standard's library encodes it; the defaults are its codes for "unknown"."""
    west = direction >= 180
    low = speed <= 255 * 0.25
    code = speed / 0.25 if low else (speed - 255 * 0.25) / 0.75
    flags = status << 4 | (2 if west else 0) | (0 if low else 1)
    half = round((alt + 1000) * 2)
    return struct.pack(
        "<BBBBbiiHHHBBHBB", 0x12, flags, round(direction - 180 * west), min(255, round(code)), round(climb * 2),
        round(place[0] * 1e7), round(place[1] * 1e7), half, half, half, accuracy, 4, tenths, 0, 0,
    )  # fmt: skip


def system(place: tuple[float, float] = (0.0, 0.0)) -> bytes:
    return struct.pack("<BBiiHBHHBHIB", 0x42, 1, round(place[0] * 1e7), round(place[1] * 1e7), 1, 0, 0, 0, 0, 0, 0, 0)


def pack(*messages: bytes) -> bytes:
    return bytes([0xF2, 25, len(messages)]) + b"".join(messages)


def beacon(payload: bytes, sender: bytes = b"\x02\x00\x00\x00\x00\x01") -> bytes:
    """Radiotap, a beacon's header, the network's name, and the vendor's element."""
    radiotap = struct.pack("<BBHI", 0, 0, 8, 0)
    head = b"\x80\0\0\0" + b"\xff" * 6 + sender + sender + bytes(2) + bytes(8) + struct.pack("<HH", 100, 0)
    return radiotap + head + b"\0\x03abc" + bytes([0xDD, len(payload) + 5]) + b"\xfa\x0b\xbc\x0d\x07" + payload


def nan(payload: bytes, sender: bytes = b"\x02\x00\x00\x00\x00\x02", filters: bool = False) -> bytes:
    """A NAN action frame; `filters` puts the optional fields before the information."""
    head = b"\xd0\0\0\0" + b"\xff" * 6 + sender + bytes(6) + bytes(2)
    optional = b"\x02\xaa\xbb" + b"\x01\xcc" if filters else b""
    info = bytes([len(payload) + 1, 9]) + payload
    control = bytes([0x1C if filters else 0x10])
    value = b"\x88\x69\x19\x9d\x92\x09" + b"\x01\x00" + control + optional + info
    attribute = bytes([3]) + struct.pack("<H", len(value)) + value
    return struct.pack("<BBHI", 0, 0, 8, 0) + head + b"\x04\x09\x50\x6f\x9a\x13" + attribute


def bluetooth(payload: bytes, *, extended: bool, sender: bytes = b"\x02\x00\x00\x00\x00\x03") -> bytes:
    """From the access address on, without the radio's header."""
    data = bytes([len(payload) + 5]) + b"\x16\xfa\xff\x0d\x01" + payload
    if not extended:
        pdu = bytes([2, 6 + len(data)]) + sender[::-1] + data
    else:
        header = b"\x09" + sender[::-1] + b"\x75\x0e"
        pdu = bytes([7, 1 + len(header) + len(data), len(header)]) + header + data
    return b"\xd6\xbe\x89\x8e" + pdu + bytes(3)


def pcap(frames: Sequence[bytes], link: int = 127, nano: bool = False, order: str = "<", step: float = 1.0) -> bytes:
    magic = 0xA1B23C4D if nano else 0xA1B2C3D4
    out = struct.pack(f"{order}IHHiIII", magic, 2, 4, 0, 0, 65535, link)
    for k, frame in enumerate(frames):
        t = UNIX + k * step
        part = round((t % 1) * (1e9 if nano else 1e6))
        out += struct.pack(f"{order}IIII", int(t), part, len(frame), len(frame)) + frame
    return out


def pcapng(frames: Sequence[bytes], link: int = 127, order: str = "<") -> bytes:
    def block(kind: int, body: bytes) -> bytes:
        body += bytes(-len(body) % 4)
        return struct.pack(f"{order}II", kind, len(body) + 12) + body + struct.pack(f"{order}I", len(body) + 12)

    out = block(0x0A0D0D0A, struct.pack(f"{order}IHHq", 0x1A2B3C4D, 1, 0, -1))
    resolution = struct.pack(f"{order}HHB3xHH", 9, 1, 9, 0, 0)  # nanoseconds
    out += block(1, struct.pack(f"{order}HHI", link, 0, 0) + resolution)
    for k, frame in enumerate(frames):
        t = (UNIX + k) * 10**9
        body = struct.pack(f"{order}IIIII", 0, t >> 32, t & 0xFFFFFFFF, len(frame), len(frame)) + frame
        out += block(6, body)
    return out


def drone_flight(n: int = 20) -> list[bytes]:
    """Packs of a drone that flies east at 4 m/s; its own clock is 0.2 s behind the capture's."""
    out: list[bytes] = []
    for k in range(n):
        place = (45.5, -122.9 + 4.0 * k / (111_320 * np.cos(np.radians(45.5))))
        tenths = (UNIX % 3600 + k) * 10 - 2
        out.append(pack(basic_id(), location(place, 90.0, 4.0, 0.5, 120.0, tenths, 0x4B), system((45.4, -122.8))))
    return out


def remote_id() -> bytes:
    return pcap([beacon(p) for p in drone_flight()])


def carmen(odometry: bool = True) -> bytes:
    """A robot that drives forward at 0.5 m/s and turns left at 0.1 rad/s, with a laser of 180 readings."""
    rows = [
        "# CARMEN Logfile",
        "PARAM robot_frontlaser_offset 0.2 nohost 0",
        "PARAM robot_front_laser_max 50.0 nohost 0",
    ]
    for k in range(40):
        s = 0.25 * k
        yaw = 0.1 * s
        x, y = 5.0 * np.sin(yaw), 5.0 * (1.0 - np.cos(yaw))
        stamps = f"{1000.0 + s:.6f} nohost {s + 0.01 * (k % 2):.6f}"
        if odometry:
            rows.append(f"ODOM {x:.6f} {y:.6f} {yaw:.6f} 0.5 0.1 0.0 {stamps}")
        ranges = " ".join(["2.50"] * 90 + ["81.91"] * 90)
        rows.append(f"FLASER 180 {ranges} {x:.6f} {y:.6f} {yaw:.6f} {x:.6f} {y:.6f} {yaw:.6f} {stamps}")
    return "\n".join([*rows, ""]).encode()
