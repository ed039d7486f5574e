"""Costmaps: exact inflation of a large map, and one update of a robot's window, beside transforms from PyPI."""

from functools import cache

import numpy as np

from benchmarks.table import Row, Side
from outrider.data import Grid
from outrider.data.footprint import Footprint
from outrider.data.grid import LETHAL
from outrider.data.scan import Scan
from outrider.mapping.inflation import Inflater, Inflation
from outrider.mapping.layers import LayeredCostmap
from outrider.mapping.obstacles import Marking

CELLS, SIDE, BEAMS, WINDOW = 4000, 0.05, 720, 10.0
INFLATION = Inflation(inscribed=0.3, radius=2.0, factor=3.0)
PROBES = np.random.default_rng(1).integers(0, CELLS, (2, 5000))


@cache
def yard():
    """4000 x 4000 cells of 5 cm, 1 % of them taken by blobs of 8 x 8."""
    rng, cells = np.random.default_rng(4), np.zeros((CELLS, CELLS), np.uint8)
    for row, col in rng.integers(0, CELLS - 8, (CELLS * CELLS // 100 // 64, 2)):
        cells[row : row + 8, col : col + 8] = LETHAL
    return cells


@cache
def memory():
    return Inflater(INFLATION, SIDE, yard().shape), np.empty_like(yard())


def inflate(maps):
    inflater, out = memory()
    for _ in range(min(maps, 3)):  # they are all alike
        inflater(yard(), out)
    return out[*PROBES].astype(float)


def graded(distance):
    """Costs at the probes, from distances in cells; the table over the whole map is not asked of the peers."""
    return INFLATION.cost(distance[*PROBES].astype(np.float64) * SIDE).astype(float)


def scipy_transform(maps):
    from scipy.ndimage import distance_transform_edt

    for _ in range(min(maps, 1)):
        distance = distance_transform_edt(yard() != LETHAL)
    return graded(distance)


def opencv_transform(maps):
    import cv2

    cv2.setNumThreads(1)
    free = (yard() != LETHAL).astype(np.uint8)
    for _ in range(min(maps, 1)):
        distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return graded(np.sqrt(np.rint(distance.astype(np.float64) ** 2)))


@cache
def scene():
    """A scan of 720 beams among blobs, two thirds of them with a return."""
    rng, cells = np.random.default_rng(7), np.zeros((600, 600), np.uint8)
    for row, col in rng.integers(0, 592, (56, 2)):
        cells[row : row + 8, col : col + 8] = 100
    cells[280:320, 280:320] = 0
    bearings = np.linspace(-np.pi, np.pi, BEAMS, endpoint=False)
    ranges = np.where(rng.random(BEAMS) < 0.33, np.inf, rng.uniform(0.5, 5.0, BEAMS))
    pose = np.array([15.012, 14.987, 0.3])
    scan = Scan(pose=pose, bearings=bearings, ranges=ranges, reach=10.0)
    return Grid(cells=cells, resolution=SIDE, origin=np.zeros(2)), scan


NARROW = Inflation(inscribed=0.3, radius=0.55, factor=3.0)


def update(scans):
    """The robot moves on by a cell with every scan: the window is shifted and drawn anew each time."""
    ground, scan = scene()
    body, there = Footprint.rectangle(0.8, 0.6), np.array([SIDE, 0.0, 0.0])
    layers = LayeredCostmap(ground, inflation=NARROW, marking=Marking(), footprint=body, window=WINDOW)
    for k in range(scans):
        pose = scan.pose + there * (k % 2)
        seen = Scan(pose=pose, bearings=scan.bearings, ranges=scan.ranges, reach=scan.reach)
        layers.update([seen], pose=pose)
        cells = layers.costmap.cells
    return cells.astype(float)


def lines(scans):
    """OpenCV's line per beam, its exact transform, and a table: to a cell, with no window that moves."""
    import cv2

    cv2.setNumThreads(1)
    ground, scan = scene()
    half = int(WINDOW / SIDE) // 2
    table = NARROW.table(SIDE)
    table = np.concatenate([table, np.zeros(2 * (2 * half) ** 2, np.uint8)])
    row, col = ground.cell_of(scan.pose[:2])
    static = np.where(ground.cells >= 65, LETHAL, 0).astype(np.uint8)
    seen = np.zeros((2 * half, 2 * half), np.uint8)
    angles = scan.pose[2] + scan.bearings
    for _ in range(scans):
        reach = np.minimum(scan.ranges, 6.0) / SIDE
        ends = np.rint(half + np.column_stack([reach * np.cos(angles), reach * np.sin(angles)])).astype(int)
        for end in ends:
            cv2.line(seen, (half, half), (int(end[0]), int(end[1])), 0)
        hit = ends[scan.ranges <= 5.0].clip(0, 2 * half - 1)
        seen[hit[:, 1], hit[:, 0]] = LETHAL
        base = np.maximum(static[row - half : row + half, col - half : col + half], seen)
        d = cv2.distanceTransform((base != LETHAL).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        cells = np.maximum(table[np.rint(d * d).astype(int)], base)
    return cells.astype(float)


def rows():
    """Rows of this module."""
    return [
        Row(
            "exact inflation, 2 m around everything in 4000 x 4000 cells of 5 cm",
            Side("Inflater: distances and costs", inflate, 1),
            [
                Side("SciPy distance_transform_edt, distances only", scipy_transform, 1),
                Side("OpenCV distanceTransform precise, distances only", opencv_transform, 1),
            ],
            target=250_000.0,
        ),
        Row(
            "costmap of 200 x 200 cells, 720-beam scan, the robot one cell on",
            Side("LayeredCostmap.update: shift, layers, footprint, inflation", update, 60),
            [Side("OpenCV line, distanceTransform, table", lines, 20)],
            target=1000.0,
            tolerance=None,
        ),
    ]
