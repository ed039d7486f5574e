"""Which papers there are. Each is a module of this package with a `PAPER`, imported when it is asked for."""

from importlib import import_module
from typing import cast

from outrider.campaign.papers.model import Paper
from outrider.errors import UsageError
from outrider.io.files import closest

_NAMES = ("amr2025", "coop2024", "swarm2023")


def paper_names() -> tuple[str, ...]:
    """The names that `outrider papers` knows."""
    return _NAMES


def find_paper(name: str) -> Paper:
    """The paper of that name; `UsageError` with the nearest one if there is none."""
    if name not in _NAMES:
        raise UsageError(f"no paper '{name}'", fix=closest(name, _NAMES))
    return cast("Paper", import_module(f"outrider.campaign.papers.{name}").PAPER)
