"""Spans of drift: how they are written, where they end, and what cannot be one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.data import Trajectory
from outrider.errors import DataError, UsageError
from outrider.eval import Alignment, Association, Span, Unit, align, associate_nearest, compare
from outrider.eval.spans import fitting_lengths, span_ends


def line(t_s: list[float], x: list[float]) -> Trajectory:
    p = np.column_stack([x, np.zeros(len(x)), np.zeros(len(x))]).astype(np.float64)
    t = np.rint(np.array(t_s) * 1e9).astype(np.int64)
    return Trajectory(t=t, p=p, q=np.tile([0.0, 0.0, 0.0, 1.0], (len(x), 1)), name="line")


def test_written_and_read() -> None:
    assert Span.parse("10s") == Span.parse("10") == Span(10.0) and str(Span.parse(" 100m ")) == "100 m"
    assert Span.parse("5r", chained=True) == Span(5.0, Unit.RECORDS, chained=True)
    for text in ("", "m", "0s", "-3m", "nan", "infs", "2.5r", "ten s"):
        with pytest.raises(UsageError, match="no span"):
            Span.parse(text)


def test_where_they_end() -> None:
    path = line([0, 1, 2, 3, 9, 10], [0, 2, 3, 7, 8, 12])
    ends = {
        "2s": ([0, 1], [2, 3]),  # across the gap: left out
        "4m": ([0, 1, 2, 3, 4], [3, 3, 3, 5, 5]),
        "2r": ([0, 1, 2, 3], [2, 3, 4, 5]),
    }
    for text, (first, last) in ends.items():
        i, j = span_ends(path, Span.parse(text))
        assert (i.tolist(), j.tolist()) == (first, last), text
    i, j = span_ends(path, Span(4.0, Unit.METRES, chained=True))
    assert (i.tolist(), j.tolist()) == ([0, 3], [3, 5])
    i, j = span_ends(path, Span(2, Unit.RECORDS, chained=True))
    assert (i.tolist(), j.tolist()) == ([0, 2], [2, 4])


@given(st.floats(0.1, 1e6))
def test_lengths_fit_twice(path: float) -> None:
    lengths = fitting_lengths(path)
    assert len(lengths) <= 5 and all(2 * length <= path for length in lengths) and list(lengths) == sorted(lengths)


def test_dead_reckoning_that_reads_one_percent_long_drifts_ten_metres_a_kilometre() -> None:
    s = np.arange(0.0, 501.0)
    told = compare(line(s.tolist(), (1.01 * s).tolist()), line(s.tolist(), s.tolist()))
    assert told.drift.m_per_km == pytest.approx(10.0) and told.drift.rad_per_km == 0.0
    assert told.drift.lengths_m == (10.0, 20.0, 50.0, 100.0, 200.0)


def test_nearest_takes_each_pose_of_the_shorter_one() -> None:
    few, many = line([1.0, 2.0, 30.0], [1, 2, 30]), line([0.9, 1.1, 2.1, 2.2, 3.0], [9, 11, 21, 22, 30])
    for pairs, back in (
        (associate_nearest(few, many, max_diff_s=0.2), False),
        (associate_nearest(many, few, max_diff_s=0.2), True),
    ):
        a, b = (pairs.reference, pairs.estimate) if not back else (pairs.estimate, pairs.reference)
        assert a.p[:, 0].tolist() == [9.0, 21.0] and b.p[:, 0].tolist() == [1.0, 2.0]  # equally near: the earlier one
        assert sum(pairs.lost.values()) == 1


@pytest.mark.parametrize(("how", "x", "words"), [(Alignment.YAW, 0.0, "one place"), (Alignment.SE3, 1.0, "one line")])
def test_positions_that_leave_a_rotation_open(how: Alignment, x: float, words: str) -> None:
    still = line([0, 1, 2, 3], [0, x, 2 * x, 3 * x])
    with pytest.raises(DataError, match=words):
        align(Association(estimate=still, reference=still, lost={}), how)
