"""SIGTERM and SIGHUP end a command as Ctrl-C does: what it was writing is removed before it goes."""

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType
from typing import final

from outrider.errors import ExitCode

SIGNALS = {"SIGTERM": ExitCode.TERMINATED, "SIGHUP": ExitCode.HUNG_UP}  # not every system has both


@final
class Stopped(BaseException):
    """Somebody asked this process to end. No `Exception`, so that nothing on the way takes it for a fault."""

    def __init__(self, code: ExitCode) -> None:
        self.code = code
        super().__init__(code)


@contextmanager
def stoppable() -> Generator[None, None, None]:
    """Raise `Stopped` in the block on the first of these signals; later ones do not disturb the tidying up.

    A signal that is ignored stays so (`nohup`).
    """
    if threading.current_thread() is not threading.main_thread():  # Python hands signals to no other
        yield
        return
    numbers = {getattr(signal, name): code for name, code in SIGNALS.items() if hasattr(signal, name)}
    before = {n: signal.getsignal(n) for n in numbers}
    mine = [n for n, handler in before.items() if handler is signal.SIG_DFL]

    def stop(number: int, _: FrameType | None) -> None:
        for n in mine:
            signal.signal(n, signal.SIG_IGN)
        raise Stopped(numbers[number])

    try:
        for n in mine:
            signal.signal(n, stop)
        yield
    finally:
        for n in mine:
            signal.signal(n, before[n])
