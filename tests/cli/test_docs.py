"""The documentation names what exists: every key of the configuration, every exit code, every file it links to."""

import importlib
import re
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import pytest

from outrider.errors import ExitCode
from outrider.io.control_points import ControlPoints
from outrider.io.sites import SECTIONS, SiteSection, parse_site
from outrider.scenarios.build import build
from outrider.scenarios.files import parse_scenario
from outrider.scenarios.parts import FAULTS, PLACES, SENSORS, VEHICLES
from outrider.workflows.settings import parse_config, schema

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def sections(text: str) -> dict[str, str]:
    parts = re.split(r"^## (\w+)$", text, flags=re.M)
    return {"": parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}


def test_every_key_of_the_configuration_is_described_and_no_other() -> None:
    told = sections((ROOT / "docs" / "config.md").read_text())
    whole = schema()
    parts = {"": whole, **{name.removesuffix("Section").lower(): d for name, d in whole["$defs"].items()}}
    assert set(told) == set(parts)
    for name, part in parts.items():
        assert re.findall(r"^\| `(\w+)` \|", told[name], flags=re.M) == list(part["properties"]), name


@pytest.mark.compiled  # inflates a map
def test_configurations_in_the_documentation_are_valid() -> None:
    import yaml

    for page in PAGES:
        for block in re.findall(r"```yaml\n(.*?)```", page.read_text(), flags=re.S):
            data = yaml.safe_load(block)
            if "team" in data and "cooperation" not in data["team"]:
                build(parse_scenario(data, str(page)))
            elif "roads" in data:
                parse_site(data)
            elif "points" in data:
                ControlPoints.model_validate(data)
            elif "streams" not in data:  # a mapping for a CSV
                parse_config(data, str(page))


def test_every_type_of_a_scenario_is_listed_and_no_other() -> None:
    text = (ROOT / "docs" / "how-to-simulate.md").read_text()
    told = {name: re.findall(r"`(\w+)`", row) for name, row in re.findall(r"^\| (\w+) \| (`.*) \|$", text, flags=re.M)}
    for name, registry in (("place", PLACES), ("vehicle", VEHICLES), ("sensor", SENSORS), ("fault", FAULTS)):
        assert told[name] == list(registry), name


def test_every_part_of_a_drawing_is_listed() -> None:
    text = (ROOT / "docs" / "how-to-map-a-site.md").read_text()
    assert set(re.findall(r"^\| `(\w+)` \|", text, flags=re.M)) == set(SiteSection.model_fields)
    assert set(SECTIONS) <= set(SiteSection.model_fields)


def test_exit_codes() -> None:
    text = (ROOT / "docs" / "exit-codes.md").read_text()
    assert {int(c) for c in re.findall(r"^\| (\d+) \|", text, flags=re.M)} == set(ExitCode) - {ExitCode.LINK_LOST}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_and_examples_exist(page: Path) -> None:
    text = page.read_text()
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", text):
        assert target.startswith(("http://", "https://")) or (page.parent / target).exists(), target
    for path in re.findall(r"`(examples/\S+?\.py)`", text):
        assert (ROOT / path).exists(), path


def exists(name: str) -> bool:
    """Whether a dotted name is a module of ours, or something in one."""
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(["outrider", *parts[:k]]))
        except ModuleNotFoundError:
            continue
        for word in parts[k:]:
            if not hasattr(found, word):
                return False
            found = getattr(found, word)
        return True
    return False


@pytest.mark.parametrize("page", sorted((ROOT / "docs" / "papers").glob("*.md")), ids=lambda p: p.stem)
def test_every_function_and_every_test_that_a_paper_page_names_is_there(page: Path) -> None:
    text = page.read_text()
    packages = {p.name for p in (ROOT / "src" / "outrider").iterdir() if p.is_dir()}
    named = {n for n in re.findall(r"`([a-z_]+(?:\.\w+)+)`", text) if n.split(".")[0] in packages}
    assert len(named) >= 10 and not exists("models.wheels.NoSuch")
    assert sorted(n for n in named if not n.endswith(".py") and not exists(n)) == []
    tests = {p.name for p in (ROOT / "tests").rglob("*.py")}
    paths = re.findall(r"`(tests/[^`]*)`", text)
    assert [p for p in paths if not list(ROOT.glob(p))] == []
    assert [t for t in re.findall(r"`(test_\w+\.py)`", text) if t not in tests] == []


def test_what_troubleshooting_quotes_is_said_by_the_program() -> None:
    joined = re.compile(r'"\s*\n\s*f?"')  # a sentence that goes on in the next line of the source
    source = "\n".join(joined.sub("", p.read_text()) for p in (ROOT / "src" / "outrider").rglob("*.py"))
    quoted = re.findall(r'"([^"]+)"', (ROOT / "docs" / "troubleshooting.md").read_text())
    assert len(quoted) >= 20
    assert [text for text in quoted if text not in source] == []


def test_the_picture_of_the_layers_shows_those_that_are_checked() -> None:
    contract = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"][0]
    rows = [[name for name in row.split(" | ") if name[0] != "("] for row in contract["layers"]]
    picture = ElementTree.parse(ROOT / "docs" / "images" / "layers.svg").getroot()
    drawn: dict[float, list[str]] = {}
    for text in picture.iter("{http://www.w3.org/2000/svg}text"):
        if text.get("class") == "name":
            drawn.setdefault(float(text.attrib["y"]), []).append(str(text.text))
    assert [drawn[y] for y in sorted(drawn)] == [row for row in rows if row != ["_sources"]]


def test_every_schema_is_named() -> None:
    told = (ROOT / "docs" / "exit-codes.md").read_text()
    used = {s for p in (ROOT / "src").rglob("*.py") for s in re.findall(r"outrider\.\w+/1", p.read_text())}
    assert len(used) >= 12
    assert sorted(s for s in used if s not in told) == []
