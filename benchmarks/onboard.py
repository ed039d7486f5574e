"""What a robot's own computer would have to do: share of one core and memory of the parts that run on board.

Measured here, in a process each; `SLOWER` extrapolates to Raspberry Pis, by published scores of one core. Geekbench 6
gives its reference, a Core i7-12700, 2500 points, and a Raspberry Pi 5 748 (github.com/geerlingguy/sbc-reviews, issue
21): 3.3 times slower than a desktop that is faster than most servers, so a cautious factor. A Raspberry Pi 4 is 1.9 to
2.5 times slower than that (sysbench, leoncode.co.uk/articles/raspberry-pi-benchmarks; worksprout.org).
`python -m benchmarks.onboard` on the device itself replaces the guess.
"""

import json
import subprocess
import sys
from dataclasses import dataclass, replace
from time import process_time
from typing import final

from benchmarks.commands import peak_mb

SLOWER = {"Raspberry Pi 5": 3.3, "Raspberry Pi 4": 8.3}
FOLLOWED_S = 40.0


@final
@dataclass(frozen=True)
class Share:
    """CPU seconds per second of the run, and the most memory of the process [MB]."""

    work: str
    share: float
    peak: float


def estimate(kind):
    """The online filter over every record of a generated log, as they come."""
    from benchmarks.engine import SECONDS, online, prepared

    online(kind)(10)
    count = prepared(kind)[2].t.size
    begun = process_time()
    online(kind)(count)
    return (process_time() - begun) / SECONDS


def control():
    """Fusion, costmap, tracks, elastic band, safety: ten cycles a second among people."""
    from benchmarks.control import cycles, drive

    cycles(len(drive()))
    return float(cycles(len(drive())).sum()) / (0.1 * len(drive()))


class Timed:
    """An agent whose decisions are timed."""

    def __init__(self, agent):
        self._agent, self.period_s, self.cpu_s = agent, agent.period_s, 0.0

    def act(self, t, records, inbox):
        """As the agent does."""
        begun = process_time()
        answer = self._agent.act(t, records, inbox)
        self.cpu_s += process_time() - begun
        return answer


def follower():
    """A drone behind another: estimate, prediction, guidance and safety filter."""
    from outrider.scenarios.build import build
    from outrider.scenarios.files import load_scenario

    for _ in range(2):  # the first one compiles
        cast = build(*load_scenario("follow-leader", {"duration_s": FOLLOWED_S}))
        timed = {r.name: replace(r, agent=Timed(r.agent)) for r in cast.team if r.name == "follower"}
        replace(cast, team=tuple(timed.get(r.name, r) for r in cast.team)).run()
    return timed["follower"].agent.cpu_s / FOLLOWED_S


WORK = {
    "estimate of a wheeled robot, every record as it comes (IMU 100 Hz)": lambda: estimate("wheeled"),
    "estimate of a drone, every record as it comes (IMU 200 Hz)": lambda: estimate("drone"),
    "whole control cycle of a ground robot among people, 10 Hz, 360 beams": control,
    "follower: estimate, prediction, guidance, safety filter": follower,
}


def shares():
    """Every part in a process of its own."""
    out = list[Share]()
    for k, work in enumerate(WORK):
        done = subprocess.run([sys.executable, "-m", "benchmarks.onboard", str(k)], capture_output=True, text=True)
        if done.returncode != 0:
            raise RuntimeError(f"{work}: {done.stderr.strip().splitlines()[-1]}")
        told = json.loads(done.stdout)
        out.append(Share(work, told["share"], told["peak"]))
    return out


def lines(measured):
    """As a table."""
    head = ["what runs", "share of one core here", *(f"{name}, extrapolated" for name in SLOWER), "memory [MB]"]
    rows = [
        [s.work, f"{s.share:.2%}", *(f"{s.share * factor:.1%}" for factor in SLOWER.values()), f"{s.peak:.0f}"]
        for s in measured
    ]
    about = "CPU time per second of the run, compiling left out; memory is the peak of a process that also simulates. "
    about += ", ".join(f"{name}: taken as {factor} times slower per core" for name, factor in SLOWER.items())
    about += " (not measured there; why: `benchmarks/onboard.py`)."
    return ["## On board", "", about, "", *("| " + " | ".join(r) + " |" for r in (head, ["---"] * len(head), *rows))]


if __name__ == "__main__":
    if len(sys.argv) > 1:
        told = list(WORK.values())[int(sys.argv[1])]()
        sys.stdout.write(json.dumps({"share": told, "peak": peak_mb()}))
    else:
        sys.stdout.write("\n".join(lines(shares())) + "\n")
