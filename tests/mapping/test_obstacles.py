"""Scans against cells and beams intersected by shapely: what is marked, what is cleared, what neither."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, box

from outrider.data.grid import FREE, LETHAL, UNKNOWN
from outrider.data.scan import Scan
from outrider.errors import ConfigError, DataError
from outrider.mapping.obstacles import HIT, MOST, NEVER, Marking, look_up, observe

SIZE, SIDE = 21, 0.1
MARKING = Marking(mark=2.0, clear=2.5)
MIDDLE = np.array([1.05, 1.05, 0.0])


def entered(cells, ranges, bearings, pose=MIDDLE, marking=MARKING, **lidar):
    scan = Scan(pose=np.array(pose), bearings=np.array(bearings), ranges=np.array(ranges), **{"reach": 10.0, **lidar})
    return observe(cells, SIDE, np.zeros(2), scan, marking)


def blank(value=UNKNOWN):
    return np.full((SIZE, SIZE), value, np.uint8)


def test_a_hit_marks_its_cell_and_frees_the_way():
    cells = blank()
    entered(cells, [0.62], [0.0])
    assert cells[10, 16] == LETHAL
    assert (cells[10, 10:16] == FREE).all()
    assert (cells[10, 17:] == UNKNOWN).all()
    assert (np.delete(cells, 10, axis=0) == UNKNOWN).all()


def test_an_obstacle_that_is_gone_is_cleared_within_one_scan():
    cells = blank()
    entered(cells, [0.62], [0.0])
    entered(cells, [np.inf], [0.0])
    assert not (cells == LETHAL).any()
    assert (cells[10, 10:] == FREE).all()


def test_a_return_behind_it_clears_too():
    cells = blank()
    entered(cells, [0.62], [0.0])
    entered(cells, [0.93], [0.0])
    assert np.flatnonzero(cells[10] == LETHAL).tolist() == [19]


def test_a_range_as_long_as_the_lidar_sees_is_no_return():
    cells = blank(LETHAL)
    entered(cells, [0.9], [0.0], reach=0.9, marking=Marking(mark=0.5, clear=5.0))
    assert (cells[10, 10:19] == FREE).all()
    assert (cells[10, 19:] == LETHAL).all()


def test_what_lies_between_marking_and_clearing_is_cleared_only():
    cells = blank()
    entered(cells, [0.82], [0.0], marking=Marking(mark=0.5, clear=0.75))
    assert not (cells == LETHAL).any()
    assert (cells[10, 10:17] == FREE).all()
    assert (cells[10, 18:] == UNKNOWN).all()


def test_no_beam_clears_what_another_one_hit():
    cells = blank()
    entered(cells, [0.62, np.inf, 0.62, np.inf], [0.0, 0.02, -0.03, 0.04])
    assert cells[10, 16] == LETHAL


@pytest.mark.parametrize("value", [np.nan, -np.inf, 0.0, -1.0, 0.04])
def test_a_beam_that_tells_nothing_does_nothing(value):
    cells = blank()
    entered(cells, [value], [0.0], blind=0.05)
    assert (cells == UNKNOWN).all()


@settings(derandomize=True, max_examples=60)
@given(
    x=st.floats(-1.0, 3.1), y=st.floats(-1.0, 3.1), heading=st.floats(-3.2, 3.2), length=st.floats(0.01, 4.0),
    hits=st.booleans(),
)  # fmt: skip
def test_clears_what_the_beam_crosses_and_nothing_else(x, y, heading, length, hits):
    """From anywhere, also from outside: cells that the beam crosses by more than rounding, not beyond its end."""
    cells = blank()
    told = entered(
        cells, [length if hits else np.inf], [0.0], pose=[x, y, heading],
        marking=Marking(mark=9.0, clear=9.5), reach=10.0 if hits else length,
    )  # fmt: skip
    end = np.array([x, y]) + length * np.array([np.cos(heading), np.sin(heading)])
    beam = LineString([(x, y), end])
    last = np.floor(end / SIDE).astype(int)[::-1]
    r0, r1, c0, c1 = told
    for row in range(SIZE):
        for col in range(SIZE):
            square = box(col * SIDE, row * SIDE, (col + 1) * SIDE, (row + 1) * SIDE)
            inside = beam.intersection(square.buffer(-1e-7)).length  # along a boundary a beam is in one row only
            if hits and [row, col] == last.tolist():
                assert cells[row, col] == LETHAL
            elif inside > 1e-6 and [row, col] != last.tolist():
                assert cells[row, col] == FREE
            elif not beam.dwithin(square, 1e-9):
                assert cells[row, col] == UNKNOWN
            if cells[row, col] != UNKNOWN:
                assert r0 <= row < r1
                assert c0 <= col < c1


def test_clearing_must_reach_farther_than_marking():
    with pytest.raises(ConfigError, match="clearing must reach farther"):
        Marking(mark=3.0, clear=3.0)


@pytest.mark.parametrize(
    "fault",
    [
        {"pose": np.array([0.0, np.nan, 0.0])},
        {"bearings": np.array([np.inf])},
        {"ranges": np.ones(2)},
        {"reach": 0.0},
        {"blind": 11.0},
    ],
)
def test_a_scan_without_a_sense_is_refused(fault):
    good = {"pose": MIDDLE, "bearings": np.zeros(1), "ranges": np.ones(1), "reach": 10.0}
    with pytest.raises(DataError, match="scan"):
        Scan(**{**good, **fault})


def test_how_often_cells_were_hit(rng: np.random.Generator) -> None:
    """Against the same in numpy: every free cell of the box counts down, every cell that was hit counts up once."""
    cells, held, plain = blank(), blank(NEVER), blank(NEVER)
    bearings = np.linspace(-np.pi, np.pi, 90, endpoint=False)
    for _ in range(30):
        ranges = np.where(rng.random(90) < 0.2, np.inf, rng.uniform(0.3, 2.2, 90))
        scan = Scan(pose=MIDDLE, bearings=bearings, ranges=ranges, reach=2.4)
        r0, r1, c0, c1 = observe(cells, SIDE, np.zeros(2), scan, MARKING, held)
        box_, free = plain[r0:r1, c0:c1], cells[r0:r1, c0:c1] == FREE
        box_[free] = np.where(box_[free] == NEVER, 0, np.maximum(box_[free].astype(int) - 1, 0))
        col, row = np.unique(np.floor(scan.hits(MARKING.mark) / SIDE).astype(int), axis=0).T
        inside = (col >= 0) & (col < SIZE) & (row >= 0) & (row < SIZE)
        at = row[inside], col[inside]
        plain[at] = np.where(plain[at] == NEVER, NEVER, np.minimum(plain[at].astype(int) + HIT, MOST))
        np.testing.assert_array_equal(held, plain)
    assert len(set(held.ravel().tolist())) > 5 and held[held < NEVER].max() <= MOST


def test_cells_are_looked_up_where_points_lie():
    cells, out = np.arange(6, dtype=np.uint8).reshape(2, 3), np.empty(4, np.uint8)
    look_up(cells, 1.0, 2.0, 0.5, np.array([[1.1, 2.1], [2.4, 2.9], [0.9, 2.1], [1.1, 3.0]]), 77, out)
    assert out.tolist() == [0, 5, 77, 77]
