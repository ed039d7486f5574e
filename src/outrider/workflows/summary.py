"""A run in numbers: the document `outrider.run/1` that `--json` prints and the run's folder keeps."""

from collections.abc import Mapping
from typing import Any, cast

import numpy as np
from scipy.special import chdtri

from outrider.data import Account, Estimates, Innovations, Outcome, Reset, Run, Trouble, Verdict
from outrider.errors import ExitCode
from outrider.io.runs import SCHEMA

GOOD = (Outcome.OK, Outcome.DEGRADED, Outcome.PARTLY_VALID)
CONTRIBUTES = (Verdict.USED, Verdict.INPUT, Verdict.RESET, Verdict.WITHHELD)


def summarise(run: Run) -> dict[str, Any]:
    """Everything about a run but its time series. SI units; degrees where the key says so."""
    return {
        "schema": SCHEMA,
        "outcome": {"code": run.outcome.name.lower(), "text": run.outcome.value},
        "log": {"path": run.log_path, "sha256": run.log_sha256, "start_ns": run.start},
        "robot": run.robot,
        "seed": run.seed,
        "versions": dict(run.versions),
        "wall_s": run.wall_seconds,
        "compile_s": run.compile_seconds,
        "datum": _datum(run),
        "figures": figures(run),
        "scored": _all_scored(run),
        "accounts": [_account(a, run) for a in run.listed],
        "findings": [
            {"severity": f.severity, "code": f.code, "source": f.source, "text": f.text, "fix": f.fix}
            for f in run.findings
        ],
        "resets": [_reset(r, run.start) for r in run.resets],
        "never_used": list(never_used(run)),
    }


def exit_code(run: Run) -> ExitCode:
    """Whether the job gave what was asked for: a valid end, no error found, every source to be fused took part."""
    sound = not any(f.severity == "error" for f in run.findings)
    return ExitCode.OK if sound and run.outcome in GOOD and not never_used(run) else ExitCode.FAILED_CHECK


def never_used(run: Run) -> tuple[str, ...]:
    """Sources that were to be fused, by our choice or by `use: fuse` in the configuration, and contributed nothing."""
    named = cast("Mapping[str, Mapping[str, object]]", run.config.get("sources", {}))
    wanted = [name for name, section in named.items() if section.get("use") == "fuse"]
    helped = [a.source for a in run.accounts if any(a.by_verdict.get(v) for v in CONTRIBUTES)]
    idle = [name for name in wanted if not any(s == name or s.startswith(f"{name} ") for s in helped)]
    return tuple(dict.fromkeys([*(f.source for f in run.findings if f.code == "never-used"), *idle]))


def figures(run: Run) -> dict[str, Any]:
    """The key figures of the fused estimate; empty without one."""
    fused = run.fused
    if not len(fused.pose):
        return {}
    p, yaw = fused.pose.p, np.degrees(fused.pose.yaw)
    lasted = run.duration
    return {
        "estimates": int(fused.t.size),
        "first_s": float(fused.t[0] - run.start) * 1e-9,
        "duration_s": lasted,
        "silence_s": float(run.silences[:, 1].sum()),
        "distance_m": fused.pose.length,
        "end": {"east_m": p[-1, 0], "north_m": p[-1, 1], "up_m": p[-1, 2], "heading_deg": yaw[-1]},
        "deviation": _deviation(fused),
        "valid_share": dict(zip(("position", "velocity", "heading"), run.valid_shares, strict=True)),
        "times_real_time": lasted / run.wall_seconds if run.wall_seconds > 0 else None,
    }


def scored(of: Innovations) -> dict[str, Any]:
    """How far the records were from the estimate that were compared, not fused; and whether it knew as much.

    rmse and median are horizontal for a position, over all columns otherwise, in the unit of the source (SI).
    """
    rows = (of.verdict == Verdict.WITHHELD) & np.isfinite(of.nis)
    if not rows.any():
        return {}
    columns = [k for k in range(len(of.columns)) if np.isfinite(of.y[rows, k]).any()]
    flat = [k for k in columns if of.columns[k] in ("east", "north")] or columns
    units = {of.units[k] for k in flat}
    e = np.linalg.norm(np.nan_to_num(of.y[rows][:, flat]), axis=1)
    nis, dof = of.nis[rows], np.maximum(of.dof[rows], 1)
    return {
        "records": int(rows.sum()),
        "unit": units.pop() if len(units) == 1 else "",
        "rmse": float(np.sqrt(np.mean(e * e))),
        "median": float(np.median(e)),
        "nis_per_dof": float(np.mean(nis / dof)),
        "within_95": float(np.mean(nis <= chdtri(dof, 0.05))),
    }


def _all_scored(run: Run) -> dict[str, Any]:
    every = {name: scored(i) for name, i in run.innovations.items()}
    return {name: scores for name, scores in every.items() if scores}


def _deviation(fused: Estimates) -> dict[str, Any]:
    """Horizontal (larger axis) and vertical standard deviation [m], heading [deg], at the end and in the median."""
    P = fused.pose.P
    if not len(P):
        return {}
    a, b, c = P[:, 0, 0], P[:, 0, 1], P[:, 1, 1]
    series = {
        "horizontal_m": np.sqrt(np.maximum((a + c) / 2 + np.hypot((a - c) / 2, b), 0.0)),
        "up_m": np.sqrt(np.maximum(P[:, 2, 2], 0.0)),
        "heading_deg": np.degrees(np.sqrt(np.maximum(P[:, 5, 5], 0.0))),
    }
    known = {name: s for name, s in series.items() if s.any()}  # zeros throughout: not estimated
    return {name: {"end": float(s[-1]), "median": float(np.nanmedian(s))} for name, s in known.items()}


def _datum(run: Run) -> dict[str, Any] | None:
    if run.datum is None:
        return None
    lat, lon = np.degrees([run.datum.lat, run.datum.lon]).tolist()
    return {"lat_deg": lat, "lon_deg": lon, "alt_m": run.datum.alt, "altitude": run.datum.altitude.lower()}


def _account(a: Account, run: Run) -> dict[str, Any]:
    worst = run.trouble(a.source)
    return {
        "source": a.source,
        "kind": a.kind,
        "role": a.role,
        "received": a.received,
        "used": a.used,
        "malformed": a.malformed,
        "by_verdict": _counts(a.by_verdict),
        "rate_hz": a.rate,
        "first_s": a.first,
        "last_s": a.last,
        "nis_per_dof": a.nis,
        "nis_per_dof_fused": run.fused_nis(a.source),
        "state": a.state.name.lower() if a.state is not None else None,
        "trouble": None if worst is None else _trouble(worst),
    }


def _trouble(worst: Trouble) -> dict[str, Any]:
    return {"state": worst.state.name.lower(), "first_s": worst.first, "times": worst.times}


def _counts(by_verdict: Mapping[Verdict, int]) -> dict[str, int]:
    return {Verdict(v).name.lower(): n for v, n in by_verdict.items() if n}


def _reset(r: Reset, start: int) -> dict[str, Any]:
    seconds = (r.t - start) * 1e-9
    return {"t_s": seconds, "source": r.source, "state": r.state, "delta": r.delta.tolist(), "reason": r.reason}
