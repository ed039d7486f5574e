"""coop2024: a ground and an aerial robot correct one another around an airliner: what is printed, its arithmetic."""

from math import pi, sqrt

from outrider.campaign.papers.model import Paper, Picture, Row, Table, Work, exact, plain_row
from outrider.campaign.papers.printed import COOPERATION

PAPER = Paper(
    name="coop2024",
    title="Cooperative navigation of a ground and an aerial robot around an airliner",
    citation="Journal of Electrical Systems 20-11s, 561-574 (2024)",
    about="What the paper prints, its arithmetic, and what its spreads say about the error it simulated.",
)


@PAPER.table
def errors(work: Work) -> Table:
    """Mean sizes of the errors with and without cooperation."""
    rows: list[Row] = []
    for group, column in (("without cooperation", "alone"), ("with cooperation", "together")):
        for e in COOPERATION:
            mean, sd = getattr(e, column)
            if mean:
                rows.append(Row(name=f"{e.robot} {e.quantity}", group=group, unit=e.unit, printed=mean, printed_sd=sd))
    note = "Printed: mean and standard deviation over the time of one run."
    return Table(key="errors", title="Figures 3 to 8: errors of estimation", rows=tuple(rows), note=note)


@PAPER.table
def gains(work: Work) -> Table:
    """The improvements that the paper states, from the means that it prints."""
    printed = {
        ("UGV", "position"): ("0.24", "47"),
        ("UAV", "position"): ("0.26", "49"),
        ("UGV", "orientation"): ("0.79", ""),
        ("UAV", "orientation"): ("0.86", ""),
    }
    rows: list[Row] = []
    for e in COOPERATION:
        if (e.robot, e.quantity) in printed:
            gain, share = printed[e.robot, e.quantity]
            alone, together = float(e.alone[0]), float(e.together[0])
            name = f"{e.robot} {e.quantity}"
            rows.append(Row(name=f"{name}, gain", unit=e.unit, printed=gain, ours=exact(alone - together)))
            rows.append(
                Row(name=f"{name}, gain", unit="%", printed=share, ours=exact(100.0 * (alone - together) / alone))
            )
    return Table(key="gains", title="Gains from cooperation, recomputed", rows=tuple(rows))


@PAPER.table
def spreads(work: Work) -> Table:
    """Spread over mean of the position error: how constant the error was."""
    note = "a planar error that is Gaussian about zero has a spread of 0.52 of its mean"
    space = "one in space has 0.42; the printed error hardly changed, so it was nearly a constant"
    rows = [
        Row(name=f"{e.robot}, spread / mean", group="printed", ours=exact(float(e.alone[1]) / float(e.alone[0])))
        for e in COOPERATION
        if e.quantity == "position"
    ]
    rows += [
        Row(name="in the plane (Rayleigh)", group="zero-mean error", ours=exact(sqrt(4.0 / pi - 1.0)), note=note),
        Row(name="in space (Maxwell)", group="zero-mean error", ours=exact(sqrt(3.0 * pi / 8.0 - 1.0)), note=space),
    ]
    title = "Position error without cooperation: constant or noise?"
    return Table(key="spreads", title=title, rows=tuple(rows))


@PAPER.picture
def cooperation(work: Work) -> Picture:
    """Printed means with their spreads."""
    table = errors(work)

    def draw() -> object:
        from outrider.plot.papers import values_figure

        return values_figure([plain_row(r) for r in table.rows if r.unit in ("m", "deg")])

    caption = "Bars are one standard deviation over time."
    return Picture(key="cooperation", title="Printed errors with and without cooperation", draw=draw, caption=caption)
