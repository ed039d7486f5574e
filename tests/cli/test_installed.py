"""The built wheel in an environment of its own: nothing that the program needs is missing from it."""

import json
import os
import site
import subprocess
import sys
import tomllib
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import pytest
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

from outrider import _kernel
from outrider._sources import PACKAGE, stamp
from outrider.cli import main
from outrider.cli.installed import kept_kernels
from outrider.errors import ExitCode

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment that holds the wheel, and sees the packages that it needs, but not this source tree."""
    folder = tmp_path_factory.mktemp("wheel")
    _run(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--disable-pip-version-check", "-w", folder, ROOT)
    environment = folder / "env"
    _run(sys.executable, "-m", "venv", "--without-pip", environment)
    python = environment / "bin" / "python"
    made = next(folder.glob("outrider-*.whl"))
    options = ("-q", "--no-deps", "--disable-pip-version-check", "--no-index")
    _run(sys.executable, "-m", "pip", "--python", python, "install", *options, made)
    packages = next((environment / "lib").glob("python*")) / "site-packages"
    (packages / "needed.pth").write_text("\n".join(site.getsitepackages()) + "\n")
    return environment / "bin"


def _run(*command: object, **options: Any) -> str:
    clean = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, timeout=600, env=clean, **options)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.compiled
def test_the_wheel_runs_where_the_source_is_not(wheel: Path, tmp_path: Path) -> None:
    told = _run(wheel / "outrider", "doctor", "--self", "--json", cwd=tmp_path)
    where = next(c["found"] for c in json.loads(told)["checks"] if c["what"] == "outrider")
    assert str(wheel.parent) in where
    assert _run(wheel / "outrider", "--version", cwd=tmp_path) == _run(wheel / "python", "-m", "outrider", "--version")
    assert "site-patrol" in _run(wheel / "outrider", "run", "--list", cwd=tmp_path)
    _run(wheel / "outrider", "run", "follow-field", "--duration", "2", "-o", "r", "-q", cwd=tmp_path)
    assert (tmp_path / "r" / "report.html").stat().st_size > 10_000
    _run(wheel / "outrider", "fuse", "r/run.mcap", "-o", "f", "-q", cwd=tmp_path)
    assert (tmp_path / "f" / "report.html").stat().st_size > 10_000


@pytest.mark.compiled
def test_kept_kernels_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("outrider._kernel._kept_in", lambda: tmp_path)
    none, of, size = kept_kernels()
    assert (none, size) == (0, 0) and of > 90
    source = PACKAGE / "core" / "angles.py"
    for kind, name in (("calls", stamp(source, _kernel._TOLD)), ("links", "another version")):
        (tmp_path / kind / name).mkdir(parents=True)
        (tmp_path / kind / name / "k.nbc").write_bytes(bytes(100))
    assert kept_kernels() == (1, of, 200)


def test_every_pin_suits_the_oldest_python_that_is_claimed() -> None:
    oldest = f"{tomllib.loads((ROOT / 'pyproject.toml').read_text())['project']['requires-python'].strip('>=')}.0"
    pins = dict(line.split("==") for line in (ROOT / "constraints.txt").read_text().splitlines())
    pinned = {canonicalize_name(name): version for name, version in pins.items()}
    as_pinned = [d for d in distributions() if pinned.get(canonicalize_name(d.name)) == d.version]
    assert len(as_pinned) > 100
    needs = {d.name: SpecifierSet(d.metadata.get("Requires-Python") or "") for d in as_pinned}
    assert [f"{name} {needed}" for name, needed in needs.items() if oldest not in needed] == []


def test_the_installation_is_looked_at(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["doctor", "--self"]) == ExitCode.OK
    told = capsys.readouterr().out
    assert "all that are needed" in told and all(line[:3].strip() and line[3] != " " for line in told.splitlines())
    taken = tmp_path / "file"
    taken.write_text("no folder")
    monkeypatch.setenv("OUTRIDER_CACHE", str(taken))
    assert main(["doctor", "--self", "--json"]) == ExitCode.FAILED_CHECK
    faults = [c for c in json.loads(capsys.readouterr().out)["checks"] if not c["ok"] and not c["optional"]]
    assert [c["what"] for c in faults] == ["compiled kernels"] and "OUTRIDER_CACHE" in faults[0]["fix"]
    assert main(["doctor"]) == ExitCode.USAGE
    assert "--self" in capsys.readouterr().err
