"""A small file of every kind that is read, ways to spoil one, and what reading it must come to."""

import bz2
import io
import json
import re
import signal
import struct
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import flight_logs
import numpy as np
import other_logs
import scipy.io
from numpy.random import Generator
from PIL import Image

import gnss_logs
from outrider.data import EventLog, Trajectory
from outrider.errors import OutriderError
from outrider.io.alerts import AlertFile
from outrider.io.control_points import read_referenced
from outrider.io.map_server import read_map
from outrider.io.moving_ai import read_moving_ai_map, read_moving_ai_scenarios
from outrider.io.record import write_recording
from outrider.io.registry import read_log
from outrider.io.replay import read_change_indication
from outrider.io.robot_localization import read_upstream
from outrider.io.route_graphs import read_route_graph
from outrider.io.sites import read_site
from outrider.io.trajectories import read_trajectory
from outrider.scenarios.files import load_scenario
from outrider.sim.logs import wheeled_log
from outrider.workflows.settings import load_config

CAP_S = 20.0  # of processor time: others compute on the same machine
ROOT = Path(__file__).resolve().parents[2]
Read = Callable[[Path], object]


class HangError(BaseException):
    """A case that takes too long; nobody who catches `Exception` catches it."""


@dataclass(frozen=True)
class Seed:
    """name of the file, its sound content, how it is read, and files beside it."""

    file: str
    data: bytes
    read: Read
    beside: Mapping[str, bytes] = field(default_factory=dict)


def spoilt(data: bytes, rng: Generator, others: list[bytes]) -> tuple[str, bytes]:
    """A way to spoil bytes, and the bytes."""
    how = str(rng.choice(list(WAYS)))
    return how, WAYS[how](data, rng, others)


def cut(d: bytes, rng: Generator, _: list[bytes]) -> bytes:
    return d[: int(rng.integers(0, max(len(d), 1)))]


def headless(d: bytes, rng: Generator, _: list[bytes]) -> bytes:
    return d[int(rng.integers(0, max(len(d), 1))) :]


def flipped(d: bytes, rng: Generator, _: list[bytes]) -> bytes:
    out = bytearray(d)
    for _k in range(int(rng.integers(1, 20)) if out else 0):
        out[int(rng.integers(len(out)))] ^= 1 << int(rng.integers(8))
    return bytes(out)


def overwritten(d: bytes, rng: Generator, _: list[bytes]) -> bytes:
    a = int(rng.integers(0, max(len(d), 1)))
    n = int(rng.choice([1, 4, 8, 64, 500]))
    fill = [b"\0", b"\xff", b"\x7f", rng.bytes(1)][int(rng.integers(4))]
    return d[:a] + fill * n + d[a + n :]


def numbers(d: bytes, rng: Generator, _: list[bytes]) -> bytes:
    """A little-endian number of any kind where another was: NaN, infinite, huge, negative."""
    a = int(rng.integers(0, max(len(d) - 8, 1)))
    bad = [struct.pack("<d", v) for v in (np.nan, np.inf, 1e308, -1e300, 0.0)]
    bad += [struct.pack("<f", v) for v in (np.nan, -np.inf, 3e38)] + [struct.pack("<q", v) for v in (-1, 2**62)]
    word = bad[int(rng.integers(len(bad)))]
    return d[:a] + word + d[a + len(word) :]


def tokens(d: bytes, rng: Generator, _: list[bytes]) -> bytes:
    """A number of a text where another was, or something that is none."""
    found = list(re.finditer(rb"-?\d+\.?\d*(e-?\d+)?", d[:200_000]))
    if not found:
        return d
    words = [b"nan", b"inf", b"-inf", b"1e308", b"-1e308", b"99999999999999999999999", b"-1", b"0", b"", b"abc", b"[]",
             b"{a: 1}",
             b"true", b"null", b"\xc3\x28", b"1e-320", b'"7"', b"- 1", b"1_000", b"0x10", b".", b"'"]  # fmt: skip
    for m in sorted(rng.choice(np.arange(len(found)), min(len(found), int(rng.integers(1, 4))), replace=False))[::-1]:
        a, b = found[int(m)].span()
        d = d[:a] + words[int(rng.integers(len(words)))] + d[b:]
    return d


def keys(d: bytes, rng: Generator, _: list[bytes]) -> bytes:
    """A key of a text written a little wrong, twice, in the words of another language, or with a value of another
    kind."""
    found = list(re.finditer(rb'([A-Za-z_]\w*)("?\s*:[ \n])', d[:200_000]))
    if not found:
        return d
    a, b = found[int(rng.integers(len(found)))].span(1)
    key, at = d[a:b], int(rng.integers(b - a))
    near = [
        key[:at] + key[at + 1 :],
        key[:at] + b"q" + key[at:],
        key.upper(),
        key + b"s",
        b"\xc3\xa9t\xc3\xa9",
        b"type",
    ]
    new = [
        near[int(rng.integers(6))],
        key + b": 1, " + key,
        key + b": 1\n" + key,
        key + b": [" + key,
        key + b": {x: 1, y",
    ]
    return d[:a] + new[int(rng.choice(5, p=[0.6, 0.1, 0.1, 0.1, 0.1]))] + d[b:]


def lines(d: bytes, rng: Generator, _: list[bytes]) -> bytes:
    """Lines in another order, twice, without some of their words, or gone."""
    rows = d.split(b"\n")
    what = int(rng.integers(4))
    if what == 0:
        rows = [rows[int(k)] for k in rng.permutation(len(rows))]
    elif what == 1:
        rows = [r for r in rows for _k in range(1 + int(rng.random() < 0.3))]
    elif what == 2:
        rows = [r for r in rows if rng.random() < 0.7]
    else:
        rows = [r[: int(rng.integers(len(r) + 1))] if rng.random() < 0.2 else r for r in rows]
    return b"\n".join(rows)


def blocks(d: bytes, rng: Generator, _: list[bytes]) -> bytes:
    """Stretches in another order or twice."""
    edges = sorted({0, len(d), *rng.integers(0, len(d) + 1, 5).tolist()})
    parts = [d[a:b] for a, b in pairwise(edges)]
    return b"".join(parts[int(k)] for k in rng.integers(0, len(parts), len(parts) + 1)) if parts else d


def huge(d: bytes, rng: Generator, _: list[bytes]) -> bytes:
    return d * int(rng.integers(2, 30)) if len(d) < 50_000 else d + d[: len(d) // 2]


def empty(d: bytes, rng: Generator, _: list[bytes]) -> bytes:
    return [b"", b"\n", b"\0" * 100, b" ", b"{}", b"[]", b"\xef\xbb\xbf", b"\xff\xfe\0"][int(rng.integers(8))]


def another(d: bytes, rng: Generator, others: list[bytes]) -> bytes:
    """The content of another kind of file, whole or behind the beginning of this one."""
    o = others[int(rng.integers(len(others)))]
    return o if rng.random() < 0.6 else d[: int(rng.integers(len(d) + 1))] + o


WAYS: dict[str, Callable[[bytes, Generator, list[bytes]], bytes]] = {
    "cut": cut, "headless": headless, "bits flipped": flipped, "overwritten": overwritten, "NaN, huge": numbers,
    "wrong words": tokens, "wrong keys": keys, "reordered lines": lines, "reordered stretches": blocks,
    "repeated": huge, "empty": empty, "wrong kind": another,
}  # fmt: skip


def mapped(path: Path) -> EventLog:
    return read_log(path, mapping=path.with_name("m.yaml"))


def fed(path: Path) -> object:
    feed = AlertFile(path, start=0)
    try:
        return feed.due(10**18)
    finally:
        feed.close()


def seeds() -> dict[str, Seed]:
    """One of every kind."""
    mapping = b"time: {column: t}\nstreams:\n  imu: {kind: IMU, columns: {gyro_x: a, gyro_y: b, gyro_z: c}}\n"
    table = "t,a,b,c\n" + "".join(f"{0.1 * k},{k},0.5,{-k}\n" for k in range(40))
    named = {"t": np.arange(20.0), "a": np.ones(20), "b": np.ones(20), "c": np.arange(20.0)}
    npz, mat, npy, image = (io.BytesIO() for _ in range(4))
    np.savez(npz, **named)
    scipy.io.savemat(mat, named)
    np.save(npy, np.column_stack(list(named.values())))
    Image.fromarray(np.random.default_rng(1).integers(0, 255, (20, 30)).astype(np.uint8)).save(image, format="PNG")
    by_column = mapping.replace(b"column: t", b'column: "[0]"')
    by_column = by_column.replace(b"gyro_x: a, gyro_y: b, gyro_z: c", b'gyro_x: "[1]", gyro_y: "[2]", gyro_z: "[3]"')
    own = "t_ns,x,y,z,qx,qy,qz,qw\n" + "".join(f"{10**17 + k * 10**8},{k},0.5,0,0,0,0,1\n" for k in range(20))
    with TemporaryDirectory() as folder:
        write_recording(wheeled_log(1, 3.0)[0], Path(folder) / "a.mcap")
        mcap = (Path(folder) / "a.mcap").read_bytes()
    tum = "".join(f"{100 + 0.1 * k} {k} 0 0 0 0 0 1\n" for k in range(30)).encode()
    kitti = "".join(f"1 0 0 {k} 0 1 0 0 0 0 1 0\n" for k in range(20)).encode()
    ekf = (
        b"ekf:\n  ros__parameters:\n    frequency: 30.0\n    two_d_mode: true\n    odom0: /wheels\n    odom0_config: ["
    )
    ekf += b", ".join([b"true", b"false"] * 7 + [b"true"]) + b"]\n    odom0_twist_rejection_threshold: 2.5\n"
    fuse = b"seed: 3\nmounts: {imu: {rpy_deg: [0, 0, 90]}}\nsources:\n  /gnss: {delay_s: 0.1, sigma: [1, 1, 2]}\n"
    fuse += b"withhold: {/gnss: 5}\nbeacons:\n  - {id: 1, xyz_m: [0, 1, 2]}\noutages_s: {/gnss: [[1, 5]]}\n"
    graph = {"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": {"id": k, "frame": "map"},
         "geometry": {"type": "Point", "coordinates": [k, 0]}}
        for k in range(3)
    ] + [{"type": "Feature", "properties": {"id": 5, "startid": 0, "endid": 1},
          "geometry": {"type": "MultiLineString", "coordinates": [[[0, 0], [1, 0]]]}}]}  # fmt: skip
    lonlat: dict[str, Any] = {"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": {"highway": "service", "width": 4},
         "geometry": {"type": "LineString", "coordinates": [[13.35, 52.51], [13.351, 52.511]]}}]}  # fmt: skip
    arena = b"type octile\nheight 3\nwidth 4\nmap\n....\n.@@.\n....\n"
    scen = b"version 1\n" + b"".join(b"0\tarena.map\t4\t3\t0\t0\t%d\t2\t%d.0\n" % (k, k + 2) for k in range(3))
    yaml = b"image: x.png\nresolution: 0.1\norigin: [0, 0, 0.1]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    points = b"points:\n" + b"".join(
        b"  - {pixel: [%d, %d], metres: [%d, %d]}\n" % (u, v, u, -v) for u, v in ((0, 0), (20, 0), (20, 15), (0, 15))
    )
    alerts = b"".join(json.dumps({"t": k, "x": 1.0, "y": 2.0, "id": f"a{k}"}).encode() + b"\n" for k in range(5))
    state = (
        "Timestamp," + ",".join(f"state[{k}]" for k in range(24)) + "," + ",".join(f"variance[{k}]" for k in range(24))
    )
    state += "\n" + "".join(f"{100000 * k}," + ",".join(["0.1"] * 48) + "\n" for k in range(10))
    beacons = [other_logs.beacon(p) for p in other_logs.drone_flight()]
    return {
        "ulog": Seed("x.ulg", flight_logs.ulog(), read_log),
        "ulog, old": Seed("x.ulg", flight_logs.ulog(old=True), read_log),
        "tlog": Seed("x.tlog", flight_logs.tlog(), read_log),
        "dataflash": Seed("x.bin", flight_logs.dataflash(), read_log),
        "ekf2 replay": Seed("x.csv", flight_logs.replay(), read_log), "mcap": Seed("x.mcap", mcap, read_log),
        "nmea": Seed("x.nmea", gnss_logs.nmea(), read_log), "ubx": Seed("x.ubx", gnss_logs.ubx(), read_log),
        "nmea and ubx": Seed("x.log", gnss_logs.mixed(), read_log), "rtklib": Seed("x.pos", gnss_logs.pos(), read_log),
        "remote id": Seed("x.pcap", other_logs.remote_id(), read_log),
        "remote id, pcapng": Seed("x.pcapng", other_logs.pcapng(beacons), read_log),
        "carmen": Seed("x.clf", other_logs.carmen(), read_log),
        "carmen, packed": Seed("x.clf.bz2", bz2.compress(other_logs.carmen()), read_log),
        "csv": Seed("x.csv", table.encode(), mapped, {"m.yaml": mapping}),
        "mapping": Seed("m.yaml", mapping, lambda p: mapped(p.with_name("x.csv")), {"x.csv": table.encode()}),
        "npz": Seed("x.npz", npz.getvalue(), mapped, {"m.yaml": mapping}),
        "mat": Seed("x.mat", mat.getvalue(), mapped, {"m.yaml": mapping}),
        "npy": Seed("x.npy", npy.getvalue(), mapped, {"m.yaml": by_column}),
        "table": Seed("x.csv", own.encode(), read_trajectory),
        "tum": Seed("x.tum", tum, read_trajectory),
        "kitti poses": Seed("x.txt", kitti, read_trajectory, {"times.txt": b"".join(b"%d.5\n" % k for k in range(20))}),
        "ekf2 states": Seed("x.csv", state.encode(), read_change_indication),
        "configuration": Seed("x.yaml", fuse, load_config), "robot_localization": Seed("x.yaml", ekf, read_upstream),
        "site": Seed("x.yaml", (ROOT / "examples/06_map_a_site.yaml").read_bytes(), read_site),
        "site, GeoJSON": Seed("x.geojson", json.dumps(lonlat).encode(), read_site),
        "scenario": Seed("x.yaml", (ROOT / "examples/04_simulate.yaml").read_bytes(), lambda p: load_scenario(str(p))),
        "route graph": Seed("x.geojson", json.dumps(graph).encode(), read_route_graph),
        "map": Seed("x.yaml", yaml, read_map, {"x.png": image.getvalue()}),
        "map image": Seed("x.png", image.getvalue(), lambda p: read_map(p.with_name("x.yaml")),
                          {"x.yaml": yaml}),
        "control points": Seed("p.yaml", points, lambda p: read_referenced(p.with_name("x.png"), p),
                               {"x.png": image.getvalue()}),
        "moving ai map": Seed("x.map", arena, read_moving_ai_map),
        "moving ai cases": Seed("x.scen", scen, read_moving_ai_scenarios),
        "alerts": Seed("x.jsonl", alerts, fed),
    }  # fmt: skip


@contextmanager
def limited(seconds: float = CAP_S) -> Iterator[None]:
    """Not longer than so many seconds of processor time, nor ten times as long if it waits."""

    def late(*_: object) -> None:
        raise HangError

    timers = {signal.SIGPROF: (signal.ITIMER_PROF, seconds), signal.SIGALRM: (signal.ITIMER_REAL, 10.0 * seconds)}
    before = {number: signal.signal(number, late) for number in timers}
    try:
        for timer, limit in timers.values():
            signal.setitimer(timer, limit)
        yield
    finally:
        for number, (timer, _) in timers.items():
            signal.setitimer(timer, 0.0)
            signal.signal(number, before[number])


def attempt(seed: Seed, data: bytes, folder: Path) -> str:
    """`read`, `refused`, or what went wrong."""
    for name, content in seed.beside.items():
        (folder / name).write_bytes(content)
    path = folder / seed.file
    path.write_bytes(data)
    try:
        with limited(), warnings.catch_warnings():
            warnings.simplefilter("error")
            got = seed.read(path)
    except OutriderError as e:
        line = str(e)
        return "refused" if line.strip() and "\n" not in line and len(line) < 2000 else f"no clear line: {line[:300]!r}"
    except HangError:
        return "hangs"
    except Exception as e:
        return f"{type(e).__name__}: {e}"[:300]
    return sound(got)


def sound(got: object) -> str:
    """`read` unless what was read holds what must not be in it."""
    if isinstance(got, EventLog):
        if not len(got):
            return "an empty log"
        if any(len(s) != len(s.t) or s.t.dtype != np.int64 for s in got):
            return "columns of unequal length"
    if isinstance(got, Trajectory) and not np.isfinite(got.p).all():
        return "NaN among positions"
    return "read"
