"""Measure every row, print tables; `--write` keeps them in docs/evidence/benchmarks.md and .json, `--gate` compares.

A gate compares ratios to peers that were measured in the same run, with what is kept: machines differ, ratios hardly.
"""

import argparse
import importlib
import json
import pkgutil
import platform
import shlex
import sys
import time
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from rich.console import Console
from rich.table import Table

import benchmarks
from benchmarks.commands import Waited, commands
from benchmarks.growth import Grown, all_growths, grow
from benchmarks.onboard import lines as share_lines
from benchmarks.onboard import shares
from benchmarks.table import HEADER, Row, Timing, cells, figures, markdown, measure

PAGE = Path(__file__).parents[1] / "docs" / "evidence" / "benchmarks.md"
KEPT = PAGE.with_suffix(".json")
GENEROUS = 0.5  # of the kept ratio to a peer


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
        f"At most {repetitions} repetitions of all sides, interleaved, one thread; the ratio is their median",
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


def waited_lines(waited: list[Waited]) -> list[str]:
    """What a user waits for, as a table."""
    rows = [f"| `{w.command}` {w.note} | {w.median:.2f} / {w.least:.2f} | {w.peak:.0f} |" for w in waited]
    return ["## Commands", "", "Wall time of a process of its own, and the most memory that it took.", "",
            "| command | median / least [s] | peak [MB] |", "| --- | --- | --- |", *rows]  # fmt: skip


def grown_lines(grown: list[Grown]) -> list[str]:
    """How cost grows, as a table."""
    rows = [
        f"| {g.growth.name} | {g.growth.unit} | "
        + ", ".join(f"{n}: {s:.3g}" for n, s in zip(g.growth.sizes, g.seconds, strict=True))
        + f" | {g.exponent:.2f} |"
        for g in grown
    ]
    about = "CPU time [s] by size, the least of three, and the exponent of the power law through them."
    head = ["| work | size | seconds | exponent |", "| --- | --- | --- | --- |"]
    return ["## Growth", "", about, "", *head, *rows]


def gate(timings: list[Timing]) -> list[str]:
    """What is slower beside its peers than half of what was kept, one line each; what is not kept yet passes."""
    kept = {row["name"]: row for row in json.loads(KEPT.read_text(encoding="utf-8"))["rows"]}
    out = list[str]()
    for t in timings:
        now = figures(t)
        before = {p["name"]: p["ratio"] for p in kept.get(t.row.name, {"peers": []})["peers"]}
        for peer in now["peers"]:
            least = GENEROUS * before.get(peer["name"], 0.0)
            if peer["ratio"] < least:
                out.append(f"{t.row.name}: {peer['ratio']:.1f} x {peer['name']}, kept {least / GENEROUS:.1f} x")
    return out


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "--write", action="store_true", help=f"keep the result in {PAGE.parent.name}/{PAGE.name}, .json"
    )
    parser.add_argument(
        "--gate", action="store_true", help="exit code 1 if a ratio to a peer is below half of the kept"
    )
    parser.add_argument("--only", default="", metavar="TEXT", help="rows whose name contains this text")
    parser.add_argument("--without", action="append", default=[], metavar="MODULE", help="leave out, as `planning`")
    parser.add_argument("--repetitions", type=int, default=9)
    asked = parser.parse_args()
    if asked.write and asked.only:
        parser.error("--write keeps the whole page: leave out --only")
    if asked.gate and not KEPT.exists():
        parser.error(f"nothing is kept to compare with: --write makes {KEPT.name}")
    console = Console()
    timings: list[Timing] = []
    begun = time.monotonic()
    for row in registry(asked.without):
        if asked.only.lower() in row.name.lower():
            with console.status(f"{row.name} (the first run compiles)"):
                timings.append(measure(row, asked.repetitions))
            print(f"{time.monotonic() - begun:5.0f} s  {row.name}", file=sys.stderr, flush=True)
    whole = not asked.only
    waited = commands() if whole and "commands" not in asked.without else []
    grown = [grow(g) for g in all_growths()] if whole and "growth" not in asked.without else []
    aboard = shares() if whole and "onboard" not in asked.without else []
    show(timings, console)
    parts = [waited_lines(waited) if waited else [], grown_lines(grown) if grown else []]
    parts.append(share_lines(aboard) if aboard else [])
    more = [line for part in parts if part for line in ("", *part)]
    console.print("\n".join(more), highlight=False)
    if asked.write:
        PAGE.parent.mkdir(parents=True, exist_ok=True)
        text = markdown(timings, preamble(asked.repetitions)) + "".join(f"{line}\n" for line in more)
        PAGE.write_text(text, encoding="utf-8")
        told = {"about": preamble(asked.repetitions), "rows": [figures(t) for t in timings]}
        told["commands"] = [
            {"command": w.command, "note": w.note, "median_s": w.median, "peak_mb": w.peak} for w in waited
        ]
        told["growth"] = [
            {"name": g.growth.name, "sizes": list(g.growth.sizes), "seconds": list(g.seconds), "exponent": g.exponent}
            for g in grown
        ]
        told["onboard"] = [{"work": s.work, "share": s.share, "peak_mb": s.peak} for s in aboard]
        KEPT.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
        console.print(f"written to {PAGE.relative_to(Path.cwd()) if PAGE.is_relative_to(Path.cwd()) else PAGE}")
    if asked.gate:
        slow = gate(timings)
        console.print("\n".join(slow) or "no ratio to a peer is below half of what was kept", highlight=False)
        return int(bool(slow))
    return 0


if __name__ == "__main__":
    sys.exit(main())
