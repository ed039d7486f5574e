"""Trials for the tests: importable by the processes that run them."""

import os
import signal
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

CALLS: list[int] = []


def drift(params: Mapping[str, Any], seed: int) -> dict[str, object]:
    """Numbers and a row of numbers, all from the seed."""
    CALLS.append(seed)
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(7,)))
    walk = rng.normal(0.0, params["sigma"], 50).cumsum()
    time.sleep(params.get("sleep_s", 0.0))
    return {"end": walk[-1], "rms": float(np.sqrt(np.mean(walk**2))), "steps": 50, "walk": walk[::10]}


def fragile(params: Mapping[str, Any], seed: int) -> dict[str, float]:
    """Fails as it is told to."""
    if seed in params["bad"]:
        return {"how": [][seed]} if params["how"] == "raise" else params["returns"]
    return {"value": float(seed), "odd": float("nan" if seed % 2 else "inf")}


def deadly(params: Mapping[str, Any], seed: int) -> dict[str, float]:
    """Some seeds end their process: always, or only the first time."""
    time.sleep(0.02)
    if seed in params.get("always", ()):
        os.kill(os.getpid(), signal.SIGKILL)
    if seed in params.get("once", ()):
        mark = Path(params["marks"]) / str(seed)
        if not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
    return {"value": seed * 0.1}


def environment(params: Mapping[str, Any], seed: int) -> dict[str, float]:
    """How the process is set up."""
    return {"threads": float(os.environ.get("OMP_NUM_THREADS", "nan")), "pid": float(os.getpid())}


def clock(params: Mapping[str, Any], seed: int) -> dict[str, float]:
    """When it ran, by the clock of all processes. From seed 1 on it waits for a second one to run beside it."""
    begun = time.monotonic()
    (Path(params["marks"]) / f"begun{seed}").touch()
    time.sleep(0.3 if seed == 0 else 0.0)
    while seed and time.monotonic() < begun + 30 and len(list(Path(params["marks"]).glob("begun[1-9]"))) < 2:
        time.sleep(0.01)
    return {"begun": begun, "ended": time.monotonic()}
