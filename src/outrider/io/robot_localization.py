"""Configurations of robot_localization's filters as plain values: ROS 1 (flat, or under a node's name) and ROS 2."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, cast, final

from outrider.errors import ConfigError
from outrider.io.checked import fault_at
from outrider.io.config import read_yaml

INPUT: Final = re.compile(r"(odom|pose|twist|imu)(\d+)")
OF_INPUT: Final = re.compile(r"((?:odom|pose|twist|imu)\d+)_(\w+)")
STATES: Final = ("x", "y", "z", "roll", "pitch", "yaw", "vx", "vy", "vz", "vroll", "vpitch", "vyaw", "ax", "ay", "az")
FLAGS: Final = ("differential", "relative", "remove_gravitational_acceleration")
LARGEST: Final = 1e9


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """One input. kind : odom, pose, twist or imu;  uses : fifteen flags in the order of `STATES`;  rest : its other
    parameters by the name after the input's."""

    name: str
    kind: str
    topic: str
    uses: tuple[bool, ...]
    rest: Mapping[str, object]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Upstream:
    """One filter node. settings : what is about no input;  others : nodes of the file that are not used."""

    path: str
    node: str
    inputs: tuple[Input, ...]
    settings: Mapping[str, object]
    others: tuple[str, ...]


def read_upstream(path: Path) -> Upstream | None:
    """The filter node of a file; None if it is no configuration of robot_localization.

    Of several nodes that in the frame of the map is taken, else the first. Raises `ConfigError` for what is missing, no
    YAML, or holds a value that cannot be understood.
    """
    nodes = nodes_in(read_yaml(path))
    filters = {name: {str(k): v for k, v in of.items()} for name, of in nodes.items() if is_filter(of)}
    if not filters:
        return None
    in_map = [
        n for n, of in filters.items() if of.get("world_frame") is not None and of["world_frame"] == of.get("map_frame")
    ]
    chosen = (in_map or list(filters))[0]
    parameters = filters[chosen]
    keys: tuple[str | int, ...] = tuple(chosen.split("/")) if chosen else ()
    names = [n for n in parameters if INPUT.fullmatch(n)]
    if not names:
        raise ConfigError("names no input of its filter", where=str(path), fix="it needs a topic, like `odom0: /odom`")
    return Upstream(
        path=str(path),
        node=chosen.partition("/")[0],
        inputs=tuple(input_of(parameters, n, keys, path) for n in names),
        settings={k: v for k, v in parameters.items() if not INPUT.fullmatch(k) and not of_input(k, names)},
        others=tuple(n.partition("/")[0] for n in nodes if n != chosen and n),
    )


def is_upstream(data: Mapping[str, Any]) -> bool:
    """Whether a file's content is a configuration of robot_localization."""
    return any(is_filter(of) for of in nodes_in(data).values())


def nodes_in(data: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Parameters by node: its name, in ROS 2 with `/ros__parameters` after it; '' where there is none."""
    out: dict[str, Mapping[str, Any]] = {}
    if is_filter(data):
        out[""] = data
    for name, of in data.items():
        if not isinstance(of, Mapping):
            continue
        inner = cast("Mapping[str, Any]", of)
        deep = inner.get("ros__parameters")
        if isinstance(deep, Mapping):
            out[f"{name}/ros__parameters"] = cast("Mapping[str, Any]", deep)
        elif is_filter(inner) or "magnetic_declination_radians" in inner:
            out[str(name)] = inner
    return out


def is_filter(parameters: Mapping[str, Any]) -> bool:
    """Whether these are parameters of a filter node: it has an input and says what to use of it."""
    return any(INPUT.fullmatch(str(k).removesuffix("_config")) for k in parameters)


def of_input(key: str, names: list[str]) -> bool:
    """Whether a parameter belongs to one of these inputs."""
    m = OF_INPUT.fullmatch(key)
    return m is not None and m[1] in names


def input_of(parameters: Mapping[str, Any], name: str, keys: tuple[str | int, ...], path: Path) -> Input:
    """One input, checked."""

    def fault(key: str, what: str, fix: str) -> ConfigError:
        return fault_at((*keys, key), what, str(path), fix)

    topic, config = parameters[name], parameters.get(f"{name}_config")
    if not isinstance(topic, str) or not topic.strip("/"):
        raise fault(name, "is no topic", "write the name of a topic, like /odom")
    if config is None:
        raise fault(name, f"has no {name}_config", "write fifteen of true and false, without it nothing is fused of it")
    flags = cast("list[object]", config) if isinstance(config, list) else []
    if len(flags) != len(STATES) or not all(isinstance(f, bool) for f in flags):
        raise fault(f"{name}_config", "is not fifteen of true and false", f"in the order {', '.join(STATES)}")
    rest = {k[len(name) + 1 :]: v for k, v in parameters.items() if of_input(k, [name]) and k != f"{name}_config"}
    for key, value in rest.items():
        if key in FLAGS and not isinstance(value, bool):
            raise fault(f"{name}_{key}", "is neither true nor false", "write true or false")
        if key.endswith("rejection_threshold") and not is_positive(value):
            raise fault(f"{name}_{key}", "is no Mahalanobis distance", "give a number above zero")
    kind = cast("re.Match[str]", INPUT.fullmatch(name))[1]
    return Input(name=name, kind=kind, topic=topic, uses=tuple(bool(f) for f in flags), rest=rest)


def is_positive(value: object) -> bool:
    """Whether a value is a number above zero, and no absurd one (infinity is none)."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and 0.0 < value < float("inf")


__all__ = ["STATES", "Input", "Upstream", "is_positive", "is_upstream", "read_upstream"]
