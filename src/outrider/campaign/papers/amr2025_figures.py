"""amr2025, drawn: figures 8, 11, 12, 14, 15, 16 and 19 from the first seed of our drives."""

from typing import Final

import numpy as np

from outrider.campaign.papers.amr2025_tables import PLACES, REAL, trials_of
from outrider.campaign.papers.model import Picture, Work
from outrider.campaign.papers.printed import GOALS
from outrider.sim.places import amr_bend, amr_loop, amr_passage
from outrider.typing import Floats

SITES: Final = {"simulation": amr_passage, "map 1": amr_passage, "map 2": amr_bend, "map 3": amr_loop}
PLANE: Final = ("_x", "_y")


def sites(work: Work) -> Picture:
    """Figures 8, 11 and 12: the maps, where the robot was sent, and how it drove."""
    first = {place: _first(work, place) for place in PLACES}

    def draw() -> object:
        from outrider.plot.drives import Line, Site, sites_figure

        out: list[Site] = []
        for place, make in SITES.items():
            world, got = make(), first[place]
            assert world.grid is not None
            lines = (
                [] if got is None else [Line("planned", _plane(got, "planned")), Line("driven", _plane(got, "driven"))]
            )
            goals = np.array([g.target for g in GOALS if g.place == place])
            boxes = tuple(w.outline for w in world.walls)
            out.append(Site(title=place, grid=world.grid, boxes=boxes, lines=tuple(lines), goals=goals))
        return sites_figure(out)

    caption = (
        "Our drawings of the sites, from what the text says of them. Dot: start, ours; numbered crosses: the paper's "
        "targets, in order; dark squares: obstacles that are on no map. One seed."
    )
    return Picture(key="sites", title="Figures 8, 11 and 12: maps and drives", draw=draw, caption=caption)


def tracks(work: Work) -> Picture | None:
    """Figure 14: where each combination of sensors says the robot was."""
    got = {place: _first(work, place) for place in REAL}
    if any(values is None for values in got.values()):
        return None

    def draw() -> object:
        from outrider.plot.drives import Line, Site, sites_figure

        out: list[Site] = []
        for place, values in got.items():
            assert values is not None
            grid, names = (
                SITES[place]().grid,
                {"odometry": "wheels", "local": "wheels, IMU", "gnss": "RTK", "fused": "all"},
            )
            assert grid is not None
            lines = tuple(Line(name, _plane(values, key)) for key, name in names.items())
            out.append(Site(title=place, grid=grid, lines=lines))
        return sites_figure(out)

    caption = "Wheels alone, and wheels with the IMU, start where the robot was put down and know nothing of RTK."
    return Picture(key="tracks", title="Figure 14: localisation by different sensors", draw=draw, caption=caption)


def northward(work: Work) -> Picture | None:
    """Figure 15: northward position over time."""
    got = _first(work, "map 3")
    if got is None:
        return None

    def draw() -> object:
        from outrider.plot.drives import Curve, curves_figure

        names = {"odometry": "wheels", "local": "wheels, IMU", "fused": "all", "true": "truth"}
        curves = tuple(Curve(name, got["t"], got[f"{key}_y"]) for key, name in names.items())
        return curves_figure([("map 3", curves)], "north [m]")

    return Picture(key="northward", title="Figure 15: northward position on map 3", draw=draw, caption="One seed.")


def degrading(work: Work) -> Picture | None:
    """Figure 16: the receiver without corrections, and what fusion makes of it."""
    got = _first(work, "map 3")
    if got is None:
        return None

    def draw() -> object:
        from outrider.plot.drives import Line, Site, sites_figure

        grid = amr_loop().grid
        assert grid is not None
        names = {"raw": "receiver", "degraded": "fused", "true": "truth"}
        lines = tuple(Line(name, _plane(got, key)) for key, name in names.items())
        return sites_figure([Site(title="map 3", grid=grid, lines=lines)])

    caption = "From the 30th second on the second receiver has single fixes only. One seed."
    return Picture(key="degrading", title="Figure 16: degraded GNSS", draw=draw, caption=caption)


def speeds(work: Work) -> Picture | None:
    """Figure 19: command and encoders."""
    got = {place: _first(work, place) for place in PLACES}
    found = {place: values for place, values in got.items() if values is not None}
    if not found:
        return None

    def draw() -> object:
        from outrider.plot.drives import Curve, curves_figure

        parts = [
            (
                place,
                (Curve("command", v["speed_t"], v["speed_told"]), Curve("encoders", v["speed_t"], v["speed_driven"])),
            )
            for place, v in found.items()
        ]
        return curves_figure(parts, "forward [m/s]")

    caption = "The caption of the paper's figure and its text swap the colours of the two. One seed."
    return Picture(key="speeds", title="Figure 19: speed commanded and driven", draw=draw, caption=caption)


def _first(work: Work, place: str) -> dict[str, Floats] | None:
    """Everything of the first seed that succeeded."""
    trials = trials_of(work, place)
    rows = [] if trials is None else [r for r in trials.rows if not r.error]
    return {k: np.asarray(v, np.float64) for k, v in rows[0].values.items()} if rows else None


def _plane(values: dict[str, Floats], name: str) -> Floats:
    return np.column_stack([values[f"{name}{axis}"] for axis in PLANE])


FIGURES: Final = (sites, tracks, northward, degrading, speeds)
