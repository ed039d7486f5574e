# ruff: noqa: T201
"""
From a drawing to a costmap
===========================

From a drawing to a costmap: make the map's files, then follow a lidar with a window around the robot.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from outrider.data.footprint import Footprint
from outrider.data.scan import Scan
from outrider.io.map_server import read_map
from outrider.io.sites import read_site
from outrider.mapping.inflation import Inflation
from outrider.mapping.layers import LayeredCostmap
from outrider.mapping.outlines import FootprintCheck
from outrider.mapping.sites import draw
from outrider.plot.site import site_figure
from outrider.plot.style import save_png
from outrider.workflows.map_site import map_site

DEPOT = Path(__file__).with_suffix(".yaml")

with TemporaryDirectory() as room:
    done, summary = map_site(DEPOT, Path(room) / "map", resolution=0.1, report=False)
    again = read_map(Path(room) / "map" / "map.yaml").grid
    print(
        f"{summary['map']['columns']} x {summary['map']['rows']} cells, exact: {(again.cells == done.grid.cells).all()}"
    )
    print(f"a dense lidar map would be {summary['volume']['dense_to_drawing']:.0f} times the drawing's size")

drawn = draw(read_site(DEPOT), 0.1)
body = Footprint.rectangle(0.9, 0.6)
inflation = Inflation(inscribed=body.inscribed, radius=1.5, factor=3.0)
layers = LayeredCostmap(
    drawn.grid, inflation=inflation, footprint=body, window=12.0, keep_out=drawn.zones.keep_out, zones_needed=True
)
here = np.array([20.0, 0.0, 0.0])
bearings = np.linspace(-np.pi, np.pi, 360, endpoint=False)
ranges = np.where(np.abs(bearings) < 0.06, 2.5, np.inf)  # somebody stands 2.5 m ahead
layers.update([Scan(pose=here, bearings=bearings, ranges=ranges, reach=10.0)], pose=here)

check = FootprintCheck(body, resolution=0.1)
for ahead in (0.0, 1.9, 2.5):
    stand, cell = check(layers.costmap, here + np.array([ahead, 0.0, 0.0]))
    print(f"{ahead:g} m ahead: {stand.value}")
save_png(site_figure(layers.costmap, None), Path("06_map_a_site.png"))
print("speed allowed at the gate:", drawn.zones.speed_at(np.array([5.0, 0.0])), "m/s")
print("finished")
