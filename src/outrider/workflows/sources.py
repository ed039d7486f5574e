"""`outrider sources`: what a log holds, and what each part would be used for."""

from dataclasses import dataclass
from math import isfinite
from typing import Any, final

from outrider.data import EventLog, Stream
from outrider.errors import DataError
from outrider.workflows.config import FuseConfig
from outrider.workflows.discover import plan

SCHEMA = "outrider.sources/1"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Listing:
    """Streams of a log with their roles. complaint : why nothing could be fused, if so."""

    log: EventLog
    roles: dict[str, str]
    complaint: str = ""

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        first, last = self.log.span
        return {
            "schema": SCHEMA,
            "log": {"path": self.log.path, "sha256": self.log.sha256, "start_ns": first, "end_ns": last},
            "sources": [self._row(s) for s in self.log],
            "mounts": sorted(self.log.mounts),
            "notes": list(self.log.notes),
            "complaint": self.complaint,
        }

    def _row(self, s: Stream) -> dict[str, Any]:
        return {
            "name": s.name,
            "kind": s.kind.value,
            "records": len(s),
            "malformed": s.malformed,
            "rate_hz": s.rate if isfinite(s.rate) else None,
            "frame": s.frame,
            "mount": "in the log" if s.frame in self.log.mounts else "",
            "used_for": self.roles.get(s.name, ""),
        }


def list_sources(log: EventLog, config: FuseConfig | None = None) -> Listing:
    """What `fuse` would do with each stream of a log; nothing is fused."""
    try:
        return Listing(log=log, roles=dict(plan(log, config or FuseConfig()).roles))
    except DataError as e:
        return Listing(log=log, roles={}, complaint=str(e))
