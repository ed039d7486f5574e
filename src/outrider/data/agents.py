"""What passes between an agent and the world: records and messages in, a command and messages out. Never truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, final, runtime_checkable

from outrider.data.events import Stream
from outrider.typing import Floats, Ints


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """What one robot tells another. receiver: a robot's name, or "" for all; t : ns, when it was sent."""

    sender: str
    receiver: str = ""
    topic: str = ""
    t: int = 0
    data: Mapping[str, Floats] = field(default_factory=dict[str, Floats])

    @property
    def size(self) -> int:
        """Bytes on the air: eight a number, and 32 for addresses, stamp and topic."""
        return 32 + 8 * sum(int(column.size) for column in self.data.values())


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Action:
    """What an agent decided. command : in the inputs of its vehicle, None to keep the last one;  records : what it
    wants kept in the log, its estimate above all;  done : its mission is over;  note : a sentence on what changed."""

    command: Floats | None = None
    messages: tuple[Message, ...] = ()
    records: tuple[Stream, ...] = ()
    done: bool = False
    note: str = ""


class Agent(Protocol):
    """Whoever drives a robot: in a simulation, over MAVLink or on a ROS 2 base alike."""

    @property
    def period_s(self) -> float:
        """Seconds between two calls of `act`."""
        ...

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        """Decide at t [ns] from the robot's own records and messages that have arrived since the last call."""
        ...


@runtime_checkable
class Planned(Protocol):
    """An agent whose commands are known before the start; a whole run of it is one compiled call."""

    def plan(self, seconds: Floats) -> Floats:
        """Commands (n, inputs) at the given seconds since the start."""
        ...


@runtime_checkable
class Lander(Protocol):
    """An agent that may come down to the ground on purpose. Of anybody else who flies, touching it is a collision."""

    @property
    def landing(self) -> bool:
        """Whether it comes down now, or stands there because it did."""
        ...


def arrived(stream: Stream, after: int, until: int) -> Stream:
    """The records of a stream that arrived in (after, until] [ns], in the order of their arrival."""
    t = stream.t_arrival
    if t.size and after < t[0] and t[-1] <= until and bool((t[1:] >= t[:-1]).all()):  # all of it, as most often
        return stream
    rows: Ints = ((t > after) & (t <= until)).nonzero()[0]
    return stream.select(rows[t[rows].argsort(kind="stable")])
