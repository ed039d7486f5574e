"""The words and numbers of a report: key figures, rows of the tables, configuration as text."""

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import cast, final

import numpy as np

from outrider.data import Account, Finding, Outcome, Reset, Run, SensorState, Trajectory, Verdict, reason
from outrider.eval import associate, heading_errors, position_errors, statistics
from outrider.plot.series import has_height, radius_95, seconds, yaw_sd

NONE = "–"
_CONTRIBUTES = (Verdict.USED, Verdict.INPUT, Verdict.RESET)
_USED = (Verdict.USED, Verdict.INPUT)
_SEVERITIES = ("error", "warning", "info")


def number(value: float, unit: str = "", digits: int = 3) -> str:
    """A number for the reader: a few significant digits, thousands apart, a dash for what is not known."""
    if not math.isfinite(value):
        return NONE
    if value != 0.0 and not 1e-3 <= abs(value) < 1e6:
        text = f"{value:.{digits - 1}e}"
    else:
        text = f"{value:,.{max(0, digits - 1 - math.floor(math.log10(abs(value))))}f}" if value else "0"
    return _with_unit(text, unit)


def ratio(value: float) -> str:
    """NIS per degree of freedom: 1 is right, and how far below 0.01 it is tells nothing."""
    return "< 0.01" if 0.0 <= value < 0.01 else number(value, digits=2 if value < 10 else 3)


def fixed(value: float, unit: str = "", places: int = 2) -> str:
    """A number with as many decimals as said: for columns and coordinates."""
    return _with_unit(f"{round(value, places) + 0.0:,.{places}f}", unit) if math.isfinite(value) else NONE


def count(value: int) -> str:
    """How many."""
    return fixed(value, places=0)


def _with_unit(text: str, unit: str) -> str:
    text = text.replace(",", "\u202f").replace("-", "\u2212")  # narrow space, true minus
    return text + (unit if unit == "°" else f" {unit}" if unit else "")


def span(seconds_: float) -> str:
    """A duration: 4.2 s, 3 min 05 s, 1 h 02 min."""
    if not math.isfinite(seconds_):
        return NONE
    if seconds_ < 60:
        return number(seconds_, "s", 2 if seconds_ < 10 else 3)
    minutes, rest = divmod(round(seconds_), 60)
    return f"{minutes} min {rest:02d} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"


@final
@dataclass(frozen=True, slots=True)
class Card:
    """One key figure."""

    name: str
    value: str
    note: str = ""


def log_name(run: Run) -> str:
    """The log without its folder."""
    return PurePath(run.log_path.rstrip("/\\")).name or run.log_path or "unnamed log"


def tone(outcome: Outcome) -> str:
    """How to colour the verdict."""
    return {Outcome.OK: "good", Outcome.DEGRADED: "warning", Outcome.PARTLY_VALID: "warning"}.get(outcome, "error")


def sorted_findings(run: Run) -> list[Finding]:
    """Errors first, then warnings, then remarks."""
    known = {s: i for i, s in enumerate(_SEVERITIES)}
    return sorted(run.findings, key=lambda f: known.get(f.severity, len(known)))


def cards(run: Run, reference: Trajectory | None) -> list[Card]:
    """The key figures, most asked for first."""
    return [*_travel(run), *_certainty(run), *_records(run), *([] if reference is None else _errors(run, reference))]


def _travel(run: Run) -> list[Card]:
    pose = run.fused.pose
    length, lasted = pose.length, run.duration
    mean = length / lasted if lasted > 0 else math.nan
    delay = float(seconds(run.fused.t[:1], run.start)[0]) if run.fused.t.size else math.nan
    out = [
        Card(
            "duration", span(lasted), f"first estimate after {span(delay)}" if math.isfinite(delay) else "no estimate"
        ),
        Card("distance", number(length, "m"), f"{number(mean, 'm/s')} on average" if lasted > 0 else ""),
    ]
    if len(pose):
        x, y, z = pose.p[-1]
        height = f"height {fixed(z, 'm')}, " if has_height(pose) else ""
        out.append(
            Card(
                "end position",
                f"{fixed(x)}, {fixed(y, 'm')}",
                f"east, north; {height}heading {fixed(math.degrees(pose.yaw[-1]), '°', 1)}",
            )
        )
    return out


def _certainty(run: Run) -> list[Card]:
    if not run.fused.t.size:
        return []
    radius = radius_95(run.fused.pose)
    known = radius[np.isfinite(radius)]
    out: list[Card] = []
    if known.size:
        out.append(
            Card(
                "95 % radius at the end",
                number(float(known[-1]), "m"),
                f"median {number(float(np.median(known)), 'm')}",
            )
        )
    heading = np.degrees(yaw_sd(run.fused.pose))
    heading = heading[np.isfinite(heading)]
    if heading.size:
        out.append(
            Card(
                "heading 1σ at the end",
                number(float(heading[-1]), "°"),
                f"median {number(float(np.median(heading)), '°')}",
            )
        )
    if run.fused.valid.shape[0]:
        share = [100.0 * run.valid_shares[k] for k in (0, 2)]
        out.append(Card("position valid", number(share[0], "%"), f"heading valid {number(share[1], '%')} of the time"))
    return out


def _records(run: Run) -> list[Card]:
    received = sum(a.received for a in run.accounts)
    used = sum(_contributed(a) for a in run.accounts)
    gated = sum(a.by_verdict.get(Verdict.GATED, 0) for a in run.accounts)
    out = [Card("records received", count(received), f"{count(used)} used, {count(gated)} gated")]
    if math.isfinite(run.wall_seconds) and run.wall_seconds > 0:
        out.append(Card("computed in", span(run.wall_seconds), _pace(run)))
    return out


def _pace(run: Run) -> str:
    compiled = f", plus {span(run.compile_seconds)} compiling" if run.compile_seconds > 0 else ""
    return f"{number(run.duration / run.wall_seconds)} × real time{compiled}" if run.duration > 0 else ""


def _errors(run: Run, reference: Trajectory) -> list[Card]:
    if not len(run.fused.pose) or not len(reference):
        return []
    pairs = associate(run.fused.pose, reference)
    position, heading = statistics(position_errors(pairs, 2)), statistics(heading_errors(pairs))
    return [
        Card(
            "horizontal RMSE",
            number(position.rmse, "m"),
            f"largest {number(position.max, 'm')}, at {count(position.n)} of {count(len(reference))} reference poses",
        ),
        Card("heading RMSE", number(math.degrees(heading.rmse), "°"), f"at {count(heading.n)} reference poses"),
    ]


def _contributed(account: Account) -> int:
    return sum(account.by_verdict.get(v, 0) for v in _CONTRIBUTES)


@final
@dataclass(frozen=True, slots=True)
class Row:
    """One source in the accounting table; `others` says where the records went that were not used."""

    source: str
    kind: str
    role: str
    received: str
    used: str
    rate: str
    seen: str
    nis: str
    nis_note: str
    state: str
    state_tone: str
    trouble: str
    others: Sequence[tuple[str, str]]


def account_rows(run: Run) -> list[Row]:
    """One row per source."""
    return [_row(a, run) for a in run.listed]


def _row(a: Account, run: Run) -> Row:
    others = [
        (count(n), reason(v, a.role))
        for v, n in sorted(a.by_verdict.items(), key=lambda item: -item[1])
        if n and v not in _USED
    ]
    if a.malformed:
        others.append((count(a.malformed), "could not be decoded"))
    fused = run.fused_nis(a.source)
    tones = {SensorState.HEALTHY: "good", SensorState.FAULTED: "error", SensorState.SUSPECT: "warning"}
    return Row(
        a.source,
        a.kind.lower().replace("_", " "),
        a.role,
        count(a.received),
        count(a.used),
        number(a.rate, "Hz"),
        _seen(a),
        ratio(fused if math.isfinite(fused) else a.nis),
        f"{ratio(a.nis)} with the gated" if fused < 0.9 * a.nis and a.by_verdict.get(Verdict.GATED) else "",
        "" if a.state is None else a.state.name.lower(),
        "plain" if a.state is None else tones.get(a.state, "plain"),
        _trouble(a, run),
        others,
    )


def _trouble(a: Account, run: Run) -> str:
    """The worst state before the end, with its time."""
    worst = run.trouble(a.source)
    if worst is None or a.state is None:
        return ""
    when = f"{worst.times} times, first " if worst.times > 1 else ""
    return f"{worst.state.name.lower()} {when}at {fixed(worst.first, 's', 1)}"


def _seen(a: Account) -> str:
    if math.isfinite(a.first):
        return f", {fixed(a.first, places=1)} to {fixed(a.last, 's', 1)}"
    return "" if a.received else ", no record"


def reset_rows(run: Run) -> list[tuple[str, str, str, str, str]]:
    """Time, source, state, jump and reason of every reset."""
    start, ordered = run.start, sorted(run.resets, key=lambda r: r.t)
    return [(fixed((r.t - start) * 1e-9, "s"), r.source, r.state, _jump(r), r.reason) for r in ordered]


def _jump(reset: Reset) -> str:
    delta = np.atleast_1d(reset.delta)
    if any(word in reset.state for word in ("heading", "yaw", "attitude")):
        return ", ".join(number(float(d)) for d in np.degrees(delta)) + "°"
    return f"{number(float(np.linalg.norm(delta)), 'm')} ({', '.join(fixed(float(d)) for d in delta)})"


def gate_tail(config: Mapping[str, object], source: str, default: float) -> float:
    """How rarely the gate refuses a good record: by `sources.NAME.gate`; a source may have uses, "NAME (use)"."""
    sources = cast("Mapping[str, Mapping[str, object]]", config.get("sources", {}))
    own = next((section for name, section in sources.items() if f"{source} ".startswith(f"{name} ")), {})
    gate = own.get("gate")
    return 1.0 - gate if isinstance(gate, float) and 0.5 < gate < 1.0 else default


def outline(value: object, indent: int = 0) -> str:
    """Nested configuration as indented text, one setting a line."""
    pad = "  " * indent
    if isinstance(value, Mapping) and value:
        items = cast("Mapping[str, object]", value).items()
        return "".join(f"{pad}{k}:{_nested(v, indent)}" for k, v in items)
    if isinstance(value, (list, tuple)) and any(isinstance(v, Mapping) for v in cast("Sequence[object]", value)):
        return "".join(f"{pad}- {outline(v, indent + 1).lstrip()}" for v in cast("Sequence[object]", value))
    return f"{pad}{scalar(value)}\n"


def _nested(value: object, indent: int) -> str:
    deep = isinstance(value, (Mapping, list, tuple)) and outline(value).count("\n") > 1
    return (
        "\n" + outline(value, indent + 1) if deep or (isinstance(value, Mapping) and value) else f" {scalar(value)}\n"
    )


def scalar(value: object) -> str:
    """One setting as text; what is not set says so."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "not set"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(scalar(v) for v in cast("Sequence[object]", value)) + "]"
    if isinstance(value, Mapping):
        return "{}"
    return "yes" if value is True else "no" if value is False else str(value)


def command(run: Run) -> str:
    """What to type to get this run again from the configuration saved beside it."""
    return f"outrider fuse {shlex.quote(run.log_path or 'LOG')} -c config.yaml --seed {run.seed}"
