"""The documentation: every snippet runs, the site builds without a warning, and nothing on it leads nowhere."""

import importlib
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from outrider.campaign.papers import Verdict, Work
from outrider.cli import main
from outrider.filters import ekf

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs" / "papers").glob("*.md"))]
PYTHON = re.compile(r"^```python\n(.*?)^```", re.S | re.M)
pytestmark = pytest.mark.compiled


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that `outrider demo` leaves, which pages go on with."""
    folder = tmp_path_factory.mktemp("pages")
    assert main(["demo", "-o", str(folder / "demo"), "-q"]) == 0
    return folder


def test_there_are_snippets() -> None:
    assert sum(len(PYTHON.findall(p.read_text())) for p in PAGES) >= 10


@pytest.mark.parametrize("page", [p for p in PAGES if PYTHON.search(p.read_text())], ids=lambda p: p.stem)
def test_the_snippets_of_a_page_run_one_after_the_other(page: Path, demo: Path, tmp_path: Path) -> None:
    shutil.copytree(demo / "demo", tmp_path / "demo")
    script = tmp_path / "page.py"
    script.write_text("\n".join(PYTHON.findall(page.read_text())))
    done = subprocess.run([sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site without what takes long: the docstrings of all modules, and running the examples."""
    pytest.importorskip("sphinx")
    source, out = tmp_path_factory.mktemp("source") / "outrider", tmp_path_factory.mktemp("site")
    keep = ("docs", "examples", "src", "README.md", "CHANGELOG.md")
    for name in keep:
        (shutil.copytree if (ROOT / name).is_dir() else _copied)(ROOT / name, source / name)
    for made in ("_build", "gallery", "reference"):
        shutil.rmtree(source / "docs" / made, ignore_errors=True)
    options = ("-q", "--fail-on-warning", "--keep-going", "-b", "html")
    command = [sys.executable, "-m", "sphinx", *options, str(source / "docs"), str(out)]
    quick = {**os.environ, "OUTRIDER_DOCS": "quick"}
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, env=quick)
    assert done.returncode == 0, done.stderr
    return out


def _copied(path: Path, to: Path) -> None:
    to.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(path, to)


class Links(HTMLParser):
    """Anchors of a page, and where it leads."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.targets: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for key, value in attrs:
            if key == "id" and value:
                self.names.add(value)
            if (tag, key) in {("a", "href"), ("img", "src"), ("link", "href"), ("script", "src")} and value:
                self.targets.append(value)


def leads(pages: dict[Path, Links]) -> Iterator[str]:
    """Every link of the site that leads nowhere."""
    for path, links in pages.items():
        for target in links.targets:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            to = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not to.exists():
                yield f"{path.name}: {target}: no such file"
            elif parts.fragment and to in pages and unquote(parts.fragment) not in pages[to].names:
                yield f"{path.name}: {target}: no such place"


def test_the_site_builds_and_nothing_on_it_leads_nowhere(site: Path) -> None:
    pages = {p.resolve(): Links(p.read_text()) for p in site.rglob("*.html")}
    assert len(pages) > 40
    assert list(leads(pages)) == []


def test_the_reference_spells_types_as_the_source_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    written = importlib.import_module("_reference").as_written
    assert written(None, "function", "", ekf.update, None, "(belief)", None) == (
        "(belief: Gaussian, y: Floats, H: Floats, R: Floats, *, consider: tuple[str, ...]=())", "Updated",
    )  # fmt: skip
    told, _ = written(None, "class", "", Work, None, "(*, seeds)", None)
    assert told.startswith("(*, seeds: int | None = None, workers: int = 0,") and "_done" not in told
    assert written(None, "method", "", Work.run, None, "(name)", None)[0].startswith("(name: str,")  # no self
    assert written(None, "class", "", Verdict, None, "(value)", None) is None


def test_every_command_and_every_how_to_is_on_the_site(site: Path) -> None:
    index = (site / "index.html").read_text()
    for page in (ROOT / "docs").glob("how-to-*.md"):
        assert f"{page.stem}.html" in index
    told = (site / "reference" / "cli.html").read_text()
    for command in ("fuse", "doctor", "eval", "run", "campaign", "map", "papers"):
        assert f'id="outrider-{command}"' in told
