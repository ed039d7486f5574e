"""`outrider papers`: three forms of one document, a folder, and refusals of one line."""

import json
from pathlib import Path
from typing import Any

import pytest

from outrider.campaign.papers import Paper, Row, Table, Work
from outrider.cli.papers import print_papers
from outrider.io.trials import MARKER, TrialStore


def test_text(outrider: Any, tmp_path: Path) -> None:
    done = outrider("papers", "amr2025", "--seeds", 0)
    assert done.code == 0 and done.err == ""
    for words in ("0.3486", "90.07", "0.2789", "differs from what is printed", "not simulated yet", "Table 5"):
        assert words in done.out, words
    assert all(line == line.rstrip() for line in done.out.splitlines()) and list(tmp_path.iterdir()) == []


def test_json_and_all_papers(outrider: Any) -> None:
    document = json.loads(outrider("papers", "--format", "json", "--seeds", 0).out)
    assert document["schema"] == "outrider.papers/1" and document["seeds"] == 0
    assert [p["name"] for p in document["papers"]] == ["amr2025", "coop2024", "swarm2023"]
    one = json.loads(outrider("papers", "coop2024", "--format", "json", "--seeds", 0).out)
    assert one["papers"] == [document["papers"][1]]


def test_list(outrider: Any) -> None:
    done = outrider("papers", "--list")
    assert [line.split(":")[0] for line in done.out.splitlines() if not line.startswith(" ")] == [
        "amr2025", "coop2024", "swarm2023",
    ]  # fmt: skip
    listed = json.loads(outrider("papers", "--list", "--format", "json").out)
    assert {p["name"] for p in listed["papers"]} == {"amr2025", "coop2024", "swarm2023"}


def test_html_on_stdout(outrider: Any, tmp_path: Path) -> None:
    done = outrider("papers", "amr2025", "--format", "html", "--seeds", 0)
    assert done.out.startswith("<!DOCTYPE html>") and "</html>" in done.out and list(tmp_path.iterdir()) == []


def test_a_folder(outrider: Any, tmp_path: Path) -> None:
    done = outrider("papers", "amr2025", "--output", "out", "--format", "json", "--seeds", 0)
    assert done.code == 0 and done.err == "outrider: written to out/report.html\n"
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"papers.json", "report.html"}
    saved = json.loads((tmp_path / "out" / "papers.json").read_text())
    assert saved.pop("files") == ["papers.json", "report.html"] and saved == json.loads(done.out)
    again = outrider("papers", "amr2025", "--output", "out")
    assert again.code == 2 and "holds an earlier result" in again.err and again.out == ""
    page = (tmp_path / "out" / "report.html").read_bytes()
    assert outrider("papers", "amr2025", "--output", "out", "--force", "--quiet", "--seeds", 0).err == ""
    assert (tmp_path / "out" / "report.html").read_bytes() == page


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("amr", "no paper 'amr' (did you mean 'amr2025'?)"),
        ("nonsense", "there are: amr2025, coop2024, swarm2023"),
        ("amr2025 --format xml", "no format 'xml' (there are: text, html, json)"),
        ("--list --format html", "no format 'html'"),
        ("amr2025 --seeds -1", "--seeds -1: '-1' is no whole number from 0"),
        ("amr2025 --seeds many", "--seeds"),
        ("amr2025 --workers -1", "--workers -1: '-1' is no whole number from 0"),
        ("amr2025 --output full", "not empty"),
        ("amr2025 --bogus", "No such option"),
    ],
)
def test_refusals(outrider: Any, tmp_path: Path, line: str, words: str) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "letter.txt").write_text("precious")
    done = outrider("papers", *line.split())
    assert done.code == 2 and done.out == "" and words in done.err and len(done.err.splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["full"] and len(list((tmp_path / "full").iterdir())) == 1


def test_an_interruption_says_what_is_kept(outrider: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    toy = Paper(name="toy", title="Toy", citation="Nobody")

    @toy.table
    def stopped(work: Work) -> Table:
        assert work.trials == Path("kept") and work.workers == 3 and work.seeds == 7
        raise KeyboardInterrupt("3 of 14 trials are kept in kept/drift")

    monkeypatch.setattr("outrider.campaign.papers.find_paper", lambda name: toy)
    done = outrider("papers", "toy", "--trials", "kept", "--workers", 3, "--seeds", 7, "-o", "out")
    assert done.code == 130 and done.err == "outrider: interrupted, 3 of 14 trials are kept in kept/drift\n"
    assert done.out == "" and list(tmp_path.iterdir()) == []


def test_trials_of_another_program_are_refused_before_anything_runs(outrider: Any, tmp_path: Path) -> None:
    store = tmp_path / "kept" / "drives"
    with TrialStore(store, {"trial": "a:b", "cases": [{}], "code": {"outrider": "0.0.1 old", "trial": "c"}}):
        pass
    before = (store / MARKER).read_bytes()
    done = outrider("papers", "swarm2023", "--trials", "kept", "--seeds", 1)
    assert done.code == 2 and done.out == "" and len(done.err.splitlines()) == 1
    assert 'kept/drives: holds trials of another configuration: code.outrider: "0.0.1 old" in the folder' in done.err
    assert (store / MARKER).read_bytes() == before


def test_text_of_seeds_and_pairs(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    from outrider.campaign.papers import Pair
    from outrider.eval import paired, summary

    toy = Paper(name="toy", title="Toy", citation="Nobody")
    row = Row(name="x[1]", group="first", unit="m", printed="2.5", ours=summary([1.0, 2.0, 3.5]), note="why")
    pair = Pair(name="a - b", unit="m", result=paired([1, 2, 4.0], [2, 3, 6.0]))
    toy.table(lambda work: Table(key="t", title="T", rows=(row, Row(name="y", printed="1")), pairs=(pair,)))
    monkeypatch.setattr("outrider.campaign.papers.find_paper", lambda name: toy)
    print_papers("toy", form="text", seeds=None, workers=0, trials=None, output=None, force=False, quiet=True)
    told = capsys.readouterr().out
    for words in ("x[1] [m]", "2.167", "-0.959 to 5.29", " 3 ", "x[1]: why", "a - b [m]", "100%", "first"):
        assert words in told, words
