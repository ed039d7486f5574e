"""What each finding rests on: from a finding back to the records that show it, as a small figure's worth of data."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Final

from outrider.data import EventLog, Finding, Run
from outrider.data.evidence import Evidence
from outrider.workflows.draft import Plan
from outrider.workflows.evidence import of_records, of_result
from outrider.workflows.evidence.case import Case

Show = Callable[[Case, Finding], Evidence | None]
SHOWN: Final[Mapping[str, Show]] = {
    "unit-g": of_records.forces,
    "no-gravity": of_records.forces,
    "unit-deg": of_records.rates,
    "unit-kmh": of_records.speeds,
    "turn-sense": of_records.turns,
    "mount-found": of_records.gravity,
    "mount-conflict": of_records.gravity,
    "clock-offset": of_records.lags,
    "stamps-backwards": of_records.stamps,
    "stamps-refused": of_records.stamps,
    "other-clock": of_records.stamps,
    "latency": of_records.latencies,
    "silence": of_records.pace,
    "silent": of_records.pace,
    "outage": of_records.outage,
    "wheel-scale": of_records.speeds,
    "heading-conflict": of_result.headings,
    "overconfident": of_result.scatter,
    "contradiction": of_result.two_places,
    "apart": of_result.two_places,
    "contradicted": of_result.disagreement,
    "jump": of_result.disagreement,
    "refused": of_result.disagreement,
    "faulted": of_result.disagreement,
    "never-used": of_result.disagreement,
    "reset": of_result.disagreement,
    "not-credible": of_result.position_deviation,
    "position-invalid": of_result.position_deviation,
    "diverged": of_result.position_deviation,
    "near-divergence": of_result.position_deviation,
    "heading-late": of_result.heading_deviation,
    "heading-unobservable": of_result.heading_deviation,
}


def with_evidence(found: Iterable[Finding], log: EventLog, chosen: Plan, run: Run) -> tuple[Finding, ...]:
    """The findings, each with what shows it where that can be drawn. log : as it was read."""
    case = Case(log=log, chosen=chosen, run=run)

    def shown(f: Finding) -> Finding:
        show = SHOWN.get(f.code)
        if f.evidence is not None or show is None:
            return f
        return replace(f, evidence=show(case, f))

    return tuple(shown(f) for f in found)


__all__ = ["with_evidence"]
