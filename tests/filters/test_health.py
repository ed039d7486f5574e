"""Gates, states of a source, resets: outliers are refused, a persistent truth is believed again."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import gammaincc
from support import channel, prior

from outrider.data import SensorState, Verdict
from outrider.filters import health
from outrider.filters.engine import RESET_TIME, Filter, OnlineFilter
from outrider.filters.health import H_BAD, H_GOOD, H_LAST_GOOD, H_RATE, H_SINCE, H_SIZE, H_STATE, H_Y, gates, judge
from outrider.filters.step import C_RESETS, OUT_NIS, OUT_STATE, OUT_VERDICT, OUT_Y
from outrider.models.motion import LaggedFollower, Motion
from outrider.models.sensors import GnssVelocity, Position

USED, GATED, FAULTED, RESET = Verdict.USED, Verdict.GATED, Verdict.FAULTED, Verdict.RESET


# ------------------------------------------------------------------------------------------------ gates


def test_gates_are_chi_square_quantiles():
    """Against the incomplete gamma function, and the printed values for 99.9 %."""
    for probability in (0.9, 0.99, 0.999):
        thresholds = gates(probability, 9)
        for dof in range(1, 10):
            assert gammaincc(0.5 * dof, 0.5 * thresholds[dof]) == pytest.approx(1.0 - probability, rel=1e-9)
    np.testing.assert_allclose(gates()[1:4], [10.828, 13.816, 16.266], atol=1e-3)


def test_a_gate_of_one_lets_everything_pass():
    assert np.isposinf(gates(1.0)[1:]).all()


# ------------------------------------------------------------------------------------------------ one source


def judged(pattern: str, period: float = 0.2) -> tuple[np.ndarray, list[Verdict], list[SensorState]]:
    """A source whose records pass (.) or fail (x) their gates: its row, the verdicts, the states."""
    h, verdicts, states = np.zeros(H_SIZE), [], []
    for k, c in enumerate(pattern):
        verdicts.append(Verdict(judge(h, period * k, c == ".", np.array([1.0, 2.0, np.nan]))))
        states.append(SensorState(int(h[H_STATE])))
    return h, verdicts, states


def test_a_source_warms_up_within_three_records():
    _, verdicts, states = judged("....")
    assert verdicts == [USED] * 4
    assert states == [SensorState.WARMING] * 2 + [SensorState.HEALTHY] * 2


def test_one_outlier_is_gated_and_forgotten():
    h, verdicts, states = judged("......x......")
    assert [v is GATED for v in verdicts] == [c == "x" for c in "......x......"]
    assert set(states[2:]) == {SensorState.HEALTHY}
    assert h[H_BAD] == 0.0 and h[H_GOOD] == 6.0


def test_the_whole_way_down_and_up():
    """Healthy, suspect, faulted while it fails; recovering on probation, suspect while its share is bad, healthy."""
    down, up = "....." + "x" * 20, "." * 40
    _, verdicts, states = judged(down + up)
    order = list(dict.fromkeys(states[4:]))
    assert order == [
        SensorState.HEALTHY,
        SensorState.SUSPECT,
        SensorState.FAULTED,
        SensorState.RECOVERING,
    ]
    after = list(dict.fromkeys(states[len(down) :]))
    assert after == [SensorState.RECOVERING, SensorState.SUSPECT, SensorState.HEALTHY]
    probation = verdicts[len(down) : len(down) + health.PROBATION]
    assert probation == [FAULTED] * (health.PROBATION - 1) + [USED]
    assert set(verdicts[len(down) + health.PROBATION :]) == {USED}


def test_a_relapse_on_probation_is_a_fault_again():
    _, verdicts, states = judged("....." + "x" * 20 + "..x....")
    assert verdicts[-7:] == [FAULTED, FAULTED, GATED, FAULTED, FAULTED, FAULTED, FAULTED]
    assert states[-5] is SensorState.FAULTED and states[-4] is SensorState.RECOVERING


def test_garbage_from_the_first_record_on_is_never_used():
    _, verdicts, states = judged("x" * 30)
    assert set(verdicts) == {GATED}
    assert states[0] is SensorState.WARMING and states[-1] is SensorState.FAULTED


def test_every_other_record_bad_is_suspect_not_faulted():
    _, verdicts, states = judged("....." + "x." * 50)
    assert set(states[20:]) == {SensorState.SUSPECT}
    assert verdicts[5:] == [GATED, USED] * 50


def test_the_row_of_failures_is_dated_from_its_first():
    h, _, _ = judged(".....xxx", period=1.0)
    assert h[H_SINCE] == 5.0 and h[H_BAD] == 3.0 and h[H_LAST_GOOD] == 4.0
    np.testing.assert_array_equal(h[H_Y : H_Y + 3], [1.0, 2.0, 0.0])
    assert 0.2 < h[H_RATE] < 0.3


# ------------------------------------------------------------------------------------------------ in the filter


class Bench:
    """A vehicle that stands at the origin; sources of position say where they think it is."""

    def __init__(self, names: tuple[str, ...] = ("a",), velocity: float = 0.1) -> None:
        theta = LaggedFollower(acceleration=0.05).theta()
        sources = tuple(channel(n, Position(sigma=0.1), reset=(0, 3)) for n in names)
        speed = channel("doppler", GnssVelocity())
        channels = (*sources, speed) if velocity else sources
        f = Filter(motion=Motion.FOLLOWER, theta=theta, coasting=theta, channels=channels)
        self.filter, self.t, self.names = OnlineFilter(f, prior(f.layout, 0.1), 0.0), 0.0, names
        self.velocity = len(names) if velocity else None

    def run(self, seconds: float, *places: float | None, rate: float = 5.0) -> list[list[tuple[Verdict, SensorState]]]:
        """Each source reports its place (east) for so long, None is silent; what became of the records, by source."""
        out: list[list[tuple[Verdict, SensorState]]] = [[] for _ in places]
        for _ in range(round(seconds * rate)):
            self.t += 1.0 / rate
            if self.velocity is not None:
                self.filter.process(self.t, self.velocity, np.zeros(3), np.full(3, 0.01))
            for k, place in enumerate(places):
                if place is not None:
                    o = self.filter.process(self.t, k, np.array([place, 0.0, 0.0]), np.full(3, 0.01))
                    self.last = o
                    out[k].append((Verdict(int(o[OUT_VERDICT])), SensorState(int(o[OUT_STATE]))))
        return out

    @property
    def east(self) -> float:
        return float(self.filter.belief.x[0])

    @property
    def resets(self) -> int:
        return int(self.filter.state.clock[C_RESETS])


def verdicts(history) -> list[Verdict]:
    return [v for v, _ in history]


def test_a_short_jump_is_gated_and_leaves_no_trace():
    bench = Bench()
    bench.run(5.0, 0.0)
    (during,) = bench.run(2.0, 20.0)
    assert set(verdicts(during)) == {GATED}
    assert abs(bench.east) < 0.1 and bench.resets == 0
    (after,) = bench.run(10.0, 0.0)
    assert set(verdicts(after)) == {USED}
    assert after[-1][1] is SensorState.HEALTHY and bench.resets == 0


def test_a_persistent_jump_earns_one_reset_that_tells_its_length():
    bench = Bench()
    bench.run(5.0, 0.0)
    (history,) = bench.run(RESET_TIME + 0.4, 20.0)
    patience = round(5 * RESET_TIME)
    assert verdicts(history)[:patience] == [GATED] * patience
    assert verdicts(history)[patience:].count(RESET) == 1 == bench.resets
    assert abs(bench.east - 20.0) < 0.5
    (rest,) = bench.run(10.0, 20.0)
    assert set(verdicts(rest)) == {USED} and rest[-1][1] is SensorState.HEALTHY
    assert bench.resets == 1 and abs(bench.east - 20.0) < 0.05


def test_the_reset_reports_how_far_it_moved():
    bench = Bench()
    bench.run(5.0, 0.0)
    bench.run(RESET_TIME, 20.0)
    while True:
        before = bench.east
        (history,) = bench.run(0.2, 20.0)
        if verdicts(history) == [RESET]:
            break
        assert bench.t < 7.0 + RESET_TIME
    assert bench.last[OUT_Y] == pytest.approx(20.0 - before, abs=1e-9)
    assert bench.last[OUT_NIS] > 1000.0


def test_no_reset_to_where_the_vehicle_cannot_be():
    """5 km away after three seconds is a fault of the source; after two minutes of nothing else it might be true."""
    bench = Bench(velocity=0.0)
    bench.run(5.0, 0.0)
    (history,) = bench.run(60.0, 5000.0, rate=2.0)
    assert set(verdicts(history)) == {GATED} and history[-1][1] is SensorState.FAULTED
    assert abs(bench.east) < 1.0
    (history,) = bench.run(80.0, 5000.0, rate=2.0)
    assert RESET in verdicts(history) and abs(bench.east - 5000.0) < 1.0


def test_no_reset_while_another_source_of_position_agrees():
    bench = Bench(("a", "b"))
    bench.run(5.0, 0.0, 0.0)
    a, b = bench.run(60.0, 0.0, 20.0)
    assert set(verdicts(a)) == {USED} and set(verdicts(b)) == {GATED}
    assert b[-1][1] is SensorState.FAULTED and a[-1][1] is SensorState.HEALTHY
    assert bench.resets == 0 and abs(bench.east) < 0.1


def test_the_liar_is_believed_only_after_the_honest_one_fell_silent_for_a_while():
    bench = Bench(("a", "b"))
    bench.run(5.0, 0.0, 0.0)
    bench.run(2.0 * RESET_TIME, 0.0, 20.0)
    _, b = bench.run(RESET_TIME - 0.4, None, 20.0)
    assert set(verdicts(b)) == {GATED}
    _, b = bench.run(2.0, None, 20.0)
    assert verdicts(b).count(RESET) == 1 and abs(bench.east - 20.0) < 0.5


def test_two_that_disagree_from_the_start_do_not_take_turns():
    """The first to be believed stays so: the estimate does not jump to and fro."""
    bench = Bench(("a", "b"))
    a, b = bench.run(60.0, 0.0, 15.0)
    assert set(verdicts(a)) == {USED} and set(verdicts(b)) == {GATED}
    assert bench.resets == 0


def test_a_faulted_source_that_agrees_again_is_on_probation():
    bench = Bench(("a", "b"))
    bench.run(5.0, 0.0, 0.0)
    bench.run(10.0, 0.0, 20.0)
    _, b = bench.run(4.0, 0.0, 0.0)
    assert verdicts(b)[: health.PROBATION - 1] == [FAULTED] * (health.PROBATION - 1)
    assert set(verdicts(b)[health.PROBATION - 1 :]) == {USED}
    assert b[0][1] is SensorState.RECOVERING and b[-1][1] in (SensorState.SUSPECT, SensorState.HEALTHY)


def test_garbage_at_the_start_never_enters():
    """A source whose first records are far off is refused while another holds the position."""
    bench = Bench(("a", "b"))
    _, b = bench.run(2.0 * RESET_TIME, 0.0, 300.0)
    assert USED not in verdicts(b) and RESET not in verdicts(b)
    _, b = bench.run(4.0, 0.0, 0.0)
    assert verdicts(b)[-1] is USED and abs(bench.east) < 0.05


def test_a_source_that_may_not_reset_never_does():
    bench = Bench()
    f = bench.filter.filter
    fixed = replace(f, channels=(replace(f.channels[0], reset=(0, 0)), *f.channels[1:]))
    bench.filter = OnlineFilter(fixed, prior(f.layout, 0.1), 0.0)
    bench.run(5.0, 0.0)
    (history,) = bench.run(30.0, 20.0)
    assert set(verdicts(history)) == {GATED} and bench.resets == 0


def test_after_an_outage_the_position_is_found_again():
    """Two minutes without a fix, driving on at an unknown pace: accepted at once or after a reset, never refused."""
    bench = Bench(velocity=0.0)
    bench.run(5.0, 0.0)
    bench.t += 120.0
    (history,) = bench.run(5.0, 90.0)
    assert verdicts(history)[-1] is USED and abs(bench.east - 90.0) < 0.2


def test_rewinding_restores_health():
    """A jump that is seen in another order of arrival ends in the same state of the source."""
    f = Bench().filter.filter
    one, two = (OnlineFilter(f, prior(f.layout, 0.1), 0.0) for _ in range(2))
    n = round(5 * RESET_TIME) + 20
    t = 0.2 * np.arange(1, n + 1)
    blocks = [np.random.default_rng(k).permutation(8) + k for k in range(0, n - 8, 8)]
    for filter_, indices in ((one, np.arange(n)), (two, np.concatenate([*blocks, np.arange(8 * len(blocks), n)]))):
        for i in indices:
            place = 20.0 if i >= 10 else 0.0
            filter_.process(float(t[i]), 0, np.array([place, 0.0, 0.0]), np.full(3, 0.01))
    assert two.rewinds >= 20
    assert one.state.health.tobytes() == two.state.health.tobytes()
    assert one.state.clock.tobytes() == two.state.clock.tobytes() and one.state.clock[C_RESETS] >= 1
