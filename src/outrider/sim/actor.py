"""One robot under way: its body, its sensors, and the agent that decides on what they say."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import final

import numpy as np

from outrider.data import Stream, joined
from outrider.data.agents import Agent, Lander, Message, Planned, arrived
from outrider.errors import ConfigError
from outrider.models.vehicles import CLIMB
from outrider.sim.course import Course
from outrider.sim.monitor import Hull
from outrider.sim.noise import generator
from outrider.sim.sensors import Setting, make_device
from outrider.sim.team import Robot
from outrider.sim.truth import Truth
from outrider.sim.world import World
from outrider.typing import Floats


@final
class Actor:
    """A robot of a run. due : ns, when its agent wants to be asked next;  done : whether its mission is over."""

    def __init__(self, world: World, robot: Robot, hulls: Mapping[str, Hull], start: int, end: int, seed: int) -> None:
        self.robot, self.course, self._start = robot, Course(world, robot, start, end, seed), start
        setting = Setting(world=world, robot=robot.name, start=start, end=end, seed=seed, hulls=hulls)
        self._devices = [(s.name, make_device(s, setting, generator(seed, robot.name, s.name))) for s in robot.sensors]
        if len({name for name, _ in self._devices}) != len(self._devices):
            raise ConfigError("two sensors of one name", where=f"robot {robot.name}", fix="give each a name of its own")
        self._kept: dict[str, list[Stream]] = {}
        self._fresh: list[Stream] = []  # not yet arrived as a whole
        self._told, self._heard = start - 1, False
        self._agent: Agent | None = None
        self._command: Floats | Planned = np.zeros(0)
        if isinstance(robot.agent, Planned):
            self._command = robot.agent
        elif robot.agent is not None:
            self._agent = robot.agent
            self._command = np.zeros(len(robot.vehicle.inputs) if robot.vehicle else 0)
        elif robot.vehicle is not None:
            raise ConfigError("has a vehicle but no agent", where=f"robot {robot.name}", fix="give it one")
        self._lander = self._agent if isinstance(self._agent, Lander) else None
        self.due = start if self._agent else end
        self.done = False

    def move(self, until: int) -> None:
        """Let the body take its steps up to `until` [ns]."""
        self.course.move(until, self._command)

    def sense(self, pieces: Mapping[str, Truth]) -> None:
        """Let every sensor record the newest piece of everybody's truth."""
        self._heard = True
        own = pieces[self.robot.name]
        others = {name: piece for name, piece in pieces.items() if name != self.robot.name}
        for name, device in self._devices:
            records = device(own, others)
            if len(records):
                self._kept.setdefault(name, []).append(records)
                if self._agent is not None:
                    self._fresh.append(records)

    def act(self, now: int, inbox: Sequence[Message]) -> tuple[tuple[Message, ...], str]:
        """Ask the agent: messages to send, and what it had to say."""
        if self._agent is None:
            return (), ""
        news = [arrived(s, self._told, now) for s in self._fresh]
        parts = zip(self._fresh, news, strict=True)
        self._fresh = [s for s, new in parts if new is not s and bool((s.t_arrival > now).any())]
        self._told = now if self._heard else self._told  # nothing has been sensed before the first step
        action = self._agent.act(now, [s for s in news if len(s)], inbox)
        if action.command is not None:
            self._command = self._checked(action.command)
        for records in action.records:
            self._kept.setdefault(records.name, []).append(records)
        self.done = action.done
        self.due = now + round(self._agent.period_s * 1e9)
        return action.messages, action.note

    def lands(self, t: int) -> bool:
        """Whether it comes down on purpose at t [ns]: its agent says so, or its schedule tells it to sink."""
        if not isinstance(self._command, np.ndarray):
            return float(self._command.plan(np.array([(t - self._start) * 1e-9]))[0, CLIMB]) < 0.0
        return self._lander is not None and self._lander.landing

    def log(self, until: int, *, prefixed: bool) -> dict[str, Stream]:
        """Everything that was recorded up to `until` [ns], by name."""
        prefix = f"{self.robot.name}/" if prefixed else ""
        whole = {f"{prefix}{name}": joined(parts) for name, parts in self._kept.items()}
        kept = {name: s if (s.t <= until).all() else s.select(s.t <= until) for name, s in whole.items()}
        return {name: replace(s, name=name, frame=f"{prefix}{s.frame}" if s.frame else "") for name, s in kept.items()}

    def _checked(self, command: Floats) -> Floats:
        inputs = self.robot.vehicle.inputs if self.robot.vehicle else ()
        if command.shape != (len(inputs),) or not bool(np.isfinite(command).all()):
            fix = f"send {', '.join(inputs)} as finite numbers"
            raise ConfigError(f"commands {command.tolist()}", where=f"the agent of {self.robot.name}", fix=fix)
        return np.asarray(command, np.float64)
