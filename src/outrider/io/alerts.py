"""Alerts from outside: one JSON object a line, in a file that grows or in a FIFO; and lists of them in scenarios."""

import json
import os
import stat
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime
from math import degrees, hypot
from pathlib import Path
from typing import Annotated, Any, Final, cast, final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from outrider.data.alerts import Alert, News
from outrider.data.site import Anchor
from outrider.errors import ConfigError, OutriderError
from outrider.io.checked import Number, Whole, validated
from outrider.io.site_geojson import FARTHEST, to_metres
from outrider.typing import Floats

LONGEST: Final = 1 << 16  # bytes of a line
AT_ONCE: Final = 1 << 20  # bytes read between two steps of the station
NOW: Final = "now"
Metres = Annotated[Number, Field(allow_inf_nan=False)]


class AlertSection(BaseModel):
    """An alert, or that one is called off."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)
    id: Annotated[Whole, Field(ge=0, le=1 << 53)] | None = None
    """Its number; without one the station gives one."""
    at: Annotated[list[Metres], Field(min_length=2, max_length=2)] | None = None
    """x and y, in metres of the site; or lat_deg and lon_deg."""
    lat_deg: Metres | None = None
    lon_deg: Metres | None = None
    sigma: Annotated[Metres, Field(ge=0, le=1000)] = 1.0
    """Standard deviation of each coordinate [m]."""
    time: str = NOW
    """When it was raised: `now`, when the station reads it, or ISO 8601 with its zone."""
    t_s: Annotated[Metres, Field(ge=0, le=1e8)] | None = None
    """When to raise it, instead: seconds since the start."""
    source: Annotated[str, Field(max_length=100)] = ""
    patience_s: Annotated[Metres, Field(gt=0, le=1e8)] = 600.0
    """How long until nobody needs to come any more."""
    hold_s: Annotated[Metres, Field(ge=0, le=1e8)] = 20.0
    """How long to observe."""
    cancel: Annotated[Whole, Field(ge=0, le=1 << 53)] | None = None
    """The number of the alert that is called off, and nothing else but when."""


@final
@dataclass(frozen=True, slots=True)
class _Item:
    """Due at t [ns]."""

    t: int
    what: Alert | int


@final
@dataclass(slots=True, kw_only=True)
class Agenda:
    """A `Feed` of alerts known beforehand. start : ns, from which `t_s` counts;  anchor : of the site."""

    start: int
    anchor: Anchor | None = None
    _items: list[_Item] = field(default_factory=list[_Item])

    def add(self, said: AlertSection, now: int) -> str:
        """Take one, at `now` [ns]; something to note, if there is. DataError or ConfigError: what is wrong with it."""
        t, late = _when(said, self.start, now)
        if said.cancel is not None:
            if said.at is not None or said.lat_deg is not None or said.id is not None:
                raise ConfigError("raises an alert and calls one off", fix="a line for each")
            self._items.append(_Item(t, said.cancel))
            return late
        p = _place(said, self.anchor)
        self._items.append(_Item(t, Alert(
            number=-1 if said.id is None else said.id, t=t, p=p, sigma=said.sigma, source=said.source,
            patience_s=said.patience_s, hold_s=said.hold_s,
        )))  # fmt: skip
        return late

    def due(self, t: int) -> News:
        """What has come up by t [ns], and was not told before."""
        ready = sorted((i for i in self._items if i.t <= t), key=lambda i: i.t)
        self._items = [i for i in self._items if i.t > t]
        whats = [i.what for i in ready]
        raised = tuple(w for w in whats if isinstance(w, Alert))
        return News(raised=raised, cancelled=tuple(w for w in whats if not isinstance(w, Alert)))


@final
class AlertFile:
    """A `Feed` from a file of JSON lines that may grow while it is read, or from a FIFO.

    A line that cannot be used costs one line of `News.faults`, with the file and the number of the line, and nothing
    else. A file that becomes shorter, or is replaced, is read again from its beginning.

    Raises ConfigError if there is no such file when it is opened.
    """

    def __init__(self, path: Path, *, start: int, anchor: Anchor | None = None) -> None:
        self._path, self._agenda = path, Agenda(start=start, anchor=anchor)
        self._fd, self._node, self._at, self._line, self._rest = -1, (-1, -1), 0, 0, b""
        self._skips = self._early = False  # within a line too long; the last line was taken before it ended
        fix = f"make it first: touch {path.name}, or mkfifo {path.name}"
        try:
            mode = path.stat().st_mode
        except OSError as e:
            raise ConfigError(f"no alerts can be read: {e.strerror}", where=str(path), fix=fix) from None
        if not (stat.S_ISREG(mode) or stat.S_ISFIFO(mode)):
            raise ConfigError("is neither a file nor a FIFO", where=str(path), fix=fix)
        self._fifo = stat.S_ISFIFO(mode)
        if not os.access(path, os.R_OK):
            raise ConfigError("no alerts can be read: permission denied", where=str(path), fix="chmod +r")

    def due(self, t: int) -> News:
        """Alerts and cancellations that have come by t [ns], and a line about each line of no use."""
        faults: list[str] = []
        notes: list[str] = []
        try:
            news = self._news(notes)
        except OSError as e:
            news = b""
            faults.append(f"{self._path}: {e.strerror}")
            self.close()
        *lines, self._rest = (self._rest + news).split(b"\n")
        if self._early and (lines or self._rest):
            self._early = False
            lines = lines[not lines[0].strip() :] if lines else lines
        if self._rest.rstrip().endswith(b"}") and not self._skips and _object(self._rest) is not None:
            lines.append(self._rest)  # the last line of a file need not end
            self._rest, self._early = b"", True
        if len(self._rest) > LONGEST:
            if not self._skips:
                faults.append(f"{self._path}:{self._line + 1}: a line of more than {LONGEST} bytes is left out")
            self._rest, self._skips = b"", True
        for line in lines:
            self._line += 1
            skipped, self._skips = self._skips, False
            note = "" if skipped or not line.strip() else self._take(line, t)
            faults += [f"{self._path}:{self._line}: {note}"] if note else []
        due = self._agenda.due(t)
        return News(raised=due.raised, cancelled=due.cancelled, faults=tuple(faults), notes=tuple(notes))

    def close(self) -> None:
        """Let go of the file; the next `due` opens it again."""
        if self._fd >= 0:
            os.close(self._fd)
        self._fd = -1

    def _news(self, notes: list[str]) -> bytes:
        """What was written since."""
        if not self._fifo and self._fd >= 0:
            now = self._path.stat()
            if (now.st_dev, now.st_ino) != self._node or now.st_size < self._at:
                notes.append(f"{self._path}: became another file, and is read from its beginning")
                self.close()
        if self._fd < 0:
            # a FIFO that is opened without waiting has an end of file until somebody writes to it
            self._fd = os.open(self._path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
            opened = os.fstat(self._fd)
            self._node, self._at, self._line, self._rest = (opened.st_dev, opened.st_ino), 0, 0, b""
        try:
            news = os.read(self._fd, AT_ONCE)
        except BlockingIOError:
            news = b""
        self._at += len(news)
        return news

    def _take(self, line: bytes, t: int) -> str:
        """Enter a line; what is to be said about it."""
        try:
            text = line.decode("utf-8-sig" if self._line == 1 else "utf-8")
            data = json.loads(text, object_pairs_hook=_once)
        except UnicodeDecodeError:
            return "is no text in UTF-8"
        except (json.JSONDecodeError, RecursionError) as e:
            return f'is no JSON: {getattr(e, "msg", "too deep")} (one object a line: {{"at": [12.0, 3.5]}})'
        except ConfigError as e:
            return _said(e)
        if not isinstance(data, dict):
            return 'is no JSON object (one a line: {"at": [12.0, 3.5]})'
        try:
            return self._agenda.add(validated(AlertSection, cast("dict[str, object]", data)), t)
        except OutriderError as e:
            return _said(e)


def agenda(sections: Iterable[AlertSection], *, start: int, anchor: Anchor | None = None) -> Agenda:
    """A feed of what a scenario lists; ConfigError, with the index, for one that makes no sense."""
    out = Agenda(start=start, anchor=anchor)
    for k, said in enumerate(sections):
        try:
            out.add(said, start)
        except OutriderError as e:
            raise ConfigError(e.what, where=f"alerts.{k}", fix=e.fix) from None
    return out


def _object(text: bytes) -> dict[str, Any] | None:
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return cast("dict[str, Any]", data) if isinstance(data, dict) else None


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object whose keys stand once each."""
    made = dict(pairs)
    if len(made) < len(pairs):
        names = [k for k, _ in pairs]
        raise ConfigError(f"{next(k for k in names if names.count(k) > 1)} stands twice", fix="once is enough")
    return made


def _said(e: OutriderError) -> str:
    return f"{e.what} ({e.fix})" if e.fix else e.what


def _when(said: AlertSection, start: int, now: int) -> tuple[int, str]:
    """When it is due [ns], and a note if its clock is ahead of ours."""
    if said.t_s is not None:
        if said.time != NOW:
            raise ConfigError("has both time and t_s", fix="time is a clock's, t_s counts from the start")
        return start + round(said.t_s * 1e9), ""
    if said.time == NOW:
        return now, ""
    try:
        stamp = datetime.fromisoformat(said.time)
    except ValueError:
        raise ConfigError(f"time: cannot be {said.time!r}", fix="now, or like 2026-05-01T14:30:00Z") from None
    if stamp.tzinfo is None:
        raise ConfigError(f"time: {said.time!r} has no zone", fix="end it with Z or +02:00")
    t = round(stamp.timestamp() * 1e6) * 1000
    if t > now:
        return now, f"its time is {(t - now) * 1e-9:.1f} s ahead of the station's clock: taken as now"
    return t, ""


def _place(said: AlertSection, anchor: Anchor | None) -> Floats:
    """(2,) m, site frame."""
    if said.at is not None:
        if said.lat_deg is not None or said.lon_deg is not None:
            raise ConfigError("has both at and lat_deg, lon_deg", fix="one of them")
        p = np.array(said.at)
        if not hypot(*p) < FARTHEST:
            raise ConfigError(f"at: {hypot(*p) / 1000:,.0f} km from the site's origin", fix="metres of the site")
        return p
    if said.lat_deg is None or said.lon_deg is None:
        raise ConfigError("says nowhere where it is", fix="at: [x, y] in metres of the site, or lat_deg and lon_deg")
    if anchor is None:
        raise ConfigError("is in degrees, and the site has no anchor", fix="at: [x, y], or anchor the site")
    lat, lon = said.lat_deg, said.lon_deg
    p, far = _metres(lat, lon, anchor)
    if far < FARTHEST:
        return p
    if _metres(lon, lat, anchor)[1] < FARTHEST:
        raise ConfigError(f"lat_deg {lat:g} and lon_deg {lon:g} are swapped", fix=f"lat_deg {lon:g}, lon_deg {lat:g}")
    here = f"the site is at {degrees(anchor.datum.lat):.3f}, {degrees(anchor.datum.lon):.3f}"
    raise ConfigError(f"lat_deg {lat:g}, lon_deg {lon:g} is not on the site", fix=here)


def _metres(lat: float, lon: float, anchor: Anchor) -> tuple[Floats, float]:
    """Metres of the site, and how far that is; nowhere on Earth is infinitely far."""
    if not (abs(lat) <= 90.0 and -180.0 <= lon <= 360.0):
        return np.zeros(2), np.inf
    p = to_metres(np.array([[lon, lat]]), anchor)[0]
    return p, hypot(*p) if _near(lat, lon, anchor) else np.inf


def _near(lat: float, lon: float, anchor: Anchor) -> bool:
    """Whether it is on this side of the Earth: flat coordinates of the other side are small again."""
    apart = abs(lat - degrees(anchor.datum.lat)), abs((lon - degrees(anchor.datum.lon) + 180.0) % 360.0 - 180.0)
    return apart[0] < 5.0 and (apart[1] < 30.0 or abs(lat) > 85.0)
