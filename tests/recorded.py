"""Real recordings through the main job, and how the runs are scored. Nothing here is fitted to a recording."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from outrider.data import EventLog, Run, Trajectory, Verdict
from outrider.eval.associate import Association, associate
from outrider.eval.outage import OutageScore, outage_windows, score_outages
from outrider.io.registry import read_log
from outrider.typing import Bools, Floats, Ints
from outrider.workflows.config import FuseConfig, MountSection
from outrider.workflows.fuse import fuse

HUSKY = "robot_localization/test/test1.bag"
FIXES = "/fix"
# The one thing that this log cannot tell: the IMU stands on its side, base <- imu = Rz(-90 deg) Rx(90 deg).
HUSKY_MOUNT = {"imu_link": MountSection(rpy_deg=(90.0, 0.0, -90.0))}
UPSTREAM_END = (-40.0454, -76.9988)  # m: where robot_localization's own test expects this profile to end
COPTER = "autopilot/copter_gps_outage_wind.tlog"
REPLAYS = "px4-ecl/test/replay_data"
STATES = "px4-ecl/test/change_indication"
FLIGHT = "px4-ulog-rs/tests/fixtures/esc_status_log.ulg"
ELLIPSE_95 = 5.991  # chi-square of two degrees of freedom


@cache
def recording(path: Path) -> EventLog:
    return read_log(path)


def husky(root: Path, **options: object) -> Run:
    return fuse(recording(root / HUSKY), FuseConfig.model_validate({"mounts": HUSKY_MOUNT, **options}))


@dataclass(frozen=True, slots=True)
class Unused:
    """Records that were kept from the filter: t (n,) ns, e (n, 2) m, nis (n,) of two degrees of freedom."""

    t: Ints
    e: Floats
    nis: Floats

    @property
    def rmse(self) -> float:
        return float(np.sqrt(np.mean(np.sum(self.e**2, axis=1))))

    @property
    def nis_per_dof(self) -> float:
        return float(np.mean(self.nis) / 2)

    @property
    def coverage(self) -> float:
        """Share inside their 95 % ellipses."""
        return float(np.mean(self.nis < ELLIPSE_95))


def unused(run: Run, source: str = FIXES) -> Unused:
    i = run.innovations[source]
    held = i.verdict == Verdict.WITHHELD
    return Unused(i.t[held], i.y[held][:, :2], i.nis[held])


def outages(root: Path, length_s: float, *, every_s: float = 10.0) -> tuple[OutageScore, Unused]:
    """One run per window; scores per window and all unused fixes together."""
    log = recording(root / HUSKY)
    windows = outage_windows(log.span[0], int(log.streams[FIXES].t[-1]), length_s, every_s=every_s)
    parts: list[Unused] = []
    for begin, end in windows:
        span = ((begin - log.span[0]) * 1e-9, (end - log.span[0]) * 1e-9)
        parts.append(unused(husky(root, local=False, output_period_s=1.0, outages_s={FIXES: (span,)})))
    pooled = Unused(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("t", "e", "nis")))
    return score_outages(windows, [p.t for p in parts], [p.e for p in parts]), pooled


def against(run: Run, reference: Trajectory) -> Association:
    """The estimate at the reference's stamps, whether or not it calls itself valid there."""
    return associate(replace(run.fused.pose, valid=np.zeros(0, np.bool_)), reference)


def rms(e: Floats) -> float:
    """Of rows: root of the mean squared norm."""
    return float(np.sqrt(np.mean(np.sum(np.atleast_2d(e.T).T ** 2, axis=1))))


def spans(t: Floats, flag: Bools) -> list[tuple[float, float]]:
    """Stretches in which a flag stands."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(int)))
    return [(float(t[a]), float(t[min(b, t.size - 1)])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def at(t: Ints, stamps: Ints, values: np.ndarray) -> np.ndarray:
    """The newest value at each stamp."""
    return values[np.clip(np.searchsorted(t, stamps, side="right") - 1, 0, t.size - 1)]


def codes(run: Run) -> Sequence[str]:
    return [f.code for f in run.findings]
