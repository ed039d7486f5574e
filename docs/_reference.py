"""Pages made from the program itself: the command line, and the public modules with their docstrings."""

import ast
import inspect
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, is_dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import dedent
from typing import Any

import typer
from PIL import Image, ImageOps
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docstrings import prepare_docstring

QUICK = os.environ.get("OUTRIDER_DOCS") == "quick"  # leaves out the docstrings of modules, which take a minute
SOURCE = Path(__file__).resolve().parents[1] / "src" / "outrider"
FULL = 88  # columns of a line that was broken
PACKAGES = {
    "data": "The nouns: records, trajectories, grids, runs, and the protocols that name what others do",
    "core": "Numbers only: rotations, geodesy, rays, distances, linear algebra",
    "models": "Process models, sensor models and vehicles",
    "mapping": "Sites, costmaps, inflation, what moves",
    "safety": "What stops a robot, under every planner and every guidance law",
    "filters": "Estimation: extended, unscented, ensemble filters, smoother, engine, health, cooperation",
    "planning": "Paths over grids and roads, elastic bands, inspections",
    "guidance": "Missions, dispatch, following, avoidance: pure functions",
    "sim": "Worlds, vehicles under way, sensors, radio, truth",
    "eval": "Errors, consistency, paired statistics",
    "io": "Readers and writers, one file per format",
    "team": "Agents: what decides for a robot",
    "scenarios": "Simulated experiments from files and by name",
    "workflows": "Fuse, doctor, evaluate, map: where things are wired together",
    "campaign": "Many runs, and the papers beside ours",
    "plot": "Figures and reports",
}


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("builder-inited", write_pages)
    app.connect("builder-inited", add_prints, priority=900)  # after the gallery's pages are there
    app.connect("autodoc-process-docstring", as_text)
    app.connect("autodoc-process-signature", as_written)
    return {"parallel_read_safe": True}


def write_pages(app: Sphinx) -> None:
    """Write the generated pages into the source folder, where changed only, so that nothing is read twice."""
    folder = Path(app.srcdir) / "reference"
    _put(folder / "cli.md", "".join(cli_page()))
    for name, about in PACKAGES.items():
        _put(folder / f"{name}.md", "".join(package_page(name, about)))


def add_prints(app: Sphinx) -> None:
    """Run every example, and add what it prints and draws to its page."""
    scripts = [] if QUICK else sorted((SOURCE.parents[1] / "examples").glob("[0-9]*.py"))
    gallery = Path(app.srcdir) / "gallery"
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:  # they are processes of their own
        printed = list(pool.map(lambda script: _ran(script, gallery / "images"), scripts))
    for script, told in zip(scripts, printed, strict=True):
        page = gallery / f"{script.stem}.rst"
        lines = "".join(f"    {line}".rstrip() + "\n" for line in told.splitlines())
        text = page.read_text()
        if "\nIt prints\n" not in text:
            begin, end = text.find(".. GENERATED FROM PYTHON"), text.find(".. _sphx_glr_download_gallery")
            picture = f".. image:: images/{script.stem}.png\n    :alt: {text[:begin].strip().splitlines()[-1]}\n\n"
            prints = f"It prints\n\n.. code-block:: text\n\n{lines}\n"
            page.write_text(text[:begin] + picture + text[begin:end] + prints + text[end:])


def _ran(script: Path, images: Path) -> str:
    """What an example prints; its picture is kept, and a small one for the index."""
    with TemporaryDirectory() as folder:
        done = subprocess.run([sys.executable, str(script)], cwd=folder, capture_output=True, text=True, timeout=600)
        if done.returncode != 0:
            raise ExtensionError(f"{script.name} failed: {done.stderr.strip().splitlines()[-1]}")
        drawn = Path(folder) / f"{script.stem}.png"
        (images / "thumb").mkdir(parents=True, exist_ok=True)
        shutil.copy(drawn, images)
        with Image.open(drawn) as picture:
            small = ImageOps.pad(picture.convert("RGB"), (400, 280), color="white")
            small.save(images / "thumb" / f"sphx_glr_{script.stem}_thumb.png")
    return done.stdout


def as_text(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Docstrings are written to be read in an editor: their lines stand as they are, set as a block of lines."""
    told = list(unwrapped(prepare_docstring("\n".join(lines))))
    lines[:] = [f"| {escaped(line)}" if line.strip() else "|" for line in told]
    lines.append("")


def as_written(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, told: str | None, returns: str | None
) -> tuple[str, str | None] | None:
    """The signature with types as the source spells them: `Floats`, not what numpy makes of it. None: as it is."""
    found = definition(obj) if told else None
    if isinstance(found, ast.ClassDef) and is_dataclass(obj):
        types = {str(ast.unparse(n.target)): n for n in found.body if isinstance(n, ast.AnnAssign)}
        given = [parameter(types[f.name]) for f in fields(obj) if f.init and f.name in types and f.name[0] != "_"]
        return f"({', '.join(['*'] * (str(told)[1:2] == '*') + given)})", None
    if isinstance(found, ast.FunctionDef):
        own = found.args
        if what == "method" and own.args and own.args[0].arg in ("self", "cls"):
            del own.args[0]
        return f"({ast.unparse(own)})", ast.unparse(found.returns) if found.returns else None
    return None


def definition(obj: Any) -> ast.stmt | None:
    """Of a class or a function, compiled or not, where there is a source."""
    try:
        return ast.parse(dedent(inspect.getsource(inspect.unwrap(getattr(obj, "py_func", obj))))).body[0]
    except (OSError, TypeError, SyntaxError):
        return None


def parameter(field: ast.AnnAssign) -> str:
    """A field of a dataclass as a parameter; what a factory makes is not spelt out."""
    value = field.value
    made = isinstance(value, ast.Call) and ast.unparse(value.func) == "field"
    default = "" if value is None else " = ..." if made else f" = {ast.unparse(value)}"
    return f"{ast.unparse(field.target)}: {ast.unparse(field.annotation)}{default}"


def unwrapped(lines: list[str]) -> Iterator[str]:
    """Lines that were broken because they were full are one again."""
    whole = ""
    for line in lines:
        if whole and line.strip() and not line.startswith((" ", "-", "*", ">")):
            whole = f"{whole} {line}"
        else:
            if whole:
                yield whole
            whole = line
        if len(line) < FULL:
            yield whole
            whole = ""
    if whole:
        yield whole


def escaped(line: str) -> str:
    """A line whose stars, bars and underscores mean themselves; what stands in backquotes is code."""
    parts = re.split(r"(``[^`]+``|`[^`]+`)", line)
    out = [
        f"``{p.strip('`')}``" if k % 2 else re.sub(r"([*|_\\`])", r"\\\1", p).replace("  ", "\u00a0\u00a0")
        for k, p in enumerate(parts)
    ]
    text = "".join(out)
    return re.sub(r"(\w)(``[^`]+``)", r"\1\\ \2", re.sub(r"(``[^`]+``)(\w)", r"\1\\ \2", text))


def cli_page() -> Iterator[str]:
    """Every command with its arguments and options, as `--help` says."""
    from outrider.cli.app import app

    command: Any = typer.main.get_command(app)
    yield "# Command line\n\nMade from the program: `outrider COMMAND --help` says the same. "
    yield "[Exit codes](../exit-codes.md).\n"
    for name, one in command.commands.items():
        context = typer.Context(one, info_name=f"outrider {name}")
        text = one.get_help(context)
        yield f"\n## outrider {name}\n\n```text\n{text.strip()}\n```\n"


def package_page(name: str, about: str) -> Iterator[str]:
    """A page of one package: every public module that says what it is, with its members."""
    yield f"# outrider.{name}\n\n{about}.\n"
    for path in sorted((SOURCE / name).rglob("*.py")):
        parts = path.relative_to(SOURCE.parent).with_suffix("").parts
        if any(p.startswith("_") and p != "__init__" for p in parts) or not ast.get_docstring(
            ast.parse(path.read_text())
        ):
            continue
        module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        if parts[-1] == "__init__" and module == f"outrider.{name}":
            continue
        yield f"\n## {module.removeprefix('outrider.')}\n\n"
        if QUICK:
            continue
        yield f"```{{eval-rst}}\n.. automodule:: {module}\n   :members:\n   :ignore-module-all:\n```\n"


def _put(path: Path, text: str) -> None:
    path.parent.mkdir(exist_ok=True)
    if not path.exists() or path.read_text() != text:
        path.write_text(text)
