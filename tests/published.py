"""Tables of evidence."""

import sys
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill


def publish(name: str, title: str, text: str, header: tuple[str, ...], rows: Sequence[tuple[object, ...]]) -> Path:
    """Write a table of evidence to docs/evidence/<name>.md and print it."""
    lines = [
        f"# {title}",
        "",
        *fill(text, 120).splitlines(),
        "",
        "Written by `make evidence`.",
        "",
        "| " + " | ".join(header) + " |",
        "|" + "---|" * len(header),
        *("| " + " | ".join(str(cell) for cell in row) + " |" for row in rows),
    ]
    path = Path(__file__).resolve().parents[1] / "docs" / "evidence" / f"{name}.md"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")
    sys.stdout.write("\n".join(lines) + "\n")
    return path
