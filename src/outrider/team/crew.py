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

from outrider.core.attitudes import quat_of_matrix
from outrider.data import Datum, Stream
from outrider.data.agents import Message
from outrider.errors import ConfigError
from outrider.filters.cooperative import FALSE_ALARM, Agreement, Member, Method, Source
from outrider.filters.cooperative.fusion import NO_RECORDS, TEAM, fuse_pair, teammates
from outrider.filters.cooperative.gossip import Teammate, meet
from outrider.filters.cooperative.group import look, views
from outrider.filters.cooperative.insight import agreement, untold
from outrider.filters.cooperative.ledger import Relative
from outrider.filters.cooperative.robot import Filter, gates
from outrider.models.kinematics import K_P, K_R, K_V, K_W, T_P, T_TH
from outrider.team.channel import Air, Channel
from outrider.team.ears import Batch, Ear, Table, merged, padded, rows_of, split, table_of
from outrider.team.exchange import Refusal
from outrider.team.navigator import Fused
from outrider.typing import Floats, Ints

AHEAD: Final = 1.0  # s that an estimate is carried on at most
PATIENCE: Final = 3.0  # s for which a meeting waits for news of it
TICK: Final = 1e-9  # s, of the clock of records


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
        self._listeners = {name: _by_stream(own) for name, own in self._ears.items()}
        self._waiting: dict[str, list[Batch]] = {name: [] for name in self.names}
        self._until = dict.fromkeys(self.names, 0.0)
        self._number: dict[tuple[str, int], int] = {}
        self._out: dict[tuple[str, int], list[Floats]] = {}
        self.kept = {name: Kept() for name in self.names}
        self.crossed: dict[tuple[str, str], list[Floats]] = {pair: [] for pair in combinations(self.names, 2)}
        self._tables: list[Table] = []
        self._filters = self._made(members)
        self._taken: list[list[tuple[Ints, Floats]]] = [[] for _ in self._filters]
        self._shown: dict[str, tuple[Filter, Floats, Floats, slice]] = {}
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
            heard: list[Ear] = []
            for m in group:
                for k, e in enumerate(self._ears[m.name]):
                    if e.partner and e.partner not in self.names:
                        raise ConfigError(f"no robot '{e.partner}'", where=m.name, fix=", ".join(self.names))
                    if e.partner and self.method is not Method.JOINT:
                        continue
                    self._number[m.name, k] = len(sources)
                    heard.append(e)
                    none = np.zeros(0)
                    sources.append(Source(robot=m.name, sensor=e.sensor, t=none, z=none, partner=e.partner))
            gate = gates(FALSE_ALARM)
            self._tables.append(table_of(heard))
            made.append(Filter(group, sources, NO_RECORDS, np.zeros(0), 0.0, gate=gate, carries=self.method.carries))
        return made

    def take(self, robot: str, t: int, news: Sequence[Stream]) -> None:
        """What a robot has recorded up to t [ns]; once everybody has come that far, all of it is fused."""
        listeners, waiting = self._listeners[robot], self._waiting[robot]
        for s in news:
            for k, e in listeners.get(s.name, ()) if len(s) else ():
                waiting.append(rows_of(k, e, s, self._start, self._datum))
        self._until[robot] = (t - self._start) * 1e-9
        until = min(self._until.values())
        if until > self._filters[0].belief.clock[0]:
            self._advance(until)

    def hear_again(self, everything: Mapping[str, Sequence[Stream]], every_s: float, end_s: float) -> None:
        """A whole recording, by robot, in steps; in one go where nobody has to be asked in between."""
        for name in self.names:
            self.take(name, self._start, everything[name])
        steps = [round(k * every_s * 1e9) for k in range(1, int(end_s / every_s + TICK) + 1)]
        if steps and all((name, k) in self._number for name, own in self._ears.items() for k in range(len(own))):
            self._whole(np.array(steps) * 1e-9)
            return
        for t in steps:
            for name in self.names:
                self.take(name, self._start + t, ())

    def _whole(self, at: Floats) -> None:
        """Fuse everything, as `_advance` does in the steps `at` (k,) s."""
        self._until = dict.fromkeys(self.names, float(at[-1]))
        for f, table, taken in zip(self._filters, self._tables, self._taken, strict=True):
            alone = [(self._number[m.name, b.ear], b) for m in f.members for b in self._due(m.name, float(at[-1]))]
            f.feed(merged(alone, table))
            f.sample(at)
            f.run(float(at[-1]))
            f.x[-1], f.P[-1] = f.belief.x, f.belief.P  # times before the end are sampled by the run
            taken.append((f.records.source, f.out))
        self._shown.clear()
        views = {name: self._sampled(name) for name in self.names}
        for i, (name, (pose, rows, f, own)) in enumerate(views.items()):
            back, P = np.swapaxes(rows, 1, 2), f.P[:, own]
            kept = self.kept[name]
            kept.t, kept.pose, kept.P = at.tolist(), list(pose), list(rows @ P[:, :, own] @ back)
            for other in self.names[:i] if self.method is Method.JOINT else ():
                _, their_rows, _, theirs = views[other]
                self.crossed[other, name] = list(their_rows @ f.P[:, theirs, own] @ back)

    def _sampled(self, name: str) -> tuple[Floats, Floats, Filter, slice]:
        """(k, 4) pose and (k, 4, errors) its rows by the robot's errors at the times that its filter has sampled."""
        f, _, _, own = self._view(name)
        i, n = [m.name for m in f.members].index(name), own.stop - own.start
        k, K = views(f.group, f.belief.u, i, f.x)
        rows = np.zeros((len(k), 4, n))
        rows[:, :3] = K[:, T_P : T_P + 3, :n]
        rows[:, 3] = (k[:, None, K_R + 6 : K_R + 9] @ K[:, T_TH : T_TH + 3, :n])[:, 0]
        pose = np.column_stack([k[:, K_P : K_P + 3], np.arctan2(k[:, K_R + 3], k[:, K_R])])
        return pose, rows, f, own

    def _advance(self, until: float) -> None:
        """Fuse everything up to `until` [s], in the order of time; what belongs to later waits."""
        meetings: list[Meeting] = []
        for f, table in zip(self._filters, self._tables, strict=True):
            alone: list[tuple[int, Batch]] = []
            for m in f.members:
                for b in self._due(m.name, until):
                    if (s := self._number.get((m.name, b.ear))) is not None:
                        alone.append((s, b))
                        continue
                    z, r = padded(b, self._ears[m.name][b.ear])
                    meetings += [(float(b.t[i]), m.name, b.ear, z[i], r[i]) for i in range(b.t.size)]
            (f.extend if self._mates else f.feed)(merged(alone, table))
        for _, met in groupby(sorted(meetings, key=lambda m: m[:3]), key=lambda m: m[0]):
            (self._tell if self._mates else self._correct)(list(met))
        if self._channel is not None:
            self._channel.receive(until)
        for f, taken in zip(self._filters, self._taken, strict=True):
            f.run(until)
            if not self._mates:  # others come back to their records
                taken.append((f.records.source, f.out))
        self._shown.clear()
        rows = {name: self._pose_rows(name) for name in self.names}
        for name in self.names:
            self._keep(name, until, rows)

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
                self._out.setdefault((name, k), []).append(np.array([[float(out.verdict), out.nis, out.dof]]))

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

    def _due(self, name: str, until: float) -> list[Batch]:
        halves = [split(b, until + TICK) for b in self._waiting[name]]
        self._waiting[name] = [later for _, later in halves if later is not None]
        return [now for now, _ in halves if now.t.size]

    def _outcomes(self) -> dict[tuple[str, int], list[Floats]]:
        """What became of the records that filters took, by robot and ear."""
        out: dict[tuple[str, int], list[Floats]] = {}
        for f, taken in zip(self._filters, self._taken, strict=True):
            every = [(f.records.source, f.out)] if self._mates else taken
            if not every:
                continue
            names = [m.name for m in f.members]
            source, rows = np.concatenate([s for s, _ in every]), np.concatenate([r for _, r in every])
            for (name, k), s in self._number.items():
                if name in names and (own := rows[source == s]).size:
                    out[name, k] = [own]
        return out

    def _view(self, robot: str) -> tuple[Filter, Floats, Floats, slice]:
        """Its filter, its kinematic view and Jacobian, and its rows of the filter's errors, as of the last step."""
        if (shown := self._shown.get(robot)) is not None:
            return shown
        i = self.names.index(robot)
        f, i = (self._filters[0], i) if self.method is Method.JOINT else (self._filters[i], 0)
        look(f.group, f.belief, f.work, i)
        e, n = (int(x) for x in f.group.rows[i, 3:5])
        shown = self._shown[robot] = f, f.work.k[i], f.work.K[i], slice(e, e + n)
        return shown

    def _keep(self, name: str, t: float, pose_rows: Mapping[str, Floats]) -> None:
        f, k, _, own = self._view(name)
        kept, rows = self.kept[name], pose_rows[name]
        kept.t.append(t)
        kept.pose.append(np.array([*k[K_P : K_P + 3], np.arctan2(k[K_R + 3], k[K_R])]))
        kept.P.append(rows @ f.belief.P[own, own] @ rows.T)
        for other in self.names[: self.names.index(name)] if self.method is Method.JOINT else ():
            theirs = self._view(other)[3]
            self.crossed[other, name].append(pose_rows[other] @ f.belief.P[theirs, own] @ rows.T)

    def _pose_rows(self, name: str) -> Floats:
        """(4, errors) east, north, up and heading by the robot's errors."""
        _, k, K, own = self._view(name)
        n = own.stop - own.start
        rows = np.zeros((4, n))
        rows[:3] = K[T_P : T_P + 3, :n]
        # the error of the heading is that of the attitude about the vertical
        rows[3] = k[K_R + 6 : K_R + 9] @ K[T_TH : T_TH + 3, :n]
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
            t=t, p=k[K_P : K_P + 3] + v * ahead, v=v, q=quat_of_matrix(R),
            heading=float(np.arctan2(R[1, 0], R[0, 0])) + w * ahead, w=w, P=rows @ f.belief.P[own, own] @ rows.T,
        )  # fmt: skip

    def agreements(self) -> list[Agreement]:
        """Of each sensor of each robot, and of each one's looks at each other: what was used, and whether it agreed."""
        told = self._outcomes()
        for key, rows in self._out.items():
            told.setdefault(key, []).extend(rows)
        if self._mates:
            for r, key in self._seen:
                found = self._mates[r.observer].outcomes.get(r.key)
                if found is not None:
                    told.setdefault(key, []).append(np.array([[float(found.verdict), found.nis, found.dof]]))
        out: list[Agreement] = []
        for (name, k), rows in sorted(told.items()):
            e = self._ears[name][k]
            what = f"{e.stream} {type(e.sensor).__name__}" if not e.partner else e.stream
            out.append(agreement(name, what, e.partner, np.concatenate(rows)))
        return out

    def unobserved(self) -> list[str]:
        """A sentence for each block of states that nothing has measured; see `filters.cooperative.unobserved`."""
        last = {n: np.diag(f.belief.P)[own] for n in self.names for f, _, _, own in (self._view(n),)}
        return untold(self.members, last)


def _heard(method: Method, e: Ear) -> bool:
    return (method.shares or not e.partner) and (e.navigation or method is not Method.NONE)


def _by_stream(ears: Sequence[Ear]) -> dict[str, list[tuple[int, Ear]]]:
    """The ears of one robot, with their numbers, by what they listen to."""
    out: dict[str, list[tuple[int, Ear]]] = {}
    for k, e in enumerate(ears):
        out.setdefault(e.stream, []).append((k, e))
    return out
