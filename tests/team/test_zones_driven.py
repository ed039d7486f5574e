"""The zones of a site are obeyed: planned around, slowed down for, and taken one way only, driven in the simulator."""

from typing import Any

import numpy as np
import pytest
from narrow import robot

from outrider.data.driving import DriveLimits, Steering
from outrider.data.grid import Grid
from outrider.data.site import Shape, ShapeKind
from outrider.io.sites import parse_site
from outrider.mapping.sites import draw
from outrider.mapping.zones import Zones
from outrider.scenarios.booked import mission
from outrider.scenarios.build import build
from outrider.scenarios.files import parse_scenario
from outrider.sim.engine import Ending, Simulation
from outrider.team.lawful import CREEP, obeyed
from outrider.typing import Floats

SLOW, SPEED = [[8.0, -4.0], [14.0, -4.0], [14.0, 4.0], [8.0, 4.0]], 0.4
BLOCK: dict[str, Any] = {  # a block of houses with a lane to either side, the shorter one to the west only
    "name": "block",
    "roads": [
        {"area": [[-6, -9], [0, -9], [0, 12], [-6, 12]]},
        {"area": [[12, -9], [18, -9], [18, 12], [12, 12]]},
        {"area": [[-1, -3], [13, -3], [13, 0], [-1, 0]]},
        {"area": [[-1, 8], [13, 8], [13, 12], [-1, 12]]},
    ],
    "buildings": [{"area": [[0, 0], [12, 0], [12, 8], [0, 8]]}, {"area": [[0, -9], [12, -9], [12, -3], [0, -3]]}],
    "one_way": [{"name": "lane", "area": [[1, -3], [11, -3], [11, 0], [1, 0]], "heading_deg": 180.0}],
}
LANE: Floats = np.array([[1.0, -3.0], [11.0, -3.0], [11.0, 0.0], [1.0, 0.0]])


def drives(drawing: dict[str, Any], start: tuple[float, float, float], stops: Any, seconds: float) -> Simulation:
    team = {"r1": robot(start, stops)}
    place = {"type": "site", "drawing": drawing}
    cast = build(parse_scenario({"duration_s": seconds, "seed": 3, "world": {"place": place}, "team": team}))
    run = cast.run()
    told = mission(cast, run)
    assert run.ending is Ending.TIME and told is not None and told["robots"]["r1"]["legs"]["open ground"] >= 1
    kinds = ["speed"] * len(drawing.get("speed_zones", ())) + ["one_way"] * len(drawing.get("one_way", ()))
    assert [z["kind"] for z in told["zones"]] == kinds
    return run


def street(*speed: dict[str, Any]) -> dict[str, Any]:
    return {"name": "street", "roads": [{"area": [[-5, -4], [30, -4], [30, 4], [-5, 4]]}], "speed_zones": list(speed)}


def speeds(run: Simulation) -> Floats:
    """(n,) m/s over ground, over half a second."""
    t = run.truth["r1"]
    n = int(0.5 / t.dt)
    gap = np.hypot(*(t.p[n:, :2] - t.p[:-n, :2]).T) / (n * t.dt)
    return np.concatenate([gap[:1].repeat(n // 2), gap, gap[-1:].repeat(n - n // 2)])


@pytest.mark.compiled
def test_a_speed_zone_is_entered_slowly_and_left_at_speed() -> None:
    zone = {"name": "school", "area": SLOW, "speed": SPEED}
    run = drives(street(zone), (0.0, 0.0, 0.0), [[26.0, 0.0]], 45.0)
    x, v = run.truth["r1"].p[:, 0], speeds(run)
    now = np.hypot(*run.truth["r1"].v[:, :2].T)
    assert now[(x > 0.9) & (x < 1.1)].min() > 0.9  # as fast as its acceleration allows, at five commands a second
    inside = (x > 8.2) & (x < 13.8)
    assert inside.any() and v[inside].max() <= 1.02 * SPEED and v[inside].mean() > 0.85 * SPEED
    assert v[(x > 3.0) & (x < 6.5)].max() > 0.7 and v[x > 16.0].max() > 0.7
    assert abs(float(x[-1]) - 26.0) < 0.3


@pytest.mark.compiled
def test_a_robot_goes_round_by_the_other_lane_and_back_through_the_one_way() -> None:
    run = drives(BLOCK, (-3.0, -1.5, 0.0), [[15.0, -1.5], [-3.0, -1.5]], 75.0)
    p = run.truth["r1"].p[:, :2]
    lane = (p[:, 0] > 1.0) & (p[:, 0] < 11.0) & (p[:, 1] < 0.0)
    ahead = np.diff(p[:, 0])[lane[:-1]]
    assert lane.any() and ahead.sum() < -9.0 and ahead[ahead > 0.0].sum() < 0.1  # westward only
    assert p[:, 1].max() > 8.0 and p[:, 0].max() > 14.5  # it came there by the northern lane
    back = p[int(p[:, 0].argmax()) :]
    assert np.hypot(*(back - [-3.0, -1.5]).T).min() < 0.3


LIMITS = DriveLimits(
    steering=Steering.HOLONOMIC, forward=1.0, sideways=0.5, backward=0.4, turn=1.0, acceleration=0.8,
    turn_acceleration=1.0,
)  # fmt: skip


def zones(*shapes: Shape) -> Zones:
    grid = Grid(cells=np.zeros((200, 400), np.uint8), resolution=0.1, origin=np.array([-10.0, -10.0]))
    kinds = {k: tuple(s for s in shapes if s.kind is k) for k in (ShapeKind.SPEED, ShapeKind.ONE_WAY)}
    keep = np.zeros_like(grid.cells)
    return Zones(on=grid, keep_out=keep, speed=kinds[ShapeKind.SPEED], one_way=kinds[ShapeKind.ONE_WAY])


def test_braking_starts_where_it_must_and_not_before() -> None:
    z = zones(Shape(kind=ShapeKind.SPEED, points=np.array(SLOW), area=True, speed=SPEED))
    path, twist = np.array([[-8.0, 0.0], [20.0, 0.0]]), np.array([1.0, 0.0, 0.2])
    for x in np.arange(-2.0, 12.0, 0.3).tolist():
        told, why = obeyed(z, twist, np.array([x, 0.0, 0.0]), path, LIMITS)
        s = max(8.0 - x, 0.0) - 0.4  # what is left after 0.4 s of reaction; the edge is seen to 0.2 m
        soon, late = (np.sqrt(SPEED**2 + 1.6 * max(s + aside, 0.0)) for aside in (-0.2, 0.2))
        assert min(1.0, 0.95 * soon) <= told[0] <= min(1.0, late) and told[2] == pytest.approx(0.2 * told[0])
        assert bool(why) == (told[0] < 1.0)


def test_against_a_one_way_zone_a_robot_creeps_and_across_it_does_not() -> None:
    z = zones(Shape(kind=ShapeKind.ONE_WAY, points=np.array(SLOW), area=True, heading=0.0, name="lane"))
    path, pose = np.array([[12.0, 0.0], [0.0, 0.0]]), np.array([12.0, 0.0, np.pi])
    told, why = obeyed(z, np.array([0.8, 0.0, 0.0]), pose, path, LIMITS)
    assert np.hypot(*told[:2]) == pytest.approx(CREEP) and "lane" in why
    across, why = obeyed(z, np.array([0.0, 0.8, 0.0]), pose, path, LIMITS)
    assert across[1] == 0.8 and why == ""
    backwards, _ = obeyed(z, np.array([-0.8, 0.0, 0.0]), pose, path, LIMITS)  # its back to the zone's way
    assert backwards[0] == -0.8


def test_zones_without_limits_change_nothing_of_a_costmap() -> None:
    site = draw(parse_site(street()), 0.5).zones
    assert site.ways is None and site.least_costs(1.0, 3.0) is None
    fast = draw(parse_site(street({"area": SLOW, "speed": 2.0})), 0.5).zones
    assert fast.least_costs(1.0, 3.0) is None
    slow = draw(parse_site(street({"area": SLOW, "speed": 0.5})), 0.5).zones.least_costs(1.0, 3.0)
    assert slow is not None and sorted(np.unique(slow).tolist()) == [0, 84]  # 1 + 3 * 84 / 252: two metres' worth
