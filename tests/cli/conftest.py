"""A small recording of a simulated robot, written once; and the command line called in this process."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from small import small_patrol

from outrider.cli import main
from outrider.data import EventLog
from outrider.io.record import write_recording


@dataclass(frozen=True)
class Done:
    """What a command left behind."""

    code: int
    out: str
    err: str


Outrider = Callable[..., Done]


@pytest.fixture(scope="session")
def small_log() -> EventLog:
    """The log in `recording`."""
    return small_patrol()


@pytest.fixture(scope="session")
def recording(small_log: EventLog, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same as a ROS 2 recording. Never written to."""
    path = tmp_path_factory.mktemp("recording") / "patrol.mcap"
    write_recording(small_log, path)
    return path


@pytest.fixture
def outrider(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Outrider:
    """Run a command in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("outrider._kernel.is_warm", lambda: True)  # else a first run tells that it compiles
    monkeypatch.setattr("outrider.cli.progress.EVERY_S", float("inf"))

    def run(*arguments: object) -> Done:
        capsys.readouterr()
        code = main([str(a) for a in arguments])
        captured = capsys.readouterr()
        return Done(code, captured.out, captured.err)

    return run
