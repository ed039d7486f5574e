"""The cache of compiled kernels: where it is, and that no fault of the disk stops a run."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from outrider import _kernel
from outrider.cli.progress import Progress

TWICE = """
from outrider._kernel import kernel
import double
print(double.double(21.0), end="")
"""
DOUBLE = """
from outrider._kernel import kernel

@kernel
def double(x):
    return x + x
"""


def doubled(folder: Path, **variables: str) -> str:
    """Compile and call a kernel in another process."""
    (folder / "double.py").write_text(DOUBLE)
    hidden = ("NUMBA_CACHE_DIR", "OUTRIDER_CACHE", "XDG_CACHE_HOME", "NUMBA_DISABLE_JIT")
    environment = {k: v for k, v in os.environ.items() if k not in hidden} | variables
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", TWICE], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0 and done.stderr == "", done.stderr
    return done.stdout


def kept(folder: Path) -> list[Path]:
    return sorted([*folder.rglob("*.nbi"), *folder.rglob("*.nbc")])


@pytest.mark.compiled
def test_kept_and_used_again(tmp_path: Path) -> None:
    assert doubled(tmp_path, OUTRIDER_CACHE=str(tmp_path / "cache")) == "42.0"
    before = {p: p.stat().st_mtime_ns for p in kept(tmp_path / "cache")}
    assert len(before) == 2 and kept(tmp_path) == list(before)
    assert doubled(tmp_path, OUTRIDER_CACHE=str(tmp_path / "cache")) == "42.0"
    assert {p: p.stat().st_mtime_ns for p in kept(tmp_path)} == before


@pytest.mark.compiled
def test_a_damaged_cache_is_compiled_again(tmp_path: Path) -> None:
    doubled(tmp_path, OUTRIDER_CACHE=str(tmp_path / "cache"))
    for path in kept(tmp_path):
        for content in (b"", path.read_bytes()[:20]):
            path.write_bytes(content)
            assert doubled(tmp_path, OUTRIDER_CACHE=str(tmp_path / "cache")) == "42.0"


@pytest.mark.compiled
def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    """Compiled in memory; never kept beside the sources, where nothing would notice that a called file changed."""
    (tmp_path / "file").write_text("")
    assert doubled(tmp_path, OUTRIDER_CACHE=str(tmp_path / "file")) == "42.0"
    assert doubled(tmp_path, HOME=str(tmp_path / "file")) == "42.0"
    assert kept(tmp_path) == [] and kept(Path(_kernel.__file__).parent) == []


def test_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr("pathlib.Path.home", homeless)
    for name in ("OUTRIDER_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    assert _kernel.cache_directory() is None
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "x"))
    assert _kernel.cache_directory() == tmp_path / "x" / "outrider" / "kernels"
    monkeypatch.setenv("OUTRIDER_CACHE", str(tmp_path / "o"))
    assert _kernel.cache_directory() == tmp_path / "o" / "kernels"


def test_the_notice_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setattr("outrider._kernel.is_warm", lambda: False)
    folders = {tmp_path / "new": "once", tmp_path / "file" / "x": "not a directory (OUTRIDER_CACHE names", None: "home"}
    for folder, words in folders.items():
        monkeypatch.setattr("outrider._kernel._kept_in", lambda folder=folder: folder)
        with Progress() as progress:
            progress("fusing", 0.0)
        told = capsys.readouterr().err
        assert words in told and told.count("\n") == 1 and (folder is None or "once" in words or str(folder) in told)


def test_a_disk_that_fills_while_compiling_is_told_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("outrider._kernel.is_warm", lambda: True)
    monkeypatch.setattr("outrider._kernel._Cache.fault", "/cache: no space left on device")
    for quiet, lines in ((False, 1), (True, 0)):
        with Progress(quiet=quiet) as progress:
            progress("fusing", 0.0)
        told = capsys.readouterr().err
        assert told.count("\n") == lines and ("no space left" in told) is (not quiet)
