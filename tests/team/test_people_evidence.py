"""A robot among people who look at nothing: 200 seeds of crossing, walking along and stopping in its way."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import pytest
from people import FREE_OF, STILL, Trial, drive, people

from outrider.safety.stage import Reason
from published import publish

pytestmark = [pytest.mark.evidence, pytest.mark.compiled]
SEEDS = 200
INTRODUCTION = """
Closed loop in the simulator: a mecanum robot (1.0 m/s ahead, 0.8 m/s^2, brakes 1.5 m/s^2, a disc of 0.45 m) drives 18 m
over a yard on its own estimate (GNSS, wheels, IMU), with a lidar of 360 beams at 10 Hz and its safety stage. Four
people of 0.3 m at 1.4 m/s per run, drawn by `outrider.sim.places.crowd`: half cross its way, the others walk along it,
with it or against it; 40 % of them stop for 3 to 8 s. They look at nothing, and are where the robot would be alone
within 2 s of it. A contact with a robot that moves (above 0.02 m/s) is the robot's fault; one with a robot
that stands is not, and is counted as well. What stands alone is passed no faster than the robot can stop within the gap
to it. Free time: without people.
"""


def test_all_arrive_and_none_collides() -> None:
    free = drive((), 0)
    assert free.arrived
    assert told(free.seconds, [drive(people(seed), seed) for seed in range(SEEDS)])


def told(free_s: float, trials: Sequence[Trial]) -> bool:
    """Write the table of the seeds from 0 on; whether it is as it should be."""
    n, ratio = len(trials), np.array([t.seconds / free_s for t in trials if t.arrived])
    fault = [k for k, t in enumerate(trials) if t.contact and t.speed > STILL]
    walked_into = [k for k, t in enumerate(trials) if t.contact and t.speed <= STILL]
    late = [k for k, t in enumerate(trials) if t.arrived and t.seconds > FREE_OF * free_s]
    room = np.array([t.room for t in trials])
    held: Counter[Reason] = Counter()
    for t in trials:
        held.update({reason: times for reason, (times, _) in t.interventions.items()})
    spread = f"median {np.median(ratio):.2f}, p95 {np.quantile(ratio, 0.95):.2f}, worst {ratio.max():.2f}"
    near = f"median {np.median(room):.2f} m, p5 {np.quantile(room, 0.05):.2f} m, least {room.min():.2f} m"
    rows = [
        (f"runs that arrive, seeds 0 to {n - 1}", f"{len(ratio)} of {n}", "all"),
        ("contacts while the robot moves", f"{len(fault)} {_seeds(fault)}", "0"),
        ("a standing robot walked into", f"{len(walked_into)} {_seeds(walked_into)}", "0"),
        (f"runs over {FREE_OF:g} x the free time of {free_s:.1f} s", f"{len(late)} {_seeds(late)}", "0"),
        ("time, share of the free time", spread, f"{FREE_OF:g}"),
        ("closest approach to anybody", near, "above 0"),
        *((f"safety stage: {reason.value}", f"{times} times", "") for reason, times in held.most_common()),
    ]
    publish("driving", "Driving among people", " ".join(INTRODUCTION.split()), ("what", "figure", "bound"), rows)
    return len(ratio) == n and not (fault or walked_into or late)


def _seeds(which: list[int]) -> str:
    return f"(seeds {', '.join(map(str, which))})" if which else ""
