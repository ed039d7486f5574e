"""Trials on the workers of a Dask cluster (optional extra `dask`): the same rows, to the last bit, as in processes.

A worker that dies loses the trials that it ran, waited to run or had not handed over: the scheduler gives them to
another. One that was there at more deaths than the scheduler allows need not be their cause: it runs again when nothing
else does, and only then is that its error. A worker runs one trial at a time, however many threads it has: kernels
share scratch.
"""

import logging
import math
import threading
from collections.abc import Generator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, cast

from outrider.campaign.pool import KILLED, Record, Task, attempt
from outrider.errors import ConfigError, UsageError

if TYPE_CHECKING:
    from distributed import Client

PATIENCE: Final = 10.0  # s for a scheduler to answer
AHEAD: Final = 4  # trials handed out per thread of the cluster
_ALONE = threading.Lock()


def in_cluster(
    name: str, tasks: Sequence[Task], address: str, code: Mapping[str, str]
) -> Generator[Record, None, None]:
    """The rows of trials in the order in which they end; `name` is "module:function".

    code : of this process, which the workers' must equal. Raises UsageError for a scheduler that does not answer or has
    no workers or is lost on the way, ConfigError for workers with another version.
    """
    for part in ("client", "utils"):  # print tracebacks of their own when a scheduler goes away
        logging.getLogger(f"distributed.{part}").setLevel(logging.CRITICAL + 1)
    with _client(address) as client:
        _require_same(client, name, code)
        yield from _drained(client, name, tasks)


def _client(address: str) -> "Client":
    try:
        from distributed import Client
    except ImportError:
        fix = "pip install 'outrider[dask]'"
        raise UsageError("needs Dask, which is not installed", where="--scheduler", fix=fix) from None
    try:
        return Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as e:
        why = " ".join(str(e).split()) or "no answer"
        fix = "is it running, and can it be reached from here? tcp://HOST:8786"
        raise UsageError(f"no scheduler answers: {why[:120]}", where=f"--scheduler {address}", fix=fix) from None


def _require_same(client: "Client", name: str, code: Mapping[str, str]) -> None:
    from outrider.campaign.trials import code_of

    told = cast("dict[str, Any]", client.run(code_of, name, on_error="return"))
    if not told:
        raise UsageError("the scheduler has no workers", where="--scheduler", fix="dask worker ADDRESS")
    for worker, theirs in told.items():
        if theirs != code:
            what = f"worker {worker} has {theirs['outrider'] if isinstance(theirs, dict) else theirs}"
            raise ConfigError(what, where="--scheduler", fix=f"install outrider {code['outrider']} there")


def _drained(client: "Client", name: str, tasks: Sequence[Task]) -> Generator[Record, None, None]:
    threads = cast("dict[str, int]", client.nthreads())
    suspects: list[Task] = []
    for task, row in _ended(client, name, tasks, AHEAD * max(sum(threads.values()), 1)):
        if row["error"] == KILLED:
            suspects.append(task)
        else:
            yield row
    for _, row in _ended(client, name, suspects, 1):
        yield row


def _ended(
    client: "Client", name: str, tasks: Sequence[Task], width: int
) -> Generator[tuple[Task, Record], None, None]:
    """Tasks and their rows as they end, with at most `width` handed out."""
    from distributed import as_completed

    todo = iter(tasks)
    handed: dict[object, Task] = {}

    def submitted() -> Any:
        task = next(todo, None)
        if task is None:
            return None
        future = client.submit(run_alone, name, task, pure=False)
        handed[future.key] = task
        return future

    first = [f for f in (submitted() for _ in range(width)) if f is not None]
    ended = as_completed(first, loop=client.loop)
    for future in ended:
        task = handed.pop(future.key)
        yield task, _row(future, task)
        another = submitted()
        if another is not None:
            ended.add(another)


def _row(future: Any, task: Task) -> Record:
    case, seed, _ = task
    from distributed.client import FutureCancelledError

    try:
        return future.result()  # also raises where a worker died after the trial, before it handed its row over
    except FutureCancelledError:  # nobody cancels here: the connection was lost, for longer than Dask waits
        raise UsageError(
            "the scheduler is gone", where="--scheduler", fix="what has ended is kept: go on with --resume"
        ) from None
    except Exception as e:
        return {"case": case, "seed": seed, "values": {}, "error": _said(e), "wall_s": math.nan}


def run_alone(name: str, task: Task) -> Record:
    """A trial, while no other runs in this process."""
    with _ALONE:
        return attempt(name, task)


def _said(error: BaseException) -> str:
    return KILLED if type(error).__name__ == "KilledWorker" else f"{type(error).__name__}: {error}"
