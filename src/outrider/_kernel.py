"""Everything about the compiler: the only module that imports numba.

A *kernel* is a function of floats and contiguous float64/int64 arrays. It writes into arrays that the caller owns,
allocates nothing in a hot loop, and never receives a function as an argument: numba does not find such a function again
in its disk cache (numba issues 2956 and 6264), so models are chosen by integer code, see `outrider.models.dispatch`.

`NUMBA_DISABLE_JIT=1` runs every kernel as plain Python; the test-suite does so once, for shapes, bounds and coverage.

numba's own cache notices a change of the file that defines a function, not of the files whose functions it calls. What
is compiled from a file therefore lives in a folder named after the content of that file and of all that it imports from
us (`_sources`). Where the cache cannot be read or written, everything is compiled in memory, in every process anew.
"""

import os
import sys
import tempfile
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from functools import cached_property, update_wrapper
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import caching
from numba.core.event import TimingListener, install_listener

from outrider._sources import package_stamp, stamp

F = TypeVar("F", bound=Callable[..., object])

_TOLD = f"{sys.version_info[:3]} {numba.__version__}"
_CACHE_SIZE = 1 << 23  # bytes that one process's kernels need on the disk, about


def cache_directory() -> Path | None:
    """Where compiled kernels are kept: `$OUTRIDER_CACHE`, else the user's cache folder; None for a user without one."""
    chosen, usual = os.environ.get("OUTRIDER_CACHE"), os.environ.get("XDG_CACHE_HOME")
    with suppress(RuntimeError):  # no $HOME, and the system does not know the user either
        base = Path(chosen) if chosen else (Path(usual) if usual else Path.home() / ".cache") / "outrider"
        return base / "kernels"
    return None


def _kept_in() -> Path | None:
    """The folder in use: numba's own variable stands over ours."""
    told = str(numba.config.CACHE_DIR)  # type: ignore[attr-defined]
    return Path(told) if told else cache_directory()


def cache_fault(*, tried: bool = False) -> str:
    """Why compiled kernels cannot be kept, with the folder; empty if they can, or could so far (`tried`)."""
    if tried:
        return _Cache.fault
    folder = _kept_in()
    if folder is None:
        return "there is no home folder"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as f:
            f.write(bytes(_CACHE_SIZE))
            f.flush()
    except OSError as e:
        return f"{folder}: {(e.strerror or str(e)).lower()}"
    return ""


def enabled() -> bool:
    """Whether kernels are compiled (`NUMBA_DISABLE_JIT` is not set)."""
    return not bool(numba.config.DISABLE_JIT)  # type: ignore[attr-defined]


def is_warm() -> bool:
    """Whether an earlier run of these sources has left compiled kernels on the disk."""
    return not enabled() or ((mark := _mark()) is not None and mark.exists())


def _mark() -> Path | None:
    """An empty file that says so."""
    folder = _kept_in()
    return None if folder is None else folder / f"{package_stamp(_TOLD)}.warm"


class _Place(caching.CompileResultCacheImpl._locator_classes[0]):  # type: ignore[misc]
    """A folder that need not be writable: it may hold what somebody else has compiled."""

    def __init__(self, py_func: Any, py_file: str) -> None:
        super().__init__(py_func, py_file)
        self._stamp = stamp(Path(py_file), _TOLD)
        self._cache_path = str(Path(numba.config.CACHE_DIR) / self._stamp)  # type: ignore[attr-defined]

    def get_source_stamp(self) -> str:
        return self._stamp

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        return cls(py_func, py_file)


class _Entry(caching.CompileResultCacheImpl):
    _locator_classes = (_Place,)


class _Cache(caching.FunctionCache):
    """numba's cache, which a fault of the disk does not stop."""

    _impl_class = _Entry
    fault = ""  # the last one, of any function

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        with suppress(Exception):  # unreadable or damaged: compiled again
            return super().load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
            if (mark := _mark()) is not None:
                mark.touch()
        except OSError as e:
            _Cache.fault = f"{_kept_in()}: {(e.strerror or str(e)).lower()}"
        except Exception:  # a damaged index
            with suppress(OSError):
                self.flush()
                super().save_overload(sig, data)


@contextmanager
def compiling() -> Generator[Callable[[], float], None, None]:
    """Gives a function that tells how many seconds have gone into compiling since; loading is not counted."""
    with install_listener("numba:compile", TimingListener()) as timer:
        yield lambda: float(timer.duration) if timer.done else 0.0


def _compile(function: Callable[..., object], *, callable_from_python: bool, inline: bool = False) -> Any:
    """numba's dispatcher. The two kinds differ by a flag that numba's cache does not look at: two folders."""
    decorate: Any = numba.njit  # its stubs do not know the private options
    made = decorate(
        nogil=True,
        error_model="numpy",
        fastmath={"contract"},
        no_cfunc_wrapper=True,
        no_cpython_wrapper=not callable_from_python,
        _nrt=False,
        forceinline=inline,
    )(function)
    if (root := _kept_in()) is not None:
        told = numba.config.CACHE_DIR  # type: ignore[attr-defined]
        numba.config.CACHE_DIR = str(root / ("calls" if callable_from_python else "links"))  # type: ignore[attr-defined]
        try:
            made._cache = _Cache(function)  # what cache=True does, with ours instead of numba's
        finally:
            numba.config.CACHE_DIR = told  # type: ignore[attr-defined]
    return made


class Kernel:
    """A compiled function, seen from both sides.

    Other kernels link against a version without a Python entry, which compiles in two thirds of the time; the version
    that Python calls is compiled only if Python calls it.
    """

    def __init__(self, function: Callable[..., object], *, inline: bool) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self._linked = _compile(function, callable_from_python=False, inline=inline)

    @cached_property
    def _called(self) -> Any:
        return _compile(self.py_func, callable_from_python=True)

    @property
    def _numba_type_(self) -> Any:
        return numba.types.Dispatcher(self._linked)

    def __call__(self, *args: object) -> object:
        return self._called(*args)


def kernel(function: F) -> F:
    """Compile on first use, keep on disk.

    `contract` lets a*b+c be one instruction; nothing else is reordered. Without numba's runtime (`_nrt`) arrays are not
    reference-counted, which is two thirds of the cost of passing them, and a kernel that allocates does not compile.
    """
    return cast("F", Kernel(function, inline=False)) if enabled() else function


def inlined(function: F) -> F:
    """A kernel that is not called but copied into the kernels that use it.

    Every array costs its caller seven to nine words on the stack and the scratch of a filter a hundred: that is worth
    it for kernels used in one place and for short ones in hot loops, and only for them, since the copies are compiled.
    """
    return cast("F", Kernel(function, inline=True)) if enabled() else function
