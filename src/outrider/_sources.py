"""What a source file stands on: a short name that changes whenever it, or one of our files that it imports, does."""

import hashlib
import re
from functools import cache
from pathlib import Path
from typing import Final

PACKAGE: Final = Path(__file__).parent
_IMPORT: Final = re.compile(
    rb"^[ \t]*(?:from[ \t]+(outrider[\w.]*)[ \t]+import[ \t]*(\([^)]*\)|[^\n#]*)|import[ \t]+(outrider[\w.]*))", re.M
)


def stamp(path: Path, *told: str) -> str:
    """Of the file and of everything of ours that it imports, by content; `told` is whatever else it depends on."""
    digest = hashlib.blake2s(" ".join(told).encode(), digest_size=8)
    for file in sorted(_closure(path), key=str):
        name = file.relative_to(PACKAGE) if file.is_relative_to(PACKAGE) else Path(file.name)
        digest.update(f"{name} ".encode() + _read(file)[0])
    return digest.hexdigest()


@cache
def package_stamp(*told: str) -> str:
    """Of all our sources, by name, size and time of change: quick, and different after an update."""
    digest = hashlib.blake2s(" ".join(told).encode(), digest_size=8)
    for path in sorted(PACKAGE.rglob("*.py")):
        stat = path.stat()
        digest.update(f"{path.relative_to(PACKAGE)} {stat.st_size} {stat.st_mtime_ns};".encode())
    return digest.hexdigest()


def _closure(path: Path) -> set[Path]:
    """The file and all that it imports, directly or not."""
    seen, due = {path}, [path]
    while due:
        new = _read(due.pop())[1] - seen
        seen |= new
        due += new
    return seen


@cache
def _read(path: Path) -> tuple[bytes, frozenset[Path]]:
    """Hash of the text, and the files of ours that it imports."""
    text = path.read_bytes()
    files: set[Path] = set()
    for module, names, plain in _IMPORT.findall(text):
        base = PACKAGE.joinpath(*(module or plain).decode().split(".")[1:])
        inner = [base / n for n in re.findall(r"\w+", names.decode())]
        files |= {f for b in (base, *inner) if (f := _file(b)) is not None}
    return hashlib.blake2s(text, digest_size=16).digest(), frozenset(files)


@cache
def _file(module: Path) -> Path | None:
    """Where a module stands, None if it is a name in one."""
    for file in (module.with_suffix(".py"), module / "__init__.py"):
        if file.is_file():
            return file
    return None
