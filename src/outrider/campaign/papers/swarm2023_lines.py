"""Figure 2 of swarm2023: the line of sight against curves of the trail, over three flights of the target."""

from collections.abc import Mapping
from typing import Final

from outrider.campaign.papers.model import Pair, Row, Table, Work, exact
from outrider.campaign.trials import Params, Trials, grid
from outrider.eval import paired, summary
from outrider.scenarios.trail_lines import Guide, Way, fly_trail

SEEDS: Final = 50
CASES: Final[list[Params]] = [*grid(way=[w.name for w in Way], guide=[g.name for g in Guide])]


def trail_line(params: Params, seed: int) -> Mapping[str, float]:
    """How far off the path of the target a follower flies [m, RMSE]."""
    return {"rmse": fly_trail(Way[str(params["way"])], Guide[str(params["guide"])], seed).rmse}


def lines(work: Work) -> Table:
    """Figure 2."""
    done: Trials | None = work.run("swarm2023-lines", trail_line, CASES, seeds=SEEDS) if work.simulates else None
    rows = [
        Row(name=guide.value, group=f"off the path: {way.value}", unit="m",
            ours=None if done is None else summary(done.column("rmse", way=way.name, guide=guide.name)))
        for way in Way for guide in Guide
    ]  # fmt: skip
    if done is not None:
        rows += [
            Row(name=guide.value, group="a command, of Python, on this machine", unit="us",
                ours=exact(fly_trail(Way.TURN, guide, 0).micros))
            for guide in Guide
        ]  # fmt: skip
    pairs = () if done is None else tuple(
        Pair(name=f"{way.value}: {guide.value} - {Guide.LOS.value}", unit="m",
             result=paired(*(done.column("rmse", way=way.name, guide=g.name) for g in (guide, Guide.LOS))))
        for way in Way for guide in Guide if guide is not Guide.LOS
    )  # fmt: skip
    note = (
        "The paper draws these flights and prints no numbers. Fixes and commands once a second, target and follower at"
        " 2 m/s, response 1 s, fixes of 0.15 m, wind of 0.8 m/s across. In still air the printed curves keep"
        " nearest to the path; in a wind across only ours, through the trail itself, stays within about a metre."
    )
    return Table(key="lines", title="Figure 2: line of sight and curves", rows=tuple(rows), pairs=pairs, note=note)
