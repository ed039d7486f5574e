"""Rows of what wheels and IMU tell of each other without any filter: clocks, geometry of the base, mount of the IMU."""

from dataclasses import replace
from typing import Final

import numpy as np

from outrider.core.angles import wrap_all
from outrider.core.attitudes import matrices_to_quats, quats_to_rpy
from outrider.data import Kind, Stream
from outrider.typing import Floats
from outrider.workflows.calibration.row import Row, row_of
from outrider.workflows.calibration.turning import Against, turning
from outrider.workflows.config import FuseConfig, SourceSection
from outrider.workflows.doctor.examine import Patient, told_mount, upright
from outrider.workflows.doctor.mounting import STEP, turned
from outrider.workflows.doctor.mounting import WINDOW as FORCES
from outrider.workflows.doctor.signals import (
    GRAVITY,
    Signal,
    instants,
    seconds,
    signal,
    speed,
)
from outrider.workflows.findings.records import mean_force
from outrider.workflows.parameters import WIDEST, What
from outrider.workflows.sandwich import SURE

WIDEST_DEG: Final = 5.0  # half of the widest interval of an angle that still says something
AGAINST_GYRO: Final = "turn rate scale against the gyro"
BASE: Final = "wheel base"
TRACK: Final = "wheel track"
ZERO: Final = "steering zero"
WIDEST_SHARE: Final = 0.05  # of a wheel base or track
NORMAL: Final = 1.96  # deviations of a 95 % interval whose deviation is known
LEVEL: Final = 0.03  # m/s^2: what a calibrated accelerometer is off by, one sigma; it tilts what gravity says


def rolling_rows(p: Patient, cfg: FuseConfig) -> list[Row]:
    """Rows of wheels against the first IMU, and of its mount."""
    imu = next(iter(p.usable(Kind.IMU)), None)
    gyro = upright(p, imu) if imu is not None else None
    if imu is None or gyro is None:
        return []
    out: list[Row] = []
    rolling: Signal | None = None
    for s in p.usable(Kind.TWIST, Kind.ACKERMANN, Kind.WHEELS):
        v, found = speed(p.log, s), turning(p.log, s, gyro)
        lag = 0.0
        if found is not None:
            out += wheel_rows(cfg, s, found)
            lag = found.lag if SURE * found.sds[0] <= WIDEST[What.DELAY] else 0.0
        if rolling is None and v is not None:
            rolling = Signal(v.source, v.t - lag, v.y)
    return out + (mount_rows(p, cfg, imu, rolling) if rolling is not None else [])


def wheel_rows(cfg: FuseConfig, s: Stream, found: Against) -> list[Row]:
    """Delay of wheels, and what their turning tells: a gain, a wheel base with the steering's zero, a track."""
    told = cfg.sources.get(s.name, SourceSection())
    late, half = told.delay_s + found.lag, SURE * found.sds[0]
    rows = [("delay_s", 5, row_of(s.name, What.DELAY.value, "s", told.delay_s, late, half, WIDEST[What.DELAY]))]
    if s.kind is Kind.TWIST:
        gain, half = told.rate_gain / found.slope, abs(told.rate_gain) * SURE * found.sds[1] / found.slope**2
        rows.append(("rate_gain", 5, row_of(s.name, AGAINST_GYRO, "", told.rate_gain, gain, half, WIDEST[What.RATE])))
    else:
        key, what, known = ("wheel_base_m", BASE, told.wheel_base_m) if s.kind is Kind.ACKERMANN else (
            "track_m", TRACK, told.track_m
        )  # fmt: skip
        widest = WIDEST_SHARE * found.slope
        known = known if known is not None else float("nan")
        rows.append((key, 4, row_of(s.name, what, "m", known, found.slope, SURE * found.sds[1], widest)))
    if s.kind is Kind.ACKERMANN:
        zero, half = np.degrees([found.zero, SURE * found.sds[2]]).tolist()
        zero += told.steering_zero_deg
        row = row_of(s.name, ZERO, "deg", told.steering_zero_deg, zero, half, WIDEST_DEG)
        rows.append(("steering_zero_deg", 3, row))
    return [replace(r, section={"sources": {s.name: {key: round(r.value, n)}}}) if r.differs else r
            for key, n, r in rows]  # fmt: skip


def mount_rows(p: Patient, cfg: FuseConfig, imu: Stream, rolling: Signal) -> list[Row]:
    """Angles of the IMU's mount."""
    found = mount_angles(p, imu, rolling)
    if found is None:
        return []
    R, xyz = told_mount(p, imu), told_place(p, imu)
    told = quats_to_rpy(matrices_to_quats(R if R is not None else np.eye(3))).ravel()
    angles = told + wrap_all(found[0] - told)
    degrees = np.round(np.degrees([told, angles, found[1]]), 4) + 0.0
    rows = [
        row_of(imu.name, f"mount, {name}", "deg", float(a), float(b), float(half), WIDEST_DEG)
        for (a, b, half), name in zip(degrees.T, ("roll", "pitch", "yaw"), strict=True)
    ]
    best = [round(r.value if r.found else r.told, 2) + 0.0 for r in rows]
    section = {"sources": {imu.name: {"mount": {"xyz_m": xyz, "rpy_deg": best}}}}
    return [replace(r, section=section) if r.differs else r for r in rows]


def told_place(p: Patient, imu: Stream) -> list[float]:
    """Where the IMU sits, as far as anybody told."""
    own = p.given.sources[imu.name].mount if imu.name in p.given.sources else None
    own = own or p.given.mounts.get(imu.frame)
    if own is not None:
        return list(own.xyz_m)
    return p.log.mounts[imu.frame][:3, 3].tolist() if imu.frame in p.log.mounts else [0.0, 0.0, 0.0]


def mount_angles(p: Patient, s: Stream, rolling: Signal | None) -> tuple[Floats, Floats] | None:
    """Roll, pitch, yaw (3,) [rad] of the IMU on the body, and half of their 95 % intervals; None without gravity.

    Gravity is what is left of the mean specific force when the accelerations that the wheels ask for are taken off.
    """
    up, turn = mean_force(s), upright(p, s)
    if up is None or abs(np.linalg.norm(up) - GRAVITY) > 0.2 * GRAVITY:
        return None
    t = seconds(p.log, s)
    axes = tuple(signal(s.name, t, s.z[:, 3 + i]) for i in range(3))
    if any(a is None for a in axes):
        return None
    R, sd = turned(axes, up, rolling, turn)  # type: ignore[arg-type]
    if rolling is not None and np.isfinite(sd):
        at = instants(rolling, axes[0], STEP)  # type: ignore[arg-type]
        f = np.column_stack([a.mean(at, FORCES) for a in axes if a is not None])
        asked = np.zeros((len(at), 3))
        asked[:, 0] = rolling.slope(at, FORCES)
        asked[:, 1] = rolling.mean(at, FORCES) * (turn.mean(at, FORCES) if turn is not None else 0.0)
        for _ in range(2):
            R, sd = turned(axes, np.nanmean(f - asked @ R, axis=0), rolling, turn)  # type: ignore[arg-type]
    tilt = NORMAL * LEVEL / GRAVITY
    return quats_to_rpy(matrices_to_quats(R)).ravel(), np.array([tilt, tilt, SURE * sd])
