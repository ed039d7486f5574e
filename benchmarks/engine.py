"""The whole engine: screening aside, everything that `fuse` does per event, on generated flights and drives."""

from functools import cache

import numpy as np

from benchmarks.table import Row, Side
from outrider.data import Kind
from outrider.filters import step as one
from outrider.filters.align import align
from outrider.filters.engine import OnlineFilter, new_track, queue, run_events
from outrider.filters.step import OUT_SIZE
from outrider.sim import drone_log, wheeled_log
from outrider.workflows.config import FuseConfig
from outrider.workflows.discover import plan
from outrider.workflows.fuse import before_start, channel_records, first_stamp, fuse

SECONDS = 20.0
FLIGHT = 600.0


@cache
def prepared(kind):
    """A generated log as events, with its filter and prior."""
    log, _ = drone_log(3, duration_s=SECONDS) if kind == "drone" else wheeled_log(3, duration_s=SECONDS)
    cfg = FuseConfig()
    chosen = plan(log, cfg)
    start = first_stamp(chosen)
    q = queue(channel_records(chosen, chosen.whole, cfg, start), start, cfg.history_s)
    aligned = align(chosen.whole, q, chosen.spread)
    before_start(q, aligned.t_start)
    imu = sum(len(s) for s in log.of(Kind.IMU))
    return chosen.whole, aligned, q.events(0, len(q)), imu


def batch(kind):
    """The compiled loop over the whole log; per epoch of the IMU."""

    def run(_):
        f, aligned, ev, _ = prepared(kind)
        s = one.state(aligned.prior.x, aligned.prior.P, aligned.t_start, len(f.channels))
        ws = one.scratch(f.layout.size, f.layout.error_size)
        out, track = np.zeros((ev.t.size, OUT_SIZE)), new_track(ev.t.size, f.layout)
        run_events(f.model(), f.sources(), s, ev, ws, out, 1e9, np.array([0.0]), track)
        return s.x.copy()

    return run


def online(kind):
    """One event at a time, in order."""

    def run(events):
        f, aligned, ev, _ = prepared(kind)
        driver = OnlineFilter(f, aligned.prior, aligned.t_start)
        for i in range(min(events, ev.t.size)):
            driver.process(float(ev.t[i]), int(ev.src[i]), ev.z[i], ev.r[i], flag=int(ev.flag[i]), order=i)
        return driver.state.x.copy()

    return run


def whole_job(seconds):
    """`fuse` from a log in memory to a `Run`, innovations and findings included."""
    run = fuse(flight(), FuseConfig())
    assert run.fused.t.size > seconds
    return run.fused.x[-1].copy()


@cache
def flight():
    """Ten minutes of a drone with a 200 Hz IMU."""
    return drone_log(3, duration_s=FLIGHT)[0]


def filterpy_ins(events):
    """A 21-state KalmanFilter of filterpy with F given: one predict per epoch, a 3-row update every twentieth."""
    from filterpy.kalman import KalmanFilter

    kf = KalmanFilter(dim_x=21, dim_z=3)
    kf.F = np.eye(21)
    kf.F[:3, 3:6] = 0.005 * np.eye(3)
    kf.H = np.eye(3, 21)
    kf.Q *= 1e-4
    for i in range(events):
        kf.predict()
        if i % 20 == 0:
            kf.update(np.zeros(3))
    return np.append(kf.x[:, 0], 0.0)  # our state has a quaternion, one number more


def rows():
    """Rows of this module."""
    *_, epochs = prepared("drone")
    return [
        Row(
            "INS, 21 error states, per IMU epoch with all its GNSS, barometer and compass updates",
            Side("engine, compiled loop", batch("drone"), epochs),
            [Side("filterpy KalmanFilter 21/3, F given, GNSS only", filterpy_ins, 2000)],
            target=5.0,
            tolerance=None,
        ),
        Row(
            "online driver, drone, per event",
            Side("OnlineFilter", online("drone"), 2000),
            target=100.0,
            tolerance=None,
        ),
        Row(
            "online driver, wheeled robot, per event",
            Side("OnlineFilter", online("wheeled"), 2000),
            target=100.0,
            tolerance=None,
        ),
        Row(
            "`fuse` of a 200 Hz flight, per second of the log (5000 us are 200 times real time)",
            Side("fuse", whole_job, int(FLIGHT)),
            target=5000.0,
            tolerance=None,
        ),
    ]
