"""Each fault of the doctor's list in fifty clean logs: how often it is named, and what is named in clean ones."""

import platform
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from evidence_table import commit, cpu

from calibration_logs import late, times, turned
from outrider.core.attitudes import quats_to_matrices, rpy_to_quats
from outrider.data import EventLog
from outrider.sim.logs import drone_log, wheeled_log
from outrider.typing import Floats
from outrider.workflows.config import FuseConfig
from outrider.workflows.doctor import prescribed
from outrider.workflows.doctor.mounting import right_angled
from outrider.workflows.doctor.visit import visit

pytestmark = pytest.mark.evidence
PAGE = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "doctor.md"
SEEDS = range(1, 51)
DEGREE = np.pi / 180.0
HEAD = """# The doctor

Written by `pytest -m evidence tests/evidence/test_doctor_evidence.py`, one test a section: each fault put into clean
generated logs, seeds 1 to 50 (a rover of 100 s with IMU, wheels and RTK; a drone of 60 s with IMU, plain GNSS and its
velocity, barometer and magnetometer). *Named*: the finding is there; *mended*: what is prescribed is the fault's
opposite, within the tolerance told; delays are drawn anew for every seed, and the largest error of what is prescribed
is told. Asked for: named and mended in 95 %, alarms on clean logs in 5 % at most.
"""
SECTIONS = ("Rover, before anything is fused", "Drone, before anything is fused", "Rover, by the run")
NOTHING = FuseConfig()


@dataclass(frozen=True)
class Fault:
    """code : that names it;  spoil : (log, random numbers) -> spoilt log and what mends it;  key : that must hold that,
    of the source;  near : within this."""

    code: str
    spoil: Callable[[EventLog, np.random.Generator], tuple[EventLog, float]]
    source: str = ""
    key: str = ""
    near: float = 1e-6
    told: FuseConfig = NOTHING


def gain(
    source: str, columns: slice, factor: float
) -> Callable[[EventLog, np.random.Generator], tuple[EventLog, float]]:
    return lambda log, _: (times(log, source, columns, factor), 1.0 / factor)


def clock(*sources: str) -> Callable[[EventLog, np.random.Generator], tuple[EventLog, float]]:
    """Off by 0.12 to 0.4 s, either way."""

    def spoil(log: EventLog, rng: np.random.Generator) -> tuple[EventLog, float]:
        delay = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.12, 0.4))
        for name in sources:
            log = late(log, name, delay)
        return log, delay

    return spoil


def bolted(
    R: Callable[[np.random.Generator], Floats],
) -> Callable[[EventLog, np.random.Generator], tuple[EventLog, float]]:
    return lambda log, rng: (replace(turned(log, "imu", R(rng)), mounts={}), float("nan"))


def oblique(rng: np.random.Generator) -> Floats:
    rpy = rng.uniform([-40.0, -40.0, -180.0], [40.0, 40.0, 180.0])
    rpy[:2] += np.sign(rpy[:2]) * 25.0  # far from straight
    return quats_to_matrices(rpy_to_quats(np.radians(rpy))).reshape(3, 3)


MIRRORED = FuseConfig.model_validate({"sources": {"imu": {"mount": {"rpy_deg": [0, 0, 90]}}}})
ROVER = {
    "accelerations in g": Fault("unit-g", gain("imu", slice(3, 6), 1 / 9.80665), "imu", "force_gain"),
    "rates in degrees": Fault("unit-deg", gain("imu", slice(0, 3), 1 / DEGREE), "imu", "rate_gain"),
    "wheels in km/h": Fault("unit-kmh", gain("wheels", slice(0, 3), 3.6), "wheels", "speed_gain"),
    "wheels' turn rates in degrees": Fault("unit-deg", gain("wheels", slice(3, 6), 1 / DEGREE), "wheels", "rate_gain"),
    "gyro mirrored": Fault("turn-sense", gain("imu", slice(0, 3), -1.0), "imu", "rate_gain"),
    "gravity instead of force": Fault("turn-sense", gain("imu", slice(3, 6), -1.0), "imu", "force_gain"),
    "wheels mirrored": Fault("turn-sense", gain("wheels", slice(5, 6), -1.0), "wheels", "rate_gain"),
    "IMU at right angles": Fault("mount-found", bolted(lambda rng: right_angled()[int(rng.integers(4, 24))])),
    "IMU at no right angle": Fault("mount-found", bolted(oblique)),
    "a mount that is told wrongly": Fault("mount-conflict", lambda log, _: (log, float("nan")), told=MIRRORED),
    "wheels' clock, 0.12 to 0.4 s": Fault("clock-offset", clock("wheels"), "wheels", "delay_s", 0.05),
}
DRONE = {
    "receiver's clock, 0.12 to 0.4 s": Fault("clock-offset", clock("gnss", "gnss_velocity"), "gnss", "delay_s", 0.05),
    "accelerations in g": Fault("unit-g", gain("imu", slice(3, 6), 1 / 9.80665), "imu", "force_gain"),
}
RUN = {  # named by the run itself: the faults of `outrider.sim.FAULTS`
    "heading-wrong": "heading-conflict", "gnss-float": "overconfident", "gnss-outage": "outage", "gnss-jump": "jump",
    "wheels-scale": "wheel-scale",
}  # fmt: skip


@lru_cache(maxsize=128)
def rover(seed: int) -> EventLog:
    return wheeled_log(seed, 100.0)[0]


@lru_cache(maxsize=128)
def flight(seed: int) -> EventLog:
    return drone_log(seed, 60.0)[0]


def counted(make: Callable[[int], EventLog], name: str, fault: Fault) -> tuple[int, int, float]:
    """Seeds in which the fault was named, and mended, and the largest error of what is prescribed."""
    named, mended, worst = 0, 0, 0.0
    for seed in SEEDS:
        log, right = fault.spoil(make(seed), np.random.default_rng([seed, 12]))
        cfg, findings = prescribed(log, fault.told)
        seen = fault.code in {f.code for f in findings}
        named += seen
        value = getattr(cfg.sources.get(fault.source), fault.key, np.nan) if fault.key else np.nan
        worst = max(worst, abs(value - right)) if seen and fault.key else worst
        mended += bool(abs(value - right) <= fault.near * max(1.0, abs(right))) if fault.key else seen
        if not seen:
            print(f"{name}: seed {seed} missed ({right:.3f})", [f.code for f in findings])  # noqa: T201
    print(f"{name}: {named} named, {mended} mended")  # noqa: T201
    return named, mended, worst


def alarms(make: Callable[[int], EventLog]) -> int:
    """Seeds in which anything is found in a clean log."""
    found = {seed: [f.code for f in prescribed(make(seed), FuseConfig())[1]] for seed in SEEDS}
    print({seed: codes for seed, codes in found.items() if codes})  # noqa: T201
    return sum(bool(codes) for codes in found.values())


def write(title: str, lines: list[str]) -> None:
    """The page with this section's lines instead of those it had."""
    text = PAGE.read_text(encoding="utf-8") if PAGE.is_file() else ""
    told = {part.partition("\n")[0]: part.partition("\n")[2].strip("\n") for part in text.split("\n## ")[1:]}
    told[title] = "\n".join(
        ["", *lines, "", f"Python {platform.python_version()}, {cpu()}. Code of commit {commit()}."]
    )
    parts = [f"## {name}\n\n{told[name].strip()}\n" for name in SECTIONS if name in told]
    PAGE.write_text("\n".join([HEAD, *parts]), encoding="utf-8")


@pytest.mark.parametrize(("title", "make", "faults"), [(SECTIONS[0], rover, ROVER), (SECTIONS[1], flight, DRONE)])
def test_faults_are_named_and_clean_logs_left_alone(
    title: str, make: Callable[[int], EventLog], faults: dict[str, Fault]
) -> None:
    n, misses = len(SEEDS), list[str]()
    lines = ["| fault | finding | named | mended |", "|---|---|---|---|"]
    for name, fault in faults.items():
        named, mended, worst = counted(make, name, fault)
        right = f"{100 * mended / n:.0f} %" if fault.key else ""
        right += f" (within {fault.near:g} s; at most {worst:.3f} s off)" if fault.key == "delay_s" else ""
        lines.append(f"| {name} | `{fault.code}` | {100 * named / n:.0f} % | {right} |")
        misses += [lines[-1]] if min(named, mended) < 0.95 * n else []
    false = alarms(make)
    lines.append(f"| none | any | {100 * false / n:.0f} % | |")
    misses += [lines[-1]] if false > 0.05 * n else []
    write(title, lines)
    assert not misses, misses


def test_what_only_the_fused_log_shows() -> None:
    n, seen = len(SEEDS), dict.fromkeys([*RUN, "none"], 0)
    for seed in SEEDS:
        for name in seen:
            log = wheeled_log(seed, 100.0, faults=() if name == "none" else (name,))[0]
            codes = {
                f.code for f in visit(log, FuseConfig()).findings if f.severity != "info" or f.code == RUN.get(name)
            }
            seen[name] += RUN[name] in codes if name != "none" else bool(codes)
            if (name == "none") == bool(codes) or (name != "none" and RUN[name] not in codes):
                print(seed, name, codes)  # noqa: T201
    lines, misses = ["| fault | finding | named |", "|---|---|---|"], list[str]()
    for name, count in seen.items():
        finding = f"`{RUN[name]}`" if name in RUN else "any but information"
        lines.append(f"| {name} | {finding} | {100 * count / n:.0f} % |")
        wrong = count > 0.05 * n if name == "none" else count < 0.95 * n
        misses += [lines[-1]] if wrong else []
    write(SECTIONS[2], lines)
    assert not misses, misses
