"""The radio: what arrives, when, and why the rest does not."""

from collections.abc import Mapping

import numpy as np
import pytest

from outrider.data.agents import Message
from outrider.errors import ConfigError
from outrider.sim.radio import Air, Lost, Radio
from outrider.typing import Floats

HERE: Mapping[str, Floats] = {"a": np.zeros(3), "b": np.array([30.0, 0.0, 40.0]), "c": np.array([500.0, 0.0, 0.0])}


def air(robots: tuple[str, ...] = ("a", "b"), **radio: object) -> Air:
    return Air(Radio(**radio), robots, 7, 0)  # type: ignore[arg-type]


def message(t: float, to: str = "b", numbers: int = 0) -> Message:
    return Message(sender="a", receiver=to, t=round(t * 1e9), data={"z": np.zeros(numbers)})


def test_latency_is_exact_and_each_message_comes_once() -> None:
    link = air(latency_s=0.25)
    link.send(message(1.0), HERE)
    assert link.receive("b", 1_249_999_999) == ()
    assert [m.t for m in link.receive("b", 1_250_000_000)] == [1_000_000_000]
    assert link.receive("b", 9_000_000_000) == ()


def test_messages_to_all_reach_all_but_the_sender() -> None:
    link = air(("a", "b", "c"))
    assert {d.receiver for d in link.send(message(0.0, to=""), HERE)} == {"b", "c"}


def test_every_loss_has_its_reason() -> None:
    down = {"*>b": ((2.0, 3.0),)}
    link = air(("a", "b", "c"), range_m=60.0, outages_s=down)
    told = [
        link.send(message(t, to), HERE)[0].lost
        for t, to in ((1.0, "b"), (2.5, "b"), (3.0, "b"), (1.0, "c"), (1.0, "d"))
    ]
    assert told == [None, Lost.OUTAGE, None, Lost.RANGE, Lost.NOBODY]
    assert link.sent == 5 and link.lost == {Lost.OUTAGE: 1, Lost.RANGE: 1, Lost.NOBODY: 1}
    assert air(loss=1.0).send(message(0.0), HERE)[0].lost is Lost.CHANCE


def test_bandwidth_makes_messages_queue() -> None:
    link = air(latency_s=0.0, bandwidth=1000.0)
    size = message(0.0, numbers=121).size
    assert size == 1000
    arrivals = [link.send(message(0.0, numbers=121), HERE)[0].t for _ in range(3)]
    assert arrivals == [10**9, 2 * 10**9, 3 * 10**9]


def test_loss_and_jitter_have_their_shares() -> None:
    link = air(loss=0.3, latency_s=0.1, jitter_s=0.05)
    made = [link.send(message(float(k)), HERE)[0] for k in range(4000)]
    waits = np.array([(d.t - d.message.t) * 1e-9 for d in made if d.t is not None])
    assert abs(1 - waits.size / 4000 - 0.3) < 4 * np.sqrt(0.3 * 0.7 / 4000)
    assert waits.min() >= 0.1 and abs(waits.mean() - 0.15) < 4 * 0.05 / np.sqrt(waits.size)


def test_another_robot_on_the_air_changes_no_loss() -> None:
    few, many = air(loss=0.5), air(("a", "b", "c"), loss=0.5)
    for k in range(50):
        many.send(message(float(k), "c"), HERE)
        assert few.send(message(float(k)), HERE)[0].lost == many.send(message(float(k)), HERE)[0].lost


@pytest.mark.parametrize(
    "wrong",
    [
        {"loss": 1.5}, {"loss": float("nan")}, {"latency_s": -1.0}, {"jitter_s": float("inf")}, {"bandwidth": 0.0},
        {"range_m": -3.0}, {"outages_s": {"a": ((0.0, 1.0),)}}, {"outages_s": {"a>b": ((2.0, 1.0),)}},
    ],
    ids=str,
)  # fmt: skip
def test_an_impossible_radio_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ConfigError):
        Radio(**wrong)  # type: ignore[arg-type]
