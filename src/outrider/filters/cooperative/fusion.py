"""Estimate a team of robots from their records, by one of several methods of sharing what they know."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final, Protocol, final

import numpy as np
from scipy.special import chdtri

from outrider.data import Gaussian, Verdict
from outrider.errors import ConfigError, DataError
from outrider.filters.cooperative import loop
from outrider.filters.cooperative.tables import I_SIZE, MOTION_THETA, POSES, Beliefs, Tables, scratch
from outrider.filters.ekf import kept
from outrider.filters.state import ROWS
from outrider.models.kinematics import T_SIZE
from outrider.models.motion import LAYOUTS, Motion
from outrider.models.sensors import Sensor, SensorModel
from outrider.models.sensors.layout import THETA_SIZE
from outrider.typing import Floats, Ints

RELATIVE: Final = (Sensor.RELATIVE_POSE, Sensor.RANGE, Sensor.BEARING, Sensor.RANGE_BEARING)
POSE_BLOCKS: Final = ("position", "heading", "yaw")
FALSE_ALARM: Final = 1e-6  # share of good records that gates refuse
_MEMORY: Final = 2e9  # bytes that cross-covariances may take


class Method(Enum):
    """How robots share what they know; the values are what a report says of it."""

    NONE = "every robot by itself, with its own navigation sensors only"
    LOCAL = "every robot by itself, with all its sensors"
    NAIVE = "the partner's estimate taken for independent: unsafe, too sure of itself"
    CI = "covariance intersection: safe for any correlation, and cautious"
    SPLIT_CI = "split covariance intersection: safe for robots that talk both ways"
    DISTRIBUTED = "cross-covariances kept in factors by the robots; only the two that meet talk"
    JOINT = "one filter for the whole team: the reference, as large as the team"

    @property
    def shares(self) -> bool:
        """Whether robots use what they measure of one another."""
        return self not in (Method.NONE, Method.LOCAL)


_CODES: Final = {
    Method.NONE: loop.NAIVE, Method.LOCAL: loop.NAIVE, Method.NAIVE: loop.NAIVE, Method.CI: loop.CI,
    Method.SPLIT_CI: loop.SPLIT_CI, Method.DISTRIBUTED: loop.DISTRIBUTED, Method.JOINT: loop.JOINT,
}  # fmt: skip


class MotionModel(Protocol):
    """The parameters of a process model."""

    def theta(self) -> Floats:
        """As its kernel reads them."""
        ...


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """One robot. belief : at the start, in the layout of its motion;  consider : states whose value stays as it is."""

    name: str
    motion: Motion
    model: MotionModel
    belief: Gaussian
    consider: tuple[str, ...] = ()


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """The records of one sensor of one robot.

    t : (n,) s, not decreasing;  z : (n, columns) as the sensor's kernel reads them;  sensor : None for an IMU that
    drives the prediction;  sigmas : (m,) of each row, instead of the sensor's own; infinite: not in use
    partner : who is seen, for a relative sensor;  navigation : whether `Method.NONE` has it too
    """

    robot: str
    sensor: SensorModel | None
    t: Floats
    z: Floats
    sigmas: Floats | None = None
    partner: str = ""
    navigation: bool = True


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TeamEstimate:
    """Estimates of everybody at common times, and what became of every record.

    t : (k,) s;  x : name -> (k, states);  variance : name -> (k, errors);  pose : name -> (k, p, p) covariance of
    position and heading;  verdict, nis, dof : of each record, in the order of `source` (index) and time
    """

    method: Method
    members: Mapping[str, Member]
    t: Floats
    x: Mapping[str, Floats]
    variance: Mapping[str, Floats]
    pose: Mapping[str, Floats]
    source: Ints
    verdict: Ints
    nis: Floats
    dof: Ints

    def counts(self) -> Mapping[Verdict, int]:
        """How many records came to what."""
        values, n = np.unique(self.verdict, return_counts=True)
        return {Verdict(int(v)): int(c) for v, c in zip(values, n, strict=True)}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Shared:
    """What two robots have in common from the start: the covariance of a block of one with a block of the other."""

    one: str
    one_block: str
    two: str
    two_block: str
    covariance: Floats


def pose_rows(member: Member) -> Ints:
    """Error rows of position and heading; of an attitude, its rotation about the body's z."""
    layout = member.belief.layout
    rows = [np.arange(layout.error(b).start, layout.error(b).stop) for b in POSE_BLOCKS if b in layout]
    if "attitude" in layout:
        rows.append(np.array([layout.error("attitude").stop - 1]))
    return np.concatenate(rows).astype(np.int64)


def fuse_team(
    members: Sequence[Member],
    sources: Sequence[Source],
    method: Method,
    t: Floats,
    *,
    shared: Sequence[Shared] = (),
    start: float | None = None,
) -> TeamEstimate:
    """Estimate every member at the times t (k,) [s].

    shared : correlations at the start, which only `DISTRIBUTED` and `JOINT` know how to use
    start : s, of the beliefs; the first record otherwise

    Raises `ConfigError` for a robot that nobody knows, one that sees itself, a sensor that cannot look at a robot;
    `DataError` for a covariance that is none, times that run backwards.
    """
    names = [m.name for m in members]
    _check_members(members, names)
    used = [s for s in sources if (method.shares or not s.partner) and (s.navigation or method is not Method.NONE)]
    for s in used:
        _check_source(s, names)
    tables = _tables(members, used, names)
    order, records = _records(used)
    first = start if start is not None else (float(records.t[0]) if records.t.size else 0.0)
    beliefs = _beliefs(members, tables, method, first, shared, names)
    n, n_x = tables.keep.size, beliefs.x.size
    kept_at = np.ascontiguousarray(t, np.float64)
    estimates = loop.Estimates(
        kept_at, np.zeros((t.size, n_x)), np.zeros((t.size, n)), np.zeros((t.size, len(members), POSES, POSES))
    )
    out = np.zeros((records.t.size, 3))
    out[:, 1] = np.nan
    work = scratch(tables.index, method is Method.JOINT)
    loop.run(_CODES[method], tables, beliefs, work, records, estimates, out)
    return _estimate(method, members, tables, estimates, order, out)


def _check_members(members: Sequence[Member], names: Sequence[str]) -> None:
    if not members or len(set(names)) < len(names):
        raise ConfigError("a team needs robots, each with a name of its own", fix=f"the names are {', '.join(names)}")
    for m in members:
        if m.belief.layout is not LAYOUTS[m.motion]:
            raise ConfigError(f"its belief is not one of {m.motion.name}", where=f"robot {m.name}")
        P = m.belief.P
        if not (np.isfinite(P).all() and np.isfinite(m.belief.x).all()):
            raise DataError("its first belief is not finite", where=f"robot {m.name}")
        if not np.allclose(P, P.T) or np.linalg.eigvalsh(P)[0] < -1e-9 * max(float(np.trace(P)), 1e-300):
            raise DataError("its first covariance is not positive definite", where=f"robot {m.name}")


def _check_source(s: Source, names: Sequence[str]) -> None:
    what = s.sensor.code.name.lower() if s.sensor is not None else "input"
    where = f"{what} of {s.robot}"
    for name in (s.robot, *([s.partner] if s.partner else [])):
        if name not in names:
            raise ConfigError(f"no robot '{name}'", where=where, fix=f"the team is {', '.join(names)}")
    if s.partner == s.robot:
        raise ConfigError("a robot cannot measure itself as its partner", where=where, fix="name the other robot")
    if s.partner and (s.sensor is None or s.sensor.code not in RELATIVE):
        known = ", ".join(c.name.lower() for c in RELATIVE)
        raise ConfigError("this sensor does not look at robots", where=where, fix=f"those that do are {known}")
    if not np.isfinite(s.t).all() or (np.diff(s.t) < 0.0).any():
        raise DataError("its times run backwards or are not finite", where=where, fix="sort the records by time")
    if s.z.ndim != 2 or s.z.shape[0] != s.t.size or s.z.shape[1] > ROWS:
        raise DataError(f"records of shape {s.z.shape} for {s.t.size} times", where=where)


def _tables(members: Sequence[Member], sources: Sequence[Source], names: Sequence[str]) -> Tables:
    index, rows, whole, poses = np.zeros((len(members), I_SIZE), np.int64), [], [], []
    theta = np.zeros((len(members), MOTION_THETA))
    n_x = n = square = table = pose = 0
    for i, m in enumerate(members):
        layout, own, parameters = m.belief.layout, pose_rows(m), m.model.theta()
        k, x = layout.error_size, layout.size
        theta[i, : parameters.size] = parameters
        index[i] = [
            int(m.motion),
            n_x,
            x,
            n,
            k,
            square,
            T_SIZE * n,
            square + n,
            table,
            len(layout.table),
            pose,
            own.size,
        ]
        rows.append(layout.table)
        shift = layout.table.copy()
        shift[:, 1] += n_x
        shift[:, 2] += np.where(shift[:, 0] == 3, 0, n)
        whole.append(shift)
        poses.append(own)
        n_x, n, square, table, pose = n_x + x, n + k, square + k * k, table + len(layout.table), pose + own.size
    sensors = [s.sensor for s in sources]
    gate = np.full((max(len(sources), 1), ROWS + 1), np.inf)
    gate[:, 1:] = chdtri(np.arange(1, ROWS + 1), FALSE_ALARM)
    parameters = [np.zeros(THETA_SIZE) if s is None else s.theta() for s in sensors]
    return Tables(
        index=index, theta=theta, table=np.concatenate(rows), rotations=np.ascontiguousarray(np.concatenate(whole)),
        keep=np.concatenate([kept(m.belief.layout, m.consider) for m in members]), pose=np.concatenate(poses),
        code=np.array([-1 if s is None else int(s.code) for s in sensors], np.int64),
        member=np.array([names.index(s.robot) for s in sources], np.int64),
        partner=np.array([names.index(s.partner) if s.partner else -1 for s in sources], np.int64),
        parameters=np.array(parameters).reshape(-1, THETA_SIZE), gate=gate,
    )  # fmt: skip


def _records(sources: Sequence[Source]) -> tuple[Ints, loop.Records]:
    """All records by time; at one time in the order of the sources. Those that are not finite have no rows."""
    t = np.concatenate([s.t for s in sources] or [np.zeros(0)]).astype(np.float64)
    which = np.repeat(np.arange(len(sources), dtype=np.int64), [s.t.size for s in sources])
    z, r = np.zeros((t.size, ROWS)), np.full((t.size, ROWS), np.inf)
    first = 0
    for s in sources:
        rows = slice(first, first + s.t.size)
        z[rows, : s.z.shape[1]] = s.z
        if s.sensor is not None:
            sigmas = s.sensor.sigmas() if s.sigmas is None else np.asarray(s.sigmas, np.float64)
            r[rows, : sigmas.size] = sigmas**2
        first += s.t.size
    bad = ~np.isfinite(z).all(axis=1)
    z[bad], r[bad] = 0.0, np.inf
    order = np.argsort(t, kind="stable")
    return which[order], loop.Records(t[order], which[order], z[order], r[order])


def _beliefs(
    members: Sequence[Member], t: Tables, method: Method, start: float, shared: Sequence[Shared], names: Sequence[str]
) -> Beliefs:
    N, n, sizes = len(members), t.keep.size, t.index[:, 4]
    squares, most = int((sizes * sizes).sum()), int(sizes.max())
    whole = np.zeros((n, n) if method is Method.JOINT else (1, 1))
    pairs = method is Method.DISTRIBUTED
    if max(whole.nbytes, 8 * N * N * most * most * pairs) > _MEMORY:
        raise ConfigError(f"{N} robots are too many for this method", fix="try fewer, or covariance intersection")
    factor = np.zeros((N, N, most * most) if pairs else (1, 1, 1))
    met = np.zeros((N, N), np.int64)
    first = t.index[:, 3]
    if method is Method.JOINT:
        for i, m in enumerate(members):
            whole[first[i] : first[i] + sizes[i], first[i] : first[i] + sizes[i]] = m.belief.P
    for s in shared:
        i, j, C = _common(s, members, names)
        if method is Method.JOINT:
            a, b = slice(first[i], first[i] + sizes[i]), slice(first[j], first[j] + sizes[j])
            whole[a, b] += C
            whole[b, a] += C.T
        elif pairs:
            factor[i, j, : C.size] += C.ravel()
            factor[j, i, : sizes[j] ** 2] = np.eye(sizes[j]).ravel()
            met[i, j] = met[j, i] = 1
    return Beliefs(
        x=np.concatenate([m.belief.x for m in members]), P=np.concatenate([m.belief.P.ravel() for m in members]),
        whole=whole, clock=np.full(N, start), u=np.zeros((N, 6)), fed=np.zeros((N, 6)),
        carried=np.concatenate([np.eye(int(k)).ravel() for k in sizes]), told=np.zeros(squares), heard=np.zeros(n),
        before=np.zeros(squares), factor=factor, met=met,
    )  # fmt: skip


def _common(s: Shared, members: Sequence[Member], names: Sequence[str]) -> tuple[int, int, Floats]:
    for name in (s.one, s.two):
        if name not in names:
            raise ConfigError(f"no robot '{name}'", where="shared", fix=f"the team is {', '.join(names)}")
    i, j = names.index(s.one), names.index(s.two)
    a, b = members[i].belief.layout, members[j].belief.layout
    C = np.zeros((a.error_size, b.error_size))
    C[a.error(s.one_block), b.error(s.two_block)] = s.covariance
    return (i, j, C) if i < j else (j, i, np.ascontiguousarray(C.T))


def _estimate(
    method: Method, members: Sequence[Member], t: Tables, e: loop.Estimates, order: Ints, out: Floats
) -> TeamEstimate:
    x, variance, pose = {}, {}, {}
    for i, m in enumerate(members):
        row = t.index[i].tolist()
        x[m.name] = e.x[:, row[1] : row[1] + row[2]]
        variance[m.name] = e.variance[:, row[3] : row[3] + row[4]]
        pose[m.name] = e.pose[:, i, : row[11], : row[11]]
    return TeamEstimate(
        method=method, members={m.name: m for m in members}, t=e.t, x=x, variance=variance, pose=pose, source=order,
        verdict=out[:, 0].astype(np.int64), nis=out[:, 1], dof=out[:, 2].astype(np.int64),
    )  # fmt: skip
