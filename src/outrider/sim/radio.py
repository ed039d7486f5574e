"""The radio between robots: what arrives, when, and why the rest does not.

A link is an ordered pair of robots. It has random numbers of its own, so another robot on the air changes none of its
losses; its messages leave one after the other at the link's bandwidth.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from math import inf
from typing import final

import numpy as np
from numpy.random import Generator

from outrider.data.agents import Message
from outrider.errors import ConfigError
from outrider.sim.noise import generator
from outrider.typing import Floats


class Lost(Enum):
    """Why a message did not arrive."""

    RANGE = "the robots were too far apart"
    OUTAGE = "the link was down"
    CHANCE = "lost on the air"
    NOBODY = "no robot of that name"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Radio:
    """How every link behaves."""

    range_m: float = inf
    latency_s: float = 0.02
    jitter_s: float = 0.0  # mean of an exponential delay on top of the latency
    loss: float = 0.0  # share of messages lost by chance
    bandwidth: float = inf  # bytes/s of one link
    outages_s: Mapping[str, tuple[tuple[float, float], ...]] = field(
        default_factory=dict[str, tuple[tuple[float, float], ...]]
    )
    """Seconds since the start during which a link is down, by "sender>receiver"; "*" is any robot."""

    def __post_init__(self) -> None:
        named = {"range_m": self.range_m, "bandwidth": self.bandwidth}
        for name, value in named.items():
            if not value > 0:
                raise ConfigError(f"is {value}", where=f"radio {name}", fix="a number above 0")
        for name, value in {"latency_s": self.latency_s, "jitter_s": self.jitter_s}.items():
            if not 0 <= value < inf:
                raise ConfigError(f"is {value}", where=f"radio {name}", fix="seconds, 0 or more")
        if not 0 <= self.loss <= 1:
            raise ConfigError(f"is {self.loss}", where="radio loss", fix="a share between 0 and 1")
        for link, windows in self.outages_s.items():
            if len(link.split(">")) != 2:
                raise ConfigError(f"names no link: '{link}'", where="radio outages_s", fix='write "sender>receiver"')
            if any(not start < end for start, end in windows):
                raise ConfigError("ends before it starts", where=f"radio outages_s {link}")

    def down(self, sender: str, receiver: str, seconds: float) -> bool:
        """Whether the link is in an outage."""
        if not self.outages_s:
            return False
        names = (f"{a}>{b}" for a in (sender, "*") for b in (receiver, "*"))
        return any(start <= seconds < end for link in names for start, end in self.outages_s.get(link, ()))


@final
@dataclass(frozen=True, slots=True)
class Delivery:
    """One message at one receiver. t : ns of arrival, or the reason why there is none."""

    message: Message
    receiver: str
    t: int | None
    lost: Lost | None = None


class Air:
    """The messages of one run under way."""

    def __init__(self, radio: Radio, robots: tuple[str, ...], seed: int, start: int) -> None:
        self._radio, self._robots, self._start = radio, robots, start
        self._rng: dict[tuple[str, str], Generator] = {
            (a, b): generator(seed, a, f"radio to {b}") for a in robots for b in robots if a != b
        }
        self._free: dict[tuple[str, str], int] = {}
        self._under_way: list[Delivery] = []
        self.lost: Counter[Lost] = Counter()
        self.sent = 0

    def send(self, message: Message, places: Mapping[str, Floats]) -> tuple[Delivery, ...]:
        """Put a message on the air; `places` are the robots' true positions [m] now."""
        receivers = [message.receiver] if message.receiver else [r for r in self._robots if r != message.sender]
        made = tuple(self._deliver(message, receiver, places) for receiver in receivers)
        self.sent += len(made)
        for d in made:
            if d.lost is None:
                self._under_way.append(d)
            else:
                self.lost[d.lost] += 1
        return made

    def receive(self, robot: str, until: int) -> tuple[Message, ...]:
        """What has reached a robot by `until` [ns], in the order of arrival; each message once."""
        here: list[Delivery] = []
        later: list[Delivery] = []
        for d in self._under_way:
            (here if d.receiver == robot and d.t is not None and d.t <= until else later).append(d)
        self._under_way = later
        return tuple(d.message for d in sorted(here, key=lambda d: (d.t or 0, d.message.sender)))

    def _deliver(self, message: Message, receiver: str, places: Mapping[str, Floats]) -> Delivery:
        radio, link = self._radio, (message.sender, receiver)
        if link not in self._rng:
            return Delivery(message, receiver, None, Lost.NOBODY)
        chance, wait = self._rng[link].random(), self._rng[link].exponential()  # always both: no fault shifts the rest
        leaves = max(message.t, self._free.get(link, message.t))
        sending = round(message.size / radio.bandwidth * 1e9) if radio.bandwidth < inf else 0
        self._free[link] = leaves + sending
        t = leaves + sending + round((radio.latency_s + radio.jitter_s * wait) * 1e9)
        if radio.down(*link, (message.t - self._start) * 1e-9):
            return Delivery(message, receiver, None, Lost.OUTAGE)
        if radio.range_m < inf and float(np.linalg.norm(places[receiver] - places[message.sender])) > radio.range_m:
            return Delivery(message, receiver, None, Lost.RANGE)
        if chance < radio.loss:
            return Delivery(message, receiver, None, Lost.CHANCE)
        return Delivery(message, receiver, t)
