"""Folders with one log per robot: each log under the name of its file."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from outrider.data import EventLog, Stream
from outrider.errors import DataError
from outrider.io.files import Progress, as_text, assemble, is_directory
from outrider.typing import Floats

QUIET = (".md", ".txt", ".yaml", ".yml", ".json", ".toml", ".png", ".jpg", ".html", ".pdf", "")  # may lie beside logs


def logs_in(folder: Path) -> dict[str, Path]:
    """Logs that stand directly in a folder, by robot: the file's name without its ending, where that is unique."""
    from outrider.io.registry import detect

    found: list[Path] = []
    for path in sorted(p for p in folder.iterdir() if not p.name.startswith(".")):
        try:
            kind = detect(path, teams=False)
        except DataError:
            continue
        if kind not in ("csv", "arrays"):  # which need a mapping each
            found.append(path)
    names = Counter(p.name.partition(".")[0] for p in found)
    return {n if names[n := p.name.partition(".")[0]] == 1 else p.name: p for p in found}


def read_team(
    path: Path,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Read all logs of a folder. Streams are `<robot>/<stream>`, frames `<robot>/<frame>`; `robot` is not used.

    start_s, end_s : seconds since the first event of each log, whose clocks may differ
    """
    from outrider.io.registry import read_log

    del robot
    logs = logs_in(path)
    streams: list[Stream] = []
    notes: list[str] = []
    mounts: dict[str, Floats] = {}
    for done, (who, file) in enumerate(logs.items()):
        if progress is not None:
            progress(done, len(logs))
        try:
            log = read_log(file, start_s=start_s, end_s=end_s)
        except DataError as e:
            notes.append(f"{who} could not be read: {e}")
            continue
        streams += [_named(who, s, len({o.robot for o in log}) > 1) for s in log]
        notes += [f"{who}: {n}" for n in log.notes]
        mounts |= {f"{who}/{frame}": T for frame, T in log.mounts.items()}
    other = [as_text(p.name) for p in sorted(path.iterdir()) if p not in logs.values() and _notable(p)]
    if other:
        notes.append(f"no logs, or logs that need a mapping: {', '.join(other[:6])}{', ...' if len(other) > 6 else ''}")
    return replace(assemble(path, streams, notes=notes, topics=topics), mounts=mounts)


def _named(who: str, s: Stream, several: bool) -> Stream:
    frame = f"{who}/{s.frame}" if s.frame else ""
    return replace(s, name=f"{who}/{s.name.strip('/')}", frame=frame, robot=f"{who}-{s.robot}" if several else who)


def _notable(path: Path) -> bool:
    return not path.name.startswith(".") and not is_directory(path) and path.suffix.lower() not in QUIET
