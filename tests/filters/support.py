"""What the tests of the engine share: filters for the simulated robots, their records, and runs of both drivers."""

from dataclasses import replace

import numpy as np

from outrider._kernel import enabled
from outrider.data import EventLog, Gaussian, StateLayout
from outrider.filters.channels import Channel, Records, records
from outrider.filters.engine import Events, Filter, OnlineFilter, Queue, Track, queue, run_batch
from outrider.filters.screen import screen
from outrider.filters.step import State
from outrider.models.motion import LAYOUTS, Motion, PlanarRobot, StrapdownIns
from outrider.models.sensors import Sensor, SensorModel
from outrider.models.sensors.gnss import GnssPosition, GnssVelocity
from outrider.models.sensors.ground import Baro
from outrider.models.sensors.inertial import Gyro
from outrider.models.sensors.layout import Mount
from outrider.models.sensors.wheels import Twist
from outrider.sim.logs import ANTENNA
from outrider.sim.truth import SITE
from outrider.typing import Floats

AT_ANTENNA = Mount(lever_arm=ANTENNA)
COMPILED = enabled()


def channel(name: str, model: SensorModel | None, *, use: tuple[int, ...] | None = None, **changes) -> Channel:
    """A channel of the stream `name` with the model's own sigmas; `use` are the rows that are fused."""
    sigma = np.ones(6) if model is None else model.sigmas()
    rows = np.ones(sigma.size, np.bool_)
    if use is not None:
        rows[:] = False
        rows[list(use)] = True
    basis = Channel(
        name=name,
        stream=name,
        sensor=None if model is None else model.code,
        theta=Mount().theta() if model is None else model.theta(),
        sigma=sigma,
        floor=np.zeros(sigma.size),
        rows=rows,
    )
    return replace(basis, **changes)


def rover(**changes) -> Filter:
    """GNSS, wheels and gyro on the planar model; changes are those of `Filter`."""
    model = PlanarRobot(acceleration=0.5, yaw_acceleration=0.5)
    channels = (
        channel("gnss", GnssPosition(mount=AT_ANTENNA), use=(0, 1), reset=(0, 2)),
        channel("wheels", Twist(), use=(0, 5)),
        channel("imu", Gyro(), use=(2,)),
    )
    basis = Filter(motion=Motion.PLANAR, theta=model.theta(), coasting=model.theta(), channels=channels)
    return replace(basis, **changes)


def drone(**changes) -> Filter:
    """IMU, GNSS with velocity and barometer on the strapdown model."""
    model = StrapdownIns(gravity=9.806)
    coasting = replace(model, gyro_noise=0.3, accel_noise=2.0).theta()
    channels = (
        channel("imu", None),
        channel("gnss", GnssPosition(mount=AT_ANTENNA), reset=(0, 3)),
        channel("gnss_velocity", GnssVelocity(mount=AT_ANTENNA)),
        channel("baro", Baro()),
    )
    basis = Filter(motion=Motion.STRAPDOWN, theta=model.theta(), coasting=coasting, channels=channels)
    return replace(basis, **changes)


def parts(f: Filter, log: EventLog) -> list[Records]:
    """Screened records of every channel."""
    verdicts = {s.name: screen(s) for s in log}
    return [records(c, log.streams[c.stream], verdicts[c.stream], SITE) for c in f.channels]


def queued(f: Filter, log: EventLog) -> Queue:
    """The events of a log, in order."""
    return queue(parts(f, log), log.span[0], f.history)


def prior(layout: StateLayout, sd: float = 1.0, x: Floats | None = None, **blocks: float) -> Gaussian:
    """A belief with one standard deviation for all but the named blocks."""
    sigma = np.full(layout.error_size, sd)
    for name, value in blocks.items():
        sigma[layout.error(name)] = value
    return Gaussian(layout.zeros() if x is None else x, np.diag(sigma**2), layout)


def start(f: Filter) -> Gaussian:
    """A prior near the start of the simulated robots, which stand at the origin and look east."""
    small = {"heading": 0.1, "attitude": 0.1, "gyro_bias": 0.01, "accel_bias": 0.1, "wheel_scale": 0.03}
    zero = {"gnss_bias": 0.0, "range_bias": 0.0, "wind": 0.0, "baro_bias": 1000.0}
    blocks = {name: value for name, value in (small | zero).items() if name in LAYOUTS[f.motion]}
    return prior(LAYOUTS[f.motion], 0.5, **blocks)


class Collected:
    """A sink that keeps everything."""

    def __init__(self) -> None:
        self.events: list[Events] = []
        self.out: list[Floats] = []
        self.track: list[Track] = []

    def __call__(self, first: int, ev: Events, out: Floats, track: Track) -> None:
        self.events.append(ev)
        self.out.append(out.copy())
        self.track.append(Track(*(a.copy() for a in track)))

    def outcomes(self) -> Floats:
        """(n, OUT_SIZE) of all events."""
        return np.concatenate(self.out)

    def tracked(self) -> Track:
        """All estimates in one."""
        return Track(*(np.concatenate(columns) for columns in zip(*self.track, strict=True)))


def batch(f: Filter, q: Queue, belief: Gaussian | None = None, **options) -> tuple[State, Collected]:
    """The compiled driver over a whole queue."""
    sink = Collected()
    return run_batch(f, belief or start(f), options.pop("t_start", 0.0), q, sink, **options), sink


def arrivals(q: Queue) -> np.ndarray:
    """Positions in the queue, in the order in which the records arrived."""
    n = np.arange(len(q))
    arrival = np.zeros(n.size, np.int64)
    for c, part in enumerate(q.parts):
        here = q.src == c
        arrival[here] = part.t_arrival[q.index[here]]
    return np.lexsort((n, q.t, arrival))


def online(f: Filter, q: Queue, belief: Gaussian | None = None) -> tuple[OnlineFilter, Floats]:
    """The online driver, fed in order of arrival; outcomes as first returned, in that order."""
    filter_ = OnlineFilter(f, belief or start(f), 0.0)
    out = np.array([feed(filter_, q, i) for i in arrivals(q)])
    return filter_, out


def feed(filter_: OnlineFilter, q: Queue, i: int) -> Floats:
    """Give the online driver event i of a queue."""
    part, row = q.parts[q.src[i]], q.index[i]
    t = (part.t[row] - q.t0) * 1e-9
    return filter_.process(
        float(t), int(q.src[i]), part.z[row], part.r[row], flag=int(part.flag[row]), order=int(row)
    ).copy()


def same(a: State, b: State) -> bool:
    """Whether two states agree in every bit."""
    return all(x.tobytes() == y.tobytes() for x, y in zip(a, b, strict=True))


def sensor_of(f: Filter, src: int) -> Sensor | None:
    """The sensor of a channel."""
    return f.channels[src].sensor


def scattered(log: EventLog) -> EventLog:
    """The same log with every stream but the IMU a few milliseconds later, so that no two stamps coincide."""
    offsets = {s.name: 1_300_000 * (i + 1) for i, s in enumerate(log) if s.name != "imu"}
    return log.with_streams(*(replace(s, t=s.t + offsets.get(s.name, 0)) for s in log))


def delayed(log: EventLog, seconds: Floats | float, seed: int = 0) -> EventLog:
    """Arrivals later by up to `seconds` each, or by exactly as much where a negative number is given."""
    rng = np.random.default_rng(seed)
    streams = []
    for s in log:
        wait = np.full(len(s), -seconds) if seconds < 0.0 else rng.uniform(0.0, seconds, len(s))
        arrival = s.t + np.rint(wait * 1e9).astype(np.int64)
        order = np.argsort(arrival, kind="stable")
        streams.append(replace(s, t_arrival=arrival).select(order))
    return log.with_streams(*streams)
