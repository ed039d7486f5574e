"""Estimates of a team under way against the same records fused at once."""

import numpy as np
import pytest

from outrider.data import Datum, Gaussian, Kind, stream
from outrider.errors import ConfigError
from outrider.filters.cooperative import Member, Method, Source, fuse_team
from outrider.models import sensors as s
from outrider.models.motion import LAYOUTS, DriftingRover, Motion
from outrider.sim.radio import Air, Radio
from outrider.team.crew import Crew
from outrider.team.ears import Ear

LAYOUT = LAYOUTS[Motion.DRIFTING]
START = 10**18
INF = float("inf")


def team(n=2):
    out = []
    for i in range(n):
        x, sd = LAYOUT.zeros(), np.zeros(LAYOUT.error_size)
        x[LAYOUT.state("position")] = 3.0 * i, 0.0
        for block, value in {"position": 0.5, "heading": 0.1, "velocity": 0.3, "yaw_rate": 0.1}.items():
            sd[LAYOUT.error(block)] = value
        belief = Gaussian(x, np.diag(sd**2), LAYOUT)
        out.append(Member(name="abc"[i], motion=Motion.DRIFTING, model=DriftingRover(), belief=belief))
    return out


def records(names, seed=3):
    """name -> (fixes, sightings of the next one), t in s."""
    rng, t = np.random.default_rng(seed), np.arange(1, 41) * 0.1
    out = {}
    for i, name in enumerate(names):
        fixes = np.column_stack([3.0 * i + 0.5 * rng.normal(size=t.size), 0.5 * rng.normal(size=(t.size, 2))])
        turn = 0.05 * rng.normal(size=t.size)
        quats = np.column_stack([np.zeros((t.size, 2)), np.sin(turn / 2), np.cos(turn / 2)])
        step = 3.0 if i + 1 < len(names) else -3.0 * i
        seen = np.column_stack([np.ones(t.size), step + 0.1 * rng.normal(size=t.size),
                                0.1 * rng.normal(size=t.size), np.zeros(t.size), quats])  # fmt: skip
        out[name] = t, fixes, seen
    return out


FIX, SEEN = (0.5, 0.5, INF), (0.1, 0.1, INF, INF, INF, 0.05)


@pytest.mark.parametrize("method", [Method.JOINT, Method.DISTRIBUTED, Method.LOCAL, Method.CI])
def test_step_by_step_is_the_same_as_at_once(method):
    members = team()
    data = records("ab")
    ears, sources = {}, []
    for name, other in (("a", "b"), ("b", "a")):
        t, fixes, seen = data[name]
        ears[name] = (
            Ear(stream="fix", sensor=s.Position(), sigmas=FIX),
            Ear(stream="eye", sensor=s.RelativePose(), sigmas=SEEN, partner=other, number=1.0),
        )
        sources += [
            Source(robot=name, sensor=s.Position(), t=t, z=fixes, sigmas=np.array(FIX)),
            Source(robot=name, sensor=s.RelativePose(), t=t, z=seen, sigmas=np.array(SEEN), partner=other),
        ]
    at = np.arange(1, 21) * 0.2
    exact = Method.JOINT if method is Method.DISTRIBUTED else method  # the same for two
    whole = fuse_team(members, sources, exact, at, start=0.0)
    crew = Crew(members, ears, method, START, Datum(lat=0.8, lon=0.1, alt=0.0))
    for k in range(1, 21):
        for name in "ab":
            t, fixes, seen = data[name]
            rows = (t > 0.2 * (k - 1) + 1e-6) & (t < 0.2 * k + 1e-6)
            stamps = START + np.rint(t[rows] * 1e9).astype(np.int64)
            news = [stream("fix", Kind.POSITION, stamps, fixes[rows]),
                    stream("eye", Kind.RELATIVE_POSE, stamps, seen[rows])]  # fmt: skip
            crew.take(name, START + round(0.2 * k * 1e9), news)
    for name in "ab":
        mine, theirs = np.array(crew.kept[name].pose), whole.x[name]
        assert np.abs(mine[:, :2] - theirs[:, LAYOUT.state("position")]).max() < 1e-9
        assert np.abs(mine[:, 3] - theirs[:, LAYOUT.state("heading")][:, 0]).max() < 1e-9
        P = np.array(crew.kept[name].P)[:, [0, 1, 3]][:, :, [0, 1, 3]]
        assert np.abs(P - whole.pose_covariance(name)).max() < 1e-9
    assert sum(a.used for a in crew.agreements()) == sum(n for v, n in whole.counts().items() if v.name == "USED")


def test_nobody_hears_of_what_has_not_been_handed_in():
    crew = Crew(team(), {n: (Ear(stream="fix", sensor=s.Position(), sigmas=FIX),) for n in "ab"}, Method.JOINT, START,
                Datum(lat=0.8, lon=0.1, alt=0.0))  # fmt: skip
    fix = stream("fix", Kind.POSITION, np.array([START + 10**8]), np.array([[1.0, 0.0, 0.0]]))
    crew.take("a", START + 2 * 10**8, [fix])
    assert crew.now("a", START + 2 * 10**8).p[0] == 0.0  # b is still to come
    crew.take("b", START + 2 * 10**8, [])
    assert crew.now("a", START + 2 * 10**8).p[0] > 0.2
    assert crew.agreements()[0].used == 1


def test_a_record_that_is_no_number_changes_nothing():
    crew = Crew(team(1), {"a": (Ear(stream="fix", sensor=s.Position(), sigmas=FIX),)}, Method.JOINT, START,
                Datum(lat=0.8, lon=0.1, alt=0.0))  # fmt: skip
    fix = stream("fix", Kind.POSITION, np.array([START + 10**8]), np.array([[np.nan, 9.0, 0.0]]))
    crew.take("a", START + 2 * 10**8, [fix])
    here = crew.now("a", START + 2 * 10**8)
    assert np.allclose(here.p, 0.0) and np.isfinite(here.P).all()
    assert crew.agreements()[0].used == 0


def test_a_partner_that_is_nobody_is_named():
    ear = Ear(stream="eye", sensor=s.RelativePose(), sigmas=SEEN, partner="zoe", number=1.0)
    with pytest.raises(ConfigError, match="no robot 'zoe'"):
        Crew(team(), {"a": (ear,), "b": ()}, Method.DISTRIBUTED, START, Datum(lat=0.8, lon=0.1, alt=0.0))


def through(method, radio, until=4.4, names="ab"):
    """A crew that has heard everything by radio, and a while after; each sees the next."""
    data, ears = records(names), {}
    for name, other in zip(names, names[1:] + names[:1], strict=True):
        ears[name] = (
            Ear(stream="fix", sensor=s.Position(), sigmas=FIX),
            Ear(stream="eye", sensor=s.RelativePose(), sigmas=SEEN, partner=other, number=1.0),
        )
    air = None if radio is None else Air(radio, tuple(names), 1, 0)
    crew = Crew(team(len(names)), ears, method, START, Datum(lat=0.8, lon=0.1, alt=0.0), air)
    stamps = START + np.rint(data["a"][0] * 1e9).astype(np.int64)
    log = {n: [stream("fix", Kind.POSITION, stamps, data[n][1]), stream("eye", Kind.RELATIVE_POSE, stamps, data[n][2])]
           for n in names}  # fmt: skip
    crew.hear_again(log, 0.2, until)
    return crew


def last(crew):
    return tuple(np.array([getattr(crew.kept[n], what)[-1] for n in crew.names]) for what in ("pose", "P"))


def test_three_robots_end_as_one_filter_would():
    """Each meets both others ten times a second, so that all news get round. Records of the last meetings are under way
    when it ends: nobody meets afterwards, so third parties hear of them no more."""
    late, exact = through(Method.DISTRIBUTED, Radio(), names="abc"), through(Method.JOINT, None, names="abc")
    alone = through(Method.LOCAL, None, names="abc")
    off, far = (np.abs(last(c)[0] - last(exact)[0])[:, :2].max() for c in (late, alone))
    assert off < 0.02 < far and not late.exchange["refused"]


def test_what_is_late_counts_as_if_it_had_come_at_once():
    """Meetings at 0.1 s, telegrams 0.25 s late: all of them heard a while after the last. Points of linearisation
    differ, so not to the last digit."""
    late, exact = through(Method.DISTRIBUTED, Radio(latency_s=0.25)), through(Method.JOINT, None)
    for mine, theirs in zip(last(late), last(exact), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=2e-3)
    assert not late.exchange["refused"] and late.exchange["telegrams"] == 80
    assert np.abs(last(through(Method.LOCAL, None))[0] - last(exact)[0]).max() > 0.02


@pytest.mark.parametrize("method", [Method.DISTRIBUTED, Method.CI, Method.NAIVE])
def test_without_any_telegram_everybody_is_alone(method):
    deaf, alone = through(method, Radio(loss=1.0)), through(Method.LOCAL, None)
    for mine, theirs in zip(last(deaf), last(alone), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-9)
    assert deaf.exchange["lost"] == {"chance": deaf.exchange["telegrams"]}
    assert sum(a.used for a in deaf.agreements() if a.partner) == 0


def test_a_radio_reaches_as_far_as_it_does():
    """The robots stand 3 m apart."""
    near, far = (through(Method.CI, Radio(range_m=r)) for r in (4.0, 2.0))
    assert near.exchange["lost"] == {} and set(far.exchange["lost"]) == {"range"}


def test_a_blow_stays_when_late_news_are_worked_in():
    """Telegrams come 0.25 s late: the robot takes its records once more from the meeting, the blow included."""
    grown = []
    for method, radio in ((Method.LOCAL, None), (Method.DISTRIBUTED, Radio(latency_s=0.25, loss=0.0))):
        crew = through(method, radio, until=3.0)
        before = crew.now("a", START + 3 * 10**9).P[0, 0]
        crew.jolt("a", 5.0, 0.0)
        for k in (16, 17):
            for name in "ab":
                crew.take(name, START + round(0.2 * k * 1e9), [])
        grown.append(np.sqrt(crew.now("a", START + round(3.4e9)).P[0, 0] - before))
    assert grown[1] > 0.02 and grown[1] <= grown[0] + 1e-9


def test_a_recording_in_one_go_is_the_same_as_in_steps():
    data, ears = records("ab"), {n: (Ear(stream="fix", sensor=s.Position(), sigmas=FIX),) for n in "ab"}
    site = Datum(lat=0.8, lon=0.1, alt=0.0)
    stepped, whole = (Crew(team(), ears, Method.JOINT, START, site) for _ in range(2))
    log = {n: [stream("fix", Kind.POSITION, START + np.rint(t * 1e9).astype(np.int64), fixes)]
           for n, (t, fixes, _) in data.items()}  # fmt: skip
    log["a"] = [log["a"][0].select(np.arange(40)[::-1])]  # whatever the order in which it was written
    whole.hear_again(log, 0.2, 4.0)
    for name in "ab":
        stepped.take(name, START, log[name])
    for k in range(1, 21):
        for name in "ab":
            stepped.take(name, START + round(0.2 * k * 1e9), ())
    for name in "ab":
        assert np.array_equal(stepped.kept[name].t, whole.kept[name].t)
        assert np.array_equal(stepped.kept[name].pose, whole.kept[name].pose)
        assert np.array_equal(stepped.kept[name].P, whole.kept[name].P)
    assert np.array_equal(stepped.crossed["a", "b"], whole.crossed["a", "b"])
    assert stepped.agreements() == whole.agreements()
    late = START + 4_100_000_000
    assert np.array_equal(stepped.now("a", late).P, whole.now("a", late).P)
