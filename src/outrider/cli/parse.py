"""Options that hold more than one value, as the part of a configuration that they stand for."""

from collections.abc import Sequence
from math import isfinite

from outrider.errors import UsageError


def overrides(
    *,
    seed: int | None = None,
    preset: str | None = None,
    mounts: Sequence[str] | None = None,
    datum: str | None = None,
    withhold: Sequence[str] | None = None,
) -> dict[str, object]:
    """What the command line says, with the keys of a configuration file; only what was given."""
    out: dict[str, object] = {}
    if seed is not None:
        out["seed"] = seed
    if preset is not None:
        out["preset"] = preset
    if mounts:
        out["mounts"] = dict(_mount(text) for text in mounts)
    if datum is not None:
        lat, lon, alt = [*_numbers(datum, "--datum", (2, 3)), 0.0][:3]
        out["datum"] = {"lat_deg": lat, "lon_deg": lon, "alt_m": alt}
    if withhold:
        out["withhold"] = dict(_every(text) for text in withhold)
    return out


def _mount(text: str) -> tuple[str, dict[str, object]]:
    """`imu=0.1,0,0.3,0,0,90`: x, y, z in metres forward, left, up; roll, pitch, yaw in degrees (may be left out)."""
    frame, numbers = _split(text, "--mount", "FRAME=x,y,z,roll,pitch,yaw")
    values = _numbers(numbers, "--mount", (3, 6))
    return frame, {"xyz_m": values[:3], "rpy_deg": values[3:] or [0.0, 0.0, 0.0]}


def _every(text: str) -> tuple[str, int]:
    source, number = _split(text, "--withhold", "SOURCE=N")
    if not number.isdecimal() or int(number) < 2:
        raise UsageError(f"'{number}' is no whole number from 2", where=f"--withhold {text}", fix="e.g. /fix=5")
    return source, int(number)


def _split(text: str, option: str, shape: str) -> tuple[str, str]:
    name, sign, value = text.rpartition("=")
    if not sign or not name or not value:
        raise UsageError("cannot be understood", where=f"{option} {text}", fix=f"write {shape}")
    return name, value


def _numbers(text: str, option: str, counts: tuple[int, ...]) -> list[float]:
    cells = text.split(",")
    try:
        values = [float(c) for c in cells]
        if not all(map(isfinite, values)):
            raise ValueError
    except ValueError:
        raise UsageError("holds what is no number", where=f"{option} {text}") from None
    if len(values) not in counts:
        needed = " or ".join(str(n) for n in counts)
        raise UsageError(f"has {len(values)} numbers", where=f"{option} {text}", fix=f"give {needed}, apart by commas")
    return values
