"""Collecting what the engine hands out, on disk when it is much: memory stays constant however long the log is."""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import BinaryIO, Final, cast, final

import numpy as np

from outrider.core.attitudes import rpy_to_quats
from outrider.data import Account, Datum, Estimates, Innovations, SensorState, StateLayout, Stream, Trajectory, Verdict
from outrider.filters.channels import Channel, Records
from outrider.filters.engine import Events, Filter, Track
from outrider.filters.step import OUT_DOF, OUT_NIS, OUT_S, OUT_STATE, OUT_VERDICT, OUT_Y
from outrider.models.motion import Motion
from outrider.models.sensors import SPECS
from outrider.typing import Floats, Ints

IN_MEMORY: Final = 1 << 20  # bytes of one column before it goes to disk

POSITION_TIMEOUT: Final = 5.0  # s without any correction of the position
VELOCITY_TIMEOUT: Final = 5.0  # s without any correction of the velocity
RECKONING_LIMIT: Final = 10.0  # m: dead reckoning is still a position while its deviation is below
SPEED_LIMIT: Final = 1.5  # m/s
HEADING_LIMIT: Final = 0.35  # rad
WHEELS_TIMEOUT: Final = 1.0  # s: what counts as dead reckoning by measured velocity


@final
class Spool:
    """One growing array in a temporary file; `array` maps it."""

    def __init__(self, shape: tuple[int, ...], dtype: type = np.float64) -> None:
        self._shape, self._dtype, self._rows = shape, np.dtype(dtype), 0
        self._file = cast("BinaryIO", tempfile.SpooledTemporaryFile(max_size=IN_MEMORY))  # noqa: SIM115

    def __del__(self) -> None:
        self._file.close()  # what `array` has mapped stays mapped

    def append(self, rows: np.ndarray) -> None:
        """Add rows of the spool's shape."""
        self._file.write(np.ascontiguousarray(rows, self._dtype).tobytes())
        self._rows += rows.shape[0]

    def array(self) -> np.ndarray:
        """All rows: in memory while they are few, mapped from the file when they are many."""
        shape = (self._rows, *self._shape)
        self._file.seek(0)
        if not getattr(self._file, "_rolled", True) or self._rows == 0:
            return np.frombuffer(self._file.read(), self._dtype).reshape(shape)
        self._file.flush()
        return np.memmap(self._file, self._dtype, mode="r", shape=shape)  # type: ignore[call-overload]


@final
@dataclass(slots=True)
class Tally:
    """What became of one channel's records."""

    t: Spool
    y: Spool
    s: Spool
    z: Spool
    nis: Spool
    dof: Spool
    verdict: Spool
    rows: Ints
    counts: dict[int, int] = field(default_factory=dict[int, int])
    nis_sum: float = 0.0
    dof_sum: float = 0.0
    states: list[tuple[float, float]] = field(default_factory=list[tuple[float, float]])
    first: float = float("nan")
    last: float = float("nan")


@final
class Collector:
    """A sink for `run_batch`."""

    def __init__(self, f: Filter, t0: int, keep: bool = True) -> None:
        n = f.layout.error_size
        self._f, self._t0, self._keep = f, t0, keep
        self._t = Spool((), np.int64)
        self._x, self._sd, self._age, self._P = (
            Spool((f.layout.size,)),
            Spool((n,)),
            Spool((n,)),
            Spool((9, 9), np.float32),
        )
        self.tallies = [new_tally(c) for c in f.channels]
        self.resets: list[tuple[float, int, Floats]] = []
        self.events = 0

    def __call__(self, first: int, ev: Events, out: Floats, track: Track) -> None:
        self.events += ev.t.size
        self._t.append(self._t0 + np.round(track.t * 1e9).astype(np.int64))
        for spool, rows in ((self._x, track.x), (self._sd, track.sd), (self._age, track.age), (self._P, track.P)):
            spool.append(rows)
        for c, tally in enumerate(self.tallies):
            here = ev.src == c
            if here.any():
                self._count(tally, c, ev.t[here], ev.z[here], out[here])

    def _count(self, tally: Tally, c: int, t: Floats, z: Floats, out: Floats) -> None:
        verdict = out[:, OUT_VERDICT].astype(np.int64)
        for v, count in zip(*np.unique(verdict, return_counts=True), strict=True):
            tally.counts[int(v)] = tally.counts.get(int(v), 0) + int(count)
        tally.first = float(np.fmin(tally.first, t[0]))
        tally.last = float(t[-1])
        change = np.flatnonzero(np.diff(np.concatenate([[-1.0], out[:, OUT_STATE]])))
        for i in change:
            if not tally.states or tally.states[-1][1] != out[i, OUT_STATE]:
                tally.states.append((float(t[i]), float(out[i, OUT_STATE])))
        reset = verdict == Verdict.RESET
        for i in np.flatnonzero(reset):
            moved = out[i, OUT_Y : OUT_Y + self._f.channels[c].reset[1]]
            self.resets.append((float(t[i]), c, np.nan_to_num(moved)))
        scored = out[:, OUT_DOF] > 0
        if not scored.any():
            return
        rows = out[scored]
        fine = np.isfinite(rows[:, OUT_NIS])
        tally.nis_sum += float(rows[fine, OUT_NIS].sum())
        tally.dof_sum += float(rows[fine, OUT_DOF].sum())
        tally.t.append(self._t0 + np.round(t[scored] * 1e9).astype(np.int64))
        tally.y.append(rows[:, OUT_Y + tally.rows])
        tally.s.append(rows[:, OUT_S + tally.rows])
        tally.z.append(z[scored][:, tally.rows])
        tally.nis.append(rows[:, OUT_NIS])
        tally.dof.append(rows[:, OUT_DOF].astype(np.int64))
        tally.verdict.append(verdict[scored])

    def estimates(self, datum: Datum | None = None) -> Estimates:
        """Everything written so far as the filter's output; `datum` ties its poses to the Earth."""
        layout, t = self._f.layout, self._t.array()
        x, sd, age, P = self._x.array(), self._sd.array(), self._age.array(), self._P.array()
        return Estimates(
            layout=layout,
            t=t,
            x=x,
            sd=sd,
            valid=validity(layout, x, sd, age),
            pose=replace(poses(self._f.motion, layout, t, x, P, sd, age), datum=datum),
        )

    def innovations(self) -> dict[str, Innovations]:
        """By channel name; only channels that scored something."""
        out: dict[str, Innovations] = {}
        for channel, tally in zip(self._f.channels, self.tallies, strict=True):
            if channel.sensor is None or not tally.dof_sum:
                continue
            names, units = SPECS[channel.sensor].names, SPECS[channel.sensor].units
            out[channel.name] = Innovations(
                t=tally.t.array(),
                y=tally.y.array(),
                s=tally.s.array(),
                nis=tally.nis.array(),
                dof=tally.dof.array(),
                verdict=tally.verdict.array(),
                z=tally.z.array(),
                columns=tuple(names[i] for i in tally.rows),
                units=tuple(units[i] for i in tally.rows),
            )
        return out


def new_tally(c: Channel) -> Tally:
    """An empty tally for a channel."""
    rows = np.flatnonzero(c.rows).astype(np.int64)
    m = (rows.size,)
    ints = (Spool((), np.int64) for _ in range(3))
    return Tally(next(ints), Spool(m), Spool(m), Spool(m), Spool(()), next(ints), next(ints), rows)


def poses(motion: Motion, layout: StateLayout, t: Ints, x: Floats, P: Floats, sd: Floats, age: Floats) -> Trajectory:
    """Poses, velocities and covariances of the body from filter states."""
    n = t.size
    p, q, v = np.zeros((n, 3)), np.zeros((n, 4)), np.zeros((n, 3))
    pos = x[:, layout.state("position")]
    p[:, : pos.shape[1]] = pos
    vel = x[:, layout.state("velocity")]
    if motion is Motion.PLANAR:
        yaw = x[:, layout.state("heading")][:, 0]
        q = rpy_to_quats(np.stack([np.zeros(n), np.zeros(n), yaw], axis=1)).reshape(n, 4)
        c, s = np.cos(yaw), np.sin(yaw)
        v[:, 0], v[:, 1] = c * vel[:, 0] - s * vel[:, 1], s * vel[:, 0] + c * vel[:, 1]
    elif motion is Motion.FOLLOWER:
        q[:] = np.nan
        v[:] = vel
    else:
        q[:] = x[:, layout.state("attitude")]
        v[:] = vel if motion is Motion.STRAPDOWN else turned(q, vel)
    pose = [0, 1, 2, 6, 7, 8]
    covariance = P[:, pose][:, :, pose].astype(np.float64)
    return Trajectory(t=t, p=p, q=q, v=v, P=covariance, valid=validity(layout, x, sd, age)[:, 0] > 0)


def turned(q: Floats, v: Floats) -> Floats:
    """R(q) v for rows."""
    u, w = q[:, :3], q[:, 3:]
    c = 2.0 * np.cross(u, v)
    return v + w * c + np.cross(u, c)


def validity(layout: StateLayout, x: Floats, sd: Floats, age: Floats) -> Ints:
    """(n, 3) int64: whether position, velocity and heading may be relied on, apart from their covariance."""
    e = layout.error("position")
    flat = slice(e.start, e.start + 2)
    age_p, sd_p = age[:, flat].max(axis=1), np.hypot(*sd[:, flat].T)
    v = layout.error("velocity")
    age_v, sd_v = age[:, v].min(axis=1), sd[:, v].max(axis=1)
    reckons = (age_v < WHEELS_TIMEOUT) & (sd_p < RECKONING_LIMIT)
    flags = np.zeros((sd.shape[0], 3), np.int64)
    flags[:, 0] = ((age_p < POSITION_TIMEOUT) & (sd_p < 5 * RECKONING_LIMIT)) | reckons
    flags[:, 1] = (age_v < VELOCITY_TIMEOUT) & (sd_v < SPEED_LIMIT)
    if "heading" in layout:
        flags[:, 2] = sd[:, layout.error("heading").start] < HEADING_LIMIT
    elif "attitude" in layout:
        flags[:, 2] = sd[:, layout.error("attitude").start + 2] < HEADING_LIMIT
    return flags


def health_at_the_end(channel: Channel, tally: Tally) -> SensorState | None:
    """Of a source that is fused: what is only compared is never judged."""
    if channel.scored:
        return None
    return SensorState(int(tally.states[-1][1])) if tally.states else SensorState.SILENT


def accounts(
    f: Filter, collector: Collector, parts: tuple[Records, ...], streams: Mapping[str, Stream], roles: Mapping[str, str]
) -> tuple[Account, ...]:
    """One account per channel, then one per stream that feeds none."""
    out: list[Account] = []
    for channel, tally, part in zip(f.channels, collector.tallies, parts, strict=True):
        s = streams[channel.stream]
        out.append(
            Account(
                source=channel.name,
                kind=s.kind.name,
                role=channel.role,
                received=int(part.t.size) + s.malformed,
                used=sum(tally.counts.get(int(v), 0) for v in (Verdict.USED, Verdict.INPUT, Verdict.RESET)),
                malformed=s.malformed,
                by_verdict={Verdict(v): c for v, c in sorted(tally.counts.items())},
                rate=s.rate,
                first=tally.first,
                last=tally.last,
                nis=tally.nis_sum / tally.dof_sum if tally.dof_sum else float("nan"),
                state=health_at_the_end(channel, tally),
            )
        )
    fed = {c.stream for c in f.channels}
    for name in sorted(set(streams) - fed):
        s = streams[name]
        none: dict[Verdict, int] = {}
        out.append(
            Account(
                source=name, kind=s.kind.name, role=roles.get(name, "not used"), received=len(s) + s.malformed, used=0,
                malformed=s.malformed, by_verdict=none, rate=s.rate, first=float("nan"), last=float("nan"),
                nis=float("nan"), state=None,
            )
        )  # fmt: skip
    return tuple(out)
