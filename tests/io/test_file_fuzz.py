"""Files spoilt in every way: each is read, or refused with one clear line. A campaign writes docs/evidence/fuzz.md."""

import os
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from fuzzing import COMMANDS, WAYS, Seed, attempt, command, seeds, spoilt

PAGE = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "fuzz.md"
SEEDS = seeds()
OTHERS = [s.data for s in SEEDS.values()]
SAMPLE, CASES = 6, int(os.environ.get("OUTRIDER_FUZZ", "280"))  # per kind of file: 36 kinds make ten thousand


def cases(
    name: str, seed: Seed, n: int, folder: Path, run: Callable[[bytes], str] | None = None
) -> tuple[Counter[str], list[str]]:
    """How many came to what, and what went wrong, with how to have it again."""
    came, wrong = Counter[str](), []
    for k in range(n):
        rng = np.random.default_rng([k, *name.encode()])
        how, data = spoilt(seed.data, rng, OTHERS)
        if rng.random() < 0.3:
            more, data = spoilt(data, rng, OTHERS)
            how = f"{how}, {more}"
        said = attempt(seed, data, folder) if run is None else run(data)
        came[said if said in ("read", "refused") else "wrong"] += 1
        if said not in ("read", "refused"):
            wrong.append(f"{name} #{k} ({how}): {said}")
    return came, wrong


@pytest.mark.parametrize("name", SEEDS)
def test_every_kind_is_read_and_spoilt_ones_end_well(name: str, tmp_path: Path) -> None:
    assert attempt(SEEDS[name], SEEDS[name].data, tmp_path) == "read"
    came, wrong = cases(name, SEEDS[name], SAMPLE, tmp_path)
    assert not wrong
    assert came.total() == SAMPLE


@pytest.mark.compiled
def test_every_command_answers_or_says_why_not(tmp_path: Path) -> None:
    wrong: list[str] = []
    for name, (kind, _) in COMMANDS.items():
        assert command(name, SEEDS[kind].data, SEEDS, tmp_path) == "read"
        wrong += cases(name, SEEDS[kind], 1, tmp_path, partial(command, name, kinds=SEEDS, folder=tmp_path))[1]
    assert not wrong


@pytest.mark.evidence
def test_campaign_over_every_reader(tmp_path: Path) -> None:
    rows, wrong, total = [], [], Counter[str]()
    for name, seed in SEEDS.items():
        came, bad = cases(name, seed, CASES, tmp_path)
        rows.append(f"| {name} | {came.total()} | {came['read']} | {came['refused']} | {came['wrong']} |")
        wrong += bad
        total += came
    for name, (kind, _) in COMMANDS.items():
        run = partial(command, name, kinds=SEEDS, folder=tmp_path)
        came, bad = cases(name, SEEDS[kind], CASES // 6, tmp_path, run)
        rows.append(f"| `outrider {name}` | {came.total()} | {came['read']} | {came['refused']} | {came['wrong']} |")
        wrong += bad
        total += came
    head = [
        "# Spoilt files and commands", "",
        "By `make evidence` (`pytest -m evidence tests/io/test_file_fuzz.py`): a small sound file of each kind,",
        f"spoilt in one of {len(WAYS)} ways",
        f"({', '.join(WAYS)}),",
        "three in ten of them in two; the seed of a case is its number and the name of the kind. *Wrong* would be any",
        "exception that is not ours, a warning, more than 20 s, a message of",
        "several lines, or NaN among positions. Logs in memory spoilt by stream are in `tests/test_fuzz.py`.", "",
        "| kind | cases | read | refused with one line | wrong |", "|---|---|---|---|---|",
    ]  # fmt: skip
    all_of = f"| all | {total.total()} | {total['read']} | {total['refused']} | {total['wrong']} |"
    if not wrong and CASES >= 280:
        PAGE.write_text("\n".join([*head, *rows, all_of, ""]), encoding="utf-8")
    print("\n".join([*rows, all_of, *wrong]))  # noqa: T201
    assert not wrong
