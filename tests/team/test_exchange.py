"""Telegrams between robots: read as written, refused by name, and the same estimate however they travel."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.data import Gaussian
from outrider.data.agents import Message
from outrider.filters.cooperative import Member, Method, Source, fuse_team
from outrider.filters.cooperative.fusion import Prepared, prepare
from outrider.models import sensors as s
from outrider.models.motion import LAYOUTS, LaggedFollower, Motion
from outrider.scenarios.radio import Heard, fuse_by_radio
from outrider.sim.radio import Lost, Radio
from outrider.team.exchange import TOPIC, Exchange, Refusal, Telegram, decode, encode
from outrider.typing import Floats

STEP, LAYOUT = 0.1, LAYOUTS[Motion.FOLLOWER]
MODEL, P0 = LaggedFollower(acceleration=0.3), np.diag([1.0] * 3 + [0.3] * 3)
PLACE_ONLY = np.array([0.1] * 3 + [np.inf] * 3)


def team(seed: int, robots: int = 2, n: int = 40, until: int = 0, gap: tuple[float, float] = (9e9, 9e9)):
    """Members, sources, truth (robots, n, 6): fixes for all, relative places every half second up to a step, and not
    in a gap [s]."""
    rng = np.random.default_rng(seed)
    x, truth = rng.normal(size=(robots, 6)), np.zeros((robots, n, 6))
    L = np.linalg.cholesky(0.09 * np.array([[STEP**3 / 3, STEP**2 / 2], [STEP**2 / 2, STEP]]))
    for k in range(n):
        truth[:, k] = x
        w = rng.normal(size=(robots, 3, 2)) @ L.T
        x = np.hstack([x[:, :3] + STEP * x[:, 3:] + w[..., 0], x[:, 3:] + w[..., 1]])
    t, members, sources = STEP * np.arange(1, n), [], []
    for i in range(robots):
        b = Gaussian(truth[i, 0] + rng.normal(size=6) * np.sqrt(np.diag(P0)), P0, LAYOUT)
        members.append(Member(name=f"r{i}", motion=Motion.FOLLOWER, model=MODEL, belief=b))
        z = truth[i, 1:, :3] + 0.5 * rng.normal(size=(n - 1, 3))
        sources.append(Source(robot=f"r{i}", sensor=s.Position(sigma=0.5), t=t, z=z))
    for i in range(robots):
        for j in range(robots):
            k = np.arange(1 + (i + 2 * j) % 5, until or n, 5)
            k = k[(k * STEP < gap[0]) | (k * STEP > gap[1])]
            z = np.zeros((k.size, 8))
            z[:, 1:4], z[:, 7] = truth[j, k, :3] - truth[i, k, :3] + 0.1 * rng.normal(size=(k.size, 3)), 1.0
            if i != j:
                sources.append(Source(robot=f"r{i}", partner=f"r{j}", sensor=s.RelativePose(), sigmas=PLACE_ONLY,
                                      t=STEP * k, z=z))  # fmt: skip
    return members, sources, truth


def ends(seed: int = 1, robots: int = 2) -> tuple[Prepared, list[Exchange]]:
    """Robots that have met once and not talked yet."""
    members, sources, _ = team(seed, robots, 12)
    ready = prepare(members, sources, Method.DISTRIBUTED, np.zeros(0), start=0.0)
    names = tuple(m.name for m in members)
    out = [Exchange(mate, names) for mate in ready.mates()]
    seen = ready.relative(ready.meetings()[0])
    for m, partner in ((seen.observer, seen.observed), (seen.observed, seen.observer)):
        out[m].mate.own.run(seen.t)
        out[m].mate.close(partner)
    out[seen.observer].mate.note(seen)
    return ready, [out[seen.observer], out[seen.observed]]


def test_a_telegram_reads_as_it_was_written_and_knows_its_size() -> None:
    _, (one, two) = ends()
    telegram = one.telegram(two.name)
    row = encode(telegram)
    back = decode(row)
    np.testing.assert_array_equal(encode(back), row)
    assert back.news.meetings == telegram.news.meetings and back.news.records[0].key == telegram.news.records[0].key
    np.testing.assert_array_equal(back.news.segments[0].W, telegram.news.segments[0].W)
    # head, heard, a meeting, one segment of 6 states, one record of a pose
    assert row.size == 11 + 4 + 3 + (5 + 12 + 36 + 6 + 21 + 21 + 6) + (8 + s.RelativePose().theta().size + 8 + 8)
    assert one.post(two.name, telegram).size == 32 + 8 * row.size == one.sent


@settings(max_examples=30)
@given(cut=st.integers(0, 60), at=st.integers(0, 150), value=st.sampled_from([np.nan, -1.0, 1e9, 0.5]))
def test_a_damaged_row_is_refused_and_changes_nothing(cut: int, at: int, value: float) -> None:
    _, (one, two) = ends()
    message = one.post(two.name, one.telegram(two.name))
    row = message.data["telegram"].copy()
    row[at % 11] = value if row[at % 11] != value else value + 1.0
    before = two.mate.own.belief.x.copy()
    bad = replace(message, data={"telegram": row[: row.size - cut]})
    why = two.receive(bad, two.mate.now)
    two.mate.settle()
    if at % 11 not in (6,) or cut:  # the age that it has seen may be any
        assert why is not None and two.refused[one.name, why] == 1
        np.testing.assert_allclose(two.mate.own.belief.x, before, atol=1e-12)
    assert np.isfinite(two.mate.own.belief.x).all()


def spoilt(telegram: Telegram, what: Refusal) -> Telegram:
    """A telegram that is wrong in one way."""
    n = telegram.news
    first, record = n.segments[0], n.records[0]
    if what is Refusal.UNKNOWN:
        return replace(telegram, news=replace(n, segments=(replace(first, robot=7),)))
    if what is Refusal.ITSELF:
        return replace(telegram, news=replace(n, records=(replace(record, observed=record.observer),)))
    if what is Refusal.DATUM:
        return replace(telegram, datum=(0.5, 0.1, 30.0))
    if what is Refusal.FUTURE:
        return replace(telegram, news=replace(n, records=(replace(record, t=record.t + 5.0),)))
    if what is Refusal.CLOCK:
        return replace(telegram, age=-0.4)
    if what is Refusal.NOT_FINITE:
        return replace(telegram, news=replace(n, segments=(replace(first, h=first.h * np.nan),)))
    return replace(telegram, news=replace(n, segments=(replace(first, W=-first.W),)))


@pytest.mark.parametrize("what", [r for r in Refusal if r is not Refusal.UNREADABLE], ids=lambda r: r.name)
def test_what_cannot_be_right_is_refused_by_name_and_counted(what: Refusal) -> None:
    _, (one, two) = ends()
    good = one.telegram(two.name)
    x, P = two.mate.own.belief.x.copy(), two.mate.own.belief.P.copy()
    assert two.receive(one.post(two.name, spoilt(good, what)), two.mate.now) is what
    two.mate.settle()
    np.testing.assert_allclose(two.mate.own.belief.x, x, atol=1e-12)
    np.testing.assert_allclose(two.mate.own.belief.P, P, atol=1e-12)
    assert two.refused == {(one.name, what): 1} and two.received == 0
    assert two.receive(one.post(two.name, good), two.mate.now) is None  # and the next one is welcome
    two.mate.settle()
    assert np.trace(two.mate.own.belief.P) < np.trace(P)


def test_a_stranger_and_a_text_are_refused() -> None:
    _, (one, two) = ends()
    good = one.post(two.name, one.telegram(two.name))
    assert two.receive(replace(good, sender="mallory"), 1.0) is Refusal.UNKNOWN
    assert two.receive(Message(sender=one.name, topic=TOPIC), 1.0) is Refusal.UNREADABLE


def by_radio(made: tuple[list[Member], list[Source], Floats], t: Floats, radio: Radio, **more: object) -> Heard:
    return fuse_by_radio(made[0], made[1], t, radio, 0, start=0.0, **more)  # type: ignore[arg-type]


def test_late_and_shuffled_news_end_as_if_they_had_come_at_once() -> None:
    """All meetings are over by 3 s, all telegrams here by 4.5 s: the same estimate to 1e-9."""
    made = team(3, 2, 50, until=30)
    end = np.array([4.8])
    at_once = by_radio(made, end, Radio(latency_s=0.0))
    for radio in (Radio(latency_s=0.5), Radio(latency_s=0.1, jitter_s=0.2)):
        late = by_radio(made, end, radio)
        assert not late.refused and late.received == at_once.received
        for name in at_once.estimate.x:
            np.testing.assert_allclose(late.estimate.x[name], at_once.estimate.x[name], atol=1e-9)
            np.testing.assert_allclose(late.estimate.P[name], at_once.estimate.P[name], atol=1e-9)


@pytest.mark.compiled
def test_what_is_lost_comes_with_the_next_telegram() -> None:
    """Half of the telegrams lost and half a second late: behind the joint filter, far ahead of none, and honest."""
    errors: dict[str, list[float]] = {"none": [], "radio": [], "joint": [], "nees": []}
    t = STEP * np.arange(20, 60)
    for seed in range(4):
        made = team(seed, 2, 60)
        done = {
            "none": fuse_team(*made[:2], Method.LOCAL, t, start=0.0),
            "joint": fuse_team(*made[:2], Method.JOINT, t, start=0.0),
            "radio": by_radio(made, t, Radio(latency_s=0.5, loss=0.5)).estimate,
        }
        for name, d in done.items():
            e = np.array([d.x[f"r{i}"] - made[2][i, 20:60] for i in (0, 1)])
            errors[name].append(float(np.mean(e[..., :3] ** 2)))
        e = done["radio"].x["r0"] - made[2][0, 20:60]
        errors["nees"].append(
            float(np.mean(np.sum(e * np.linalg.solve(done["radio"].P["r0"], e[..., None])[..., 0], 1)))
        )
    none, radio, joint = (np.sqrt(np.mean(errors[k])) for k in ("none", "radio", "joint"))
    assert joint < radio < none
    assert np.mean(errors["nees"]) / 6.0 == pytest.approx(1.0, abs=0.35)


@pytest.mark.compiled
def test_a_robot_that_disappears_and_returns_is_caught_up_with() -> None:
    made = team(2, 3, 60)
    radio = Radio(latency_s=0.02, outages_s={"r2>*": ((1.0, 4.0),), "*>r2": ((1.0, 4.0),)})
    end = np.array([5.85])
    away, here = by_radio(made, end, radio), by_radio(made, end, Radio(latency_s=0.02))
    assert away.lost[Lost.OUTAGE] > 20 and not away.refused
    for name in ("r0", "r1", "r2"):
        e = away.estimate.x[name][0] - here.estimate.x[name][0]
        assert np.linalg.norm(e[:3]) < 0.5 * np.sqrt(np.trace(here.estimate.P[name][0][:3, :3]))


def five_metres_off(liar: str, first: float, last: float):
    """From a time on, until another, a robot says that it is 5 m farther east than it knows."""

    def off(t: float) -> bool:
        return first < t <= last

    def lie(name: str, t: float, telegram: Telegram) -> Telegram:
        if name != liar:
            return telegram
        n = telegram.news
        step = np.array([5.0, 0, 0, 0, 0, 0])
        own = int(liar[1:])
        wrong = tuple(
            replace(q, x_start=q.x_start + step * off(q.start), x_end=q.x_end + step * off(q.end))
            if q.robot == own
            else q
            for q in n.segments
        )
        return replace(telegram, news=replace(n, segments=wrong))

    return lie


@pytest.mark.compiled
def test_a_robot_that_lies_is_isolated_named_and_admitted_again() -> None:
    costs, t = [], STEP * np.arange(20, 80)
    for seed in range(2):
        made = team(seed, 3, 80)
        honest = by_radio(made, t, Radio())
        fooled = by_radio(made, t, Radio(), lie=five_metres_off("r2", 2.0, 4.0))
        assert not honest.isolated
        for name in ("r0", "r1"):
            events = fooled.isolated[name]
            assert {who for _, who, _ in events} == {"r2"}
            assert [out for _, _, out in events][:2] == [True, False]
            assert 2.0 < events[0][0] < 4.0 < events[-1][0] < 7.5 and not events[-1][2]
        squares: list[float] = []
        for done in (honest, fooled):
            e = np.array([done.estimate.x[f"r{i}"] - made[2][i, 20:80] for i in range(2)])
            squares.append(float(np.mean(e[..., :3] ** 2)))
        costs.append(squares)
    honest_rmse, fooled_rmse = np.sqrt(np.mean(costs, axis=0))
    assert fooled_rmse < 1.1 * honest_rmse
