"""Every command in the documentation is one that the program takes, and can be typed where it stands."""

import re
import shlex
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from outrider.cli.app import app

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [p for p in PAGES if not {"_build", "gallery", "reference"} & set(p.relative_to(ROOT).parts)]
BLOCK = re.compile(r"^```\w*\n(.*?)^```$", re.S | re.M)
COMMANDS: dict[str, Any] = get_command(app).commands  # type: ignore[attr-defined]
WRITES = {"demo": "outrider-demo", "run": "{name}-run", "campaign": "{what}-campaign", "swarm": "swarm-{task}"}


def typed(page: Path) -> list[list[str]]:
    """The words of every command that stands on a line of its own in a block; what follows # | > is the shell's."""
    lines = [line for block in BLOCK.findall(page.read_text()) for line in block.splitlines()]
    commands = [m[1] for line in lines if (m := re.fullmatch(r"(?:\$ )?outrider (\w.*)", line))]
    return [shlex.split(re.split(r" [|>#] ", re.sub(r"\s+#.*", "", line))[0]) for line in commands]


def mentioned(page: Path) -> list[list[str]]:
    """The words of every command between backquotes in the text; they may be the half of one."""
    text = BLOCK.sub("", page.read_text())
    return [m.split() for m in re.findall(r"`outrider ([a-z][^`]*)`", text)]


def taken(words: list[str]) -> dict[str, Any]:
    """What the parser makes of a command; raises what it complains of."""
    name, *rest = words
    return COMMANDS[name].make_context(name, rest).params


def test_there_are_commands() -> None:
    assert sum(len(typed(p)) for p in PAGES) >= 60 and sum(len(mentioned(p)) for p in PAGES) >= 60
    assert {words[0] for p in PAGES for words in typed(p)} >= set(COMMANDS) - {"schema"}


@pytest.mark.parametrize("page", [p for p in PAGES if typed(p)], ids=lambda p: p.stem)
def test_a_command_is_understood(page: Path) -> None:
    for words in typed(page):
        taken(words)


@pytest.mark.parametrize("page", [p for p in PAGES if mentioned(p)], ids=lambda p: p.stem)
def test_a_mentioned_command_has_these_options(page: Path) -> None:
    for words in mentioned(page):
        name, *words = (w.rstrip(",") for w in words)
        known = {o for p in COMMANDS[name].params for o in (*p.opts, *p.secondary_opts)} | {"--help"}
        assert {w for w in words if re.match(r"-[a-z]$|--\w", w)} <= known, words


@pytest.mark.parametrize("page", [p for p in PAGES if "--set" in p.read_text()], ids=lambda p: p.stem)
def test_settings_are_those_of_the_scenario(page: Path) -> None:
    from outrider.scenarios.files import load_scenario, settings_of
    from outrider.scenarios.registry import scenarios

    for words in [*typed(page), *mentioned(page)]:
        given = settings_of(tuple(b for a, b in pairwise(words) if a == "--set"))
        if given and words[0] in ("run", "campaign") and words[1] in scenarios():
            load_scenario(words[1], given)


@pytest.mark.parametrize("page", [p for p in PAGES if typed(p)], ids=lambda p: p.stem)
def test_no_two_commands_of_a_page_write_into_one_folder(page: Path) -> None:
    folders: Counter[str] = Counter()
    for words in typed(page):
        asked = taken(words)
        if words[0] not in WRITES or asked.get("dry_run") or asked.get("names") or {"report", "replay"} & set(words):
            continue
        folder = WRITES[words[0]].format(**{k: Path(str(v)).stem for k, v in asked.items() if isinstance(v, str)})
        folders[str(asked["output"] or folder)] += not asked["force"]
    assert [f for f, times in folders.items() if times > 1] == []
