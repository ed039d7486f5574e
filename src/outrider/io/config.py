"""YAML files as plain dicts; every fault is named with its file and its line.

Values are read by the core schema of YAML 1.2: `1e9` is a number and `010` is ten, `yes` and `on` are words, nothing
turns into a date or into minutes. The older rules that PyYAML follows would turn each of these into something else.
"""

import re
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from outrider.errors import ConfigError

if TYPE_CHECKING:
    from yaml import Node, SafeDumper, SafeLoader

CORE = {  # tag -> what is one, and the letters that it begins with
    "null": (r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    "bool": (r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    "int": (r"[-+]?[0-9]+", list("-+0123456789")),
    "float": (r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
              list("-+.0123456789")),
    "merge": (r"<<", ["<"]),
}  # fmt: skip
PROBLEMS = {  # how the parser's words begin -> ours, and a remedy
    "mapping values are not allowed": ("a colon where none can be", "quote what has a colon, or mend the indentation"),
    "found character '\\t'": ("a tab where spaces have to be", "indent with spaces"),
    "expected <block end>": ("the indentation does not fit what is above", "begin keys of one level in one column"),
    "could not find expected ':'": ("a key without a colon", "write `key: value`"),
    "expected ',' or ']'": ("a list that is not closed", "write [1, 2, 3]"),
    "expected ',' or '}'": ("a mapping that is not closed", "write {key: value}"),
}
LARGEST = 1 << 20  # bytes: what is longer was not written by hand, and is probably the log


def read_yaml(path: Path) -> dict[str, Any]:
    """Read a YAML mapping; an empty file, or one of comments only, is an empty mapping.

    Raises `ConfigError` for what is missing, no YAML, no mapping, or has a key twice (YAML itself keeps the last).
    """
    import yaml

    text = _text(path)
    try:
        loader = _core_loader()(text)
        node = loader.get_single_node()
        if node is None:
            return {}
        _refuse_repeated_keys(node, path)
        data = loader.construct_document(node)
    except yaml.MarkedYAMLError as e:
        line = e.problem_mark.line + 1 if e.problem_mark else 0
        problem = str(e.problem or e.context)
        what, fix = next((v for k, v in PROBLEMS.items() if problem.startswith(k)), (problem, ""))
        raise ConfigError(f"is not YAML: {what}", where=at_line(path, line), fix=fix) from None
    except (yaml.YAMLError, ValueError) as e:  # a control character; a number of thousands of digits
        raise ConfigError(f"is not YAML: {str(e).splitlines()[0]}", where=str(path)) from None
    except RecursionError:
        raise ConfigError("is nested too deeply", where=str(path)) from None
    if not isinstance(data, dict):
        raise ConfigError("is no mapping of keys to values", where=at_line(path, 1), fix="write `key: value` lines")
    return cast("dict[str, Any]", data)


def merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with the values of `over`, mappings joined key by key."""
    out = dict(base)
    for key, value in over.items():
        mine = out.get(key)
        both = isinstance(mine, Mapping) and isinstance(value, Mapping)
        out[key] = merged(cast("Mapping[str, Any]", mine), cast("Mapping[str, Any]", value)) if both else value
    return out


def settings_of(texts: Sequence[str]) -> dict[str, Any]:
    """`--set a.b=value` as nested mappings; values are read as YAML. Raises `ConfigError` for one that is none."""
    out: dict[str, Any] = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not sign or not key or not all(key.split(".")):
            raise ConfigError("cannot be understood", where=f"--set {text}", fix="write a.b=value")
        node: Any = parse_yaml(value, f"--set {text}")
        for word in reversed(key.split(".")):
            node = {word: node}
        out = merged(out, node)
    return out


def parse_yaml(text: str, where: str) -> object:
    """One value from the command line."""
    import yaml

    try:
        return yaml.load(text, Loader=_core_loader())
    except (yaml.YAMLError, ValueError, RecursionError):
        raise ConfigError("is not YAML", where=where, fix="quote what has a colon or a bracket of its own") from None


def yaml_text(data: Mapping[str, object]) -> str:
    """A mapping as YAML that reads back as the same, to the last bit; lists of numbers stand on one line."""
    import yaml

    how: dict[str, Any] = {"sort_keys": False, "allow_unicode": True, "width": 120, "default_flow_style": None}
    return yaml.dump(dict(data), Dumper=_core_dumper(), **how)


def line_of(path: Path, keys: Sequence[str | int]) -> int:
    """The line, from 1, on which the value at `keys` stands, or the last of its parents that is there; 0 if unknown."""
    import yaml

    try:
        node = yaml.compose(_text(path), Loader=_core_loader())
    except (ConfigError, yaml.YAMLError, RecursionError):
        return 0
    line = 0
    for key in keys:
        entry = _entry(node, key)
        if entry is None:
            break
        line, node = entry
    return line


def at_line(path: Path | str, line: int) -> str:
    """`file:line`, or the file alone where the line is not known (0)."""
    return f"{path}:{line}" if line else str(path)


@cache
def _core_loader() -> "type[SafeLoader]":
    import yaml

    class Core(yaml.SafeLoader):
        yaml_implicit_resolvers = {}  # noqa: RUF012 - as in the base class; filled below

    for tag, (pattern, first) in CORE.items():
        Core.add_implicit_resolver(f"tag:yaml.org,2002:{tag}", re.compile(rf"^(?:{pattern})$"), first)
    Core.add_constructor("tag:yaml.org,2002:int", lambda _, node: int(node.value))
    return Core


@cache
def _core_dumper() -> "type[SafeDumper]":
    """Quotes what either of the two schemas would take for anything but text."""
    import yaml

    class Core(yaml.SafeDumper):
        pass

    for tag, (pattern, first) in CORE.items():
        Core.add_implicit_resolver(f"tag:yaml.org,2002:{tag}", re.compile(rf"^(?:{pattern})$"), first)
    return Core


def _text(path: Path) -> str:
    try:
        if path.is_fifo() and path.parent != Path("/dev/fd"):  # to open it would wait for somebody to write
            raise ConfigError("is a pipe, no file", where=str(path), fix="save what it gives as a file")
        with path.open("rb") as f:
            raw = f.read(LARGEST + 1)
    except OSError as e:
        raise ConfigError(f"cannot be read: {(e.strerror or str(e)).lower()}", where=str(path)) from None
    if len(raw) > LARGEST:
        raise ConfigError("is longer than 1 MiB, too long for a configuration", where=str(path), fix="is it the log?")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ConfigError("is no text (UTF-8)", where=str(path), fix="is it the log?") from None


def _entry(node: "Node | None", key: str | int) -> "tuple[int, Node] | None":
    """Line and value of one key of a mapping, or of one item of a list."""
    import yaml

    if isinstance(node, yaml.MappingNode):
        for name, value in node.value:
            if name.value == str(key):
                return name.start_mark.line + 1, value
    if isinstance(node, yaml.SequenceNode) and isinstance(key, int) and key < len(node.value):
        item = node.value[key]
        return item.start_mark.line + 1, item
    return None


def _refuse_repeated_keys(node: "Node", path: Path) -> None:
    import yaml

    if isinstance(node, yaml.SequenceNode):
        for item in node.value:
            _refuse_repeated_keys(item, path)
    if isinstance(node, yaml.MappingNode):
        seen: dict[str, int] = {}
        for key, value in node.value:
            line = key.start_mark.line + 1
            if key.value in seen and key.tag != "tag:yaml.org,2002:merge" and isinstance(key, yaml.ScalarNode):
                where = at_line(path, line)
                raise ConfigError(f"'{key.value}' is there twice", where=where, fix=f"first on line {seen[key.value]}")
            if isinstance(key, yaml.ScalarNode):
                seen[key.value] = line
            _refuse_repeated_keys(value, path)
