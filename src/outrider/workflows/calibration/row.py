"""One calibrated number, and what becomes of it in a configuration."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Any, Final, final

NO_MOTION: Final = "not observable in this log: it has no motion"
VAGUE: Final = "not observable in this log: the motion does not tell it"
LEVEL: Final = "not observable in this log: the robot stays level"
UNSETTLED: Final = "not found: the search did not settle"
AS_TOLD: Final = "as told"
FOUND: Final = "found"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A parameter of a source. told : what configuration, log or default say, NaN for
    nothing;  value : what the log tells, NaN where it
    tells nothing;  half : half of its 95 % interval;  verdict : a sentence;  section : where the value belongs in the
    configuration, if it differs from what was told."""

    source: str
    what: str
    unit: str
    told: float
    value: float = float("nan")
    half: float = float("nan")
    verdict: str
    section: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @property
    def found(self) -> bool:
        """Whether the log tells it."""
        return isfinite(self.value)

    @property
    def differs(self) -> bool:
        """Whether what was told lies outside the interval."""
        return self.found and not abs(self.value - self.told) <= self.half

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        number = {"value": self.value, "half_95": self.half} if self.found else {"value": None, "half_95": None}
        return {"source": self.source, "what": self.what, "unit": self.unit,
                "told": self.told if isfinite(self.told) else None, **number, "verdict": self.verdict}  # fmt: skip


def row_of(source: str, what: str, unit: str, told: float, value: float, half: float, widest: float) -> Row:
    """A row with its verdict: an interval wider than `widest` says nothing."""
    if not half <= widest:
        return Row(source=source, what=what, unit=unit, told=told, verdict=VAGUE)
    verdict = AS_TOLD if abs(value - told) <= half else FOUND
    return Row(source=source, what=what, unit=unit, told=told, value=value, half=half, verdict=verdict)
