"""Tables of evidence."""

import sys
from collections.abc import Sequence
from pathlib import Path
from subprocess import run
from textwrap import fill


def code() -> str:
    """The commit that is measured, with a plus if what is measured has been changed since."""
    here = Path(__file__).resolve().parents[1]
    told = [
        run(["git", "-C", str(here), *words], capture_output=True, text=True, check=False).stdout.strip()
        for words in (["rev-parse", "--short", "HEAD"], ["status", "--porcelain", "src"])
    ]
    return (told[0] or "unknown") + ("+" if told[1] else "")


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
