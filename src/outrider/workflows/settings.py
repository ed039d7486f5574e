"""From a YAML file and the command line to a checked `FuseConfig`; a fault becomes one line with its remedy."""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, cast

from pydantic import ValidationError

from outrider.errors import ConfigError
from outrider.io.config import at_line, line_of, read_yaml
from outrider.workflows.config import FuseConfig

Keys = tuple[str | int, ...]


def load_config(path: Path | None = None, overrides: Mapping[str, object] | None = None) -> FuseConfig:
    """The configuration of a file (defaults without one), with what the command line says instead."""
    data = {} if path is None else read_yaml(path)
    return parse_config(merged(data, overrides or {}), "" if path is None else str(path))


def parse_config(data: Mapping[str, object], where: str = "") -> FuseConfig:
    """Check a configuration; `where` is its file, in which the faulty line is looked up.

    Raises `ConfigError` that names key, fault and remedy of the first fault, and how many more there are.
    """
    try:
        return FuseConfig.model_validate(data)
    except ValidationError as e:
        raise _config_error(e, data, where) from None


def merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with the values of `over`, mappings joined key by key."""
    out = dict(base)
    for key, value in over.items():
        mine = out.get(key)
        out[key] = merged(_mapping(mine), _mapping(value)) if _is_both(mine, value) else value
    return out


def schema() -> dict[str, Any]:
    """JSON schema of the configuration, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **FuseConfig.model_json_schema()}


def _mapping(value: object) -> Mapping[str, Any]:
    return cast("Mapping[str, Any]", value)


def _is_both(a: object, b: object) -> bool:
    return isinstance(a, Mapping) and isinstance(b, Mapping)


def _config_error(error: ValidationError, data: object, where: str) -> ConfigError:
    faults = error.errors(include_url=False)
    first = faults[0]
    keys = _real_keys(first["loc"], data, missing=first["type"] == "missing")
    what, fix = _in_words(cast("Mapping[str, Any]", first), keys)
    name = ".".join(str(k) for k in keys)
    more = len({tuple(_real_keys(f["loc"], data)) for f in faults}) - 1
    what = f"{name}: {what}" if name else what
    what += f", and {more} more fault{'s' * (more > 1)}" if more > 0 else ""
    line = line_of(Path(where), keys) if where else 0
    return ConfigError(what, where=at_line(where, line) if where else "configuration", fix=fix)


def _real_keys(loc: Sequence[str | int], data: object, *, missing: bool = False) -> Keys:
    """The part of pydantic's location that exists in the data: it also names the alternatives it tried."""
    keys: list[str | int] = []
    for key in loc:
        if isinstance(data, Mapping) and key in data:
            data = cast("Mapping[str | int, object]", data)[key]
        elif isinstance(data, (list, tuple)) and isinstance(key, int) and key < len(cast("Sequence[object]", data)):
            data = cast("Sequence[object]", data)[key]
        elif missing and isinstance(data, Mapping) and key == loc[-1]:
            keys.append(key)
            break
        else:
            continue
        keys.append(key)
    return tuple(keys)


def _in_words(fault: Mapping[str, Any], keys: Keys) -> tuple[str, str]:
    """What is wrong, and a remedy."""
    kind, message, given = str(fault["type"]), str(fault["msg"]), fault["input"]
    if kind == "extra_forbidden":
        known = _keys_at(keys[:-1])
        return "unknown key", _remedy(str(keys[-1]), known)
    if kind == "missing" and isinstance(fault["loc"][-1], int):
        return f"needs more numbers than {len(given)}", ""
    if kind == "missing":
        return "is missing", f"all keys here: {', '.join(_keys_at(keys[:-1]))}"
    if kind == "literal_error":
        allowed = [w.strip(" '") for w in str(fault["ctx"]["expected"]).replace(" or ", ", ").split(",")]
        return f"cannot be '{given}'", _remedy(str(given), allowed)
    if kind == "value_error":
        return message.removeprefix("Value error, "), ""
    shown = repr(given) if isinstance(given, (str, int, float, bool)) or given is None else type(given).__name__
    return f"{message[:1].lower()}{message[1:].replace('Input ', '')}, is {shown}".replace("input should", "should"), ""


def _remedy(name: str, known: Sequence[str]) -> str:
    near = get_close_matches(name, known, n=1)
    return f"did you mean '{near[0]}'?" if near else f"there are: {', '.join(known)}"


def _keys_at(keys: Keys) -> list[str]:
    """Every key that the configuration may have at a place."""
    whole = FuseConfig.model_json_schema()
    node = whole
    for key in keys:
        inside = node.get("properties", {}).get(key) or node.get("additionalProperties") or node.get("items") or {}
        node = _resolved(cast("dict[str, Any]", inside), whole)
    return list(node.get("properties", {}))


def _resolved(node: dict[str, Any], whole: dict[str, Any]) -> dict[str, Any]:
    """A part of the schema with references followed, and `null` left out of alternatives."""
    for one in node.get("anyOf", []):
        if "$ref" in one:
            node = one
    return whole["$defs"][node["$ref"].rsplit("/", 1)[-1]] if "$ref" in node else node
