"""Pictures of a run, rendered by MuJoCo: the world, its movers and the team, from a camera that follows.

Needs OpenGL; without a screen set MUJOCO_GL to `egl` or `osmesa`.
"""

import warnings
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from outrider.core.solids import cast
from outrider.data import Grid
from outrider.errors import ConfigError
from outrider.sim.engine import Simulation
from outrider.sim.monitor import Hull
from outrider.sim.physics.body import library
from outrider.sim.truth import Truth
from outrider.sim.world import World
from outrider.typing import Bools, Floats

BEAMS: Final = 600  # at each solid: what they hit is its hull
COLOURS: Final = ("0.16 0.45 0.82 1", "0.90 0.45 0.10 1", "0.20 0.60 0.30 1", "0.60 0.30 0.70 1", "0.75 0.15 0.25 1")
LOOK_ALONG: Final = 55.0  # degrees, counter-clockwise from east
LOOK_DOWN: Final = -38.0
NEAREST: Final = 10.0  # m
FIELD_OF_VIEW: Final = 45.0  # upright

_XML: Final = """
<mujoco>
  <visual>
    <global offwidth="{width}" offheight="{height}" fovy="{fovy}"/>
    <headlight ambient="0.35 0.35 0.35" diffuse="0.5 0.5 0.5"/><quality shadowsize="4096"/><map zfar="400"/>
  </visual>
  <asset>
    <texture type="skybox" builtin="gradient" rgb1="0.75 0.85 0.95" rgb2="0.95 0.97 1" width="256" height="256"/>
    <texture name="ground" type="2d" builtin="checker" rgb1="0.83 0.84 0.80" rgb2="0.79 0.80 0.76" width="256"
             height="256"/>
    <material name="ground" texture="ground" texrepeat="0.1 0.1" texuniform="true"/>
    {meshes}
  </asset>
  <worldbody>
    <light directional="true" dir="-0.4 0.3 -1" diffuse="0.5 0.5 0.5"/>
    <geom type="plane" size="0 0 1" material="ground"/>
    {things}
  </worldbody>
</mujoco>
"""


def pictures(run: Simulation, seconds: Floats, width: int = 960, height: int = 540) -> Iterator[NDArray[np.uint8]]:
    """(height, width, 3) at each of the `seconds` since the start. Raises ConfigError without MuJoCo or OpenGL."""
    mujoco = library()
    model: Any = mujoco.MjModel.from_xml_string(_drawn(run, width, height))
    data: Any = mujoco.MjData(model)
    camera: Any = mujoco.MjvCamera()
    try:
        with warnings.catch_warnings():  # a missing screen is told twice
            warnings.simplefilter("ignore")
            renderer: Any = mujoco.Renderer(model, height, width)
    except Exception as e:  # whatever the driver says, in words of its own
        fix = "MUJOCO_GL=egl or MUJOCO_GL=osmesa renders without a screen"
        raise ConfigError(f"nothing can be rendered here: {e}".splitlines()[0], where="OpenGL", fix=fix) from None
    with renderer:
        for t in seconds.tolist():
            stamp = np.array([run.monitor.start + round(t * 1e9)])
            team = [truth.at(stamp) for truth in run.truth.values()]
            feet = [m.at(t) for m in run.monitor.world.movers]
            data.mocap_pos[:] = np.array([*(a.p[0] for a in team), *feet])
            data.mocap_quat[:] = np.array(
                [*(a.q[0, [3, 0, 1, 2]] for a in team), *([1.0, 0.0, 0.0, 0.0] for _ in feet)]
            )
            mujoco.mj_forward(model, data)
            _aim(camera, team)
            renderer.update_scene(data, camera)
            yield renderer.render().copy()


def _aim(camera: Any, team: list[Truth]) -> None:
    """Far enough to have the whole team in view."""
    p = np.vstack([a.p for a in team])
    camera.lookat[:] = 0.5 * (p.min(axis=0) + p.max(axis=0))
    camera.distance = NEAREST + 1.8 * float(np.linalg.norm(p.max(axis=0) - p.min(axis=0)))
    camera.azimuth, camera.elevation = LOOK_ALONG, LOOK_DOWN


def _drawn(run: Simulation, width: int, height: int) -> str:
    world = run.monitor.world
    hulls = [(*_points(world, k), "0.72 0.75 0.80 1") for k in range(len(world.solids.names))]
    hulls += [(f"wall{k}", _prism(w.outline, w.low, w.high), "0.70 0.62 0.55 1") for k, w in enumerate(world.walls)]
    meshes = "".join(f'<mesh name="{name}" vertex="{_listed(p)}"/>' for name, p, _ in hulls)
    things = "".join(f'<geom type="mesh" mesh="{name}" rgba="{rgba}"/>' for name, _, rgba in hulls)
    if world.grid is not None:
        things += "".join(_boxes(world.grid, world.grid_height))
    for k, name in enumerate(run.truth):
        things += f'<body name="robot {name}" mocap="true">{_robot(run.monitor.hulls[name], COLOURS[k % 5])}</body>'
    for k, m in enumerate(world.movers):
        shape = f'type="cylinder" size="{m.radius} {m.height / 2}" pos="0 0 {m.height / 2}" rgba="0.35 0.35 0.4 1"'
        things += f'<body name="mover {k}" mocap="true"><geom {shape}/></body>'
    return _XML.format(width=width, height=height, fovy=FIELD_OF_VIEW, meshes=meshes, things=things)


def _robot(hull: Hull, rgba: str) -> str:
    """A cylinder as it collides, with a nose ahead."""
    half, nose = hull.height / 2, 0.35 * hull.radius
    body = f'<geom type="cylinder" size="{hull.radius} {half}" pos="0 0 {half}" rgba="{rgba}"/>'
    at = f'pos="{hull.radius} 0 {hull.height}" size="{nose} {nose / 2} {nose / 4}"'
    return body + f'<geom type="box" {at} rgba="0.1 0.1 0.1 1"/>'


def _points(world: World, k: int) -> tuple[str, Floats]:
    """Where beams from all around meet a solid, which is convex."""
    table = np.ascontiguousarray(world.solids.table[k : k + 1])
    centre, radius = table[0, 19:22], float(table[0, 22]) * 1.01
    rng = np.random.default_rng(k)
    origin = rng.normal(size=(BEAMS, 3))
    origin = centre + radius * origin / np.linalg.norm(origin, axis=1)[:, None]
    towards = centre + (rng.random((BEAMS, 3)) - 0.5) * radius - origin
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    beams = np.hstack([origin, towards]).tolist()
    ranges = np.array([cast(table, ox, oy, oz, dx, dy, dz, 3.0 * radius) for ox, oy, oz, dx, dy, dz in beams])
    hit = np.isfinite(ranges)
    return f"solid{k}", origin[hit] + ranges[hit, None] * towards[hit]


def _prism(outline: Floats, low: float, high: float) -> Floats:
    return np.vstack([np.column_stack([outline, np.full(len(outline), z)]) for z in (max(low, -1.0), min(high, 60.0))])


def _listed(p: Floats) -> str:
    return " ".join(f"{v:.3f}" for v in p.ravel().tolist())


def _boxes(grid: Grid, top: float) -> Iterator[str]:
    """Occupied cells as few boxes: runs along rows, and alike runs of following rows together."""
    for row, col, rows, cols in _rectangles(grid.occupied):
        half = 0.5 * grid.resolution * np.array([cols, rows])
        x, y = grid.origin + grid.resolution * np.array([col, row]) + half
        size = f"{half[0]:.3f} {half[1]:.3f} {top / 2:.3f}"
        yield f'<geom type="box" size="{size}" pos="{x:.3f} {y:.3f} {top / 2:.3f}" rgba="0.62 0.66 0.60 1"/>'


def _rectangles(occupied: Bools) -> Iterator[tuple[int, int, int, int]]:
    """First row, first column, rows, columns."""
    open_runs: dict[tuple[int, int], int] = {}
    for row in range(occupied.shape[0] + 1):
        cells = np.zeros(occupied.shape[1] + 2, np.int8)
        if row < occupied.shape[0]:
            cells[1:-1] = occupied[row]
        edges = np.flatnonzero(np.diff(cells)).reshape(-1, 2)
        now = {(int(a), int(b - a)) for a, b in edges}
        for run in [r for r in open_runs if r not in now]:
            first = open_runs.pop(run)
            yield first, run[0], row - first, run[1]
        for run in now:
            open_runs.setdefault(run, row)
