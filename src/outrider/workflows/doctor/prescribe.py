"""From what was found to a configuration, for the job itself and as a file to start from."""

from collections.abc import Mapping
from typing import Any

from outrider.data import EventLog, Finding
from outrider.io.config import merged, yaml_text
from outrider.workflows.config import FuseConfig
from outrider.workflows.doctor.examine import examine
from outrider.workflows.doctor.receiver import receiver_clock, told


def prescribed(log: EventLog, cfg: FuseConfig) -> tuple[FuseConfig, tuple[Finding, ...]]:
    """The configuration with what the log itself tells of all that it leaves open, and what was found.

    Nothing is prescribed with `diagnose: false`, nor for a preset, which stands for somebody else's choice.
    """
    if not cfg.diagnose or cfg.preset != "default":
        return cfg, ()
    found = examine(log, cfg)
    better = with_more(cfg, found.prescribed)
    late = receiver_clock(log, better)
    if late is None:
        return better, found.findings
    delays = {"sources": {name: {"delay_s": round(late.delay, 3)} for name in late.streams}}
    return with_more(better, delays), (*found.findings, told(late))


def with_more(cfg: FuseConfig, more: Mapping[str, Any]) -> FuseConfig:
    """The configuration with what it leaves open."""
    return FuseConfig.model_validate(merged(more, cfg.model_dump(exclude_unset=True))) if more else cfg


def starter(cfg: FuseConfig, findings: tuple[Finding, ...]) -> str:
    """A configuration file: what is set, and as comments what was found and is not mended by it."""
    said = cfg.model_dump(mode="json", exclude_unset=True)
    harm = [f for f in findings if f.severity != "info"]
    lines = [f"# {f.severity}: {f.text}" + (f"\n#     {f.fix}" if f.fix else "") for f in harm]
    body = yaml_text(said) if said else "# nothing has to be configured"
    return "\n".join([*lines, body]).rstrip() + "\n"
