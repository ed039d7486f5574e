"""Short ways to make a `Finding`, and what several questions ask of a plan."""

import numpy as np

from outrider.data import Finding
from outrider.filters.ranged import spread_out
from outrider.models.sensors.layout import OWN
from outrider.workflows.draft import Plan


def info(code: str, text: str, source: str = "", fix: str = "") -> Finding:
    """Worth knowing."""
    return Finding(severity="info", code=code, text=text, source=source, fix=fix)


def warning(code: str, text: str, source: str = "", fix: str = "") -> Finding:
    """The estimate may be worse for it."""
    return Finding(severity="warning", code=code, text=text, source=source, fix=fix)


def error(code: str, text: str, source: str = "", fix: str = "") -> Finding:
    """The estimate is wrong, or part of the data was in vain."""
    return Finding(severity="error", code=code, text=text, source=source, fix=fix)


def any_absolute(chosen: Plan) -> bool:
    """Whether anything but a heading source ties the run to the site frame: positions, or ranges to known places."""
    fused = [c for c in chosen.whole.channels if not c.scored]
    beacons = [c.theta[OWN : OWN + 3] for c in fused if c.beacon is not None]
    return any(c.reset[1] > 0 for c in fused) or spread_out(np.reshape(beacons, (-1, 3)))
