"""The table that the evidence writes: docs/evidence/recordings.md."""

import platform
import subprocess
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "recordings.md"
PARTS = ("husky", "outages", "replay", "copter", "flights", "plaza", "highway", "plans", "uwb")
INTRODUCTION = """# Real recordings

Written by `make evidence` (or `pytest -m evidence tests/evidence`), which also asserts every bound. One default set of
tuning for all rows; all that is configured is what a log cannot tell (a mount, the places of beacons). `fuse` draws no
random numbers (its seed is 1 and unused): the same input gives the same bits. The recordings are public and not part of
this repository; the tests look for them in `$OUTRIDER_DATA`.
"""


@dataclass
class Table:
    rows: dict[str, list[tuple[str, ...]]] = field(default_factory=dict)

    def add(self, part: str, recording: str, what: str, figure: str, bound: str = "", command: str = "") -> None:
        print(f"{recording}: {what}: {figure} {bound}")  # noqa: T201
        self.rows.setdefault(part, []).append((recording, what, figure, bound, f"`{command}`" if command else ""))

    def text(self) -> str:
        head = ["| recording | what | figure | bound | command |", "|---|---|---|---|---|"]
        body = ["| " + " | ".join(row) + " |" for part in PARTS for row in self.rows[part]]
        versions = ", ".join(f"{name} {version(name)}" for name in ("outrider", "numpy", "numba"))
        machine = f"Machine: {cpu()}, Python {platform.python_version()}, {versions}."
        return "\n".join([INTRODUCTION, *head, *body, "", machine, "", f"Code of commit {commit()}.", ""])

    def into(self, page: str) -> str:
        """The page with the rows that were run now instead of those of the same name; a line says on what code."""
        new = {row[:2]: "| " + " | ".join(row) + " |" for rows in self.rows.values() for row in rows}
        told, run = ": code of commit ", dict.fromkeys(recording for recording, _ in new)
        kept = [line for line in page.rstrip("\n").split("\n")
                if told not in line or not set(line.partition(told)[0].split(", ")) <= set(run)]  # fmt: skip
        lines = [new.pop((*_cells(line),), line) for line in kept]
        last = max(k for k, line in enumerate(lines) if line.startswith("| "))
        lines[last + 1 : last + 1] = new.values()
        return "\n".join([*lines, ", ".join(run) + told + f"{commit()}.", ""])


def _cells(line: str) -> tuple[str, ...]:
    """Recording and what, of a row."""
    return tuple(cell.strip() for cell in line.strip("| ").split(" | ")[:2])


def commit() -> str:
    """What the code in this folder is called, and whether it was changed since."""

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=PAGE.parent, capture_output=True, text=True, check=False).stdout

    changed = " with changes" if git("diff", "HEAD", "--stat", "--", "../../src") else ""
    return f'"{git("log", "-1", "--format=%s").strip()}"{changed}'


def cpu() -> str:
    info = Path("/proc/cpuinfo")
    names = [line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if "model name" in line]
    return names[0] if names else platform.machine()


def write(table: Table) -> None:
    """The page; where only some parts were run, their rows in it."""
    if set(table.rows) == set(PARTS):
        PAGE.parent.mkdir(parents=True, exist_ok=True)
        PAGE.write_text(table.text(), encoding="utf-8")
    elif table.rows and PAGE.is_file():
        PAGE.write_text(table.into(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
