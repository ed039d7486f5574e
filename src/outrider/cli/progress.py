"""Progress on stderr: a bar on a terminal, a line every few seconds elsewhere, nothing when quiet."""

import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING, final

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

    def __enter__(self) -> "Progress":
        if not self.quiet and sys.stderr.isatty():
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
            sys.stderr.write(f"outrider: {text}\n")

    def _notice_compiling(self) -> None:
        """Say so if the first use of the kernels is going to take its time."""
        from outrider import _kernel  # imports the compiler

        if not _kernel.is_warm():
            self.say("compiling kernels, once: this takes a minute, later runs start at once")
