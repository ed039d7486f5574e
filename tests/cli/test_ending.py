"""How a command ends when stdout, stderr, the disk or the user fails it: the code, one line, nothing half-written."""

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from outrider.cli import main
from outrider.cli.stop import Stopped, stoppable
from outrider.errors import ExitCode

FULL = Path("/dev/full")
COMMANDS = {"help": ["--help"], "fuse help": ["fuse", "--help"], "sources": ["sources", "{log}", "-q"],
            "json": ["sources", "{log}", "--json", "-q"], "schema": ["schema"], "version": ["--version"]}  # fmt: skip


def started(arguments: list[str], **streams: Any) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, "-m", "outrider", *arguments], text=True, **streams)


@pytest.mark.skipif(not FULL.exists(), reason="no /dev/full here")
@pytest.mark.parametrize("name", COMMANDS)
def test_a_full_stdout_is_one_line(recording: Path, name: str) -> None:
    with FULL.open("w") as out:
        run = started([a.format(log=recording) for a in COMMANDS[name]], stdout=out, stderr=subprocess.PIPE)
        err = run.communicate(timeout=120)[1]
    assert err == "outrider: stdout: cannot be written: no space left on device\n"
    assert run.returncode == ExitCode.USAGE


@pytest.mark.parametrize("name", COMMANDS)
def test_nobody_reads(recording: Path, name: str) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    run = started([a.format(log=recording) for a in COMMANDS[name]], stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    assert run.communicate(timeout=120)[1] == "" and run.returncode == ExitCode.UNREAD == 128 + signal.SIGPIPE


@pytest.mark.compiled
def test_a_result_survives_a_stdout_that_is_closed(recording: Path, tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    run = started(["fuse", str(recording), "-q", "--no-report", "-o", str(tmp_path / "run")], stdout=writing)
    os.close(writing)
    assert run.wait(timeout=300) == ExitCode.UNREAD
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["outcome"]["code"] == "ok"


def test_without_stderr_and_stdout(recording: Path) -> None:
    command = f"{sys.executable} -m outrider sources {recording} >&- 2>&-"
    assert subprocess.run(["sh", "-c", command], timeout=120).returncode == 0
    command = f"{sys.executable} -m outrider sources none.bag >&- 2>&-"
    assert subprocess.run(["sh", "-c", command], timeout=120).returncode == ExitCode.BAD_DATA


STOPPING = """
import os, signal, sys
from pathlib import Path
from outrider.cli import main
from outrider.io.runs import run_folder
import outrider.workflows.fuse_file as job

signal.signal(signal.SIGHUP, signal.SIG_DFL)  # whatever started these tests may ignore it, which is respected

def stop(source, output, *_, **__):
    with run_folder(output) as part:
        (part / "half").write_text("half")
        print(part.name.startswith("."), file=sys.stderr)
        os.kill(os.getpid(), signal.{name})
        os.kill(os.getpid(), signal.{name})  # `timeout` sends it twice

job.fuse_file = stop
sys.exit(main(["fuse", {log!r}, "-q", "-o", "run"]))
"""


@pytest.mark.parametrize(
    ("name", "word"), [("SIGTERM", "terminated"), ("SIGHUP", "hung up"), ("SIGINT", "interrupted")]
)
def test_a_signal_leaves_nothing_half_written(recording: Path, tmp_path: Path, name: str, word: str) -> None:
    code = STOPPING.format(name=name, log=str(recording))
    if name == "SIGINT":
        code = code.replace(f"        os.kill(os.getpid(), signal.{name})  #", "        #")
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 128 + getattr(signal, name) and done.stdout == ""
    assert done.stderr == f"True\noutrider: {word}, nothing was written\n"
    assert list(tmp_path.iterdir()) == []


def test_signals_are_as_before_afterwards() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(Stopped), stoppable():
        os.kill(os.getpid(), signal.SIGTERM)
        signal.pause()
    assert signal.getsignal(signal.SIGTERM) is before


def test_nohup_is_respected() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stoppable():
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_in_a_thread(capsys: pytest.CaptureFixture[str]) -> None:
    codes: list[int] = []
    thread = threading.Thread(target=lambda: codes.append(main(["--version"])))
    thread.start()
    thread.join()
    assert codes == [0]


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (MemoryError(), "not enough memory (--topic, --start and --end"),
        (OSError(28, "No space left on device"), ": no space left on device"),
        (PermissionError(13, "Permission denied", "somewhere"), "somewhere: permission denied"),
    ],
)
def test_what_the_machine_refuses(
    outrider: Any, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, words: str
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("outrider.workflows.fuse_file.fuse", fails)
    done = outrider("fuse", recording)
    assert done.code == ExitCode.USAGE and words in done.err and done.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
