"""The picture of an inspection says what share was seen."""

import numpy as np

from outrider.plot.inspection import Inspected, inspection_figure


def test_shares_and_both_views_are_drawn():
    p = np.random.default_rng(1).uniform(0, 5, (40, 3))
    seen = np.arange(40) < 30
    figure = inspection_figure({"ugv": Inspected(surface=p, seen=seen, planned=p[:3], driven=p[:3] + 0.1)})
    above, side = figure.axes
    told = [line.get_label() for line in above.get_lines()]
    assert told == ["seen, 75%", "not seen, 25%", "planned", "as it went"]
    assert np.array_equal(side.get_lines()[1].get_xydata(), p[~seen][:, [0, 2]])
