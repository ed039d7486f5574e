"""What a finding rests on, as a small figure's worth of data."""

from dataclasses import dataclass
from typing import Any, Final, final

from outrider.typing import Floats

LINE: Final = "line"
POINTS: Final = "points"
REFUSED: Final = "refused"  # points of what was not believed
BARS: Final = "bars"  # x : (n,) centres, equally wide apart


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """One series. x, y : (n,), finite, in the units of the axes;  drawn : `LINE`, `POINTS`, `REFUSED` or `BARS`."""

    x: Floats
    y: Floats
    name: str = ""
    drawn: str = LINE


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evidence:
    """Curves and what to see in them. at, levels : marked places on the horizontal and vertical axis, with a word each;
    log_y : a logarithmic vertical axis;  square : one scale on both axes;  names : of the places 0, 1, ... on the
    horizontal axis."""

    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    text: str
    at: tuple[tuple[float, str], ...] = ()
    levels: tuple[tuple[float, str], ...] = ()
    log_y: bool = False
    square: bool = False
    names: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "text": self.text, "x": self.x_label, "y": self.y_label, "at": {word: x for x, word in self.at},
            "levels": {word: y for y, word in self.levels},
            "curves": [{"name": c.name, "drawn": c.drawn, "x": c.x.tolist(), "y": c.y.tolist()} for c in self.curves],
        }  # fmt: skip


__all__ = ["BARS", "LINE", "POINTS", "REFUSED", "Curve", "Evidence"]
