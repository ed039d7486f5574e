"""Footprints against distances that shapely measures."""

import numpy as np
import pytest
from shapely import Point, Polygon

from outrider.data.footprint import Footprint
from outrider.errors import ConfigError

FOOTPRINTS = {
    "disc": Footprint.circle(0.3),
    "rectangle": Footprint.rectangle(1.0, 0.6),
    "ahead": Footprint.rectangle(1.0, 0.6, ahead=0.2),
    "capsule": Footprint.capsule(0.4, 0.2, 0.25),
    "round corners": Footprint(np.array([[-0.2, -0.1], [0.5, 0.0], [-0.2, 0.1]]), radius=0.1),
}


@pytest.mark.parametrize("name", FOOTPRINTS)
def test_the_inscribed_and_the_circumscribed_disc_touch_the_boundary(name: str) -> None:
    f = FOOTPRINTS[name]
    points = f.outline if len(f.outline) > 2 else np.vstack([f.outline, f.outline[::-1], f.outline])
    core = Polygon(points) if len(f.outline) > 2 else (Point(f.outline[0]) if len(f.outline) == 1 else None)
    if core is None:
        from shapely import LineString

        core = LineString(f.outline)
    covered = core.buffer(f.radius, quad_segs=256) if f.radius else core
    assert f.inscribed == pytest.approx(covered.exterior.distance(Point(0, 0)), abs=1e-5)
    assert f.circumscribed == pytest.approx(np.hypot(*np.array(covered.exterior.coords).T).max(), abs=1e-5)


def test_a_pose_turns_then_moves() -> None:
    corners = Footprint.rectangle(2.0, 1.0).at(np.array([[10.0, 5.0, np.pi / 2], [0.0, 0.0, 0.0]]))
    assert corners.shape == (2, 4, 2)
    assert corners[0] == pytest.approx(np.array([[10.5, 4.0], [10.5, 6.0], [9.5, 6.0], [9.5, 4.0]]))


@pytest.mark.parametrize(
    ("outline", "radius", "says"),
    [
        ([[0, 0]], 0.0, "nothing"),
        ([[-1, 0], [1, 0]], 0.0, "nothing"),
        ([[1, 1], [2, 1], [2, 2], [1, 2]], 0.0, "origin"),
        ([[-1, -1], [-1, 1], [1, 1], [1, -1]], 0.0, "clockwise"),
        ([[-1, -1], [1, -1], [0, 0], [1, 1], [-1, 1]], 0.0, "convex"),
        ([[-1, -1], [1, -1], [1, -1], [0, 1]], 0.0, "no length"),
        ([[0, np.nan]], 0.1, "shape"),
        ([[0, 0]], -0.1, "radius"),
    ],
)
def test_what_is_no_footprint(outline: list, radius: float, says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        Footprint(np.array(outline, dtype=float), radius)
