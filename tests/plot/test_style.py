"""Colours anyone can tell apart, and settings that stay ours."""

from itertools import combinations
from pathlib import Path

import factory
import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from outrider.plot import map_figure, save_png, style

# Machado, Oliveira and Fernandes (2009), severity 1, on linear RGB.
VISION = {
    "ordinary": np.eye(3),
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
}
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def linear(colour: str) -> np.ndarray:
    """Linear RGB of #rrggbb."""
    c = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of linear RGB."""
    x = TO_XYZ @ np.clip(rgb, 0, 1) / [0.9505, 1.0, 1.089]
    f = np.where(x > 0.008856, np.cbrt(x), 7.787 * x + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def contrast(a: str, b: str) -> float:
    """WCAG contrast ratio."""
    low, high = sorted((float(TO_XYZ[1] @ linear(c))) for c in (a, b))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_colours_stay_apart_for_every_reader(vision: str, theme: str) -> None:
    colours = [style.FUSED, style.LOCAL, style.REJECTED, *style.SOURCES]
    shown = colours if theme == "light" else [style.DARK[c] for c in colours]
    seen = [lab(np.array(VISION[vision]) @ linear(c)) for c in shown]
    least = min(float(np.linalg.norm(a - b)) for a, b in combinations(seen, 2))
    assert least > 10.0


def test_colours_stand_out_from_the_paper() -> None:
    for light, dark in style.DARK.items():
        if light in (style.GRID, style.PAPER, "#b9c4cf"):
            continue
        assert contrast(light, style.PAPER) > 2.0
        assert contrast(dark, style.DARK[style.PAPER]) > 3.0


def test_every_colour_has_a_dark_twin() -> None:
    used = {style.FUSED, style.LOCAL, style.REJECTED, *style.SOURCES, *style.AXES, *style.STATE_COLOURS.values()}
    assert used <= set(style.DARK)


def test_nothing_global_changes(tmp_path: Path) -> None:
    before = dict(mpl.rcParams)
    figure = map_figure(factory.full_run(50))
    save_png(figure, tmp_path / "map.png")
    style.to_svg(figure, "map")
    assert dict(mpl.rcParams) == before
    assert (tmp_path / "map.png").read_bytes()[:4] == b"\x89PNG"


def test_user_settings_do_not_leak_in() -> None:
    plain = style.to_svg(map_figure(factory.full_run(50)), "map")
    with mpl.rc_context({"axes.facecolor": "red", "lines.linewidth": 9.0, "text.usetex": True}):
        assert style.to_svg(map_figure(factory.full_run(50)), "map") == plain


def test_svg_follows_the_theme() -> None:
    svg = style.to_svg(map_figure(factory.full_run(50)), "map")
    for colour in style.DARK:
        assert colour not in svg
    assert "var(--c-1c2530)" in svg


def test_legend_never_covers_the_axes() -> None:
    figure = map_figure(factory.full_run(50), reference=factory.trajectory(np.linspace(0, 300, 50)))
    assert isinstance(figure, Figure)
    figure.draw_without_rendering()
    legend, axes = figure.legends[0].get_window_extent(), figure.axes[0].get_window_extent()
    assert legend.y0 >= axes.y1
    assert figure.bbox.x0 <= legend.x0 and legend.x1 <= figure.bbox.x1 and legend.y1 <= figure.bbox.y1 + 1
