"""What a `Run` says about its sources, as ROS diagnostics: changes of health as they happen, a summary at the end."""

from collections.abc import Iterator, Mapping
from typing import Any

from outrider.data import Account, Finding, Outcome, Reset, Run, SensorState, reason
from outrider.io._ros_encode import Messages

OK, WARN, ERROR, STALE = 0, 1, 2, 3  # diagnostic_msgs/DiagnosticStatus
_STATES = {
    SensorState.WARMING: OK, SensorState.HEALTHY: OK, SensorState.SUSPECT: WARN, SensorState.FAULTED: ERROR,
    SensorState.RECOVERING: WARN, SensorState.SILENT: STALE,
}  # fmt: skip
_SEVERITIES = {"info": OK, "warning": WARN, "error": ERROR}
_OUTCOMES = {Outcome.OK: OK, Outcome.DEGRADED: WARN}


def diagnostics(run: Run, messages: Messages) -> Iterator[tuple[int, bytes]]:
    """DiagnosticArray messages in time order."""
    last = _last_stamp(run)
    events = [(r.t, [_reset(messages, r)]) for r in run.resets]
    for source, changes in run.health.items():
        events += [(run.start + round(t * 1e9), [_state(messages, source, int(code))]) for t, code in changes.tolist()]
    last = max([last, *(t for t, _ in events)])
    summary = [_outcome(messages, run.outcome)]
    summary += [_account(messages, a) for a in run.accounts] + [_finding(messages, f) for f in run.findings]
    for t, statuses in [*sorted(events, key=lambda event: event[0]), (last, summary)]:
        given = {"header.stamp.sec": t // 10**9, "header.stamp.nanosec": t % 10**9, "status": statuses}
        yield t, messages.pack(messages.make("diagnostic_msgs/msg/DiagnosticArray", given))


def _last_stamp(run: Run) -> int:
    """Last stamp [ns] of anything in the run; its start, if there is nothing."""
    stamps = [run.fused.t, run.fused.pose.t, *(i.t for i in run.innovations.values())]
    return max((int(t.max()) for t in stamps if t.size), default=run.start)


def _status(messages: Messages, level: int, name: str, text: str, values: Mapping[str, object] | None = None) -> Any:
    pairs = [
        messages.make("diagnostic_msgs/msg/KeyValue", {"key": key, "value": str(value)})
        for key, value in (values or {}).items()
    ]
    given = {"level": level, "name": f"outrider: {name}", "message": text, "hardware_id": "outrider", "values": pairs}
    return messages.make("diagnostic_msgs/msg/DiagnosticStatus", given)


def _outcome(messages: Messages, outcome: Outcome) -> Any:
    return _status(messages, _OUTCOMES.get(outcome, ERROR), "outcome", outcome.value)


def _state(messages: Messages, source: str, code: int) -> Any:
    state = SensorState(code)
    return _status(messages, _STATES[state], source, state.name.lower())


def _reset(messages: Messages, r: Reset) -> Any:
    delta = " ".join(f"{v:.4g}" for v in r.delta.ravel())
    return _status(messages, WARN, f"reset of {r.state}", r.reason, {"source": r.source, "delta": delta})


def _account(messages: Messages, a: Account) -> Any:
    level = OK if a.state is None else _STATES[a.state]
    counts = {"received": a.received, "used": a.used, "malformed": a.malformed}
    counts |= {reason(verdict, a.role): count for verdict, count in a.by_verdict.items() if count}
    values = {"kind": a.kind, **counts, "rate_hz": f"{a.rate:.3g}", "nis": f"{a.nis:.3g}"}
    return _status(messages, level, a.source, a.role, values)


def _finding(messages: Messages, f: Finding) -> Any:
    values = {name: text for name, text in (("source", f.source), ("fix", f.fix)) if text}
    return _status(messages, _SEVERITIES.get(f.severity, WARN), f.code, f.text, values)
