"""`outrider fuse`: a log file in, a folder with the run out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import final

from outrider.data import EventLog, Finding, Run, Trajectory
from outrider.io.registry import read_log
from outrider.io.robots import of_robot
from outrider.io.runs import REPORT, ensure_free, run_folder, write_run
from outrider.workflows.config import FuseConfig
from outrider.workflows.fuse import fuse
from outrider.workflows.summary import summarise
from outrider.workflows.upstream import Translator

Progress = Callable[[str, float], None]
"""Called with (what is being done, share done)."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """Which part of a log to read, and how. topics : names or patterns, all by default;  start_s, end_s : seconds
    since the log's first event;  mapping : makes a CSV readable;  robot : which of several."""

    log: Path
    topics: Sequence[str] | None = None
    start_s: float | None = None
    end_s: float | None = None
    mapping: Path | None = None
    robot: str | None = None

    def read(self, robot: str = "robot", progress: Progress | None = None) -> EventLog:
        """Read the log; progress counts its bytes."""

        def of_bytes(done: int, total: int) -> None:
            if progress is not None:
                progress("reading", min(1.0, done / max(total, 1)))

        named = {} if self.robot is not None else {"robot": robot}  # names of several robots are those of the log
        log = read_log(
            self.log, **named, topics=self.topics, start_s=self.start_s, end_s=self.end_s, progress=of_bytes,
            mapping=self.mapping,
        )  # fmt: skip
        return of_robot(log, self.robot)


def fuse_file(
    source: Input,
    output: Path,
    config: FuseConfig | Translator | None = None,
    *,
    force: bool = False,
    report: bool = True,
    command: str = "",
    progress: Progress | None = None,
) -> Run:
    """Read, fuse and write a run's folder; the folder appears complete, or not at all.

    config : or what makes one for the log, and has a word on it
    command : what the report tells to type to get the run again

    Raises
    ------
    OutputExistsError   there is something at `output` (before any work is done)
    DataError           the log cannot be read, or nothing in it can be fused
    ConfigError         the configuration does not fit the log
    """
    config = config or FuseConfig()
    ensure_free(output, force=force)
    log = source.read(config.robot if isinstance(config, FuseConfig) else "robot", progress)
    told: tuple[Finding, ...] = ()
    if not isinstance(config, FuseConfig):
        translator, config = config, config(log)
        told = translator.findings
    if progress is not None:
        progress("fusing", 0.0)
    run = fuse(log, config, remarks=told, progress=progress)
    save(run, output, source, force=force, report=report, command=command, progress=progress)
    return run


def save(
    run: Run,
    output: Path,
    source: Input,
    *,
    force: bool = False,
    report: bool = True,
    reference: Trajectory | None = None,
    command: str = "",
    progress: Progress | None = None,
    also: Callable[[Path], None] | None = None,
) -> None:
    """Write a run's folder. reference : drawn in the report;  also : writes further files into the folder."""
    with run_folder(output, force=force) as part:
        if also is not None:
            also(part)
        if report:
            from outrider.plot import write_report  # imports matplotlib

            if progress is not None:
                progress("report", 0.0)
            write_report(run, part / REPORT, reference=reference, command=command)
        if progress is not None:
            progress("writing", 0.5)
        write_run(run, part, document(run, source))
        if progress is not None:
            progress("writing", 1.0)


def document(run: Run, source: Input) -> dict[str, object]:
    """The summary, with the part of the log that was read."""
    summary = summarise(run)
    chosen = {"topics": source.topics, "start_s": source.start_s, "end_s": source.end_s}
    chosen["robot"] = source.robot
    chosen["mapping"] = None if source.mapping is None else str(source.mapping)
    return {**summary, "log": {**summary["log"], "read": {k: v for k, v in chosen.items() if v is not None}}}
