"""Scenario files: read, with what the command line says instead, checked, written."""

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, cast, get_type_hints

from pydantic import TypeAdapter, ValidationError

from outrider.errors import ConfigError
from outrider.io.checked import remedy, validated
from outrider.io.config import merged, parse_yaml, read_yaml, yaml_text
from outrider.scenarios.parts import SENSORS, Scenario
from outrider.scenarios.registry import Registered, find_scenario
from outrider.scenarios.sections import STRICT, bounded

ENDINGS = (".yaml", ".yml")


def load_scenario(name: str, given: Mapping[str, object] | None = None) -> tuple[Scenario, str]:
    """A scenario by its file or by its name, and the file, "" if there is none.

    given : values by dotted key (`team.rover.mission.speed`, `team.rover.sensors.0.rate_hz`), which stand over the
    file's; of a named scenario also by the fields of its configuration
    """
    given = dict(given or {})
    path = Path(name)
    if path.suffix.lower() in ENDINGS:
        return parse_scenario(_beside(_overridden(read_yaml(path), given), path.parent), name), name
    found = find_scenario(name)
    _known(found, given)
    own = {key: given.pop(key) for key in list(given) if key in found.knobs}
    about = {"name": found.name, "about": found.about}
    return parse_scenario(_overridden({**about, **found.describe(_configured(found, own))}, given)), ""


def _known(found: Registered, given: Mapping[str, object]) -> None:
    """Refuse a word that is neither a setting of a named scenario nor a key of every scenario, with what was meant."""
    knobs, keys = list(found.knobs), list(Scenario.model_fields)
    for key in given:
        head = key.split(".")[0]
        if head not in (*knobs, *keys):
            meant = remedy(head, keys if "." in key else [*knobs, *keys])
            fix = meant if meant.startswith("did you mean") else f"there are: {', '.join(knobs)}; or a key of its file"
            raise ConfigError(f"{found.name} has no setting of that name", where=f"--set {key}", fix=fix)


def parse_scenario(data: Mapping[str, object], where: str = "") -> Scenario:
    """Check a scenario; `where` is its file, in which the faulty line is looked up.

    Raises `ConfigError` that names key, fault and remedy of the first fault, and how many more there are.
    """
    return validated(Scenario, data, where)


def resolved(scenario: Scenario) -> dict[str, Any]:
    """The whole scenario, every default written out; it runs to the same bits."""
    return scenario.model_dump(mode="python", exclude_none=True)


def write_scenario(scenario: Scenario, path: Path) -> None:
    """Write it resolved, as YAML."""
    path.write_text(scenario_text(scenario), encoding="utf-8")


def scenario_text(scenario: Scenario) -> str:
    """The resolved scenario as YAML."""
    return yaml_text(resolved(scenario))


def schema() -> dict[str, Any]:
    """JSON schema of a scenario file, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **Scenario.model_json_schema()}


def settings_of(texts: tuple[str, ...]) -> dict[str, object]:
    """`a.b=value` as values by dotted key; a value is read as YAML."""
    out: dict[str, object] = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not sign or not key or not all(key.split(".")):
            raise ConfigError("cannot be understood", where=f"--set {text}", fix="write a.b=value")
        out[key] = parse_yaml(value, f"--set {text}")
    return out


def _beside(data: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Files that a scenario names are beside it; written out they can be found from anywhere."""
    world, team = data.get("world"), data.get("team")
    robots = cast("dict[str, Any]", team).values() if isinstance(team, dict) else ()
    sections = [world.get("place") if isinstance(world, dict) else None]
    sections += [r.get("mission") for r in robots if isinstance(r, dict)]
    for section in sections:
        if isinstance(section, dict) and isinstance(section.get("file"), str) and section["file"]:
            section["file"] = str((folder / section["file"]).resolve())
    return data


def _configured(found: Registered, own: Mapping[str, object]) -> object:
    """The configuration of a named scenario."""
    hints = get_type_hints(found.config)
    checked: dict[str, Any] = {}
    for f in fields(found.config):
        if f.name in own:
            try:
                checked[f.name] = TypeAdapter(
                    bounded(STRICT.get(hints[f.name], hints[f.name]), f.name)
                ).validate_python(own[f.name])
            except ValidationError as e:
                text = str(e.errors()[0]["msg"]).replace("Input should", "should").removeprefix("Value error, ")
                text += "" if ", is " in text else f", is {own[f.name]!r}"
                raise ConfigError(text, where=f"--set {f.name}") from None
    return found.config(**checked)


def _overridden(data: Mapping[str, Any], given: Mapping[str, object]) -> dict[str, Any]:
    """The data with values by dotted key in their places. A number picks an item of a list, counted from 0."""
    out = merged(data, {})
    for key, value in given.items():
        *way, last = key.split(".")
        node: Any = out
        for word in way:
            node = _inside(node, word, key)
        _put(node, last, value, key)
    return out


def _inside(node: Any, word: str, key: str) -> Any:
    """A copy of what stands at one step of the way, put in its place."""
    if isinstance(node, dict):
        inner = cast("dict[str, Any]", node).get(word, {})
    else:
        inner = node[_index(node, word, key)]
    if not isinstance(inner, (dict, list)):
        raise ConfigError(f"'{word}' holds nothing", where=f"--set {key}", fix="it is a value: leave out what follows")
    copied: Any = dict(inner) if isinstance(inner, dict) else list(inner)
    node[word if isinstance(node, dict) else _index(node, word, key)] = copied
    return copied


def _put(node: Any, word: str, value: object, key: str) -> None:
    node[word if isinstance(node, dict) else _index(node, word, key)] = value


def _index(node: list[Any], word: str, key: str) -> int:
    """The item that is meant: by number, or by its name or type."""
    if word.isdecimal() and int(word) < len(node):
        return int(word)
    names = [_called(one) for one in node]
    for kind in range(2):
        if word in (found := [n[kind] for n in names]):
            return found.index(word)
    known = [n[0] for n in names if n[0]]
    fix = remedy(word, known) if known else f"a number below {len(node)}"
    raise ConfigError(f"no item '{word}'", where=f"--set {key}", fix=fix)


def _called(one: Any) -> tuple[str, str]:
    """The name of an item, its own or that of its type, and its type."""
    if not isinstance(one, dict):
        return "", ""
    kind = str(one.get("type", ""))
    usual = next((f.default for f in fields(SENSORS[kind]) if f.name == "name"), kind) if kind in SENSORS else kind
    return str(one.get("name", usual)), kind
