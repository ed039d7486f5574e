"""Errors a user can act on, and exit codes. Every message says what is wrong, where, and how to mend it."""

from enum import IntEnum


class ExitCode(IntEnum):
    """What a command returns to the shell."""

    OK = 0
    FAILED_CHECK = 1  # the work was done and the answer is "no": a threshold missed, a configured sensor never used
    USAGE = 2  # command line or configuration
    BAD_DATA = 3  # a log that cannot be read or holds nothing usable
    LINK_LOST = 4  # a live source went silent
    HUNG_UP = 129  # 128 + signal, as shells report it
    INTERRUPTED = 130
    UNREAD = 141  # nobody reads stdout any more
    TERMINATED = 143


class OutriderError(Exception):
    """One line: what, where, how to fix it.

    Attributes
    ----------
    what : str   the fault, in the words of the field
    where : str  file, line, topic, key or robot; may be empty
    fix : str    what the user can do; may be empty
    """

    exit_code: ExitCode = ExitCode.BAD_DATA

    def __init__(self, what: str, *, where: str = "", fix: str = "") -> None:
        self.what, self.where, self.fix = what, where, fix
        super().__init__(str(self))

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        remedy = f" ({self.fix})" if self.fix else ""
        return f"{place}{self.what}{remedy}"


class UsageError(OutriderError):
    """The command line asks for something impossible."""

    exit_code = ExitCode.USAGE


class ConfigError(OutriderError):
    """A configuration that contradicts itself, names something unknown or lacks something needed."""

    exit_code = ExitCode.USAGE


class DataError(OutriderError):
    """A log that cannot be read, or that holds nothing this job can use."""

    exit_code = ExitCode.BAD_DATA


class OutputExistsError(OutriderError):
    """The output is there already; nothing was overwritten."""

    exit_code = ExitCode.USAGE


class InterruptionError(OutriderError):
    """Ctrl-C stopped work that is kept: the message says how much, and where."""

    exit_code = ExitCode.INTERRUPTED
