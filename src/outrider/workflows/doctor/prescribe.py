"""From what was found to a configuration, for the job itself and as a file to start from."""

from outrider.data import EventLog, Finding
from outrider.io.config import merged, yaml_text
from outrider.workflows.config import FuseConfig
from outrider.workflows.doctor.examine import examine


def prescribed(log: EventLog, cfg: FuseConfig) -> tuple[FuseConfig, tuple[Finding, ...]]:
    """The configuration with what the log itself tells of all that it leaves open, and what was found.

    Nothing is prescribed with `diagnose: false`, nor for a preset, which stands for somebody else's choice.
    """
    if not cfg.diagnose or cfg.preset != "default":
        return cfg, ()
    found = examine(log, cfg)
    if not found.prescribed:
        return cfg, found.findings
    given = cfg.model_dump(exclude_unset=True)
    return FuseConfig.model_validate(merged(found.prescribed, given)), found.findings


def starter(cfg: FuseConfig, findings: tuple[Finding, ...]) -> str:
    """A configuration file: what is set, and as comments what was found and is not mended by it."""
    told = cfg.model_dump(mode="json", exclude_unset=True)
    harm = [f for f in findings if f.severity != "info"]
    lines = [f"# {f.severity}: {f.text}" + (f"\n#     {f.fix}" if f.fix else "") for f in harm]
    body = yaml_text(told) if told else "# nothing has to be configured"
    return "\n".join([*lines, body]).rstrip() + "\n"
