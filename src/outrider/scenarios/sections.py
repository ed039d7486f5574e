"""Sections of a scenario file, made of our own frozen dataclasses: the same fields, defaults and types, checked.

What a file cannot hold is translated: an enum is one of its names in small letters, an array a list of lists. An angle
may be given in degrees by the key with `_deg`, an orientation as `mount_rpy_deg` (roll, pitch, yaw).
"""

from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import Enum
from functools import cache, reduce
from math import hypot, inf, isnan
from operator import or_
from types import NoneType, UnionType
from typing import Annotated, Any, Final, Literal, TypeAlias, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np
from annotated_types import Ge, Gt, Le
from pydantic import AfterValidator, BaseModel, ConfigDict, create_model, model_validator
from pydantic import Field as Option

from outrider.core.attitudes import rpy_to_quats
from outrider.errors import ConfigError
from outrider.io import checked
from outrider.io.checked import Flag, Whole

T = TypeVar("T")

ANGLES: Final[Mapping[str, tuple[str, ...]]] = {
    "Attitude": ("sigma", "yaw_error"),
    "Camera": ("half_angle", "incidence", "turn", "low", "high"),
    "BodyTwist": ("sigma_w",),
    "Heading": ("sigma", "offset"),
    "Imu": ("misalignment", "gyro_range"),
    "Lidar": ("field",),
    "Multirotor": ("yaw_rate", "tilt_rate"),
    "ObjectPose": ("sigma_angle", "apart"),
    "RobotCamera": ("half_angle", "sigma_angle"),
    "Rotorcraft": ("yaw_rate", "tilt_rate"),
    "Steering": ("limit", "rate"),
    "TebSettings": ("yaw",),
    "PursuitSettings": ("yaw",),
    "SteeringEncoder": ("sigma_angle", "offset"),
}
"""Fields in radians, or radians per second, by class."""
FASTEST: Final = 20_000.0  # Hz: no sensor of a robot is faster, and a run would not end
LARGEST: Final = 10_000.0  # m, m/s: a site, or what moves in it
LONGEST: Final = 1e9  # s, whose nanoseconds are a stamp
MOST: Final = 1e12  # of anything: far beyond any use, and what follows from it stays finite
SIZES: Final = ("side", "speed", "radius")
COUNTS: Final = ("beams", "wheels", "satellites")
POSITIVE: Final = (
    "accel_range", "claims", "gear", "gyro_range", "half_angle", "max_range", "multipath_reach", "period_s",
    "reach",
)  # fmt: skip
NOT_NEGATIVE: Final = (
    "apart", "jitter_s", "latency_s", "misalignment", "multipath", "phase_s", "tick", "vibration", "wait_s",
)  # fmt: skip
SPREADS: Final = ("_density", "_instability", "_scale", "_start", "_walk")  # how such a name ends
SHARES: Final = ("blocked", "drop", "loss")
ENDLESS: Final = (
    "accel_range", "bandwidth", "ceiling", "dwell_s", "end_s", "floor", "gyro_range", "max_range", "radio_range",
    "range_m", "reach",
)  # fmt: skip
"""What may be infinite: a reach without end."""


def _known(value: float) -> float:
    if abs(_endless(value)) == inf:
        raise ValueError(f"should be a finite number, is {value}")
    if abs(value) > MOST:
        raise ValueError(f"should be within {MOST:g}, is {value:g}")
    return value


def _endless(value: float) -> float:
    if isnan(value):
        raise ValueError("should be a number, is nan")
    return value


Number: TypeAlias = Annotated[checked.Number, AfterValidator(_known)]
Endless: TypeAlias = Annotated[checked.Number, AfterValidator(_endless)]
STRICT: Final[Mapping[Any, Any]] = {float: Number, int: Whole, bool: Flag}
Table: TypeAlias = list[Number] | list[list[Number]]


class Part(BaseModel):
    """A section: unknown keys are errors, values are frozen, angles may come in degrees."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _in_radians(cls, data: object) -> object:
        if not isinstance(data, Mapping):
            return data
        given = dict(cast("Mapping[str, Any]", data))
        for key in [k for k in cls.model_fields if k.endswith("_deg") and given.get(k) is not None]:
            name = key.removesuffix("_rpy_deg") if key.endswith("_rpy_deg") else key.removesuffix("_deg")
            if name in given:
                raise ValueError(f"both {name} and {key} are given")
            try:
                angle = np.radians(np.array(given[key], np.float64))
                turned = rpy_to_quats(angle.reshape(1, 3))[0] if key.endswith("_rpy_deg") else angle
            except (TypeError, ValueError):
                continue  # no numbers: the field says so
            del given[key]
            given[name] = turned.tolist()
        return given


class MadePart(Part):
    """A section that has no source to look for the words of its keys in, which takes seconds for all of them."""

    model_config = ConfigDict(use_attribute_docstrings=False)


def _turn(q: tuple[float, ...]) -> tuple[float, ...]:
    if not abs(hypot(*q) - 1.0) < 1e-3:
        raise ValueError("is no rotation (x, y, z, w of a length of 1; or write mount_rpy_deg: [roll, pitch, yaw])")
    return q


def section_of(cls: type[Any], *, tag: str = "", skip: tuple[str, ...] = ()) -> type[Part]:
    """The section that describes an instance of a dataclass; with `tag`, its key `type` holds that word."""
    hints = get_type_hints(cls)
    made: dict[str, Any] = {"type": (Literal[tag], ...)} if tag else {}  # type: ignore[valid-type]
    for f in fields(cls):
        if not f.init or f.name in skip:
            continue
        kind: Any = _translated(hints[f.name], f.name)
        if f.name == "mount":
            kind = Annotated[kind, AfterValidator(_turn)]
        made[f.name] = (kind, _option(f, hints[f.name]))
        if f.name in ANGLES.get(cls.__name__, ()):
            made[f"{f.name}_deg"] = (kind | None, None)
        if f.name == "mount":
            made["mount_rpy_deg"] = (tuple[Number, Number, Number] | None, None)
    return create_model(cls.__name__, __base__=MadePart, __doc__=_first_sentence(cls), **made)


@cache
def inner_section(cls: type[Any]) -> type[Part]:
    """The section of a dataclass that others hold."""
    return section_of(cls)


def tagged(registry: Mapping[str, type[Any]], skip: tuple[str, ...] = ()) -> Any:
    """The type of a section that is one of a registry, by its key `type`."""
    sections = [section_of(cls, tag=name, skip=skip) for name, cls in registry.items()]
    return Annotated[reduce(or_, cast("list[Any]", sections)), Option(discriminator="type")]


def made_of(cls: type[T], section: BaseModel, **more: object) -> T:
    """The instance that a section describes. What cannot be is a `ConfigError` of its class."""
    hints = get_type_hints(cls)
    names = [f.name for f in fields(cast("Any", cls)) if f.init and f.name in type(section).model_fields]
    return cls(**{n: _real(hints[n], getattr(section, n), n) for n in names if n not in more}, **more)


def plain_value(value: object) -> object:
    """What a file would hold for a value."""
    if isinstance(value, Enum):
        return value.name.lower()
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain_value(getattr(value, f.name)) for f in fields(value) if f.init}
    if isinstance(value, Mapping):
        items = cast("Mapping[object, object]", value).items()
        return {plain_value(k): plain_value(v) for k, v in items}
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [plain_value(v) for v in cast("tuple[object, ...]", value)] if isinstance(value, tuple) else value


def _option(f: "Field[Any]", hint: object) -> Any:
    if f.default is not MISSING:
        return Option(default=plain_value(f.default), validate_default=True)
    if f.default_factory is not MISSING:
        made = plain_value(f.default_factory())
        return Option(default_factory=lambda: made, validate_default=True)
    return ...


def _translated(hint: Any, name: str) -> Any:
    """The type that a file holds; bounds by the field's name."""
    origin, inside = get_origin(hint), get_args(hint)
    if origin is np.ndarray:
        return Table
    if origin in (Union, UnionType):
        return reduce(or_, [None if a is NoneType else _translated(a, name) for a in inside])
    if origin is tuple:
        return tuple[tuple(a if a is ... else _translated(a, name) for a in inside)]  # type: ignore[misc]
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return dict[_translated(inside[0], ""), _translated(inside[1], name)]  # type: ignore[misc]
    if is_dataclass(hint):
        return inner_section(cast("type[Any]", hint))
    if isinstance(hint, type) and issubclass(hint, Enum):
        return Literal[tuple(e.name.lower() for e in hint)]  # type: ignore[misc]
    return bounded(STRICT.get(hint, hint), name)


def bounded(kind: Any, name: str) -> Any:
    """Rates, sizes, reaches and counts are positive, deviations and delays are not negative, a share is at most 1."""
    if kind == Number and (name in (*ENDLESS, *SIZES) or name.endswith("_hz")):  # which have bounds of their own
        kind = Endless
    elif kind == Number and name.endswith("_s"):
        kind = Annotated[kind, Ge(-LONGEST), Le(LONGEST)]
    if name.endswith("_hz"):
        return Annotated[kind, Gt(0), Le(FASTEST)]
    if name in SIZES and kind is not Whole:  # a whole number picks a column
        return Annotated[kind, Gt(0), Le(LARGEST)]
    if name in POSITIVE or name.endswith("tau_s") or (kind is Whole and name in COUNTS):
        return Annotated[kind, Gt(0)]
    if name in SHARES:
        return Annotated[kind, Ge(0), Le(1)]
    if name in NOT_NEGATIVE or "sigma" in name or name.endswith(SPREADS):
        return Annotated[kind, Ge(0)]
    return kind


def _real(hint: Any, value: Any, name: str) -> Any:
    """The value that our own class takes."""
    origin, inside = get_origin(hint), get_args(hint)
    if value is None:
        return None
    if origin is np.ndarray:
        try:
            return np.array(value, np.float64)
        except ValueError:
            raise ConfigError(f"rows of {name} are not of one length", fix="give each the same number") from None
    if origin in (Union, UnionType):
        return _real(next(a for a in inside if a is not NoneType), value, name)
    if origin is tuple:
        kinds = inside[:1] * len(value) if inside[-1] is ... else inside
        return tuple(_real(kind, v, name) for kind, v in zip(kinds, value, strict=True))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {_real(inside[0], k, ""): _real(inside[1], v, name) for k, v in value.items()}
    if is_dataclass(hint):
        return made_of(cast("type[Any]", hint), value)
    return hint[value.upper()] if isinstance(hint, type) and issubclass(hint, Enum) else value


def _first_sentence(cls: type[Any]) -> str:
    return " ".join((cls.__doc__ or "").split("\n\n")[0].split())
