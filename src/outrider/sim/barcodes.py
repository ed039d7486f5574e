"""Robots in a room that see barcodes on landmarks and on one another: what each logs, and where it really was.

The sizes are those of the UTIAS data sets of cooperative localisation (Leung et al., IJRR 2011): five robots, fifteen
landmarks, 15 m x 8 m, commands at 67 Hz as odometry, range and bearing of barcodes at about 4 Hz. Robots do not avoid
one another.
"""

from dataclasses import dataclass
from math import cos, hypot, pi, sin
from typing import Final, final

import numpy as np
from numpy.random import Generator

from outrider.core.angles import wrap, wrap_all
from outrider.core.attitudes import rpy_to_quats
from outrider.data import EventLog, Kind, Stream, Trajectory, stream
from outrider.errors import ConfigError
from outrider.sim.noise import generator
from outrider.typing import Floats, Ints

EPOCH: Final = 1_248_272_273_000_000_000  # ns
STEP: Final = 0.1  # s, how long a command holds
UNKNOWN: Final = 99  # a barcode of nobody


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BarcodeTeam:
    """What is simulated. Noise is white; scales, curvature and walks of odometry as `OdometricRobot` has them.

    seers : how many robots see landmarks, from the first on;  shown : how many landmarks can be seen at all
    misread : share of barcodes read as another's or as nobody's;  liar : a robot that reads all of them wrongly
    """

    robots: int = 5
    landmarks: int = 15
    duration_s: float = 900.0
    room: tuple[float, float] = (15.0, 8.0)  # m
    seers: int = 5
    shown: int = 15
    speed: float = 0.16  # m/s
    odometry_hz: float = 67.0
    camera_hz: float = 4.3
    truth_hz: float = 20.0
    sigma_range: float = 0.12  # m
    sigma_bearing: float = 0.5 * pi / 180.0  # rad
    reach: float = 6.0  # m
    half_view: float = 0.55  # rad
    seen: float = 0.7  # share of what could be seen
    misread: float = 0.01
    liar: int = 0
    speed_scale: float = 0.03
    turn_scale: float = 0.05
    curvature: float = 0.02  # 1/m
    distance_walk: float = 0.04  # m per sqrt(m)
    side_walk: float = 0.025  # m per sqrt(m)
    turn_walk: float = 0.08  # rad per sqrt(rad)
    heading_walk: float = 0.045  # rad per sqrt(m)

    def __post_init__(self) -> None:
        if not (1 <= self.robots <= 20 and 0 <= self.landmarks <= 60 and self.duration_s >= 1.0):
            fix = "1 to 20 robots, up to 60 landmarks, 1 s or more"
            raise ConfigError("cannot be simulated", where="team of barcodes", fix=fix)


@final
@dataclass(frozen=True, slots=True)
class Drive:
    """Commands of one robot and what came of them. t : (n,) s;  v, w : commands from there on;  pose : (n, 3)."""

    t: Floats
    v: Floats
    w: Floats
    pose: Floats

    def at(self, t: Floats) -> Floats:
        """(k, 3) pose between: steps are short."""
        x, y = (np.interp(t, self.t, self.pose[:, i]) for i in range(2))
        return np.column_stack([x, y, np.interp(t, self.t, np.unwrap(self.pose[:, 2]))])


def barcode_log(team: BarcodeTeam, seed: int) -> tuple[EventLog, dict[str, Trajectory]]:
    """The log of everybody, as `outrider.io.mrclam` reads it (without ground truth), and the truth of everybody."""
    names = [f"robot{i + 1}" for i in range(team.robots)]
    places = _landmarks(team, generator(seed, "room", "landmarks"))
    drives = [_drive(team, generator(seed, n, "drive")) for n in names]
    streams: list[Stream] = []
    truth: dict[str, Trajectory] = {}
    for i, name in enumerate(names):
        rng = generator(seed, name, "logs")
        begin = float(rng.uniform(0.0, 4.0))
        streams += [_odometry(team, drives[i], name, begin, rng), _measurements(team, i, drives, places, begin, seed)]
        truth[name] = _truth(team, drives[i], name, rng)
    marks = {float(team.robots + 1 + k): (float(p[0]), float(p[1]), 0.0) for k, p in enumerate(places)}
    ids = {name: i + 1 for i, name in enumerate(names)}
    return EventLog(streams={s.name: s for s in streams}, path="", ids=ids, beacons=marks), truth


def _landmarks(team: BarcodeTeam, rng: Generator) -> Floats:
    """Spread over the room: each as far as possible from those before, of some draws."""
    out = np.zeros((0, 2))
    for _ in range(team.landmarks):
        draws = rng.uniform((0.5, 0.5), (team.room[0] - 0.5, team.room[1] - 0.5), (12, 2))
        away = np.linalg.norm(draws[:, None] - out[None], axis=2).min(axis=1, initial=1e9)
        out = np.vstack([out, draws[np.argmax(away)]])
    return out


def _drive(team: BarcodeTeam, rng: Generator) -> Drive:
    """From waypoint to waypoint: turn, drive, now and then wait."""
    n = int(np.ceil(team.duration_s / STEP)) + 1
    noise = rng.standard_normal((n, 4)).tolist()
    s_v, s_w, bend = (rng.standard_normal(3) * [team.speed_scale, team.turn_scale, team.curvature]).tolist()
    x, y, a = float(rng.uniform(1, team.room[0] - 1)), float(rng.uniform(1, team.room[1] - 1)), rng.uniform(-pi, pi)
    goal, wait = (x, y), 3.0
    rows: list[tuple[float, float, float, float, float]] = []
    for along, across, turned, heading in noise:
        v = w = 0.0
        if wait > 0.0:
            wait -= STEP
        elif hypot(goal[0] - x, goal[1] - y) < 0.3:
            goal = (float(rng.uniform(1, team.room[0] - 1)), float(rng.uniform(1, team.room[1] - 1)))
            wait = float(rng.uniform(3.0, 15.0)) if rng.uniform() < 0.2 else 0.0
        else:
            off = wrap(np.arctan2(goal[1] - y, goal[0] - x) - a)
            v = team.speed if abs(off) < 0.3 else 0.067
            w = 0.398 * max(-1.0, min(1.0, 2.0 * off)) if abs(off) > 0.1 else 0.0
        rows.append((v, w, x, y, a))
        step = (1.0 + s_v) * v * STEP
        bow = (1.0 + s_w) * w * STEP + bend * step
        turn = bow + team.turn_walk * abs(bow) ** 0.5 * turned + team.heading_walk * step**0.5 * heading
        ahead, aside = step + team.distance_walk * step**0.5 * along, team.side_walk * step**0.5 * across
        c, s = cos(a + 0.5 * turn), sin(a + 0.5 * turn)
        x, y, a = x + c * ahead - s * aside, y + s * ahead + c * aside, wrap(a + turn)
    all_rows = np.array(rows)
    return Drive(STEP * np.arange(n, dtype=np.float64), all_rows[:, 0], all_rows[:, 1], all_rows[:, 2:])


def _stamps(hz: float, begin: float, end: float, rng: Generator) -> Floats:
    """Irregular, to the millisecond."""
    gaps = rng.uniform(0.4, 1.6, int((end - begin) * hz * 1.1) + 10) / hz
    t = begin + np.cumsum(gaps)
    return np.round(t[t < end], 3)


def _ns(t: Floats) -> Ints:
    return EPOCH + np.round(t * 1e3).astype(np.int64) * 1_000_000


def _odometry(team: BarcodeTeam, d: Drive, name: str, begin: float, rng: Generator) -> Stream:
    """The command in force, with a second missing now and then, while the robot goes on."""
    t = _stamps(team.odometry_hz, begin, team.duration_s, rng)
    for gap in rng.uniform(0.0, team.duration_s, int(team.duration_s / 300.0)):
        t = t[(t < gap) | (t > gap + 1.0)]
    k = np.searchsorted(d.t, t, side="right") - 1
    z = np.full((t.size, 6), np.nan)
    z[:, 0], z[:, 1], z[:, 5] = np.round(d.v[k], 3), 0.0, np.round(d.w[k], 3)
    return stream(f"{name}/odometry", Kind.TWIST, _ns(t), z, robot=name)


def _measurements(team: BarcodeTeam, who: int, drives: list[Drive], places: Floats, begin: float, seed: int) -> Stream:
    """Every barcode in view of a frame, the same frame twice now and then."""
    name = f"robot{who + 1}"
    rng = generator(seed, name, "camera")
    t = _stamps(team.camera_hz, begin + 1.5, team.duration_s, rng)
    own = drives[who].at(t)
    rows: list[Floats] = []
    for subject in range(1, team.robots + team.landmarks + 1):
        k = subject - team.robots - 1
        if subject == who + 1 or (k >= 0 and (who >= team.seers or k >= team.shown)):
            continue
        other = drives[subject - 1].at(t)[:, :2] if k < 0 else np.tile(places[k], (t.size, 1))
        d = other - own[:, :2]
        r, b = np.hypot(*d.T), wrap_all(np.arctan2(d[:, 1], d[:, 0]) - own[:, 2])
        view = (r > 0.3) & (r < team.reach) & (np.abs(b) < team.half_view) & (rng.uniform(size=t.size) < team.seen)
        draws = rng.standard_normal((t.size, 2)) * [team.sigma_range, team.sigma_bearing]
        z = np.column_stack([t, np.full(t.size, subject), np.maximum(r + draws[:, 0], 0.1), b + draws[:, 1]])
        rows.append(z[view])
    z = np.vstack(rows)
    z = z[np.argsort(z[:, 0], kind="stable")]
    wrong = rng.uniform(size=len(z)) < (1.0 if team.liar == who + 1 else team.misread)
    others = rng.integers(1, team.robots + team.landmarks + 1, len(z)).astype(np.float64)
    z[wrong, 1] = np.where(rng.uniform(size=len(z)) < 0.5, others, -UNKNOWN)[wrong]
    again = z[rng.uniform(size=len(z)) < 0.01]
    again[:, 0] += 0.15
    z = np.vstack([z, again])
    z = z[np.argsort(z[:, 0], kind="stable")]
    z[:, 2:] = np.round(z[:, 2:], 3)
    return stream(f"{name}/measurement", Kind.RANGE_BEARING, _ns(z[:, 0]), z[:, 1:], robot=name)


def _truth(team: BarcodeTeam, d: Drive, name: str, rng: Generator) -> Trajectory:
    """Poses, but for some seconds in which the cameras lost the robot."""
    t = np.arange(0.0, team.duration_s, 1.0 / team.truth_hz)
    lost = float(rng.uniform(0.0, team.duration_s))
    t = t[(t < lost) | (t > lost + 5.0)]
    pose = d.at(t)
    flat = np.zeros(t.size)
    q = rpy_to_quats(np.column_stack([flat, flat, pose[:, 2]]))
    return Trajectory(t=_ns(t), p=np.column_stack([pose[:, :2], flat]), q=q, name=name)
