"""Short ways to make a `Finding`, and what several questions ask of a plan."""

from outrider.data import Finding
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
    """Whether anything but a heading source ties the run to the site frame."""
    return any(c.reset[1] > 0 and not c.scored for c in chosen.whole.channels)
