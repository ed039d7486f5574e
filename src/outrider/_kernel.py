"""Everything about the compiler: the only module that imports numba.

A *kernel* is a function of floats and contiguous float64/int64 arrays. It writes into arrays that the caller owns,
allocates nothing in a hot loop, and never receives a function as an argument: numba does not find such a function again
in its disk cache (numba issues 2956 and 6264), so models are chosen by integer code, see `outrider.models.dispatch`.

`NUMBA_DISABLE_JIT=1` runs every kernel as plain Python; the test-suite does so once, for shapes, bounds and coverage.

numba's own cache notices a change of the file that defines a function, not of the files whose functions it calls. The
cache therefore lives in a folder named after the state of *all* our sources.
"""

import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])

_PACKAGE = Path(__file__).parent


def _sources_stamp() -> str:
    """A short name that changes whenever one of our source files does (name, size and modification time)."""
    digest = hashlib.blake2s(f"{sys.version_info[:3]} {numba.__version__}".encode(), digest_size=8)
    for layer in ("_kernel.py", "core", "models", "filters", "sim", "eval"):
        root = _PACKAGE / layer
        for path in sorted(root.rglob("*.py")) if root.is_dir() else [root]:
            stat = path.stat()
            digest.update(f"{path.relative_to(_PACKAGE)} {stat.st_size} {stat.st_mtime_ns};".encode())
    return digest.hexdigest()


def cache_directory() -> Path:
    """Where compiled kernels are kept: `$OUTRIDER_CACHE`, else the user's cache folder."""
    root = os.environ.get("OUTRIDER_CACHE")
    base = Path(root) if root else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "outrider"
    return base / "kernels" / _sources_stamp()


def enabled() -> bool:
    """Whether kernels are compiled (`NUMBA_DISABLE_JIT` is not set)."""
    return not bool(numba.config.DISABLE_JIT)  # type: ignore[attr-defined]


def is_warm() -> bool:
    """Whether an earlier run has left compiled kernels on the disk."""
    return not enabled() or any(cache_directory().rglob("*.nbc"))


if not os.environ.get("NUMBA_CACHE_DIR"):
    numba.config.CACHE_DIR = str(cache_directory())  # type: ignore[attr-defined]


def kernel(function: F) -> F:
    """Compile on first use, keep on disk.  `contract` lets a*b+c be one instruction; nothing else is reordered."""
    decorate = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, no_cfunc_wrapper=True, _nrt=False)
    return cast("F", decorate(function))
