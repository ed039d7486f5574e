"""What a world must not be, part by part."""

from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from outrider.errors import ConfigError
from outrider.sim.world.ground import Ground
from outrider.sim.world.parts import Body, Mover
from outrider.sim.world.wind import Wind
from outrider.typing import Floats

if TYPE_CHECKING:
    from outrider.sim.world.world import World

Fault = tuple[str, str, str]  # where, what, how to mend it


def check(world: "World") -> None:
    """Raise `ConfigError` for the first fault."""
    for where, what, fix in _faults(world):
        raise ConfigError(what, where=f"world {world.name!r}, {where}", fix=fix)


def _faults(world: "World") -> Iterator[Fault]:
    if not (np.isfinite(world.gravity) and world.gravity >= 0.0):
        yield "gravity", f"{world.gravity:g} m/s^2", "zero or more: it points down"
    if world.grid is not None and not np.isfinite(world.grid_height):
        yield "grid", f"a height of {world.grid_height:g} m", "a finite grid_height"
    yield from _names(world)
    if world.solids.table.shape[0] != len(world.solids.names):
        yield "solids", f"{world.solids.table.shape[0]} rows and {len(world.solids.names)} names", "one name each"
    for wall in world.walls:
        yield from _prism(f"wall {wall.name!r}", wall.outline, wall.low, wall.high, finite=True)
    if world.fence is not None:
        yield from _prism("fence", world.fence.polygon, world.fence.floor, world.fence.ceiling, finite=False)
    for mover in world.movers:
        yield from _mover(mover)
    for name, body in world.objects.items():
        yield from _body(f"object {name!r}", body)
    yield from _wind(world.wind)
    yield from _ground(world.ground)


def _names(world: "World") -> Iterator[Fault]:
    """Parts of one solid may share a name; walls and movers have their own."""
    alone = [*(wall.name for wall in world.walls), *(mover.name for mover in world.movers), *set(world.solids.names)]
    for name, times in Counter(alone).items():
        if times > 1 or name in ("", "grid"):
            yield f"{name!r}", "this name is taken or reserved", "give every wall, mover and solid a name of its own"


def _prism(where: str, outline: Floats, low: float, high: float, *, finite: bool) -> Iterator[Fault]:
    if outline.ndim != 2 or outline.shape[1] != 2 or outline.shape[0] < 3 or not np.isfinite(outline).all():
        yield where, f"an outline of shape {outline.shape}", "at least three finite points (x, y)"
        return
    if not low < high or (finite and not np.isfinite([low, high]).all()):
        yield where, f"from {low:g} m up to {high:g} m", "the lower height first"
    crossing = _crossing(outline)
    if crossing is not None:
        yield (
            where,
            "its outline crosses or touches itself near ({:g}, {:g})".format(*crossing),
            "list the corners in order",
        )


def _crossing(outline: Floats) -> Floats | None:
    """A point near which two sides that are no neighbours meet, or a side has no length; None if there is none."""
    n = outline.shape[0]
    a, e = outline, np.roll(outline, -1, axis=0) - outline
    short = np.flatnonzero(np.hypot(*e.T) == 0.0)
    if short.size:
        return a[short[0]]
    w = a[None] - a[:, None]  # (i, j): from the start of side i to that of side j
    det = e[:, None, 0] * e[None, :, 1] - e[:, None, 1] * e[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (w[..., 0] * e[None, :, 1] - w[..., 1] * e[None, :, 0]) / det  # along side i
        r = (w[..., 0] * e[:, None, 1] - w[..., 1] * e[:, None, 0]) / det  # along side j
    i, j = np.indices((n, n))
    apart = ((i - j) % n > 1) & ((j - i) % n > 1)
    meets = np.argwhere(apart & (s >= 0.0) & (s <= 1.0) & (r >= 0.0) & (r <= 1.0))
    return outline[meets[0, 0]] if meets.size else None


def _mover(mover: Mover) -> Iterator[Fault]:
    where = f"mover {mover.name!r}"
    if mover.t_s.ndim != 1 or mover.t_s.size < 1 or mover.p.shape != (mover.t_s.size, 3):
        yield where, f"{mover.t_s.size} times and positions {mover.p.shape}", "one position (x, y, z) for every time"
        return
    if not (np.isfinite(mover.t_s).all() and np.isfinite(mover.p).all() and (np.diff(mover.t_s) > 0.0).all()):
        yield where, "its script does not run forward in time", "finite positions at increasing times"
    if not (0.0 < mover.radius < np.inf and 0.0 < mover.height < np.inf):
        yield where, f"radius {mover.radius:g} m, height {mover.height:g} m", "both positive"


def _body(where: str, body: Body) -> Iterator[Fault]:
    if body.p.shape != (3,) or body.q.shape != (4,) or abs(float(np.linalg.norm(body.q)) - 1.0) > 1e-6:
        yield where, f"pose {body.p.tolist()}, {body.q.tolist()}", "a position and a unit quaternion x y z w"


def _wind(wind: Wind) -> Iterator[Fault]:
    numbers = [*wind.mean, *wind.sigma, *wind.length]
    if not np.isfinite(numbers).all() or min(wind.sigma) < 0.0 or min(wind.length) <= 0.0:
        yield "wind", f"gusts of {wind.sigma} m/s over {wind.length} m", "no negative sigma, positive lengths"
    if wind.airspeed is not None and not 0.0 < wind.airspeed < np.inf:
        yield "wind", f"an airspeed of {wind.airspeed:g} m/s", "a positive one, or None for the mean wind's"


def _ground(ground: Ground) -> Iterator[Fault]:
    if not np.isfinite(ground.slope).all():
        yield "ground", f"a slope of {ground.slope}", "two finite numbers, rise per metre"
    for where, slips in [("ground", ground), *((f"slip patch at {s.centre}", s) for s in ground.patches)]:
        if not (0.0 <= slips.longitudinal < 1.0 and 0.0 <= slips.lateral < 1.0):
            yield where, f"slips of {slips.longitudinal:g} and {slips.lateral:g}", "shares from 0 to below 1"
    for patch in ground.patches:
        if not (patch.radius > 0.0 and np.isfinite([*patch.centre, patch.radius]).all()):
            yield f"slip patch at {patch.centre}", f"a radius of {patch.radius:g} m", "a positive one"
