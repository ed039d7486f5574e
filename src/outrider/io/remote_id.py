"""Open Drone ID captures: what drones broadcast of themselves, as streams.

A value that is not known has a code of its own on the air (position 0, 0; direction 361; speed 255; vertical speed 63;
altitude -1000): here it is NaN, and never a coordinate. Source: ASTM F3411-22a section 5.4.5 (message layout).
"""

import mmap
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, cast, final

import numpy as np

from outrider.data import Altitude, EventLog, Fix, Kind, Stream, stream
from outrider.io._odid_frames import LINKS, found_in, messages
from outrider.io.files import Progress, assemble, ensure_readable
from outrider.io.pcap import packets
from outrider.typing import Floats, Ints

BASIC_ID, LOCATION, SYSTEM = 0, 1, 4
E7: Final = 1e-7 * np.pi / 180
UNKNOWN_DIRECTION, UNKNOWN_CLIMB, UNKNOWN_TENTHS = 361, 63.0, 36_000
HORIZONTAL: Final = (  # m, 95 % radius of the codes
    np.nan, 18520.0, 7408.0, 3704.0, 1852.0, 926.0, 555.6, 185.2, 92.6, 30.0, 10.0, 3.0, 1.0, np.nan, np.nan, np.nan,
)  # fmt: skip
VERTICAL: Final = (np.nan, 150.0, 45.0, 25.0, 10.0, 3.0, 1.0, *[np.nan] * 9)  # m, 95 %
SPEED: Final = (np.nan, 10.0, 3.0, 1.0, 0.3, *[np.nan] * 11)  # m/s, 95 %
RADIUS_95, INTERVAL_95 = 2.4477, 1.96  # standard deviations in a radius of two dimensions, and in an interval
HOUR: Final = 3600 * 10**9
TRUSTED: Final = 60 * 10**9  # ns: a drone's clock that is further off the capture's is not used
REPORT_EVERY: Final = 1 << 20
PLACE: Final = struct.Struct("<ii")
BODY: Final = struct.Struct("<BBBbiiHHHBBHBx")  # Location after its first byte


@final
@dataclass(slots=True)
class Drone:
    """What one transmitter said. location : capture stamp and the message without its first byte."""

    name: str = ""
    location: list[tuple[int, bytes]] = field(default_factory=list[tuple[int, bytes]])
    system: list[tuple[int, bytes]] = field(default_factory=list[tuple[int, bytes]])


@final
@dataclass(slots=True)
class Heard:
    """Everything in a capture."""

    drones: dict[bytes, Drone] = field(default_factory=dict[bytes, Drone])
    packets: int = 0
    links: set[int] = field(default_factory=set[int])
    end: int = 0  # of the last packet in the file


def read_remote_id(
    path: Path,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Read a capture of Wi-Fi (beacon, NAN) or Bluetooth (4, 5) in which drones identify themselves.

    Streams: `position` (GNSS, ellipsoidal height; extra: fix, height above take-off, status), `velocity`, `baro` and
    `operator` (a STATUS; extra: lat, lon [rad], alt [m]). Several drones: each is a robot of its serial number, and
    its streams are `<number>/position` and so on. Stamps are the drone's own where they agree with the capture's.
    """
    with ensure_readable(path).open("rb") as f, mmap.mmap(f.fileno(), 0, access=mmap.ACCESS_READ) as data:
        heard = _listen(cast(bytes, data), progress)
        cut = bool(data[heard.end :].strip(b"\0")) if heard.packets else True
    named = _by_name(heard)
    notes = ["the file is truncated or damaged: what stands before was read"] if cut else []
    if not heard.links & set(LINKS):
        links = ", ".join(map(str, sorted(heard.links))) or "none"
        notes.insert(0, f"no Wi-Fi or Bluetooth packets (link types {links})")
    elif not named:
        notes.insert(0, f"none of its {heard.packets} packets is of Open Drone ID")
    streams: list[Stream] = []
    for name, drone in named.items():
        own = _streams(drone, notes, name)
        alone = len(named) == 1
        streams += [replace(s, robot=robot) for s in own] if alone else [
            replace(s, name=f"{name}/{s.name}", robot=name) for s in own
        ]  # fmt: skip
    return assemble(path, streams, notes=notes, topics=topics, start_s=start_s, end_s=end_s)


def _listen(data: bytes, progress: Progress | None) -> Heard:
    heard, report = Heard(), 0
    for packet in packets(data):
        if progress is not None and packet.end >= report:
            progress(packet.end, len(data))
            report = packet.end + REPORT_EVERY
        heard.packets += 1
        heard.links.add(packet.link)
        heard.end = packet.end
        for sender, found in found_in(packet):
            drone = heard.drones.setdefault(sender, Drone())
            for message in messages(found):
                _take(drone, packet.t, message)
    return heard


def _take(drone: Drone, t: int, message: bytes) -> None:
    kind = message[0] >> 4
    if kind == LOCATION:
        drone.location.append((t, message[1:]))
    elif kind == SYSTEM:
        drone.system.append((t, message[1:]))
    elif kind == BASIC_ID:
        text = message[2:22].split(b"\0")[0].decode("ascii", "replace").strip()
        if text and text.isprintable() and "�" not in text:
            drone.name = "".join(c if c.isalnum() or c in "-_." else "_" for c in text)


def _by_name(heard: Heard) -> dict[str, Drone]:
    """By serial number, else by address; one drone may speak through several transmitters."""
    out: dict[str, Drone] = {}
    for sender, drone in heard.drones.items():
        if drone.location or drone.system:
            known = out.setdefault(drone.name or sender.hex(":"), Drone())
            known.location = sorted([*known.location, *drone.location], key=lambda m: m[0])
            known.system = sorted([*known.system, *drone.system], key=lambda m: m[0])
    return out


def _streams(drone: Drone, notes: list[str], name: str) -> list[Stream]:
    out: list[Stream] = []
    if drone.location:
        arrival = np.array([t for t, _ in drone.location], np.int64)
        rows = np.array([BODY.unpack(m[: BODY.size]) for _, m in drone.location], np.float64)
        out += _motion(_own_time(arrival, rows[:, 11], notes, name), arrival, rows)
    if drone.system:
        out.append(_operator(drone))
    return out


def _motion(t: Ints, arrival: Ints, rows: Floats) -> list[Stream]:
    """Position, velocity and pressure altitude of Location messages."""
    flags, direction, speed, climb, lat, lon, baro, height, above, accuracy, finer, *_ = rows.T
    bits = flags.astype(np.int64)
    h, v = _nibble(accuracy, 0, HORIZONTAL, RADIUS_95), _nibble(accuracy, 4, VERTICAL)
    s = _nibble(finer, 0, SPEED, RADIUS_95)
    known = (lat != 0) | (lon != 0)
    sane = known & (np.abs(lat) <= 900_000_000) & (np.abs(lon) <= 1_800_000_000)
    z = np.column_stack([np.where(sane, lat * E7, np.nan), np.where(sane, lon * E7, np.nan), _altitude(height)])
    extra = {"fix": np.where(sane, Fix.UNKNOWN.value, Fix.NONE.value), "height": _altitude(above), "status": bits >> 4}
    position = stream(
        "position", Kind.GNSS, t, z, var=np.column_stack([h, h, v]) ** 2, t_arrival=arrival,
        altitude=Altitude.ELLIPSOID, extra={n: c.astype(np.float64) for n, c in extra.items()},
        malformed=int((known & ~sane).sum()),
    )  # fmt: skip
    velocity = _velocities(bits, direction, speed, climb * 0.5)
    var = np.repeat(s[:, None] ** 2, 3, axis=1)
    moving = stream("velocity", Kind.GNSS_VELOCITY, t, velocity, var=var, t_arrival=arrival)
    pressure = stream("baro", Kind.BARO, t, _altitude(baro)[:, None], t_arrival=arrival, altitude=Altitude.PRESSURE)
    told = [x.select(np.flatnonzero(np.isfinite(x.z).any(axis=1))) for x in (moving, pressure)]
    return [position.select(np.flatnonzero(~known | sane)), *told]


def _velocities(bits: Ints, direction: Floats, speed: Floats, climb: Floats) -> Floats:
    """(n, 3) east, north, up [m/s] of course over ground, speed in one of two scales, and climb."""
    course = direction + np.where(bits & 2, 180, 0)
    fast, code = (bits & 1) > 0, speed
    v = np.where(fast, code * 0.75 + 255 * 0.25, code * 0.25)
    v[fast & (code == 255)] = np.nan
    angle = np.radians(np.where((course < UNKNOWN_DIRECTION - 0.5), course, np.nan))
    angle[(v == 0) & np.isnan(angle)] = 0.0  # at rest there is no direction
    up = np.where(climb == UNKNOWN_CLIMB, np.nan, climb)
    return np.column_stack([v * np.sin(angle), v * np.cos(angle), up])


def _altitude(code: Floats) -> Floats:
    """Half metres above -1000 m, which itself means unknown."""
    return np.where(code == 0, np.nan, code * 0.5 - 1000.0)


def _nibble(codes: Floats, shift: int, table: Sequence[float], sigmas: float = INTERVAL_95) -> Floats:
    """Standard deviations of accuracy codes."""
    return np.array(table)[(codes.astype(int) >> shift) & 0xF] / sigmas


def _own_time(arrival: Ints, tenths: Floats, notes: list[str], name: str) -> Ints:
    """(n,) Unix ns: tenths of seconds since the hour, in the hour that brings them next to the capture's clock."""
    known = np.flatnonzero(tenths <= UNKNOWN_TENTHS)
    since = np.where(tenths <= UNKNOWN_TENTHS, tenths, 0).astype(np.int64) * 10**8
    hours = np.round((arrival - since) / HOUR).astype(np.int64)
    own = hours * HOUR + since
    off: Ints = np.abs(own - arrival)
    if not known.size or np.median(off[known]) > TRUSTED:
        notes.append(f"{name} tells no time of its own that fits the capture's: stamps are those of the capture")
        return arrival
    return np.where(tenths <= UNKNOWN_TENTHS, own, arrival)


def _operator(drone: Drone) -> Stream:
    """Where the pilot is: places that a System message tells."""
    t = np.array([t for t, _ in drone.system], np.int64)
    places = np.array([PLACE.unpack_from(m, 1) for _, m in drone.system], np.float64)
    heights = _altitude(np.array([int.from_bytes(m[17:19], "little") for _, m in drone.system], np.float64))
    known = places.any(axis=1) & (np.abs(places) <= [900_000_000, 1_800_000_000]).all(axis=1)
    lat, lon = np.where(np.column_stack([known, known]), places * E7, np.nan).T
    kind = np.array([[m[0] & 3] for _, m in drone.system], np.float64)  # 0 take-off, 1 live, 2 fixed
    return stream("operator", Kind.STATUS, t, kind, extra={"lat": lat, "lon": lon, "alt": heights})
