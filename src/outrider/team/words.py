"""What robots and their station tell each other, as messages of numbers. What is lost is said again."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from outrider.data.agents import Message
from outrider.guidance.patrol import Duty, Ended, Order, Report
from outrider.typing import Floats

ORDER: Final = "order"
CANCEL: Final = "cancel"
STATUS: Final = "status"
GRANT: Final = "grant"
ASK: Final = "ask"
PAD: Final = "pad"
WISH: Final = "wish"
SIGHTING: Final = "sighting"
DUTIES: Final = tuple(Duty)
ENDS: Final = tuple(Ended)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """What a robot says of itself, again and again.

    pose : (3,) east, north [m], heading [rad];  velocity : (2,) m/s, site frame;  duty, and the order it follows, -1
    for none;  battery : share;  ended : its latest reports.
    """

    robot: str
    t: int
    pose: Floats
    velocity: Floats
    duty: Duty
    order: int
    battery: float
    ended: tuple[Report, ...]

    def message(self) -> Message:
        """To everybody."""
        ended = np.array([(alert, ENDS.index(how)) for alert, how in self.ended], np.float64).reshape(-1, 2)
        said = np.array([DUTIES.index(self.duty), self.order, self.battery])
        data = {"pose": self.pose, "velocity": self.velocity, "said": said, "ended": ended}
        return Message(sender=self.robot, topic=STATUS, t=self.t, data=data)

    @classmethod
    def of(cls, m: Message) -> "Status":
        """From a message of that topic."""
        duty, order, battery = m.data["said"].tolist()
        ended = tuple((int(a), ENDS[int(how)]) for a, how in m.data["ended"].tolist())
        return cls(
            robot=m.sender, t=m.t, pose=m.data["pose"], velocity=m.data["velocity"], duty=DUTIES[int(duty)],
            order=int(order), battery=battery, ended=ended,
        )  # fmt: skip


def order_message(sender: str, receiver: str, t: int, order: Order) -> Message:
    """Go and look."""
    data = {
        "number": np.array([order.number, order.alert]),
        "view": order.view,
        "times": np.array([order.hold_s, order.until_s]),
    }
    return Message(sender=sender, receiver=receiver, topic=ORDER, t=t, data=data)


def order_of(m: Message) -> Order:
    """From a message of that topic."""
    hold, until = m.data["times"].tolist()
    number, alert = (int(n) for n in m.data["number"])
    return Order(number=number, alert=alert, view=m.data["view"], hold_s=hold, until_s=until)


def number_message(topic: str, sender: str, receiver: str, t: int, number: int) -> Message:
    """An order that is cancelled, a passage that is asked for or granted, -1 for none."""
    return Message(sender=sender, receiver=receiver, topic=topic, t=t, data={"number": np.array([number])})


def number_of(m: Message) -> int:
    """From a message of one number."""
    return int(m.data["number"][0])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Pad:
    """What the carrier of a pad says of it. pose : (4,) east, north, up [m] of its middle, heading [rad];  velocity :
    (2,) m/s;  ready : whether it stands in the open for a drone."""

    carrier: str
    t: int
    pose: Floats
    velocity: Floats
    ready: bool

    def message(self) -> Message:
        """To everybody."""
        data = {"pose": self.pose, "velocity": self.velocity, "ready": np.array([float(self.ready)])}
        return Message(sender=self.carrier, topic=PAD, t=self.t, data=data)

    @classmethod
    def of(cls, m: Message) -> "Pad":
        """From a message of that topic."""
        ready = bool(m.data["ready"][0])
        return cls(carrier=m.sender, t=m.t, pose=m.data["pose"], velocity=m.data["velocity"], ready=ready)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """Something that stands in the way, as one robot has seen it.

    source, number : who, and which of its sightings: a newer one of that number replaces it;  t : ns, when it was seen
    last;  ends : (2, 2) m, site frame, of the line that it lies along;  radius : m, around that line;  P : (2, 2) m^2,
    of its place.
    """

    source: str
    number: int
    t: int
    ends: Floats
    radius: float
    P: Floats

    def message(self, t: int) -> Message:
        """To everybody, sent at t [ns]; the stamp is in whole seconds and nanoseconds, which floats hold."""
        seen = np.array([self.t // 10**9, self.t % 10**9], np.float64)
        which = np.array([float(self.number), self.radius])
        data = {"which": which, "seen": seen, "ends": self.ends, "covariance": self.P}
        return Message(sender=self.source, topic=SIGHTING, t=t, data=data)

    @classmethod
    def of(cls, m: Message) -> "Sighting":
        """From a message of that topic."""
        number, radius = m.data["which"].tolist()
        s, ns = (int(x) for x in m.data["seen"])
        return cls(
            source=m.sender, number=int(number), t=s * 10**9 + ns, ends=m.data["ends"], radius=radius,
            P=m.data["covariance"],
        )  # fmt: skip
