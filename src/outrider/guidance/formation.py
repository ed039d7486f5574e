"""Who follows whom: the order of a column, and how it changes when drones join, leave, split and merge. Pure functions.

The first follows the target, everybody else the one ahead. Nobody needs to agree on more than this order.
"""

from dataclasses import dataclass, replace
from typing import final

from outrider.errors import UsageError


@final
@dataclass(frozen=True, slots=True)
class Column:
    """order : names, the first ahead;  target : whom the first follows."""

    order: tuple[str, ...]
    target: str

    def __post_init__(self) -> None:
        if len(set(self.order)) < len(self.order) or self.target in self.order:
            raise UsageError(f"a drone is twice in the column {', '.join(self.order)} behind {self.target}")

    def ahead(self, name: str) -> str:
        """Whom a drone follows. Raises `UsageError` for one that is not in the column."""
        at = _at(self, name)
        return self.order[at - 1] if at else self.target


def _at(column: Column, name: str) -> int:
    if name not in column.order:
        raise UsageError(f"{name} is not in the column", fix=f"there are: {', '.join(column.order) or 'none'}")
    return column.order.index(name)


def join(column: Column, name: str, *, behind: str = "") -> Column:
    """With one more, behind somebody (the target, or one of the column), else as the last."""
    at = 0 if behind == column.target else len(column.order) if not behind else _at(column, behind) + 1
    return replace(column, order=(*column.order[:at], name, *column.order[at:]))


def leave(column: Column, name: str) -> Column:
    """Without one: who followed it follows the one ahead of it."""
    at = _at(column, name)
    return replace(column, order=(*column.order[:at], *column.order[at + 1 :]))


def split(column: Column, first: str, target: str) -> tuple[Column, Column]:
    """The part ahead of `first`, and the part from it on, which follows another target."""
    at = _at(column, first)
    return replace(column, order=column.order[:at]), Column(column.order[at:], target)


def merge(ahead: Column, behind: Column) -> Column:
    """One column of two: the second follows the last of the first."""
    return Column((*ahead.order, *behind.order), ahead.target)
