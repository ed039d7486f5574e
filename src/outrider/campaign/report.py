"""The report of a campaign: a document of schema `outrider.campaign/1`, and a page with tables and plots."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from outrider import __version__
from outrider.campaign.results import Line, Results, chosen, damage, failures, lines
from outrider.eval.paired import Paired
from outrider.io.files import replacing

SCHEMA: Final = "outrider.campaign/1"
PAGE: Final = "report.html"


def document(r: Results, values: Sequence[str] = ()) -> dict[str, Any]:
    """What came of a campaign; `values` as for `chosen`."""
    seeds = np.unique(r.seeds).size
    ended, asked = len(r.case), len(r.cases) * seeds
    samples = len({c.get("sample") for c in r.cases})
    return {
        "schema": SCHEMA,
        "folder": str(r.folder),
        "trial": r.trial,
        "about": _about(r),
        "cases": len(r.cases),
        "seeds": int(seeds) * samples,
        "first_seed": int(r.seeds.min()),
        "ended": ended,
        "asked": asked,
        "failed": len(r.errors),
        "damaged_lines": list(r.damaged),
        "warnings": [told] if (told := damage(r.damaged)) else [],
        "varied": [k for k in r.varied if k != "sample"],
        "groups": list(r.groups),
        "sampled": r.sampled,
        "failures": [{"error": e, "times": n, "trial": first} for e, n, first in failures(r)],
        "values": list(r.values),
        "lines": [_line(r, one) for one in lines(r, chosen(r, values))],
        "extremes": [_extreme(r, name) for name in chosen(r, values)],
        "version": __version__,
    }


def page_of(folder: Path, values: Sequence[str] = ()) -> Path:
    """Where the page of chosen values is kept: beside the campaign's own, which nobody chose any for."""
    chosen_by = "-".join(re.sub(r"[^\w.]+", "_", v) for v in values)[:80]
    return folder / (f"{Path(PAGE).stem}-{chosen_by}.html" if values else PAGE)


def write_report(r: Results, told: Mapping[str, Any], path: Path, *, command: str = "") -> None:
    """Write the page over an earlier one."""
    from outrider.plot.campaign import campaign_page  # imports matplotlib

    names = list(dict.fromkeys(str(line["value"]) for line in told["lines"]))
    axes = {key: [case.get(key) for case in r.cases] for key in r.varied if key != "sample"}
    text = campaign_page(dict(told), {n: r.values[n] for n in names}, r.case, r.group, axes, command=command)
    with replacing(path, force=True) as part:
        part.write_text(text, encoding="utf-8")


def _about(r: Results) -> str:
    first = r.cases[0]
    what = str(first.get("scenario", first.get("log", r.trial)))
    return what if "log" not in r.varied else f"{len({str(c.get('log')) for c in r.cases})} logs"


def _line(r: Results, one: Line) -> dict[str, Any]:
    x = r.values[one.value][r.group == r.groups.index(one.group)]
    known = x[np.isfinite(x)]
    s = one.summary
    floor = 0.0 if known.size and known.min() >= 0.0 else -np.inf  # what is never negative has no negative mean
    return {
        "value": one.value,
        "case": one.group,
        "n": s.n,
        "mean": s.mean,
        "sd": s.sd,
        "low": max(s.low, floor) if np.isfinite(s.low) else None,
        "high": s.high if np.isfinite(s.high) else None,
        "least": float(known.min()) if known.size else None,
        "largest": float(known.max()) if known.size else None,
        "difference": None if one.against is None else _difference(one.against, one.p),
    }


def _difference(d: Paired, p: float) -> dict[str, Any]:
    low, high = (x if np.isfinite(x) else None for x in (d.low, d.high))
    return {"mean": d.mean, "low": low, "high": high, "wins": d.wins, "p": p, "n": d.n}


def _extreme(r: Results, name: str) -> dict[str, Any]:
    """The trials in which a value was least and largest: those to replay."""
    x = r.values[name]
    if not np.isfinite(x).any():
        return {"value": name, "least": None, "largest": None}
    return {"value": name, "least": int(r.numbers[np.nanargmin(x)]), "largest": int(r.numbers[np.nanargmax(x)])}
