"""The command line: parse, call a workflow, print. Heavy imports happen inside the commands, after parsing."""

import sys
from collections.abc import Sequence

from outrider.errors import ExitCode, OutriderError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code. A failure is one line on stderr; `--debug` shows where it came from."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    from outrider.cli.app import app

    try:
        code = app(arguments or ["--help"], prog_name="outrider", standalone_mode=False)
    except OutriderError as e:
        return _fail(str(e), e.exit_code, arguments)
    except KeyboardInterrupt:
        code = ExitCode.INTERRUPTED
    except Exception as e:
        if callable(worded := getattr(e, "format_message", None)):  # the parser's own complaints
            return _fail(str(worded()).rstrip("."), ExitCode.USAGE, arguments)
        what = " ".join(f"{type(e).__name__}: {e}".split())
        return _fail(f"internal error, {what} (rerun with --debug and report it)", ExitCode.FAILED_CHECK, arguments)
    if code == ExitCode.INTERRUPTED:
        return _fail("interrupted, nothing was written", ExitCode.INTERRUPTED, ())
    return int(code or 0)


def _fail(text: str, code: ExitCode, arguments: Sequence[str]) -> int:
    if "--debug" in arguments:
        import traceback

        traceback.print_exc()
    sys.stderr.write(f"outrider: {text}\n")
    return int(code)
