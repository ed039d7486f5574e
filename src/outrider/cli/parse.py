"""Texts of the command line as values, and options as the part of a configuration that they stand for."""

import re
from collections.abc import Callable, Iterable, Sequence
from math import isfinite
from pathlib import Path
from typing import TypeVar

from outrider.errors import UsageError

T = TypeVar("T")
LARGEST = 2**63 - 1
MOST = 1e9  # seconds or metres: more is a slip of the keyboard, and its nanoseconds are no stamp


def name(option: str) -> Callable[[object], str]:
    """A parser of names."""

    def parse(text: object) -> str:
        if not str(text):
            raise UsageError("is empty", where=option, fix="a variable that is not set?")
        return str(text)

    return parse


def file(option: str) -> Callable[[object], Path]:
    """A parser of file names; none at all would be the current folder."""
    named = name(option)
    return lambda text: Path(named(text))


def written(option: str) -> Callable[[object], Path]:
    """A parser of names of what is written: by libraries that want UTF-8, unlike the file system."""
    named = file(option)

    def parse(text: object) -> Path:
        try:
            str(text).encode()
        except UnicodeEncodeError:
            raise UsageError("is no text in UTF-8", where=option, fix="give another name") from None
        return named(text)

    return parse


def number(
    option: str, *, least: float | None = None, above: float | None = None, most: float = MOST
) -> Callable[[object], float]:
    """A parser of finite numbers, `least` and more or more than `above`; `most` at most, below zero as above."""

    def parse(text: object) -> float:
        value = _number(str(text), f"{option} {text}")
        if (least is not None and value < least) or (above is not None and value <= above):
            bound = f"{least:g} or more" if least is not None else f"more than {above:g}"
            raise UsageError("is too small", where=f"{option} {text}", fix=f"give {bound}")
        if abs(value) > most:
            bound = f"{most:g} or less" if value > 0.0 else f"{-most:g} or more"
            raise UsageError("is too large", where=f"{option} {text}", fix=f"give {bound}")
        return value

    return parse


def whole(option: str, least: int = 0) -> Callable[[object], int]:
    """A parser of whole numbers from `least` to the largest of 64 bits."""

    def parse(text: object) -> int:
        return _whole(str(text), least, f"{option} {text}")

    return parse


def overrides(
    *,
    robot: str | None = None,
    seed: int | None = None,
    preset: str | None = None,
    mounts: Sequence[str] | None = None,
    datum: str | None = None,
    withhold: Sequence[str] | None = None,
) -> dict[str, object]:
    """What the command line says, with the keys of a configuration file; only what was given."""
    out: dict[str, object] = {}
    if robot is not None:
        out["robot"] = robot
    if seed is not None:
        out["seed"] = seed
    if preset is not None:
        out["preset"] = preset
    if mounts:
        out["mounts"] = _once("--mount", map(_mount, mounts))
    if datum is not None:
        out["datum"] = _datum(datum)
    if withhold:
        out["withhold"] = _once("--withhold", map(_every, withhold))
    return out


def _mount(text: str) -> tuple[str, dict[str, object]]:
    """`imu=0.1,0,0.3,0,0,90`: x, y, z in metres forward, left, up; roll, pitch, yaw in degrees (may be left out)."""
    shape = "FRAME=x,y,z or FRAME=x,y,z,roll,pitch,yaw"
    frame, numbers = _split(text, "--mount", shape)
    values = _numbers(numbers, "--mount", text, (3, 6), shape)
    return frame, {"xyz_m": values[:3], "rpy_deg": values[3:] or [0.0, 0.0, 0.0]}


def _datum(text: str) -> dict[str, object]:
    shape = "LAT,LON,ALT: degrees, degrees, metres above the ellipsoid"
    values = _numbers(text, "--datum", text, (2, 3), shape)
    if len(values) == 2:
        raise UsageError("the height is missing", where=f"--datum {text}", fix=f"write {shape}, e.g. {text},0")
    return dict(zip(("lat_deg", "lon_deg", "alt_m"), values, strict=True))


def _every(text: str) -> tuple[str, int]:
    source, every = _split(text, "--withhold", "SOURCE=N")
    return source, _whole(every, 2, f"--withhold {text}")


def seconds_of(text: str, option: str) -> tuple[str, float]:
    """SOURCE=S: a name, and more than zero seconds."""
    source, seconds = _split(text, option, "SOURCE=SECONDS")
    value = _number(seconds, f"{option} {text}")
    if not 0.0 < value <= MOST:
        raise UsageError(
            "is no time", where=f"{option} {text}", fix=f"give more than zero seconds, and {MOST:g} at most"
        )
    return source, value


def _once(option: str, pairs: Iterable[tuple[str, T]]) -> dict[str, T]:
    """As a dict; what stands there twice is no typing error that we could guess."""
    out: dict[str, T] = {}
    for name, value in pairs:
        if name in out:
            raise UsageError(f"'{name}' is there twice", where=option, fix="give each once")
        out[name] = value
    return out


def _split(text: str, option: str, shape: str) -> tuple[str, str]:
    name, sign, value = text.rpartition("=")
    if not sign or not name or not value:
        raise UsageError("cannot be understood", where=f"{option} {text}", fix=f"write {shape}")
    return name, value


def _numbers(text: str, option: str, whole_text: str, counts: tuple[int, ...], shape: str) -> list[float]:
    where = f"{option} {whole_text}"
    values = [_number(cell, where) for cell in text.split(",")]
    if len(values) not in counts:
        raise UsageError(f"has {len(values)} number{'s' * (len(values) != 1)}", where=where, fix=f"write {shape}")
    return values


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = None
    if value is None or "_" in text:
        raise UsageError(f"'{_short(text)}' is no number", where=where, fix="write it like 12.5")
    if not isfinite(value):
        raise UsageError(f"'{_short(text)}' is no finite number", where=where, fix="write it like 12.5")
    return value


def _whole(text: str, least: int, where: str) -> int:
    digits = re.fullmatch(r"\+?(\d{1,99})", text, re.ASCII)
    if digits is None or not least <= int(digits[1]) <= LARGEST:
        upper = f" to {LARGEST}" if digits is not None and int(digits[1]) > LARGEST else ""
        raise UsageError(
            f"'{_short(text)}' is no whole number from {least}{upper}", where=_short(where), fix="write it like 5"
        )
    return int(digits[1])


def _short(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:60]}..."
