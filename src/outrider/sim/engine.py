"""The run of a team through a world: vehicles move, sensors feel it, agents decide on what has arrived.

Between two decisions everything is compiled: a vehicle takes all its steps in one call. An agent whose commands are
known beforehand (`Planned`) asks for no decision, so that an open-loop run is a few calls altogether. How a run is cut
into pieces changes no bit of it: slow errors are drawn for the whole run, white noise row by row, each source of each
robot from numbers of its own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from math import lcm
from typing import final

from outrider.data import EventLog, Stream
from outrider.data.agents import Planned
from outrider.errors import ConfigError
from outrider.sim.actor import Actor
from outrider.sim.logs import signed
from outrider.sim.monitor import Closest, Monitor
from outrider.sim.radio import Air, Radio
from outrider.sim.team import Robot
from outrider.sim.truth import EPOCH, Truth
from outrider.sim.world import World
from outrider.typing import Floats

LONGEST = 300_000_000_000  # ns, of one piece
AGAIN = 1_500_000_000  # ns, within which the same words are one note


class Ending(Enum):
    """How a simulation ended; the value is the sentence a user reads."""

    GOAL = "every mission is over"
    TIME = "the time is over"
    COLLISION = "collision"
    DIVERGED = "a vehicle's state is not finite any more: a smaller step, or gentler commands"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Note:
    """What an agent said. t : ns."""

    t: int
    robot: str
    text: str


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """What happened. log : what the sensors recorded and the agents kept;  truth : by robot;  ended : ns;  hit : the
    collision that ended it."""

    log: EventLog
    truth: Mapping[str, Truth]
    ending: Ending
    ended: int
    hit: Closest | None
    monitor: Monitor
    notes: tuple[Note, ...]
    air: Air

    @property
    def sentence(self) -> str:
        """How it ended, with what and when."""
        if self.hit is None:
            return self.ending.value
        seconds = (self.hit.t - self.monitor.start) * 1e-9
        return f"{self.hit.robot} collides with {self.hit.what} after {seconds:.1f} s"


def simulate(
    world: World, team: Sequence[Robot], duration_s: float, seed: int, *, radio: Radio = Radio(), start: int = EPOCH
) -> Simulation:
    """Run the team for at most `duration_s`, to the end of every mission, or to the first collision.

    Raises ConfigError for a world, a team or a period that cannot be.
    """
    world.validate()
    names = tuple(r.name for r in team)
    missions = [r.name for r in team if r.agent is not None and not isinstance(r.agent, Planned)]
    if not names or len(set(names)) != len(names):
        raise ConfigError("every robot needs a name of its own", where="team", fix="name one at least, each once")
    end = start + _whole(duration_s, team)
    hulls = {r.name: r.hull for r in team}
    actors = {r.name: Actor(world, r, hulls, start, end, seed) for r in team}
    flyers = frozenset(r.name for r in team if r.flies)
    air, monitor = Air(radio, names, seed, start), Monitor(world, hulls, start, flyers)
    moving = _board(team, actors)
    _check_starts(actors, monitor)
    notes: list[Note] = []
    now, ending, hit = start, Ending.TIME, None
    while True:
        places = {name: a.course.truth.p[a.course.k] for name, a in actors.items()}
        for name, actor in actors.items():
            if actor.due <= now < end and not actor.done:
                messages, text = actor.act(now, air.receive(name, now))
                notes += [Note(t=now, robot=name, text=text)] if text else []
                for message in messages:
                    air.send(message, places)
        if missions and all(actors[name].done for name in missions):
            ending = Ending.GOAL
        if now >= end or ending is not Ending.TIME:
            break
        until = min(end, now + LONGEST, *(a.due for a in actors.values() if not a.done))
        for actor in moving:
            actor.move(until)
        if not all(a.course.finite for a in actors.values()):
            ending = Ending.DIVERGED
            break
        pieces = {name: a.course.piece(now, until) for name, a in actors.items()}
        for actor in actors.values():
            actor.sense(pieces)
        hit, now = _crash(actors) or monitor.look(pieces, lambda name, t: actors[name].lands(t)), until
        if hit is not None:
            ending, now = Ending.COLLISION, hit.t
    return Simulation(
        log=_log(actors, now),
        truth={name: a.course.piece(start, now) for name, a in actors.items()},
        ending=ending, ended=now, hit=hit, monitor=monitor, notes=_told(notes, actors, now), air=air,
    )  # fmt: skip


def _board(team: Sequence[Robot], actors: Mapping[str, Actor]) -> list[Actor]:
    """Put drones on their pads; everybody in the order in which they move, carriers before what they carry."""
    by_name = {r.name: r for r in team}
    for robot in team:
        if robot.on and (robot.on not in by_name or by_name[robot.on].on):
            fix = f"choose among {', '.join(n for n, r in by_name.items() if r.pad)}".rstrip()
            raise ConfigError(f"starts on '{robot.on}', which carries nobody", where=f"robot {robot.name}", fix=fix)
        if robot.on:
            actors[robot.name].course.board(robot, by_name[robot.on], actors[robot.on].course)
    return sorted(actors.values(), key=lambda a: bool(a.robot.on))


def _told(notes: list[Note], actors: Mapping[str, Actor], until: int) -> tuple[Note, ...]:
    """What agents said and what became of drones on pads, in order of time; the same words again are one note."""
    for name, actor in actors.items():
        for row, status in actor.course.deck.events if actor.course.deck is not None else ():
            notes.append(Note(t=int(actor.course.truth.t[row]), robot=name, text=status.value))
    said = sorted((n for n in notes if n.t <= until), key=lambda n: n.t)
    return tuple(sorted((n for name in actors for n in _once([n for n in said if n.robot == name])), key=lambda n: n.t))


def _once(notes: list[Note]) -> list[Note]:
    """Notes of one robot; one that comes again within `AGAIN` is the first one, with how often and for how long."""
    out: list[Note] = []
    spell: list[Note] = []
    for n in [*notes, None]:
        if n is not None and spell and n.text == spell[-1].text and n.t - spell[-1].t <= AGAIN:
            spell.append(n)
            continue
        if len(spell) > 1:
            lasted = (spell[-1].t - spell[0].t) * 1e-9
            out.append(replace(spell[0], text=f"{spell[0].text} ({len(spell)} times within {lasted:.1f} s)"))
        else:
            out += spell
        spell = [] if n is None else [n]
    return out


def _crash(actors: Mapping[str, Actor]) -> Closest | None:
    """The first landing that failed."""
    failed: list[Closest] = []
    for name, actor in actors.items():
        deck = actor.course.deck
        if deck is not None and deck.status.crashed:
            what = f"the pad of {actor.robot.on}: {deck.status.value}"
            failed.append(Closest(robot=name, what=what, distance=0.0, t=int(actor.course.truth.t[deck.events[-1][0]])))
    return min(failed, key=lambda c: c.t, default=None)


def _check_starts(actors: Mapping[str, Actor], monitor: Monitor) -> None:
    hit = monitor.look({name: a.course.piece(a.course.truth.start, a.course.truth.start) for name, a in actors.items()})
    if hit is not None:
        raise ConfigError(f"starts {-hit.distance:.2f} m inside {hit.what}", where=f"robot {hit.robot}", fix="move it")


def _whole(duration_s: float, team: Sequence[Robot]) -> int:
    """The duration [ns] in whole steps of every vehicle; periods of agents must be whole steps as well."""
    steps = {round(r.vehicle.step_s * 1e9) for r in team if r.vehicle is not None}
    for robot in team:
        agent = robot.agent
        if agent is None or isinstance(agent, Planned):
            continue
        for step in steps:
            if not agent.period_s > 0 or round(agent.period_s * 1e9) % step:
                fix = f"take a multiple of {step * 1e-9:g} s, the step of the vehicles"
                raise ConfigError(f"a period of {agent.period_s} s", where=f"the agent of {robot.name}", fix=fix)
    step = lcm(*steps) if steps else 1
    if not duration_s * 1e9 >= step:
        raise ConfigError(f"a duration of {duration_s} s", where="simulation", fix="take one step at least")
    return round(duration_s * 1e9) // step * step


def _log(actors: Mapping[str, Actor], until: int) -> EventLog:
    several = len(actors) > 1
    streams: dict[str, Stream] = {}
    mounts: dict[str, Floats] = {}
    for name, actor in actors.items():
        streams |= actor.log(until, prefixed=several)
        mounts |= {f"{name}/{frame}" if several else frame: T for frame, T in actor.robot.mounts.items()}
    return signed(EventLog(streams=streams, mounts=mounts))
