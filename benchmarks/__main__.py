"""Measure every row and print one table; `--write` keeps it in docs/evidence/benchmarks.md."""

import argparse
import importlib
import pkgutil
import platform
import shlex
import sys
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from rich.console import Console
from rich.table import Table

import benchmarks
from benchmarks.table import HEADER, Row, Timing, cells, markdown, measure

PAGE = Path(__file__).parents[1] / "docs" / "evidence" / "benchmarks.md"


def registry(without: list[str]) -> list[Row]:
    """The rows of every module of this package that has any, but those `without`."""
    names = sorted(m.name for m in pkgutil.iter_modules(benchmarks.__path__) if not m.name.startswith("_"))
    names = [name for name in names if name not in without]
    modules = [importlib.import_module(f"benchmarks.{name}") for name in names]
    return [row for module in modules if hasattr(module, "rows") for row in module.rows()]


def processor() -> str:
    """The processor's name, where the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    return next((x.split(":", 1)[1].strip() for x in lines if x.startswith("model name")), platform.processor())


def preamble(repetitions: int) -> list[str]:
    """Where and with what this was measured."""
    packages = ["outrider", "numpy", "numba", "scipy", "filterpy", "stonesoup", "scikit-image", "mujoco", "rotorpy"]
    return [
        f"{datetime.now(UTC):%Y-%m-%d}, {processor()}, {platform.system()} {platform.machine()}",
        f"Python {platform.python_version()}, " + ", ".join(f"{p} {_version(p)}" for p in packages),
        f"{repetitions} repetitions of all sides, interleaved, one thread; the ratio is the median over repetitions",
        "Machines, and one machine from hour to hour, differ by a factor of two or more: trust the ratios",
        f"Made by `{shlex.join(['python', '-m', 'benchmarks', *sys.argv[1:]])}`",
    ]


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "absent"


def show(timings: list[Timing], console: Console) -> None:
    """Print the table."""
    table = Table(title="microseconds of CPU time per event", show_lines=True)
    for title in HEADER:
        table.add_column(title)
    for timing in timings:
        table.add_row(*(cell.replace("**", "") for cell in cells(timing)))
    console.print(table)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"keep the table in {PAGE.parent.name}/{PAGE.name}")
    parser.add_argument("--only", default="", metavar="TEXT", help="rows whose name contains this text")
    parser.add_argument("--without", action="append", default=[], metavar="MODULE", help="leave out, as `planning`")
    parser.add_argument("--repetitions", type=int, default=15)
    asked = parser.parse_args()
    console = Console()
    timings: list[Timing] = []
    for row in registry(asked.without):
        if asked.only.lower() in row.name.lower():
            with console.status(f"{row.name} (the first run compiles)"):
                timings.append(measure(row, asked.repetitions))
    show(timings, console)
    if asked.write:
        PAGE.parent.mkdir(parents=True, exist_ok=True)
        PAGE.write_text(markdown(timings, preamble(asked.repetitions)), encoding="utf-8")
        console.print(f"written to {PAGE.relative_to(Path.cwd()) if PAGE.is_relative_to(Path.cwd()) else PAGE}")


if __name__ == "__main__":
    main()
