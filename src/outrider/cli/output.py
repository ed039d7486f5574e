"""stdout that tells its own faults from those of other files, and stderr that has none."""

import os
import sys
from collections.abc import Generator
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from typing import Any, TextIO, cast, final


@final
class Unwritten(Exception):  # noqa: N818 - not always a fault
    """stdout cannot be written. No `OSError`, which the libraries that print would answer in their own ways.

    quiet : nobody reads it any more, which is no fault
    """

    def __init__(self, fault: OSError) -> None:
        self.quiet = isinstance(fault, BrokenPipeError)
        super().__init__((fault.strerror or str(fault)).lower())


@final
class _Watched:
    """A stream whose faults are `Unwritten`."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with _told():
            return self._stream.write(text)

    def flush(self) -> None:
        with _told():
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def tell(text: str) -> None:
    """Text on stderr; that nobody listens is no reason to end."""
    if sys.stderr is not None:  # closed by the shell
        with suppress(OSError):
            sys.stderr.write(text)


@contextmanager
def watched_stdout() -> Generator[None, None, None]:
    """Raise `Unwritten` in the block, at its end at the latest, if stdout cannot be written; it is then silenced."""
    stream = sys.stdout
    if stream is None:  # closed by the shell: Python prints nowhere
        yield
        return
    if isinstance(stream, TextIOWrapper):
        stream.reconfigure(errors="backslashreplace")  # file names may hold what no encoding has
    sys.stdout = cast("TextIO", _Watched(stream))
    try:
        yield
        sys.stdout.flush()
    except Unwritten:
        with suppress(OSError, ValueError):  # Python would flush it once more at the end; or it is no real file
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        raise
    finally:
        sys.stdout = stream


@contextmanager
def _told() -> Generator[None, None, None]:
    try:
        yield
    except OSError as e:
        raise Unwritten(e) from None
