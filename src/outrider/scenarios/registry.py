"""Scenarios by name: functions of a typed configuration that return what a scenario file would hold."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from importlib import import_module
from typing import Any, Final, TypeAlias, TypeVar, final, get_type_hints

from outrider.errors import ConfigError
from outrider.io.checked import remedy

C = TypeVar("C")
Description: TypeAlias = dict[str, Any]
"""The content of a scenario file."""
Describe: TypeAlias = Callable[[C], Description]

BUILT_IN: Final = ("ground", "air", "cooperative", "aircraft", "guarding", "amr2025", "leading", "swarm2023")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Registered:
    """One scenario. config : the dataclass its function takes."""

    name: str
    tags: tuple[str, ...]
    about: str
    config: type[Any]
    describe: Callable[[Any], Description]

    @property
    def knobs(self) -> dict[str, object]:
        """Fields of its configuration with their defaults."""
        made = self.config()
        return {f.name: getattr(made, f.name) for f in fields(self.config)}


_REGISTRY: dict[str, Registered] = {}


def scenario(name: str, *, tags: tuple[str, ...] = ()) -> Callable[[Describe[C]], Describe[C]]:
    """Register a function of a configuration, a frozen dataclass with a default for everything."""

    def add(describe: Describe[C]) -> Describe[C]:
        if name in _REGISTRY:
            raise ConfigError(f"two scenarios have the name '{name}'")
        config = next(iter(get_type_hints(describe).values()))
        about = " ".join((describe.__doc__ or "").split("\n\n")[0].split())
        _REGISTRY[name] = Registered(name=name, tags=tags, about=about, config=config, describe=describe)
        return describe

    return add


def scenarios() -> Mapping[str, Registered]:
    """Every scenario by name."""
    for module in BUILT_IN:
        import_module(f"outrider.scenarios.{module}")
    return dict(sorted(_REGISTRY.items()))


def find_scenario(name: str) -> Registered:
    """A scenario by its name; ConfigError that says which there are."""
    known = scenarios()
    if name not in known:
        fix = f"{remedy(name, list(known))}; a file needs its ending .yaml"
        raise ConfigError(f"no scenario '{name}'", fix=fix)
    return known[name]
