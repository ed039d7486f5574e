"""The command line: parse, call a workflow, print. Heavy imports happen inside the commands, after parsing."""

import sys
from collections.abc import Sequence
from errno import EDQUOT, EFBIG, ENOSPC

from outrider.cli.output import Unwritten, tell, watched_stdout
from outrider.cli.stop import Stopped, stoppable
from outrider.errors import ExitCode, OutriderError

FULL = (ENOSPC, EDQUOT, EFBIG)
STOPPED = {
    ExitCode.INTERRUPTED: "interrupted",
    ExitCode.TERMINATED: "terminated",
    ExitCode.HUNG_UP: "hung up",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code. A failure is one line on stderr; `--debug` shows where it came from."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with stoppable(), watched_stdout():
            code = _run(arguments or ["--help"])
    except OutriderError as e:
        return _fail(str(e), e.exit_code, arguments)
    except Unwritten as e:
        return ExitCode.UNREAD if e.quiet else _fail(f"stdout: cannot be written: {e}", ExitCode.USAGE, arguments)
    except Stopped as e:
        code = e.code
    except KeyboardInterrupt:
        code = ExitCode.INTERRUPTED
    except MemoryError:
        return _fail("not enough memory (--topic, --start and --end read less of a log)", ExitCode.USAGE, arguments)
    except Exception as e:
        if isinstance(e, OSError) and (e.filename or e.errno in FULL):  # not ours to foresee
            from tempfile import gettempdir

            where = e.filename or f"temporary files in {gettempdir()}"
            return _fail(f"{where}: {(e.strerror or str(e)).lower()}", ExitCode.USAGE, arguments)
        if callable(worded := getattr(e, "format_message", None)):  # the parser's own complaints
            return _fail(_with_remedy(str(worded())), ExitCode.USAGE, arguments)
        what = " ".join(f"{type(e).__name__}: {e}".split())
        return _fail(f"internal error, {what} (rerun with --debug and report it)", ExitCode.FAILED_CHECK, arguments)
    if code in STOPPED:  # the parser answers Ctrl-C with the code
        return _fail(f"{STOPPED[ExitCode(code)]}, nothing was written", ExitCode(code), ())
    return code


def _run(arguments: list[str]) -> int:
    from typer.main import get_command

    from outrider.cli.app import app

    command, name = get_command(app), "outrider"
    if arguments[1:] == ["--help"] and (one := getattr(command, "commands", {}).get(arguments[0])) is not None:
        # asked directly, the parser need not load what checks values: half of the time
        command, name, arguments = one, f"{name} {arguments[0]}", arguments[1:]
    return int(command(arguments, prog_name=name, standalone_mode=False) or 0)


def _fail(text: str, code: ExitCode, arguments: Sequence[str]) -> int:
    if "--debug" in arguments:
        import traceback

        tell(traceback.format_exc())
    tell(f"outrider: {_one_line(text)}\n")
    return int(code)


def _with_remedy(complaint: str) -> str:
    text = " ".join(complaint.split()).rstrip(".")
    return text if text.endswith(")") else f"{text} (--help tells what there is)"


def _one_line(text: str) -> str:
    """Whatever a file name holds: no line break, nothing that a terminal obeys."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode() for c in text)
