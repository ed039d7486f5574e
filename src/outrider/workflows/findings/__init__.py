"""What the run says about the data: plain statements, each with a cause and a remedy.

One function per question; each looks at a finished run, the plan and the alignment it came from, and returns findings.
"""

from collections.abc import Iterable
from typing import Final

from outrider.data import Finding, Run
from outrider.filters.align import Alignment
from outrider.workflows.draft import Plan
from outrider.workflows.findings.agreement import confidence, heading_conflicts, outages, refusals, silence
from outrider.workflows.findings.contradiction import contradictions, fair
from outrider.workflows.findings.credibility import credible, silences
from outrider.workflows.findings.records import clocks, gravity_and_mounts, unit_of_force, unit_of_rates, unstated_noise
from outrider.workflows.findings.result import alignment, divergence, preset, reliance, resets, wheel_scale
from outrider.workflows.findings.stretches import jumps

QUESTIONS: Final = (
    credible, contradictions, silences, alignment, reliance, preset, heading_conflicts, gravity_and_mounts,
    unit_of_force, unit_of_rates, silence, jumps, outages, confidence, wheel_scale, resets, refusals,
    unstated_noise, clocks, divergence,
)  # fmt: skip
ORDER: Final = {"error": 0, "warning": 1, "info": 2}
HARM: Final = (  # what spoils most of an estimate first; what is not listed stands behind
    "diverged", "contradiction", "not-credible", "never-used", "input-missing", "other-clock", "mount-conflict",
    "unit-deg", "unit-g", "unit-kmh", "turn-sense", "range-scale", "mount-found", "heading-unobservable",
    "contradicted", "apart", "clock-offset", "heading-conflict", "near-divergence", "no-gravity", "reset", "faulted",
    "silent", "silence", "position-invalid", "overconfident", "jump", "refused", "stamps-refused", "stamps-backwards",
)  # fmt: skip


def judge(run: Run, chosen: Plan, aligned: Alignment) -> tuple[Finding, ...]:
    """All findings, worst first."""
    found = list(chosen.findings)
    for question in QUESTIONS:
        found += question(run, chosen, aligned)
    return in_order_of_harm(fair(found, chosen))


def in_order_of_harm(found: Iterable[Finding]) -> tuple[Finding, ...]:
    """Errors, warnings, remarks; among themselves what does most harm first."""
    rank = {code: k for k, code in enumerate(HARM)}
    return tuple(sorted(found, key=lambda f: (ORDER[f.severity], rank.get(f.code, len(HARM)))))


__all__ = ["in_order_of_harm", "judge"]
