"""The examples run, warnings being errors."""

import runpy
from pathlib import Path

import pytest
from PIL import Image

EXAMPLES = sorted((Path(__file__).resolve().parents[2] / "examples").glob("[0-9]*.py"))


@pytest.mark.compiled
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(path), run_name="__main__")
    assert "finished" in capsys.readouterr().out
    assert [p.name for p in tmp_path.iterdir()] == [f"{path.stem}.png"]
    with Image.open(tmp_path / f"{path.stem}.png") as picture:
        assert picture.width > 1000 and len(picture.convert("RGB").getcolors(1 << 20) or ()) > 20


def test_there_are_examples() -> None:
    assert len(EXAMPLES) >= 2
