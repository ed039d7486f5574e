"""The table that the evidence writes: docs/evidence/recordings.md."""

import platform
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "recordings.md"
PARTS = ("husky", "outages", "replay", "copter", "flights", "plaza", "highway", "plans")
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
        return "\n".join([INTRODUCTION, *head, *body, "", machine, ""])


def cpu() -> str:
    info = Path("/proc/cpuinfo")
    names = [line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if "model name" in line]
    return names[0] if names else platform.machine()


def write(table: Table) -> None:
    """The page, but only when every part of it was run."""
    if set(table.rows) == set(PARTS):
        PAGE.parent.mkdir(parents=True, exist_ok=True)
        PAGE.write_text(table.text(), encoding="utf-8")
