"""The health of every source over time, as coloured bars."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from outrider.data import Run, SensorState
from outrider.plot.series import GAP, end_time, seconds
from outrider.plot.style import LEFT, MUTED, PAPER, STATE_COLOURS, WIDTH, finish, label, styled
from outrider.typing import Floats

_BARS = 400  # per source; a state that flickers faster than the plot can show is thinned to these


@styled
def health_figure(run: Run) -> Figure | None:
    """One row per fused source, coloured by `SensorState`; None if no source has a recorded history."""
    sources = [a.source for a in run.accounts if a.source in run.health]
    sources += [name for name in run.health if name not in sources]
    sources = [name for name in sources if run.health[name].shape[0]]
    if not sources:
        return None
    figure = Figure(figsize=(WIDTH, 0.1 + 0.3 * len(sources)))
    ax = figure.add_subplot()
    end = end_time(run)
    seen: set[SensorState] = set()
    for row, name in enumerate(sources):
        for begin, width, state in [*state_bars(run.health[name], end), *silent_bars(run, name, end)]:
            ax.broken_barh([(begin, width)], (row - 0.32, 0.64), **_look(state))
            seen.add(state)
    ax.set_yticks(range(len(sources)), [label(s) for s in sources])
    ax.set_ylim(len(sources) - 0.5, -0.5)
    ax.set_xlim(0.0, end)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0, labelcolor=MUTED)
    ax.set_xlabel("time from start [s]")
    names = {SensorState.SILENT: "no usable record"}
    handles = [Patch(label=names.get(s, s.name.lower()), **_look(s)) for s in sorted(seen)]
    return finish(figure, handles, left=max(LEFT, 0.25 + 0.078 * max(len(s) for s in sources)))


def _look(state: SensorState) -> dict[str, Any]:
    silent = state is SensorState.SILENT
    return {"facecolor": STATE_COLOURS[state], "edgecolor": "none", "hatch": "////" if silent else None,
            "hatchcolor": PAPER}  # fmt: skip


def silent_bars(run: Run, name: str, end: float) -> list[tuple[float, float, SensorState]]:
    """(begin, width, silent) of each stretch in which a source had no record that could be used."""
    account = next((a for a in run.accounts if a.source == name), None)
    if account is None or not np.isfinite(account.last):
        return []
    known = np.array([account.first, account.last])
    if name in run.innovations:
        known = np.sort(seconds(run.innovations[name].t, run.start))
    t = np.concatenate([known, [end]])
    long = max(GAP, 20 / account.rate if account.rate > 0 else GAP)
    rows = np.flatnonzero(np.diff(t) > long) if name in run.innovations else np.flatnonzero(np.diff(t[1:]) > long) + 1
    return [(float(t[i]), float(t[i + 1] - t[i]), SensorState.SILENT) for i in rows]


def state_bars(history: Floats, end: float) -> list[tuple[float, float, SensorState]]:
    """(begin, width, state) of each stretch of one state; history (k, 2) holds the changes: time [s], state."""
    t, state = history[:, 0], history[:, 1].astype(int)
    change = np.flatnonzero(np.concatenate([[True], np.diff(state) != 0]))
    if change.size > _BARS:
        change = change[np.linspace(0, change.size - 1, _BARS).astype(int)]
    edges = np.concatenate([t[change], [max(end, float(t[-1]))]])
    return [(float(edges[i]), float(edges[i + 1] - edges[i]), SensorState(int(state[k]))) for i, k in enumerate(change)]
