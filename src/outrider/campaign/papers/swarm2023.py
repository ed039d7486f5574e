"""swarm2023: one drone follows another on Kalman filters of three kinds: what is printed, and whether it fits."""

from math import hypot, sqrt

from outrider.campaign.papers import printed, swarm2023_filters
from outrider.campaign.papers.model import Paper, Picture, Row, Table, Work, exact, plain_row
from outrider.campaign.papers.printed import LOCALISATION, METHODS
from outrider.campaign.papers.swarm2023_figures import pictures
from outrider.campaign.papers.swarm2023_lines import lines
from outrider.campaign.papers.swarm2023_tables import guidance, mission, rendezvous

PAPER = Paper(
    name="swarm2023",
    title="Trajectory planning and collision avoidance of UAVs with nonlinear Kalman filters",
    citation="Hematulin, Kamsing, Torteeka, Somjit, Phisannupawong, Jarawan: Drones 7, 142 (2023)",
    doi="10.3390/drones7020142",
    about="What the paper prints from one run each, whether its numbers fit together, and its flights over many seeds.",
)
localisation = PAPER.table(swarm2023_filters.localisation)
for _make in (*swarm2023_filters.TABLES, lines, rendezvous, mission, guidance):
    PAPER.table(_make)


@PAPER.table
def horizontal(work: Work) -> Table:
    """Table 1 against itself: xy from x and y, and the height error that xyz implies."""
    rows: list[Row] = []
    for signal, by_method in LOCALISATION.items():
        for method, (x, y, xy, _) in zip(METHODS, by_method, strict=True):
            ours = exact(hypot(float(x), float(y)))
            rows.append(Row(name=f"{method}, {signal}", group="xy from x and y", unit="m", printed=xy, ours=ours,
                            accept=(float(xy) - 1.5e-5, float(xy) + 1.5e-5)))  # fmt: skip
    for signal, by_method in LOCALISATION.items():
        for method, (_, _, xy, xyz) in zip(METHODS, by_method, strict=True):
            ours = exact(sqrt(float(xyz) ** 2 - float(xy) ** 2))
            rows.append(Row(name=f"{method}, {signal}", group="z from xy and xyz", unit="m", ours=ours))
    note = (
        "GPS, EKF and UKF have one height error, 0.046 m: a constant offset, not the noise of 0.15 m on the axes. "
        "Rounding of x and y allows 1.5e-5 m in xy."
    )
    return Table(key="horizontal", title="Table 1 against itself", rows=tuple(rows), note=note)


@PAPER.table
def elsewhere(work: Work) -> Table:
    """The same results in the abstract, the text and the tables."""
    full, blocked = (float(LOCALISATION[s][3][3]) for s in ("full signal", "blocked signal"))
    swapped = "the text exchanges inside and outside"
    rows = tuple(
        Row(name=name, group=group, unit="m", printed=said, ours=exact(in_table), note=note)
        for group, name, said, in_table, note in (
            ("abstract", "EnKF, full signal", printed.ABSTRACT_FULL, full, ""),
            ("abstract", "EnKF, blocked signal", printed.ABSTRACT_BLOCKED, blocked, ""),
            ("abstract", "EnKF, rendezvous", printed.ABSTRACT_RENDEZVOUS, float(printed.RENDEZVOUS_RMSE[3]), ""),
            ("text", "EnKF, rendezvous", printed.TEXT_RENDEZVOUS, float(printed.RENDEZVOUS_RMSE[3]), ""),
            ("text", "EnKF, inside the zone", printed.TEXT_INSIDE, float(printed.MISSION_INSIDE[3]), swapped),
            ("text", "EnKF, outside the zone", printed.TEXT_OUTSIDE, float(printed.MISSION_OUTSIDE[3]), swapped),
        )
    )
    note = "Printed: what abstract and text say. Ours: the tables of the paper."
    return Table(key="elsewhere", title="Abstract and text against the tables", rows=rows, note=note)


@PAPER.picture
def methods(work: Work) -> Picture:
    """Printed RMSE in space, method by method."""
    rows = [r for r in localisation(work).rows if r.name.endswith(", xyz") and r.printed]
    rows += rendezvous(Work(seeds=0)).rows[:4] + mission(Work(seeds=0)).rows[:8]

    def draw() -> object:
        from outrider.plot.papers import values_figure

        return values_figure([plain_row(r) for r in rows])

    caption = "One run each: the spread between runs is not printed."
    return Picture(key="methods", title="Printed RMSE of the three filters", draw=draw, caption=caption)


for _draw in (*swarm2023_filters.PICTURES, *pictures()):
    PAPER.picture(_draw)
