"""What a driver is wary of: things that stand alone and are not drawn."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.data.grid import Grid
from outrider.data.scan import Scan
from outrider.mapping.inflation import Inflation
from outrider.mapping.layers import LayeredCostmap
from outrider.team.navigator import Fused
from outrider.team.sight import Sight

SIDE = 0.1
HERE = Fused(
    t=0, p=np.zeros(3), v=np.zeros(3), q=np.array([1.0, 0.0, 0.0, 0.0]), heading=0.0, w=0.0, P=1e-4 * np.eye(3)
)  # fmt: skip


def ranges(discs: list[tuple[float, float, float]], bearings: np.ndarray) -> np.ndarray:
    """To the nearest disc (x, y, radius) along each beam from the origin, inf where there is none."""
    out = np.full(bearings.shape, np.inf)
    for x, y, radius in discs:
        along = x * np.cos(bearings) + y * np.sin(bearings)
        off2 = x * x + y * y - along * along
        hit = (along > 0.0) & (off2 < radius * radius)
        out = np.where(hit, np.minimum(out, along - np.sqrt(np.where(hit, radius * radius - off2, 0.0))), out)
    return out


def wary(things: list[tuple[float, float, float]], drawn: list[tuple[float, float, float]]) -> np.ndarray:
    cells = np.zeros((160, 160), np.uint8)
    y, x = (np.mgrid[:160, :160] + 0.5) * SIDE - 8.0
    for east, north, radius in drawn:
        cells[np.hypot(x - east, y - north) < radius] = 100
    ground = Grid(cells=cells, resolution=SIDE, origin=np.array([-8.0, -8.0]))
    sight = Sight(LayeredCostmap(ground, inflation=Inflation(inscribed=0.3, radius=0.8, factor=2.5)))
    bearings = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    scan = Scan(pose=np.zeros(3), bearings=bearings, ranges=ranges(things + drawn, bearings), reach=12.0, blind=0.1)
    for k in range(3):
        assert not sight.look(0.1 * k, HERE, [scan], [])
    return sight.surroundings(0.2, np.zeros(2), np.empty((0, 5))).wary


@settings(max_examples=12)
@given(bearing=st.floats(-3.1, 3.1), far=st.floats(1.5, 5.0))
def test_what_stands_alone_may_set_off(bearing: float, far: float) -> None:
    x, y = far * np.cos(bearing), far * np.sin(bearing)
    (row,) = wary([(x, y, 0.25)], [])
    assert np.hypot(row[0] - x, row[1] - y) < 0.1
    assert abs(row[2] - 0.25) < 0.1


def test_what_is_drawn_or_stands_beside_a_wall_will_not() -> None:
    post, bin_ = (3.0, 0.0, 0.25), (0.0, 3.0, 0.25)
    beside_bin = [(0.1 * k - 1.0, 3.5, 0.08) for k in range(21)]
    assert len(wary([post], [])) == 1
    assert len(wary([], [post])) == 0
    assert len(wary([bin_], beside_bin)) == 0
    assert len(wary([bin_, post], beside_bin)) == 1
