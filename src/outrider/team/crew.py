"""The estimates of a team while it is under way: everybody's records as they come, and who measures whom.

The same filters and the same ways of sharing as `fuse_team`, step by step. A step is worked out when everybody has
handed in what belongs to it, so that nobody hears of the future; until then an estimate is carried on.

With a radio, `DISTRIBUTED` talks by telegrams (`team.channel`), which may be lost or late; the other methods of pairs
exchange their estimates where they meet, or not at all if either direction is lost. `JOINT` knows everything at once.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, groupby
from typing import Any, Final, TypeAlias, final

import numpy as np

from outrider.core.rotations import matrices_to_quats
from outrider.data import Datum, Kind, Stream
from outrider.data.agents import Message
from outrider.errors import ConfigError
from outrider.filters.channels import site_position
from outrider.filters.cooperative import FALSE_ALARM, Agreement, Member, Method, Source
from outrider.filters.cooperative.fusion import NO_RECORDS, TEAM, fuse_pair, teammates
from outrider.filters.cooperative.gossip import Teammate, meet
from outrider.filters.cooperative.group import look
from outrider.filters.cooperative.insight import agreement, untold
from outrider.filters.cooperative.ledger import Relative
from outrider.filters.cooperative.robot import Filter, Records, gates
from outrider.filters.state import ROWS
from outrider.models.kinematics import K_P, K_R, K_V, K_W, T_P, T_TH
from outrider.models.sensors import SensorModel
from outrider.team.channel import Air, Channel
from outrider.team.exchange import Refusal
from outrider.team.navigator import Fused
from outrider.typing import Floats, Ints

AHEAD: Final = 1.0  # s that an estimate is carried on at most
PATIENCE: Final = 3.0  # s for which a meeting waits for news of it


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Ear:
    """How a stream of one robot is heard. columns : of its z, first and end;  sigmas : (m,), infinite: not in use;
    partner : who is seen, by `number` in the first column;  navigation : whether `Method.NONE` has it, too."""

    stream: str
    sensor: SensorModel
    sigmas: tuple[float, ...]
    columns: tuple[int, int] = (0, ROWS)
    partner: str = ""
    number: float = -1.0
    navigation: bool = True


@final
@dataclass(slots=True)
class Kept:
    """What a robot thought, once a step. t : s;  pose : (4,) east, north, up [m], heading;  P : (4, 4)."""

    t: list[float] = field(default_factory=list[float])
    pose: list[Floats] = field(default_factory=list[Floats])
    P: list[Floats] = field(default_factory=list[Floats])


Meeting: TypeAlias = tuple[float, str, int, Floats, Floats]
"""s, who, by which of its ears, z, r"""


@final
class Crew:
    """`take` what a robot has recorded up to now; `now` is where it is.

    kept : of each robot;  crossed : pair -> (4, 4) covariance of both errors, once a step, where it is known (`JOINT`)
    """

    def __init__(
        self, members: Sequence[Member], ears: Mapping[str, Sequence[Ear]], method: Method, start: int, datum: Datum,
        air: Air | None = None,
    ) -> None:  # fmt: skip
        """start : ns, of the beliefs, second 0 of the air;  air : None if nothing is lost. Its range is judged by the
        estimates.

        Raises ConfigError for a partner that is not in the team."""
        self.method, self._start, self._datum, self.members, self.ears = method, start, datum, members, ears
        self.names = [m.name for m in members]
        self._ears = {name: [e for e in ears[name] if _heard(method, e)] for name in self.names}
        self._waiting: dict[str, list[tuple[Floats, int, Floats, Floats]]] = {name: [] for name in self.names}
        self._until = dict.fromkeys(self.names, 0.0)
        self._number: dict[tuple[str, int], int] = {}
        self._out: dict[tuple[str, int], list[tuple[float, float, float]]] = {}
        self.kept = {name: Kept() for name in self.names}
        self.crossed: dict[tuple[str, str], list[Floats]] = {pair: [] for pair in combinations(self.names, 2)}
        self._filters = self._made(members)
        self._air = air
        self._sent = 0
        self._mates: list[Teammate] = []
        self._channel: Channel | None = None
        self._seen: list[tuple[Relative, tuple[str, int]]] = []
        if method is Method.DISTRIBUTED and len(members) <= TEAM:
            patience = PATIENCE if air is not None else np.inf
            self._mates = teammates(members, self._filters, 0.0, gates(FALSE_ALARM), patience=patience)
            if air is not None:
                self._channel = Channel(self._mates, tuple(self.names), air, self._places)

    def _made(self, members: Sequence[Member]) -> list[Filter]:
        groups = [members] if self.method is Method.JOINT else [[m] for m in members]
        made: list[Filter] = []
        for group in groups:
            sources: list[Source] = []
            for m in group:
                for k, e in enumerate(self._ears[m.name]):
                    if e.partner and e.partner not in self.names:
                        raise ConfigError(f"no robot '{e.partner}'", where=m.name, fix=", ".join(self.names))
                    if e.partner and self.method is not Method.JOINT:
                        continue
                    self._number[m.name, k] = len(sources)
                    none = np.zeros(0)
                    sources.append(Source(robot=m.name, sensor=e.sensor, t=none, z=none, partner=e.partner))
            gate = gates(FALSE_ALARM)
            made.append(Filter(group, sources, NO_RECORDS, np.zeros(0), 0.0, gate=gate, carries=self.method.carries))
        return made

    def take(self, robot: str, t: int, news: Sequence[Stream]) -> None:
        """What a robot has recorded up to t [ns]; once everybody has come that far, all of it is fused."""
        for s in news:
            for k, e in enumerate(self._ears[robot]):
                if e.stream == s.name and len(s):
                    self._waiting[robot].append(self._rows(k, e, s))
        self._until[robot] = (t - self._start) * 1e-9
        until = min(self._until.values())
        if until > self._filters[0].belief.clock[0]:
            self._advance(until)

    def hear_again(self, everything: Mapping[str, Sequence[Stream]], every_s: float, end_s: float) -> None:
        """A whole recording, by robot, in steps."""
        for name in self.names:
            self.take(name, self._start, everything[name])
        for k in range(1, int(end_s / every_s + 1e-9) + 1):
            for name in self.names:
                self.take(name, self._start + round(k * every_s * 1e9), ())

    def _rows(self, k: int, e: Ear, s: Stream) -> tuple[Floats, int, Floats, Floats]:
        own = s if not e.partner else s.select(s.z[:, 0] == e.number)
        z = site_position(own, self._datum) if own.kind is Kind.GNSS else own.z[:, e.columns[0] : e.columns[1]]
        out, r = np.zeros((len(own), ROWS)), np.full((len(own), ROWS), np.inf)
        out[:, : z.shape[1]], r[:, : len(e.sigmas)] = z, np.array(e.sigmas) ** 2
        bad = ~np.isfinite(out).all(axis=1)
        out[bad], r[bad] = 0.0, np.inf
        return np.asarray((own.t - self._start) * 1e-9, np.float64), k, out, r

    def _advance(self, until: float) -> None:
        """Fuse everything up to `until` [s], in the order of time; what belongs to later waits."""
        meetings: list[Meeting] = []
        for f in self._filters:
            rows = [(m.name, self._due(m.name, until)) for m in f.members]
            alone = [(name, b) for name, batch in rows for b in batch if (name, b[1]) in self._number]
            for name, batch in rows:
                for t, k, z, r in batch:
                    if (name, k) not in self._number:
                        meetings += [(float(t[i]), name, k, z[i], r[i]) for i in range(t.size)]
            (f.extend if self._mates else f.feed)(_sorted(alone, self._number, self._ears))
        for _, met in groupby(sorted(meetings, key=lambda m: m[:3]), key=lambda m: m[0]):
            (self._tell if self._mates else self._correct)(list(met))
        if self._channel is not None:
            self._channel.receive(until)
        for f in self._filters:
            f.run(until)
            if not self._mates:  # others come back to their records
                self._count(f, self._out)
        for name in self.names:
            self._keep(name, until)

    def _tell(self, met: Sequence[Meeting]) -> None:
        """Those who have met pass on what they have heard. met : of one time"""
        told: list[Relative] = []
        for t, name, k, z, r in met:
            e = self._ears[name][k]
            i, j = self.names.index(name), self.names.index(e.partner)
            told.append(Relative(observer=i, observed=j, t=t, serial=len(self._seen), code=int(e.sensor.code),
                                 theta=e.sensor.theta(), z=z, r=r))  # fmt: skip
            self._seen.append((told[-1], (name, k)))
        if self._channel is not None:
            self._channel.receive(told[0].t)
            self._channel.meet(told)
            return
        for r in told:
            for m in (r.observer, r.observed):
                self._filters[m].run(r.t)
            meet(self._mates[r.observer], self._mates[r.observed], [r])

    def _correct(self, met: Sequence[Meeting]) -> None:
        """Those who have met correct one another by what they estimate."""
        for t, name, k, z, r in met:
            e = self._ears[name][k]
            i, j = self.names.index(name), self.names.index(e.partner)
            for n in (i, j):
                self._filters[n].run(t)
            if self._through(t, name, e.partner):
                out = fuse_pair(self.method, self._filters, i, j, int(e.sensor.code), e.sensor.theta(), z, r)
                self._out.setdefault((name, k), []).append((float(out.verdict), out.nis, out.dof))

    def _through(self, t: float, one: str, two: str) -> bool:
        """Whether two robots hear each other's estimate."""
        if self._air is None:
            return True
        heard = True
        for sender, receiver in ((one, two), (two, one)):
            b = self._filters[self.names.index(sender)].belief
            row = np.concatenate([b.x, b.P[np.triu_indices(len(b.P))]])
            message = Message(sender=sender, receiver=receiver, t=round(t * 1e9), data={"estimate": row})
            self._sent += message.size
            heard &= all(d.t is not None for d in self._air.send(message, self._places(t)))
            self._air.receive(receiver, 2**62)
        return heard

    def _places(self, t: float) -> dict[str, Floats]:
        """Where everybody thought to be at the last step."""
        return {n: k.pose[-1][:3] if k.pose else np.zeros(3) for n, k in self.kept.items()}

    @property
    def exchange(self) -> dict[str, Any] | None:
        """What went over the radio; None if nothing did."""
        if self._air is None or not self._air.sent:
            return None
        ends = [] if self._channel is None else self._channel.ends
        refused = sum((e.refused for e in ends), Counter[tuple[str, Refusal]]())
        return {
            "telegrams": self._air.sent, "sent_bytes": sum(e.sent for e in ends) if ends else self._sent,
            "lost": {reason.name.lower(): n for reason, n in sorted(self._air.lost.items(), key=lambda x: x[0].name)},
            "refused": [{"from": who, "code": why.name.lower(), "text": why.value, "times": n}
                        for (who, why), n in sorted(refused.items(), key=lambda x: (x[0][0], x[0][1].name))],
            "isolated": [{"t_s": t, "robot": self.names[m], "by": e.name, "isolated": out}
                         for e in ends for t, m, out in e.mate.events],
        }  # fmt: skip

    def _due(self, name: str, until: float) -> list[tuple[Floats, int, Floats, Floats]]:
        due: list[tuple[Floats, int, Floats, Floats]] = []
        later: list[tuple[Floats, int, Floats, Floats]] = []
        for t, k, z, r in self._waiting[name]:
            now = t <= until + 1e-9
            due += [(t[now], k, z[now], r[now])] if now.any() else []
            later += [] if now.all() else [(t[~now], k, z[~now], r[~now])]
        self._waiting[name] = later
        return due

    def _count(self, f: Filter, into: dict[tuple[str, int], list[tuple[float, float, float]]]) -> None:
        back = {(self._number[name, k], name): (name, k) for name, k in self._number}
        names = [m.name for m in f.members]
        for s in np.unique(f.records.source).tolist():
            name = names[int(f.group.member[s])]
            rows = f.out[f.records.source == s]
            into.setdefault(back[s, name], []).extend((float(v), float(n), float(d)) for v, n, d in rows)

    def _view(self, robot: str) -> tuple[Filter, Floats, Floats, slice]:
        """Its filter, its kinematic view and Jacobian, and its rows of the filter's errors."""
        i = self.names.index(robot)
        f, i = (self._filters[0], i) if self.method is Method.JOINT else (self._filters[i], 0)
        look(f.group, f.belief, f.work, i)
        e, n = (int(x) for x in f.group.rows[i, 3:5])
        return f, f.work.k[i], f.work.K[i], slice(e, e + n)

    def _keep(self, name: str, t: float) -> None:
        f, k, _, own = self._view(name)
        kept, rows = self.kept[name], self._pose_rows(name)
        kept.t.append(t)
        kept.pose.append(np.array([*k[K_P : K_P + 3], np.arctan2(k[K_R + 3], k[K_R])]))
        kept.P.append(rows @ f.belief.P[own, own] @ rows.T)
        for other in self.names[: self.names.index(name)] if self.method is Method.JOINT else ():
            theirs = self._view(other)[3]
            self.crossed[other, name].append(self._pose_rows(other) @ f.belief.P[theirs, own] @ rows.T)

    def _pose_rows(self, name: str) -> Floats:
        """(4, errors) east, north, up and heading by the robot's errors."""
        _, k, K, own = self._view(name)
        n = own.stop - own.start
        rows = np.zeros((4, n))
        rows[:3] = K[T_P : T_P + 3, :n]
        # the error of the heading is that of the attitude about the vertical
        rows[3] = k[K_R : K_R + 9].reshape(3, 3)[2] @ K[T_TH : T_TH + 3, :n]
        return rows

    def jolt(self, robot: str, speed: float, tilt: float) -> None:
        """It may be pushed now as no sensor tells, as one that touches down: standard deviations, m/s and rad."""
        f, _, _, own = self._view(robot)
        layout = next(m for m in f.members if m.name == robot).belief.layout
        soon = float(np.nextafter(f.belief.clock[0], np.inf))
        for block, sigma in (("velocity", speed), ("pitch", tilt), ("roll", tilt)):
            if block in layout:
                rows = np.arange(own.start + layout.error(block).start, own.start + layout.error(block).stop)
                f.blows.append((soon, rows, sigma**2))

    def now(self, robot: str, t: int) -> Fused:
        """Where a robot is at t [ns], carried on at its own velocity and yaw rate since the last step."""
        f, k, K, own = self._view(robot)
        ahead = min(max((t - self._start) * 1e-9 - float(f.belief.clock[0]), 0.0), AHEAD)
        R, v, w = k[K_R : K_R + 9].reshape(3, 3).copy(), k[K_V : K_V + 3].copy(), float(k[K_W + 2])
        rows = K[T_P : T_P + 3, : own.stop - own.start]
        return Fused(
            t=t, p=k[K_P : K_P + 3] + v * ahead, v=v, q=matrices_to_quats(R[None])[0],
            heading=float(np.arctan2(R[1, 0], R[0, 0])) + w * ahead, w=w, P=rows @ f.belief.P[own, own] @ rows.T,
        )  # fmt: skip

    def agreements(self) -> list[Agreement]:
        """Of each sensor of each robot, and of each one's looks at each other: what was used, and whether it agreed."""
        told = self._out
        if self._mates:
            told = {}
            for f in self._filters:
                self._count(f, told)
            for r, key in self._seen:
                found = self._mates[r.observer].outcomes.get(r.key)
                if found is not None:
                    told.setdefault(key, []).append((float(found.verdict), found.nis, found.dof))
        out: list[Agreement] = []
        for (name, k), rows in sorted(told.items()):
            e = self._ears[name][k]
            what = f"{e.stream} {type(e.sensor).__name__}" if not e.partner else e.stream
            out.append(agreement(name, what, e.partner, np.array(rows)))
        return out

    def unobserved(self) -> list[str]:
        """A sentence for each block of states that nothing has measured; see `filters.cooperative.unobserved`."""
        last = {n: np.diag(f.belief.P)[own] for n in self.names for f, _, _, own in (self._view(n),)}
        return untold(self.members, last)


def _heard(method: Method, e: Ear) -> bool:
    return (method.shares or not e.partner) and (e.navigation or method is not Method.NONE)


def _sorted(
    batches: Sequence[tuple[str, tuple[Floats, int, Floats, Floats]]],
    number: Mapping[tuple[str, int], int],
    ears: Mapping[str, Sequence[Ear]],
) -> Records:
    """All rows by time, at one time relative ones last."""
    if not batches:
        return NO_RECORDS
    t = np.concatenate([b[0] for _, b in batches])
    source: Ints = np.repeat([number[name, b[1]] for name, b in batches], [b[0].size for _, b in batches])
    last = np.repeat([bool(ears[name][b[1]].partner) for name, b in batches], [b[0].size for _, b in batches])
    order = np.lexsort((source, last, t))
    z, r = (np.vstack([b[c] for _, b in batches])[order] for c in (2, 3))
    return Records(t=t[order], source=source[order].astype(np.int64), z=z, r=r)
