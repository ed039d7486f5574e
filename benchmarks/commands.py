"""What a user waits for: commands in processes of their own, cold (nothing compiled) and warm."""

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np

REPETITIONS = 5
COLD = ("outrider demo", "cold: kernels are compiled", ("demo", "-o", "{folder}/d", "-q"))
WARM = (
    ("outrider --help", "", ("--help",)),
    ("outrider --version", "", ("--version",)),
    ("outrider run --list", "", ("run", "--list")),
    ("outrider demo", "simulates, fuses and scores 319 s", ("demo", "-o", "{folder}/{k}", "-q")),
    (
        "outrider fuse",
        "of that recording, with its report",
        ("fuse", "{folder}/0/patrol.mcap", "-o", "{folder}/f{k}", "-q"),
    ),
    ("outrider doctor", "of that recording", ("doctor", "{folder}/0/patrol.mcap", "-q")),
)


PROGRAM = """
import sys
from pathlib import Path
from outrider.cli import main
peak = Path(sys.argv.pop(1))
code = main(sys.argv[1:])
status = Path("/proc/self/status").read_text(encoding="ascii")
peak.write_text(str(next(int(x.split()[1]) for x in status.splitlines() if x.startswith("VmHWM")) / 1024))
sys.exit(code)
"""


@final
@dataclass(frozen=True)
class Waited:
    """Wall time [s], median and least, and the most memory that the process took [MB]."""

    command: str
    note: str
    median: float
    least: float
    peak: float


def peak_mb() -> float:
    """Of this process so far. `getrusage` would count what its parent had when it began."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return next(float(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM")) / 1024.0


def commands() -> list[Waited]:
    """Every row; the cold one first, into a cache of its own."""
    with tempfile.TemporaryDirectory() as folder:
        cold = {**os.environ, "OUTRIDER_CACHE": f"{folder}/cache"}
        name, note, words = COLD
        out = [_waited(name, note, [_once(words, folder, 0, cold)])]
        out += [
            _waited(name, note, [_once(words, folder, k, dict(os.environ)) for k in range(REPETITIONS)])
            for name, note, words in WARM
        ]
    return out


def _once(words: tuple[str, ...], folder: str, k: int, environment: dict[str, str]) -> tuple[float, float]:
    told = [w.format(folder=folder, k=k) for w in words]
    begun = time.monotonic()
    peak = Path(folder) / "peak"
    subprocess.run(
        [sys.executable, "-c", PROGRAM, str(peak), *told], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        env=environment, cwd=Path(folder), check=True,
    )  # fmt: skip
    return time.monotonic() - begun, float(peak.read_text(encoding="ascii"))


def _waited(name: str, note: str, runs: list[tuple[float, float]]) -> Waited:
    walls = [wall for wall, _ in runs]
    return Waited(name, note, float(np.median(walls)), min(walls), max(mb for _, mb in runs))
