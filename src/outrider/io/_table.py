"""Text tables: a few named columns of a file, with what could not be read counted.

The standard library's parser, because pyarrow's stumbles over bytes that are not UTF-8 in ragged rows.
"""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO, final

import numpy as np

from outrider.io.files import Progress
from outrider.io.stamps import to_nanoseconds
from outrider.typing import Bools, Floats, Ints

REPORT_EVERY = 1 << 14  # lines between two reports of progress
MISSING = {"", "nan", "NaN", "NAN", "null", "NULL", "None", "-"}


@final
@dataclass(frozen=True, slots=True)
class Header:
    """Column names, and how many lines stand before the first row."""

    names: tuple[str, ...]
    lines: int
    delimiter: str


@final
@dataclass(slots=True)
class Rows:
    """Columns of a file. numbers : NaN where absent or broken;  broken : cells that hold no number."""

    numbers: dict[str, Floats] = field(default_factory=dict[str, Floats])
    broken: dict[str, Bools] = field(default_factory=dict[str, Bools])
    texts: dict[str, list[str]] = field(default_factory=dict[str, list[str]])
    stamps: dict[str, tuple[Ints, Bools]] = field(default_factory=dict[str, tuple[Ints, Bools]])
    ragged: int = 0  # rows with too many or too few cells, which are left out


def header_of(path: Path, delimiter: str, names: Sequence[str] | None) -> Header:
    """The column names: given, or the first line, or the last comment line (# or %) if the rows follow it directly."""
    with path.open(encoding="utf-8-sig", errors="replace") as f:
        comments: list[str] = []
        first = ""
        for line in f:
            if line.strip() and line.lstrip()[0] not in "#%":
                first = line
                break
            comments.append(line)
    if names is not None:
        return Header(tuple(names), len(comments), delimiter)
    cells = [c.strip().strip('"') for c in first.rstrip("\r\n").split(delimiter)]
    above = [c.strip() for c in comments[-1].strip().lstrip("#% ").split(delimiter)] if comments else []
    if len(above) == len(cells) > 1 and _is_number(cells[0]):
        return Header(tuple(above), len(comments), delimiter)
    return Header(tuple(cells), len(comments) + 1, delimiter)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def read_rows(
    path: Path,
    header: Header,
    *,
    numbers: Sequence[str] = (),
    texts: Sequence[str] = (),
    stamps: dict[str, str],
    progress: Progress | None = None,
) -> Rows:
    """Read the named columns; `stamps` maps a column to the unit of its stamps."""
    wanted = sorted({*numbers, *texts, *stamps})
    index = [header.names.index(c) for c in wanted]
    out, width, kept = Rows(), len(header.names), list[list[str]]()
    with path.open(encoding="utf-8-sig", errors="replace") as f:  # lines end in LF, CR LF, or CR as on old Macs
        reader = csv.reader(_lines(f, header.lines, path.stat().st_size, progress), delimiter=header.delimiter)
        while True:
            try:
                row = next(reader, None)
            except csv.Error:  # a cell of more than 128 KiB
                out.ragged += 1
                continue
            if row is None:
                break
            if len(row) == width:
                kept.append([row[i] for i in index])
            elif row:
                out.ragged += 1
    columns = [[c.strip() for c in column] for column in zip(*kept, strict=True)] or [[] for _ in wanted]
    for name, cells in zip(wanted, columns, strict=True):
        if name in numbers:
            out.numbers[name], out.broken[name] = _numbers(cells)
        if name in texts:
            out.texts[name] = cells
        if name in stamps:
            out.stamps[name] = to_nanoseconds(cells, stamps[name])
    return out


def _lines(f: TextIO, skip: int, size: int, progress: Progress | None) -> Iterator[str]:
    done = 0
    for number, line in enumerate(f):
        done += len(line)
        if progress is not None and number % REPORT_EVERY == 0:
            progress(min(done, size), size)
        if number >= skip and line[:1] not in ("#", "%"):
            yield line.replace("\0", "")


def _numbers(cells: list[str]) -> tuple[Floats, Bools]:
    broken = np.zeros(len(cells), np.bool_)
    try:
        return np.array(cells, np.float64), broken
    except ValueError:
        values = np.full(len(cells), np.nan)
    for i, cell in enumerate(cells):
        try:
            values[i] = float(cell)
        except ValueError:
            broken[i] = cell not in MISSING
    return values, broken
