"""A walk at (3 north, 4 east, 0 up) m/s, one fix a second, as receivers and post-processors write it.

Sentences are put together by pynmea2, messages by pyubx2's writer; the rest by the printed formats.
"""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

import numpy as np

LAT, LON, ALT, GEOID = 47.4, 8.5, 500.0, 48.0
NORTH, EAST = 3.0, 4.0
N = 20
METRES_PER_DEGREE = 111_180.0
BEGIN = datetime(2024, 5, 1, 23, 59, 50, tzinfo=UTC)  # midnight falls into the walk
GPS_MINUS_UTC = 18


def begin_ns() -> int:
    return int(BEGIN.timestamp()) * 10**9


def place(k: float) -> tuple[float, float]:
    """Latitude and longitude [deg] after k seconds."""
    return LAT + NORTH * k / METRES_PER_DEGREE, LON + EAST * k / METRES_PER_DEGREE / np.cos(np.radians(LAT))


def week_and_tow(k: float) -> tuple[int, float]:
    """GPS week and seconds of it."""
    since = (BEGIN - datetime(1980, 1, 6, tzinfo=UTC)).total_seconds() + GPS_MINUS_UTC + k
    return int(since // 604_800), since % 604_800


def sexagesimal(degrees: float, width: int) -> str:
    whole = int(abs(degrees))
    return f"{whole:0{width}d}{(abs(degrees) - whole) * 60:010.7f}"


def sentence(talker: str, name: str, *fields: object) -> str:
    """One sentence with its checksum, by pynmea2's writer."""
    from pynmea2 import NMEASentence

    body = f"{talker}{name},{','.join(map(str, fields))}"
    return f"${body}*{NMEASentence.checksum(body):02X}\r\n"


def nmea_epoch(k: int, quality: int = 4, names: Sequence[str] = ("RMC", "GGA", "GST", "VTG")) -> str:
    when = BEGIN + timedelta(seconds=k)
    lat, lon = place(k)
    hms, dmy = when.strftime("%H%M%S.00"), when.strftime("%d%m%y")
    at = (sexagesimal(lat, 2), "N", sexagesimal(lon, 3), "E") if quality else ("", "", "", "")
    knots, course = f"{np.hypot(NORTH, EAST) * 3600 / 1852:.5f}", f"{np.degrees(np.arctan2(EAST, NORTH)):.4f}"
    status, height = ("A", f"{ALT:.3f}") if quality else ("V", "")
    told = {
        "RMC": sentence("GN", "RMC", hms, status, *at, knots, course, dmy, "", "", "R" if quality else "N", "V"),
        "GGA": sentence("GN", "GGA", hms, *at, quality, 12, 0.8, height, "M", GEOID, "M", 1.0, "0000"),
        "GST": sentence("GN", "GST", hms, 1.0, "", "", "", 0.02, 0.01, 0.03),
        "VTG": sentence("GN", "VTG", course, "T", "", "M", knots, "N", "18.0", "K", "R"),
        "ZDA": sentence("GN", "ZDA", hms, f"{when:%d}", f"{when:%m}", f"{when:%Y}", "00", "00"),
        "HDT": sentence("GN", "HDT", 90.0, "T"),
    }
    return "".join(told[n] for n in names)


def nmea() -> bytes:
    return "".join(nmea_epoch(k) for k in range(N)).encode()


def ubx_message(name: str, **fields: object) -> bytes:
    """One message, by pyubx2's writer; values in its units."""
    from pyubx2 import GET, UBXMessage

    return UBXMessage("NAV", name, GET, **fields).serialize()


def pvt(k: int, **more: object) -> bytes:
    when = BEGIN + timedelta(seconds=k)
    lat, lon = place(k)
    fields: dict[str, object] = {
        "iTOW": round(week_and_tow(k)[1] * 1000), "year": when.year, "month": when.month, "day": when.day,
        "hour": when.hour, "min": when.minute, "second": when.second, "validDate": 1, "validTime": 1, "nano": -1000,
        "fixType": 3, "gnssFixOk": 1, "carrSoln": 2, "numSV": 17, "lon": lon, "lat": lat,
        "height": round((ALT + GEOID) * 1000), "hMSL": round(ALT * 1000), "hAcc": 14, "vAcc": 20,
        "velN": round(NORTH * 1000), "velE": round(EAST * 1000), "velD": 0, "sAcc": 50, "pDOP": 1.2,
    }  # fmt: skip
    return ubx_message("NAV-PVT", **(fields | more))


def ubx() -> bytes:
    return b"".join(pvt(k) for k in range(N))


def mixed() -> bytes:
    """Both, with half a correction message in between."""
    return b"".join(pvt(k) + nmea_epoch(k).encode() + b"\xd3\x00\x13\x3e\xd0" for k in range(N))


def pos(coordinates: str = "latitude(deg) longitude(deg)  height(m)", dated: bool = False) -> bytes:
    """RTKLIB's text."""
    rows = ["% program   : RTKPOST", "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,5:single,ns=# of satellites)"]
    rows.append(f"%  GPST  {coordinates}   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio")
    for k in range(N):
        week, tow = week_and_tow(k)
        lat, lon = place(k)
        gps = BEGIN + timedelta(seconds=k + GPS_MINUS_UTC)
        stamp = f"{gps:%Y/%m/%d %H:%M:%S.000}" if dated else f"{week} {tow:.3f}"
        rows.append(f"{stamp} {lat:.9f} {lon:.9f} {ALT + GEOID:.4f} 1 12 0.02 0.01 0.03 0.001 0.001 -0.001 1.00 40.0")
    return "\n".join([*rows, ""]).encode()
