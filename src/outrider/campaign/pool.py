"""Where trials run: in this process, or in several that share nothing but the cache of compiled kernels.

A process that dies takes no result with it. Which trial killed it cannot be known, so all that were under way run
again, one at a time; one that ends its process again when alone is the culprit and becomes a row that says so.
"""

import importlib
import math
import os
import signal
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import reduce
from multiprocessing import connection, get_context, parent_process
from pathlib import Path
from typing import Any, TypeAlias, cast

import numpy as np

Record: TypeAlias = dict[str, Any]
Task: TypeAlias = tuple[int, int, dict[str, object]]
"""Index of the case, seed, parameters of the case."""

DIED = "the process that ran it died, twice"
KILLED = "the workers that ran it died, one after the other"
LOST = (DIED, KILLED)  # no fault of the trial: it runs again when a campaign is gone on with
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def attempt(trial: Callable[..., Any] | str, task: Task) -> Record:
    """Run one trial, given as a function or by its name; whatever it raises is part of its row."""
    case, seed, params = task
    begun = time.perf_counter()
    values: Record = {}
    error = ""
    try:
        function = find(trial) if isinstance(trial, str) else trial
        values = _plain(function(dict(params), seed))
    except (Exception, SystemExit) as e:
        frame = traceback.extract_tb(e.__traceback__)[-1]
        error = f"{type(e).__name__}: {' '.join(str(e).split())} ({Path(frame.filename).name}:{frame.lineno})"
    return {"case": case, "seed": seed, "values": values, "error": error, "wall_s": time.perf_counter() - begun}


def here(trial: Callable[..., Any], tasks: Sequence[Task]) -> Generator[Record, None, None]:
    """The rows of trials run one after the other in this process."""
    for task in tasks:
        yield attempt(trial, task)


def in_processes(name: str, tasks: Sequence[Task], workers: int, *, first_alone: bool) -> Generator[Record, None, None]:
    """The rows of trials in the order in which they end; `name` is "module:function".

    first_alone : let the first trial fill the cache of compiled kernels before the others begin
    """
    todo, suspects = deque(tasks), deque[Task]()
    while todo or suspects:
        if suspects:
            lost = yield from _drain(name, suspects, 1, width=1)
            for case, seed, _ in lost:
                yield {"case": case, "seed": seed, "values": {}, "error": DIED, "wall_s": math.nan}
        else:
            lost = yield from _drain(name, todo, workers, width=2 * workers, first_alone=first_alone)
            suspects.extend(lost)
            first_alone = False


def _drain(
    name: str, queue: deque[Task], workers: int, *, width: int, first_alone: bool = False
) -> Generator[Record, None, list[Task]]:
    """Run what is queued with at most `width` tasks handed out; returns those under way when a process died."""
    out: dict[Future[Record], Task] = {}
    with _pool(workers) as pool:
        while queue or out:
            limit = 1 if first_alone else width
            try:
                while queue and len(out) < limit:
                    out[pool.submit(attempt, name, queue[0])] = queue[0]
                    queue.popleft()
            except BrokenProcessPool:  # told by the futures, too
                if not out:
                    return [queue.popleft()]
            ended, _ = wait(out, return_when=FIRST_COMPLETED)
            lost = [out[f] for f in ended if isinstance(f.exception(), BrokenProcessPool)]
            for future in ended:
                if out.pop(future) not in lost:
                    yield future.result()
                    first_alone = False
            if lost:
                # A pool that breaks ends all its futures; some may have finished just before.
                wait(out)
                for future, task in out.items():
                    if future.exception() is None:
                        yield future.result()
                    else:
                        lost.append(task)
                return sorted(lost, key=lambda task: task[:2])
    return []


@contextmanager
def _pool(workers: int) -> Generator[ProcessPoolExecutor, None, None]:
    """Fresh processes with one thread each; leaving in haste (Ctrl-C) ends them without waiting."""
    with _one_thread():
        pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_begin)
        try:
            yield pool
        except BaseException:
            for process in list((getattr(pool, "_processes", None) or {}).values()):
                process.kill()
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        pool.shutdown(cancel_futures=True)


@contextmanager
def _one_thread() -> Generator[None, None, None]:
    """Processes begun inside compute with one thread each: they are many, and sums have one order."""
    kept = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in kept.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _begin() -> None:
    """In a new process: Ctrl-C is for the parent to handle, and a parent that was killed is followed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent.sentinel,), daemon=True).start()


def _follow(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)


def find(name: str) -> Callable[..., Any]:
    """The function called "module:function"."""
    module, _, path = name.partition(":")
    return cast("Callable[..., Any]", reduce(getattr, path.split("."), cast("Any", importlib.import_module(module))))


def _plain(returned: object) -> Record:
    """What a trial returned as floats and lists of floats, in its order."""
    if not isinstance(returned, Mapping):
        raise TypeError(f"a trial returns names and numbers, not {type(returned).__name__}")
    out: Record = {}
    for name, value in cast("Mapping[object, Any]", returned).items():
        array = np.asarray(value)
        if array.dtype.kind not in "bifu" or array.ndim > 1:
            raise TypeError(f"'{name}' is neither a number nor a row of numbers")
        out[str(name)] = array.astype(np.float64).tolist()
    return out
