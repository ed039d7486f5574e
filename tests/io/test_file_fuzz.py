"""Files spoilt in every way: each is read, or refused with one clear line. A campaign writes docs/evidence/fuzz.md."""

import os
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest
from fuzzing import WAYS, Seed, attempt, seeds, spoilt
from numpy.random import Generator
from wrong_words import FILES, LINES, REFUSED, ended, fresh, make_place, spoilt_file, spoilt_line

PAGE = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "fuzz.md"
SEEDS = seeds()
OTHERS = [s.data for s in SEEDS.values()]
SAMPLE, CASES = 6, int(os.environ.get("OUTRIDER_FUZZ", "280"))  # per kind of file: 35 kinds make ten thousand
QUICK = ("sources", "run", "campaign report", "papers --list", "eval REFERENCE")


Came = tuple[Counter[str], list[str]]


def counted(name: str, numbers: Iterable[int], case: Callable[[Generator], tuple[str, str]]) -> Came:
    """How many came to what, and what went wrong, with how to have it again."""
    came, wrong = Counter[str](), []
    for k in numbers:
        how, said = case(np.random.default_rng([k, *name.encode()]))
        came[said if said in ("read", "refused") else "wrong"] += 1
        if said not in ("read", "refused"):
            wrong.append(f"{name} #{k} ({how}): {said}")
    return came, wrong


def cases(name: str, seed: Seed, n: int, folder: Path) -> Came:
    """A file of one kind, spoilt and read."""

    def case(rng: Generator) -> tuple[str, str]:
        how, data = spoilt(seed.data, rng, OTHERS)
        if rng.random() < 0.3:
            more, data = spoilt(data, rng, OTHERS)
            how = f"{how}, {more}"
        return how, attempt(seed, data, folder)

    return counted(name, range(n), case)


def renewed(place: Path) -> Path:
    """The user's folder as it was."""
    return fresh(place.with_name("kept"), place)


def spoilt_files(name: str, place: Path, numbers: Iterable[int]) -> Came:
    """A command with a spoilt file."""
    file, words = FILES[name]

    def case(rng: Generator) -> tuple[str, str]:
        path = renewed(place) / file
        how, data = spoilt_file(path, rng, OTHERS)
        path.write_bytes(data)
        return how, ended(words, place)

    return counted(name, numbers, case)


def wrong_lines(name: str, place: Path, numbers: Iterable[int]) -> Came:
    """A command typed wrongly."""

    def case(rng: Generator) -> tuple[str, str]:
        how, words = spoilt_line(LINES.get(name) or REFUSED[name], rng, surely=name in REFUSED)
        return f"{how}: {words}", ended(words, renewed(place))

    return counted(name, numbers, case)


@pytest.mark.parametrize("name", SEEDS)
def test_every_kind_is_read_and_spoilt_ones_end_well(name: str, tmp_path: Path) -> None:
    assert attempt(SEEDS[name], SEEDS[name].data, tmp_path) == "read"
    came, wrong = cases(name, SEEDS[name], SAMPLE, tmp_path)
    assert not wrong
    assert came.total() == SAMPLE


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A user's folder, of which a copy is kept beside it."""
    folder = tmp_path / "place"
    folder.mkdir()
    make_place(folder, SEEDS)
    fresh(folder, tmp_path / "kept")
    return folder


@pytest.mark.compiled
def test_a_command_answers_or_says_why_not(place: Path) -> None:
    wrong: list[str] = []
    for name in QUICK:
        assert ended(FILES[name][1] if name in FILES else LINES[name], renewed(place)) == "read", name
    for name in [*FILES][::2]:
        wrong += spoilt_files(name, place, range(1))[1]
    for name in [*LINES, *REFUSED]:
        wrong += wrong_lines(name, place, range(1))[1]
    assert not wrong


@pytest.mark.evidence
def test_campaign_over_every_reader_and_command(tmp_path: Path, place: Path) -> None:
    rows, wrong, total = [], [], Counter[str]()
    for name, seed in SEEDS.items():
        came, bad = cases(name, seed, CASES, tmp_path)
        rows.append(f"| {name} | {came.total()} | {came['read']} | {came['refused']} | {came['wrong']} |")
        wrong += bad
        total += came
    for what, run, names in (("with a spoilt file", spoilt_files, FILES), ("typed wrongly", wrong_lines, LINES),
                             ("that cannot be", wrong_lines, REFUSED)):  # fmt: skip
        for name, words in names.items():
            sound = words[1] if names is FILES else words
            if names is not REFUSED and (said := ended(sound, renewed(place), patient=True)) != "read":
                wrong.append(f"{name}, as it should be: {said}")
            came, bad = run(name, place, range(CASES // 10))
            figures = " | ".join(str(n) for n in (came.total(), came["read"], came["refused"], came["wrong"]))
            rows.append(f"| `outrider {name}`, {what} | {figures} |")
            wrong += bad
            total += came
    head = [
        "# Spoilt files and commands", "",
        "By `make evidence` (`pytest -m evidence tests/io/test_file_fuzz.py`): a small sound file of each kind,",
        f"spoilt in one of {len(WAYS)} ways",
        f"({', '.join(WAYS)}),",
        "three in ten of them in two; the seed of a case is its number and the name of the kind. *Wrong* would be any",
        "exception that is not ours, a warning, more than 20 s of processor time, a message of",
        "several lines, or NaN among positions. Logs in memory spoilt by stream are in `tests/test_fuzz.py`.", "",
        "Commands run in a user's folder, each with one of its files spoilt, and typed wrongly: a word or a number",
        "that cannot be, a misspelt option, words twice, left out, swapped or too many, and outputs that exist, are",
        "somebody's files, or cannot be made. *Wrong* is there also a code that is not documented, NaN in an answer, a",
        "file that was changed though nobody asked for it, and anything left behind by what was refused.", "",
        "| kind | cases | read | refused with one line | wrong |", "|---|---|---|---|---|",
    ]  # fmt: skip
    all_of = f"| all | {total.total()} | {total['read']} | {total['refused']} | {total['wrong']} |"
    if not wrong and CASES >= 280:
        PAGE.write_text("\n".join([*head, *rows, all_of, ""]), encoding="utf-8")
    print("\n".join([*rows, all_of, *wrong]))  # noqa: T201
    assert not wrong
