"""Values of a file against the model of what may stand there; the first fault becomes one line with its remedy."""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar, cast

from pydantic import BaseModel, Strict, ValidationError

from outrider.errors import ConfigError
from outrider.io.config import at_line, line_of

Keys = tuple[str | int, ...]
Model = TypeVar("Model", bound=BaseModel)
Number = Annotated[float, Strict()]  # a text that reads like a number is none, nor is `true`
Whole = Annotated[int, Strict()]
Flag = Annotated[bool, Strict()]
MAPPING, LIST = "a mapping of keys to values", "a list, like [1, 2]"
EXPECTED: Final = {  # pydantic's kinds of fault in our words
    "float_type": "a number", "finite_number": "a finite number", "int_type": "a whole number",
    "int_from_float": "a whole number", "bool_type": "true or false", "string_type": "text", "invalid_key": "text",
    "dict_type": MAPPING, "mapping_type": MAPPING, "model_type": MAPPING, "model_attributes_type": MAPPING,
    "tuple_type": LIST, "list_type": LIST, "greater_than": "more than {gt:g}", "greater_than_equal": "{ge:g} or more",
    "less_than": "less than {lt:g}", "less_than_equal": "{le:g} or less", "too_short": "{min_length} entry or more",
    "string_too_short": "{min_length} letter or more", "string_too_long": "{max_length} letter or less",
}  # fmt: skip


def validated(model: type[Model], data: Mapping[str, object], where: str = "") -> Model:
    """The model of some data; `where` is their file, in which the faulty line is looked up.

    Raises `ConfigError` that names key, fault and remedy of the first fault, and how many more there are.
    """
    try:
        return model.model_validate(data)
    except ValidationError as e:
        raise _config_error(model, e, data, where) from None


def _config_error(model: type[BaseModel], error: ValidationError, data: object, where: str) -> ConfigError:
    faults = cast("list[Mapping[str, Any]]", error.errors(include_url=False))
    places = [_real_keys(f["loc"], data, missing=f["type"] == "missing") for f in faults]
    at = max(range(len(faults)), key=lambda i: (places[i][:1] == places[0][:1], len(places[i]), -i))
    keys = places[at]  # of alternatives that were tried, the one that fitted best
    what, fix = _in_words(model, faults[at], keys, data)
    more = len({p[:2] for p in places}) - 1
    what += f", and {more} more fault{'s' * (more > 1)}" if more > 0 else ""
    return fault_at(keys, what, where, fix)


def fault_at(keys: Keys, what: str, where: str, fix: str = "") -> ConfigError:
    """A fault of the value at `keys`; `where` as in `validated`."""
    name = ".".join(str(k) for k in keys)
    line = line_of(Path(where), keys) if where else 0
    place = at_line(where, line) if where else "configuration"
    return ConfigError(f"{name}: {what}" if name else what, where=place, fix=fix)


def remedy(name: str, known: Sequence[str]) -> str:
    """The known name that was probably meant, else all of them."""
    near = get_close_matches(name, known, n=1)
    return f"did you mean '{near[0]}'?" if near else f"there are: {', '.join(known)}"


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


def _in_words(model: type[BaseModel], fault: Mapping[str, Any], keys: Keys, data: object) -> tuple[str, str]:
    """What is wrong, and a remedy."""
    kind, given, more = str(fault["type"]), fault["input"], cast("Mapping[str, Any]", fault.get("ctx", {}))
    if kind == "extra_forbidden":
        return "unknown key", remedy(str(keys[-1]), _keys_at(model, keys[:-1], data))
    if kind == "missing" and isinstance(fault["loc"][-1], int):
        return f"needs more numbers than {len(given)}", ""
    if kind == "missing":
        return "is missing", f"all keys here: {', '.join(_keys_at(model, keys[:-1], data))}"
    if kind == "too_long":
        return f"has {more['actual_length']} entries, takes {more['max_length']}", ""
    if kind == "literal_error":
        return f"cannot be '{given}'", remedy(str(given), _words(more["expected"]))
    if kind == "union_tag_invalid":
        return f"there is no '{more['tag']}'", remedy(str(more["tag"]), _words(more["expected_tags"]))
    if kind == "union_tag_not_found":
        return "says no type", "write `type: NAME`"
    if kind == "value_error":
        what, _, fix = str(more["error"]).partition(" (")
        return what, fix.removesuffix(")")
    if given is None:
        return "is empty", "write something after it, or leave the key out"
    expected = EXPECTED.get(kind, "").format(**more) or str(fault["msg"])
    return f"should be {expected}, is {_shown(given)}", _how_to_write(expected, given)


def _shown(given: object) -> str:
    if isinstance(given, bool):
        return str(given).lower()
    if isinstance(given, (str, int, float)):
        text = repr(given)
        return text if len(text) <= 40 else f"{text[:40]}..."
    return "a mapping" if isinstance(given, Mapping) else "a list" if isinstance(given, (list, tuple)) else repr(given)


def _how_to_write(expected: str, given: object) -> str:
    """The remedy where a value means the right thing and is written in a wrong way."""
    if expected == "text" and isinstance(given, (bool, int, float)):
        return f"put it in quotes: '{_shown(given)}'"
    if expected == "true or false" and str(given).lower() in ("yes", "on", "1", "y", "no", "off", "0", "n"):
        return f"write {'true' if str(given).lower() in ('yes', 'on', '1', 'y') else 'false'}"
    if "number" in expected and isinstance(given, str):
        try:
            value = float(given.replace(",", ".").replace("_", ""))
        except ValueError:
            return "write it like 12.5" if "whole" not in expected else "write it like 5"
        return f"write {value:g}, without quotes" if isfinite(value) else ""
    if expected == "a whole number" and isinstance(given, float) and given.is_integer():
        return f"write {given:.0f}"
    return ""


def _words(listed: object) -> list[str]:
    """Pydantic's list of alternatives as words."""
    return [w.strip(" '") for w in str(listed).replace(" or ", ", ").split(",")]


def _keys_at(model: type[BaseModel], keys: Keys, data: object) -> list[str]:
    """Every key that may stand at a place."""
    whole = node = model.model_json_schema()
    for key in keys:
        named, every = node.get("properties", {}).get(key), node.get("patternProperties", {}).values()
        inside = named or next(iter(every), None) or node.get("additionalProperties") or node.get("items") or {}
        data = cast("Any", data)[key]
        node = _resolved(cast("dict[str, Any]", inside), whole, data)
    return list(node.get("properties", {}))


def _resolved(node: dict[str, Any], whole: dict[str, Any], data: object) -> dict[str, Any]:
    """A part of the schema with references followed, `null` left out of alternatives, and the type chosen."""
    for one in node.get("anyOf", []):
        if "$ref" in one or "discriminator" in one:
            node = one
    if "discriminator" in node and isinstance(data, Mapping):
        tag = cast("Mapping[str, object]", data).get(node["discriminator"]["propertyName"])
        return _resolved({"$ref": node["discriminator"]["mapping"].get(tag, "")}, whole, data)
    return whole["$defs"].get(node["$ref"].rsplit("/", 1)[-1], {}) if "$ref" in node else node
