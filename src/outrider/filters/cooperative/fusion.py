"""Estimate a team of robots from their records, by one of several methods of sharing what they know."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final, final

import numpy as np

from outrider.data import Verdict
from outrider.errors import ConfigError, DataError
from outrider.filters.cooperative.gossip import Teammate, meet
from outrider.filters.cooperative.intersection import intersect
from outrider.filters.cooperative.ledger import Relative
from outrider.filters.cooperative.meeting import Outcome, factored, naive, sight
from outrider.filters.cooperative.robot import FALSE_ALARM, Filter, Member, Records, Source, gates, pose_rows
from outrider.filters.state import ROWS
from outrider.models.motion import LAYOUTS
from outrider.models.sensors import Sensor
from outrider.typing import Floats, Ints

TEAM: Final = 8  # robots, up to which everybody keeps a ledger of the whole team
NO_RECORDS: Final = Records(t=np.zeros(0), source=np.zeros(0, np.int64), z=np.zeros((0, ROWS)), r=np.zeros((0, ROWS)))
RELATIVE: Final = (Sensor.RELATIVE_POSE, Sensor.RANGE, Sensor.BEARING, Sensor.RANGE_BEARING)


class Method(Enum):
    """How robots share what they know; the values are what a report says of it."""

    NONE = "every robot by itself, with its own navigation sensors only"
    LOCAL = "every robot by itself, with all its sensors"
    NAIVE = "the partner's estimate taken for independent: unsafe, too sure of itself"
    CI = "covariance intersection: safe for any correlation, and cautious"
    SPLIT_CI = "split covariance intersection: safe for robots that talk both ways"
    FACTORED = "cross-covariances kept in factors: exact for two robots, too sure of itself for more"
    DISTRIBUTED = (
        "those that meet tell one another all they have heard: as good as the joint filter, as late as the news"
    )
    JOINT = "one filter for the whole team: the reference, as large as the team"

    @property
    def shares(self) -> bool:
        """Whether robots use what they measure of one another."""
        return self not in (Method.NONE, Method.LOCAL)

    @property
    def carries(self) -> bool:
        """Whether a robot keeps track of what happened to its errors since the last exchange."""
        return self in (Method.SPLIT_CI, Method.FACTORED, Method.DISTRIBUTED)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TeamEstimate:
    """Estimates of everybody at common times, and what became of every record.

    t : (k,) s;  x : name -> (k, states);  P : name -> (k, n, n)
    source, verdict, nis, dof : of each record by time; `source` counts those that were given
    """

    method: Method
    members: Mapping[str, Member]
    t: Floats
    x: Mapping[str, Floats]
    P: Mapping[str, Floats]
    source: Ints
    verdict: Ints
    nis: Floats
    dof: Ints

    def counts(self) -> Mapping[Verdict, int]:
        """How many records came to what."""
        values, n = np.unique(self.verdict, return_counts=True)
        return {Verdict(int(v)): int(c) for v, c in zip(values, n, strict=True)}

    def pose_covariance(self, name: str) -> Floats:
        """(k, p, p) of position and heading."""
        rows = pose_rows(self.members[name])
        return self.P[name][:, rows[:, None], rows]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Shared:
    """What two robots have in common from the start: the covariance of a block of one with a block of the other."""

    one: str
    one_block: str
    two: str
    two_block: str
    covariance: Floats


def fuse_team(
    members: Sequence[Member],
    sources: Sequence[Source],
    method: Method,
    t: Floats,
    *,
    shared: Sequence[Shared] = (),
    start: float | None = None,
    false_alarm: float = FALSE_ALARM,
) -> TeamEstimate:
    """Estimate every member at the times t (k,) [s], not decreasing.

    `DISTRIBUTED` equals `JOINT` for two robots, and comes within a few percent of it in teams that meet often: what is
    missing is news under way. Teams of more than `TEAM` robots use what is constant in their size: exact for two that
    have met nobody else, split covariance intersection with others.

    shared : correlations at the start, which only `JOINT`, `FACTORED` and `DISTRIBUTED` know how to use
    start : s, of the beliefs; the first record otherwise
    false_alarm : share of good records that the gates of innovations refuse; 0: nothing is refused

    Of records of one time those of robots alone come first. Raises `ConfigError` for a robot that nobody knows, one
    that sees itself, a sensor that cannot look at a robot; `DataError` for a covariance that is none, or times that
    run backwards.
    """
    ready = prepare(members, sources, method, t, shared=shared, start=start, false_alarm=false_alarm)
    if method is Method.JOINT:
        filters = [Filter(members, sources, ready.records, ready.at, ready.start, gate=ready.gate)]
        _correlate(filters[0], ready.common)
        filters[0].run(ready.end)
        out = filters[0].out
    else:
        filters, out = _apart(ready, method)
    return ready.estimate(method, filters, out)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """Checked members, sources and records of a team, and a filter of each robot's own where they are apart.

    records : by time;  owner, whom : (sources,) who measured whom, -1: nobody;  filters, rows : of each robot, with its
    own records and where these are among all
    """

    members: Sequence[Member]
    sources: Sequence[Source]
    records: Records
    at: Floats
    start: float
    end: float
    gate: Floats
    common: Sequence[tuple[int, int, Floats]]
    owner: Ints
    whom: Ints
    filters: Sequence[Filter]
    rows: Sequence[Ints]

    def meetings(self) -> list[int]:
        """Relative records by time; of times before one of the two has begun none."""
        out: list[int] = []
        for e in np.flatnonzero(self.whom[self.records.source] >= 0).tolist():
            pair = self._pair(e)
            if float(self.records.t[e]) >= max(self.start, *(self.members[m].start for m in pair)):
                out.append(e)
        return out

    def _pair(self, e: int) -> tuple[int, int]:
        k = int(self.records.source[e])
        return int(self.owner[k]), int(self.whom[k])

    def relative(self, e: int) -> Relative:
        """Record e, of one robot by another."""
        (i, j), sensor = self._pair(e), self.sources[int(self.records.source[e])].sensor
        assert sensor is not None
        return Relative(
            observer=i, observed=j, t=float(self.records.t[e]), serial=e, code=int(sensor.code), theta=sensor.theta(),
            z=self.records.z[e], r=self.records.r[e],
        )  # fmt: skip

    def mates(self, patience: float = np.inf) -> list[Teammate]:
        """Everybody with a ledger of the team."""
        return teammates(self.members, self.filters, self.start, self.gate, common=self.common, patience=patience)

    def finish(self, out: Floats) -> None:
        """Run everybody to the end; out (records, 3) <- what became of each robot's own records."""
        for f, rows in zip(self.filters, self.rows, strict=True):
            f.run(self.end)
            out[rows] = f.out

    def estimate(self, method: Method, filters: Sequence[Filter], out: Floats) -> TeamEstimate:
        """The result; out (records, 3) verdict, NIS, degrees of freedom."""
        x, P = _split(self.members, filters)
        return TeamEstimate(
            method=method, members={m.name: m for m in self.members}, t=self.at, x=x, P=P, source=self.records.source,
            verdict=out[:, 0].astype(np.int64), nis=out[:, 1], dof=np.nan_to_num(out[:, 2]).astype(np.int64),
        )  # fmt: skip


def prepare(
    members: Sequence[Member],
    sources: Sequence[Source],
    method: Method,
    t: Floats,
    *,
    shared: Sequence[Shared] = (),
    start: float | None = None,
    false_alarm: float = FALSE_ALARM,
) -> Prepared:
    """What `fuse_team` starts from, for those who let robots meet in a way of their own."""
    names = [m.name for m in members]
    _check_members(members, names)
    for s in sources:
        _check_source(s, names)
    records = _records(sources, [k for k, s in enumerate(sources) if _has(method, s)])
    first = start if start is not None else float(records.t[0]) if records.t.size else 0.0
    at, gate = np.ascontiguousarray(t, np.float64), gates(false_alarm)
    end = max(at[-1] if at.size else first, records.t[-1] if records.t.size else first) + 1e-9
    owner = np.array([names.index(s.robot) for s in sources], np.int64)
    whom = np.array([names.index(s.partner) if s.partner else -1 for s in sources], np.int64)
    rows = [np.flatnonzero((whom[records.source] < 0) & (owner[records.source] == i)) for i in range(len(members))]
    filters: list[Filter] = []
    for i, m in enumerate(members) if method is not Method.JOINT else ():
        own = [k for k in range(len(sources)) if owner[k] == i and whom[k] < 0]
        part = Records(t=records.t[rows[i]], source=np.searchsorted(own, records.source[rows[i]]).astype(np.int64),
                       z=records.z[rows[i]], r=records.r[rows[i]])  # fmt: skip
        filters.append(Filter([m], [sources[k] for k in own], part, at, first, gate=gate, carries=method.carries))
    return Prepared(
        members=members, sources=sources, records=records, at=at, start=first, end=end, gate=gate,
        common=[_common(s, members, names) for s in shared], owner=owner, whom=whom, filters=filters, rows=rows,
    )  # fmt: skip


def _has(method: Method, s: Source) -> bool:
    """Whether a method uses these records."""
    return (method.shares or not s.partner) and (s.navigation or method is not Method.NONE)


def _apart(ready: Prepared, method: Method) -> tuple[Sequence[Filter], Floats]:
    """Every robot has a filter of its own, and they meet. Each runs only when it meets somebody, and at the end."""
    filters = ready.filters
    for i, j, C in ready.common if method in (Method.FACTORED, Method.DISTRIBUTED) else ():
        filters[i].factors[j], filters[j].factors[i] = C, np.eye(C.shape[1])
        for robot in (filters[i], filters[j]):
            robot.before[...] = robot.belief.P
    mates = ready.mates() if method is Method.DISTRIBUTED and len(filters) <= TEAM else []
    out = np.full((ready.records.t.size, 3), np.nan)
    out[ready.whom[ready.records.source] >= 0] = Verdict.NOT_ALIGNED, np.nan, 0
    for e in ready.meetings():
        seen = ready.relative(e)
        i, j = seen.observer, seen.observed
        filters[i].run(seen.t)
        filters[j].run(seen.t)
        if mates:
            meet(mates[i], mates[j], [seen])
            out[e] = mates[i].outcomes[seen.key]
        else:
            out[e] = fuse_pair(method, filters, i, j, seen.code, seen.theta, seen.z, seen.r)
    ready.finish(out)
    return filters, out


def teammates(
    members: Sequence[Member],
    filters: Sequence[Filter],
    start: float,
    gate: Floats,
    *,
    common: Sequence[tuple[int, int, Floats]] = (),
    patience: float = np.inf,
) -> list[Teammate]:
    """A ledger of the team for each robot's own filter, which carries. common : see `Prepared`;  patience : see
    `Teammate`"""
    out: list[Teammate] = []
    for i, f in enumerate(filters):
        team = Filter(members, [], NO_RECORDS, np.zeros(0), start, gate=gate)
        _correlate(team, common)
        out.append(Teammate(i, f, team, start, patience=patience))
    return out


def fuse_pair(
    method: Method, filters: Sequence[Filter], i: int, j: int, code: int, theta: Floats, z: Floats, r: Floats
) -> Outcome:
    """Robot i has seen robot j, and they correct one another as the method says; both filters are at its time."""
    if method is Method.FACTORED or (method is Method.DISTRIBUTED and _among_themselves(filters, i, j)):
        return factored(filters[i], filters[j], i, j, code, theta, z, r)
    s = sight(filters[i], filters[j], code, theta, z, r)
    if method is Method.NAIVE:
        return naive(filters[i], filters[j], s)
    return intersect(filters[i], filters[j], s, split=method is not Method.CI)


def _among_themselves(filters: Sequence[Filter], i: int, j: int) -> bool:
    """Whether two robots know all of their correlations: neither has met anybody but the other."""
    one, two = filters[i], filters[j]
    return not (one.mixed or two.mixed) and one.factors.keys() <= {j} and two.factors.keys() <= {i}


def _correlate(joint: Filter, common: Sequence[tuple[int, int, Floats]]) -> None:
    starts = joint.group.rows[:, 3]
    for i, j, C in common:
        a, b = slice(starts[i], starts[i] + C.shape[0]), slice(starts[j], starts[j] + C.shape[1])
        joint.belief.P[a, b] += C
        joint.belief.P[b, a] += C.T


def _split(members: Sequence[Member], filters: Sequence[Filter]) -> tuple[dict[str, Floats], dict[str, Floats]]:
    x: dict[str, Floats] = {}
    P: dict[str, Floats] = {}
    for f in filters:
        for m, (_, i, n_x, e, n, _, _) in zip(f.members, f.group.rows.tolist(), strict=True):
            x[m.name], P[m.name] = f.x[:, i : i + n_x], f.P[:, e : e + n, e : e + n]
    return x, P


def _check_members(members: Sequence[Member], names: Sequence[str]) -> None:
    if not members or len(set(names)) < len(names):
        raise ConfigError("a team needs robots, each with a name of its own", fix=f"the names are {', '.join(names)}")
    for m in members:
        where, P = f"robot {m.name}", m.belief.P
        if m.belief.layout is not LAYOUTS[m.motion]:
            raise ConfigError(f"its belief is not one of {m.motion.name.lower()}", where=where)
        if not (np.isfinite(P).all() and np.isfinite(m.belief.x).all()):
            raise DataError("its first belief is not finite", where=where, fix="give numbers for state and covariance")
        if not np.allclose(P, P.T) or np.linalg.eigvalsh(P)[0] < -1e-9 * float(np.trace(P)):
            raise DataError("its first covariance is not positive definite", where=where, fix="give variances >= 0")


def _check_source(s: Source, names: Sequence[str]) -> None:
    what = s.sensor.code.name.lower() if s.sensor is not None else "input"
    where = f"{what} of {s.robot}"
    for name in (s.robot, *([s.partner] if s.partner else [])):
        if name not in names:
            raise ConfigError(f"no robot '{name}'", where=where, fix=f"the team is {', '.join(names)}")
    if s.partner == s.robot:
        raise ConfigError("a robot cannot measure itself", where=where, fix="name the other robot as partner")
    if s.partner and (s.sensor is None or s.sensor.code not in RELATIVE):
        known = ", ".join(c.name.lower() for c in RELATIVE)
        raise ConfigError("this sensor does not look at robots", where=where, fix=f"those that do are {known}")
    if not np.isfinite(s.t).all() or (np.diff(s.t) < 0.0).any():
        raise DataError("its times run backwards or are not finite", where=where, fix="sort the records by time")
    if s.z.ndim != 2 or s.z.shape[0] != s.t.size or s.z.shape[1] > ROWS:
        raise DataError(f"records of shape {s.z.shape} for {s.t.size} times", where=where, fix="one row for each time")


def _records(sources: Sequence[Source], used: Sequence[int]) -> Records:
    """All records by time, at one time relative ones last. Those that are not finite have no rows."""
    t = np.concatenate([sources[k].t for k in used] or [np.zeros(0)]).astype(np.float64)
    which = np.repeat(np.array(used, np.int64), [sources[k].t.size for k in used])
    z, r = np.zeros((t.size, ROWS)), np.full((t.size, ROWS), np.inf)
    last = np.zeros(t.size, np.bool_)
    first = 0
    for k in used:
        s = sources[k]
        rows = slice(first, first + s.t.size)
        z[rows, : s.z.shape[1]], last[rows] = s.z, bool(s.partner)
        if s.sensor is not None:
            sigmas = s.sensor.sigmas() if s.sigmas is None else np.asarray(s.sigmas, np.float64)
            r[rows, : sigmas.size] = sigmas**2
        first += s.t.size
    bad = ~np.isfinite(z).all(axis=1)
    z[bad], r[bad] = 0.0, np.inf
    order = np.lexsort((last, t))
    return Records(t=t[order], source=which[order], z=z[order], r=r[order])


def _common(s: Shared, members: Sequence[Member], names: Sequence[str]) -> tuple[int, int, Floats]:
    for name in (s.one, s.two):
        if name not in names:
            raise ConfigError(f"no robot '{name}'", where="shared", fix=f"the team is {', '.join(names)}")
    i, j = names.index(s.one), names.index(s.two)
    a, b = members[i].belief.layout, members[j].belief.layout
    C = np.zeros((a.error_size, b.error_size))
    C[a.error(s.one_block), b.error(s.two_block)] = s.covariance
    return i, j, C
