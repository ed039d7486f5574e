"""From a YAML file and the command line to a checked `FuseConfig`; a fault becomes one line with its remedy."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from outrider.errors import ConfigError
from outrider.io.checked import validated
from outrider.io.config import merged, read_yaml
from outrider.io.robot_localization import is_upstream
from outrider.workflows.config import FuseConfig


def load_config(path: Path | None = None, overrides: Mapping[str, object] | None = None) -> FuseConfig:
    """The configuration of a file (defaults without one), with what the command line says instead."""
    given = parse_config(overrides or {}, "command line")  # by itself: its faults do not stand in the file
    if path is None:
        return given
    data = read_yaml(path)
    if is_upstream(data):
        what = "is a configuration of robot_localization"
        raise ConfigError(what, where=str(path), fix="`outrider fuse LOG -c` reads it, and leaves ours in config.yaml")
    parse_config(data, str(path))
    return parse_config(merged(data, overrides or {}), str(path))


def parse_config(data: Mapping[str, object], where: str = "") -> FuseConfig:
    """Check a configuration; `where` is its file, in which the faulty line is looked up.

    Raises `ConfigError` that names key, fault and remedy of the first fault, and how many more there are.
    """
    return validated(FuseConfig, data, where)


def schema() -> dict[str, Any]:
    """JSON schema of the configuration, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **FuseConfig.model_json_schema()}
