"""Progress on stderr: a bar on a terminal, a line every few seconds elsewhere, nothing when quiet."""

import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING, final

from outrider.cli.output import tell

if TYPE_CHECKING:
    from rich.progress import Progress as Bar
    from rich.progress import TaskID

EVERY_S = 3.0  # between two lines where there is no terminal


@final
class Progress:
    """Called with (what is being done, share done); a context that clears its bar when it ends."""

    def __init__(self, *, quiet: bool = False) -> None:
        self.quiet = quiet
        self._bar: Bar | None = None
        self._tasks: dict[str, TaskID] = {}
        self._said = time.monotonic()
        self._fault = ""  # why compiled kernels cannot be kept, once that has been said

    def __enter__(self) -> "Progress":
        if not self.quiet and sys.stderr is not None and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

            columns = (TextColumn("{task.description:<16}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None
        if error is None:
            self._notice_not_kept()

    def __call__(self, what: str, share: float) -> None:
        if what == "fusing" and share == 0.0:
            self._notice_compiling()
        if self._bar is not None:
            if what not in self._tasks:
                self._tasks[what] = self._bar.add_task(what, total=1.0)
            self._bar.update(self._tasks[what], completed=share)
        elif not self.quiet and time.monotonic() - self._said >= EVERY_S:
            self.say(f"{what} {share:.0%}")

    def say(self, text: str) -> None:
        """One line, above the bar if there is one."""
        if self.quiet:
            return
        self._said = time.monotonic()
        if self._bar is not None:
            self._bar.console.print(text, highlight=False)
        else:
            tell(f"outrider: {text}\n")

    def _notice_compiling(self) -> None:
        """Say so if the first use of the kernels is going to take its time."""
        from outrider import _kernel  # imports the compiler

        if _kernel.is_warm():
            return
        self._fault = _kernel.cache_fault()
        if self._fault:
            self.say(f"compiling kernels, which takes a minute in every run: {_not_kept(self._fault)}")
        else:
            self.say("compiling kernels, once: this takes a minute, later runs start at once")

    def _notice_not_kept(self) -> None:
        """Say so if the disk was full in the middle of it."""
        kernel = sys.modules.get("outrider._kernel")
        if not self._fault and kernel is not None and (fault := kernel.cache_fault(tried=True)):
            self.say(f"some kernels were compiled and will be again in the next run: {_not_kept(fault)}")


def _not_kept(fault: str) -> str:
    return f"they cannot be kept, {fault} (OUTRIDER_CACHE names another folder)"
