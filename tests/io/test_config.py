"""YAML with line numbers: every fault is one line that names the place."""

import math
from pathlib import Path

import pytest

from outrider.errors import ConfigError, ExitCode
from outrider.io.config import LARGEST, line_of, read_yaml, yaml_text

FAULTS = {
    "a: 1\nb: 2\na: 3\n": (3, "'a' is there twice .first on line 1."),
    "a:\n  - x: 1\n    x: 2\n": (3, "'x' is there twice"),
    "a: 1\nb: [1, 2\n": (3, "is not YAML"),
    "a: 1\n\tb: 2\n": (2, "is not YAML: a tab where spaces have to be .indent with spaces"),
    "a: b: c\n": (1, "a colon where none can be .quote"),
    "a:\n  b: 1\n c: 2\n": (3, "the indentation does not fit"),
    "a: {b: 1\nc\n": (3, "a mapping that is not closed"),
    "- 1\n- 2\n": (1, "no mapping"),
    "just words": (1, "no mapping"),
    "a: !!python/object:os.system {}": (1, "is not YAML"),
    "when: !!timestamp 2024-13-45": (0, "is not YAML"),
    f"seed: {'9' * 5000}": (0, "is not YAML"),
    "[" * 3000: (0, "nested too deeply|is not YAML"),
    "a: \x07": (0, "is not YAML"),
}


@pytest.mark.parametrize("text", FAULTS)
def test_a_fault_is_one_line_with_its_place(tmp_path: Path, text: str) -> None:
    path = tmp_path / "c.yaml"
    path.write_text(text)
    line, what = FAULTS[text]
    with pytest.raises(ConfigError, match=what) as caught:
        read_yaml(path)
    assert caught.value.where == (f"{path}:{line}" if line else str(path))
    assert "\n" not in str(caught.value) and caught.value.exit_code == ExitCode.USAGE


def test_plain_files(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    for text in ("", "# nothing yet\n", "\ufeff"):
        path.write_text(text, encoding="utf-8")
        assert read_yaml(path) == {}
    path.write_text("base: &b {x: 1}\nmore: {<<: *b, y: 2}\nname: müll\n", encoding="utf-8")
    assert read_yaml(path) == {"base": {"x": 1}, "more": {"x": 1, "y": 2}, "name": "müll"}


VALUES = {
    "1": 1, "-3": -3, "+3": 3, "010": 10, "1e9": 1e9, "1E-3": 1e-3, "1.": 1.0, ".5": 0.5, "-1.5e+2": -150.0,
    ".inf": math.inf, "-.inf": -math.inf, "true": True, "False": False, "~": None, "null": None, "": None,
    "yes": "yes", "on": "on", "Off": "Off", "n": "n", "0x10": "0x10", "0b1": "0b1", "1_000": "1_000", "12:30": "12:30",
    "2024-05-01": "2024-05-01", "'1'": "1", '"1e9"': "1e9", "1,5": "1,5", "e3": "e3", "=": "=", ".": ".",
}  # fmt: skip


@pytest.mark.parametrize("text", VALUES)
def test_values_are_what_they_look_like(tmp_path: Path, text: str) -> None:
    """The core schema of YAML 1.2, not the older one that makes minutes, dates and octal numbers of plain words."""
    path = tmp_path / "c.yaml"
    path.write_text(f"a: {text}\n")
    value = read_yaml(path)["a"]
    assert value == VALUES[text] and type(value) is type(VALUES[text])


@pytest.mark.parametrize("text", [*VALUES, "no", "1:30", "0o7", "<<", "a: b", "#", "\u2028"])
def test_what_is_written_is_read_as_the_same(tmp_path: Path, text: str) -> None:
    """Also texts that one of the two schemas of YAML would take for something else."""
    path = tmp_path / "c.yaml"
    data = {"value": text.strip("'\""), text: [1.5, 1e16, 1e-9, 10, True, None, math.inf, text]}
    path.write_text(yaml_text(data), encoding="utf-8")
    assert read_yaml(path) == data


def test_what_is_no_text_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "log.bag"
    for content, what in ((b"\xff\xfe\x00#ROSBAG", "no text"), (b"a: 1\n" * LARGEST, "too long")):
        path.write_bytes(content)
        with pytest.raises(ConfigError, match=what):
            read_yaml(path)
    for missing in (tmp_path, tmp_path / "none.yaml"):
        with pytest.raises(ConfigError, match="cannot be read"):
            read_yaml(missing)


def test_lines_of_keys(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    path.write_text("a: 1\nb:\n  c:\n    - 10\n    - d: 20\n      e: 30\n")
    assert line_of(path, ["a"]) == 1
    assert line_of(path, ["b", "c", 1, "e"]) == 6
    assert line_of(path, ["b", "nope"]) == 2  # the last parent that is there
    assert line_of(path, ["nope"]) == 0
    assert line_of(tmp_path / "none.yaml", ["a"]) == 0
