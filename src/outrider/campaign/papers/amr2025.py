"""amr2025: an eight-wheeled robot navigates on hand-drawn maps. The arithmetic of its tables; then our drives."""

import numpy as np

from outrider.campaign.papers import amr2025_figures, amr2025_tables
from outrider.campaign.papers.model import Paper, Picture, Row, Table, Work, exact
from outrider.campaign.papers.printed import CONTROL, GOALS, HEADINGS, PATHS

PAPER = Paper(
    name="amr2025",
    title="Active counter-UAS with an autonomous mobile robot",
    citation="Li, Fan, Cai, Wang, Fan: Scientific Reports 15, 45790 (2025)",
    doi="10.1038/s41598-025-28565-7",
    about="Recomputed: what it states about its own tables. Simulated: its drives, on our drawings of its sites.",
)

_REAL = np.array([g.place != "simulation" for g in GOALS])
_D = np.array([np.hypot(*np.subtract(g.actual, g.target)) for g in GOALS])  # m
_HEADING_ERROR = HEADINGS[:, 0] - HEADINGS[:, 1]  # deg


@PAPER.table
def goals(work: Work) -> Table:
    """Distance between where the robot was sent and where it ended."""
    d, printed = _D[_REAL], np.array([g.d for g in GOALS])
    overall = "the 0.35 m are those of the seven real drives alone; with the two simulated ones it is less"
    rows = (
        Row(name="mean, seven real drives", unit="m", printed="0.35", ours=exact(printed[_REAL].mean())),
        Row(name="mean, all nine drives", unit="m", printed="0.35", ours=exact(printed.mean()), note=overall),
        Row(name="RMSE, real drives", unit="m", ours=exact(np.sqrt(np.mean(d**2)))),
        Row(name="largest, real drives", unit="m", ours=exact(d.max()), note="returning to the start of map 3"),
        Row(
            name="largest difference between a printed distance and its coordinates",
            unit="m",
            ours=exact(np.abs(printed - _D).max()),
            note="rounding alone allows 0.005 m, or more where the coordinates are rounded, too",
        ),
    )
    note = (
        "This is how well goals were reached, which includes the planner's tolerance; it is no error of localisation."
    )
    return Table(key="goals", title="Table 2: goals and where the robot ended", rows=rows, note=note)


@PAPER.table
def headings(work: Work) -> Table:
    """Heading by the filter against a protractor."""
    e = _HEADING_ERROR
    absolute = np.abs(e)
    bound = "the bound is an image in the source; this share belongs to any from 1.1 to below 1.3 deg"
    claim = "the abstract's claim holds for the mean, not for every angle"
    rows = (
        Row(name="mean error", unit="deg", printed="0.37", ours=exact(e.mean())),
        Row(name="mean square error", unit="deg^2", printed="0.89", ours=exact(np.mean(e**2))),
        Row(name="root mean square error", unit="deg", printed="0.94", ours=exact(np.sqrt(np.mean(e**2)))),
        Row(name="mean absolute error", unit="deg", ours=exact(absolute.mean()), note="an image in the source"),
        Row(name="share up to 1.1 deg", unit="%", printed="77.8", ours=exact(_share(absolute, 1.1)), note=bound),
        Row(name="share up to 1 deg", unit="%", ours=exact(_share(absolute, 1.0))),
        Row(name="largest error", unit="deg", printed="1", relation="<", ours=exact(absolute.max()), note=claim),
    )
    return Table(key="headings", title="Table 3: heading against a protractor", rows=rows)


def _share(x: np.ndarray, bound: float) -> float:
    return 100.0 * float(np.mean(x <= bound + 1e-9))  # the rows hold tenths, which are not exact in binary


@PAPER.table
def paths(work: Work) -> Table:
    """Smoothness and length of what was driven, relative to what was planned."""
    printed = {"map 1": ("88.84", "8.53"), "map 3": ("89.9", "1.14")}
    notes = {
        "map 1": "88.848: the last digit was cut, not rounded",
        "map 2": "left out by the paper's own text",
        "map 3": "89.9 is the driven coefficient itself, 0.8991; the ratio is 90.07 %",
    }
    rows: list[Row] = []
    for p in PATHS:
        smc, length = printed.get(p.place, ("", ""))
        ratio = 100.0 * float(p.smc_driven) / float(p.smc_planned)
        longer = 100.0 * (float(p.length_driven) / float(p.length_planned) - 1.0)
        accept = (88.84, 88.85) if p.place == "map 1" else None
        note = notes.get(p.place, "")
        rows += [
            Row(name=f"{p.place}, smoothness kept", group="smoothness driven / planned", unit="%", printed=smc,
                ours=exact(ratio), accept=accept, note=note),
            Row(name=f"{p.place}, longer by", group="length driven / planned - 1", unit="%", printed=length,
                ours=exact(longer)),
        ]  # fmt: skip
    rows.sort(key=lambda r: r.group, reverse=True)
    return Table(key="paths", title="Table 4: paths driven and planned", rows=tuple(rows))


@PAPER.table
def control(work: Work) -> Table:
    """Claims about the speeds in table 5."""
    mae = {c.place: float(c.mae) for c in CONTROL}
    r = [float(c.r) for c in CONTROL]
    others = [v for place, v in mae.items() if place != "map 2"]
    abstract = "map 2 is above; the body of the text leaves it out, the abstract does not say so"
    rows = (
        Row(name="largest MAE", unit="m/s", printed="0.02", relation="<", ours=exact(max(mae.values())), note=abstract),
        Row(name="largest MAE without map 2", unit="m/s", printed="0.02", relation="<", ours=exact(max(others))),
        Row(name="mean MAE", unit="m/s", ours=exact(np.mean(list(mae.values())))),
        Row(name="smallest correlation", printed="0.9", relation=">", ours=exact(min(r))),
    )
    return Table(key="control", title="Table 5: speeds driven and commanded", rows=rows)


for _make in (
    amr2025_tables.fusion,
    amr2025_tables.driven_goals,
    amr2025_tables.measured_headings,
    amr2025_tables.driven_paths,
    amr2025_tables.driven_speeds,
    amr2025_tables.localisation,
    amr2025_tables.degraded,
):
    PAPER.table(_make)
for _draw in amr2025_figures.FIGURES:
    PAPER.picture(_draw)


@PAPER.picture
def goal_errors(work: Work) -> Picture:
    """The nine drives one by one."""

    def draw() -> object:
        from outrider.plot.papers import bars_figure

        names = [f"{g.place}\n({g.target[0]:g}, {g.target[1]:g})" for g in GOALS]
        lines = [("mean of seven real drives", float(_D[_REAL].mean())), ("mean of all nine", float(_D.mean()))]
        return bars_figure(names, _D, "distance to the goal [m]", pale=~_REAL, lines=lines)

    caption = "From the printed coordinates. Pale: simulated drives, which the printed mean of 0.35 m leaves out."
    return Picture(key="goal-errors", title="Table 2, drive by drive", draw=draw, caption=caption)


@PAPER.picture
def heading_errors(work: Work) -> Picture:
    """The nine headings one by one."""

    def draw() -> object:
        from outrider.plot.papers import bars_figure

        names = [f"{h:g}°" for h in HEADINGS[:, 1]]
        lines = [("mean", float(_HEADING_ERROR.mean())), ("claimed bound, 1°", 1.0), ("claimed bound, 1°", -1.0)]
        return bars_figure(names, _HEADING_ERROR, "estimate minus protractor [deg]", lines=lines)

    caption = "Signed errors over the measured heading. Three of nine are beyond one degree."
    return Picture(key="heading-errors", title="Table 3, angle by angle", draw=draw, caption=caption)
