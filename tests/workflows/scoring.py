"""Runs against what really happened, for the tests of the main job."""

from dataclasses import dataclass, replace

import numpy as np

from outrider.core.angles import wrap_all
from outrider.core.geodesy import geodetic_to_enu
from outrider.data import EventLog, Finding, Run
from outrider.eval.consistency import chi_square
from outrider.sim import Truth
from outrider.typing import Bools, Floats


@dataclass(frozen=True, slots=True)
class Errors:
    """Estimate minus truth: t (n,) s since the log's start, p, v (n, 3), yaw (n,), P (n, 3, 3)."""

    t: Floats
    p: Floats
    v: Floats
    yaw: Floats
    P: Floats

    def within(self, start: float, end: float) -> Bools:
        return (self.t >= start) & (self.t < end)

    def horizontal(self, start: float = 0.0, end: float = np.inf) -> Floats:
        return np.linalg.norm(self.p[self.within(start, end), :2], axis=1)

    def nees(self, axes: int = 2) -> Floats:
        """(n,) e' P^-1 e, chi-square of `axes` degrees of freedom for a filter that tells the truth about itself."""
        return chi_square(self.p[:, :axes], self.P[:, :axes, :axes])


def errors(run: Run, truth: Truth) -> Errors:
    """Of every output within the truth's span; the truth is carried to the run's datum."""
    pose = run.fused.pose
    inside = (pose.t >= truth.t[0]) & (pose.t <= truth.t[-1])
    there = truth.at(pose.t[inside])
    d, s = run.datum, truth.datum
    origin = np.zeros(3) if d is None else geodetic_to_enu(s.lat, s.lon, s.alt, d.lat, d.lon, d.alt).ravel()
    return Errors(
        t=(pose.t[inside] - run.start) * 1e-9,
        p=pose.p[inside] - there.p - origin,
        v=pose.v[inside] - there.v,
        yaw=wrap_all(pose.yaw[inside] - there.trajectory().yaw),
        P=pose.P[inside][:, :3, :3],
    )


def rms(e: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(e))))


def codes(run: Run) -> set[str]:
    return {f.code for f in run.findings}


def said(run: Run, code: str) -> Finding:
    """The one finding of a code."""
    (finding,) = [f for f in run.findings if f.code == code]
    return finding


def only(log: EventLog, *names: str) -> EventLog:
    return replace(log, streams={name: log.streams[name] for name in names})


def first(log: EventLog, records: int) -> EventLog:
    return replace(log, streams={s.name: s.select(slice(0, records)) for s in log})


def same_bits(a: Run, b: Run) -> bool:
    """Whether two runs agree in every number they hold."""
    pairs = [(a.fused.t, b.fused.t), (a.fused.x, b.fused.x), (a.fused.sd, b.fused.sd), (a.fused.pose.P, b.fused.pose.P)]
    for name in set(a.innovations) | set(b.innovations):
        pairs += [(a.innovations[name].nis, b.innovations[name].nis), (a.innovations[name].y, b.innovations[name].y)]
    return all(x.shape == y.shape and x.tobytes() == y.tobytes() for x, y in pairs)
