"""Synthetic runs for the plot tests: a robot on a wavy loop, with every feature of a run present or left out."""

from dataclasses import replace

import numpy as np

from outrider.data import (
    Account,
    Datum,
    Estimates,
    Finding,
    Innovations,
    Manifold,
    Outcome,
    Reset,
    Run,
    SensorState,
    StateLayout,
    Trajectory,
    Verdict,
    empty_estimates,
)
from outrider.typing import Floats

LAYOUT = StateLayout(
    ("position", 2, "m"),
    ("heading", Manifold.ANGLE, "rad"),
    ("velocity", 2, "m/s"),
    ("yaw_rate", 1, "rad/s"),
    ("gyro_bias", 1, "rad/s"),
    ("wheel_scale", 1, ""),
)
T0 = 1_700_000_000_000_000_000


def trajectory(t_s: Floats, scale: float = 1.0, turn: float = 0.0, seed: int = 0, sigma: float = 0.3) -> Trajectory:
    """A wavy loop of 80 m by 50 m with covariance that grows in the middle third; stamps are `t_s` after T0."""
    phase = 2 * np.pi * t_s / max(float(t_s[-1]) if t_s.size else 0.0, 1.0)
    p = np.stack([80 * np.sin(phase), 50 * (1 - np.cos(phase)) + 4 * np.sin(5 * phase), 0 * phase], axis=1) * scale
    v = np.gradient(p, t_s, axis=0) if t_s.size > 1 else np.zeros_like(p)
    yaw = np.arctan2(v[:, 1], v[:, 0]) + turn
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    q = np.stack([0 * yaw, 0 * yaw, np.sin(yaw / 2), np.cos(yaw / 2)], axis=1)
    middle = (phase > 2.2) & (phase < 4.0)
    sd = sigma * (1 + 8 * np.where(middle, np.sin((phase - 2.2) * np.pi / 1.8), 0.0))
    P = np.zeros((t_s.size, 6, 6))
    P[:, 0, 0], P[:, 1, 1], P[:, 2, 2] = sd**2, (0.5 * sd) ** 2, 0.04
    P[:, 0, 1] = P[:, 1, 0] = 0.3 * sd**2
    P[:, 5, 5] = np.radians(2 + 10 * middle) ** 2
    noise = np.random.default_rng(seed).normal(size=p.shape) * (0.02, 0.02, 0.0)
    return Trajectory(t=T0 + (t_s * 1e9).astype(np.int64), p=p @ R.T + noise, q=q, v=v @ R.T, P=P)


def estimates(pose: Trajectory) -> Estimates:
    """Planar estimates around a trajectory: states, deviations, and invalid flags where the position is uncertain."""
    n = len(pose)
    x, sd = np.zeros((n, LAYOUT.size)), np.full((n, LAYOUT.error_size), 0.1)
    x[:, :2], x[:, 2], x[:, 3] = pose.p[:, :2], pose.yaw, np.linalg.norm(pose.v, axis=1)
    decay = np.exp(-np.linspace(0, 6, n))
    x[:, 6], sd[:, 6] = 0.002 * (1 - decay), 1e-4 + 0.01 * decay
    x[:, 7], sd[:, 7] = 0.04 * (1 - decay), 2e-3 + 0.1 * decay
    valid = np.ones((n, 3), np.int64)
    valid[np.sqrt(pose.P[:, 0, 0]) > 2.2, 0] = 0
    valid[: n // 20, 2] = 0
    return Estimates(layout=LAYOUT, t=pose.t, x=x, sd=sd, valid=valid, pose=pose)


UNITS = {"x": "m", "y": "m", "heading": "rad", "v_x": "m/s", "w_z": "rad/s"}


def innovations(t_s: Floats, columns: tuple[str, ...], seed: int = 1, outliers: float = 0.03) -> Innovations:
    """White innovations of the stated size with some gross outliers that were gated."""
    rng = np.random.default_rng(seed)
    s = np.full((t_s.size, len(columns)), 0.7) * (1 + 0.4 * np.sin(t_s / 30))[:, None]
    y = rng.normal(size=s.shape) * s
    wild = rng.random(t_s.size) < outliers
    y[wild] *= 12
    nis = ((y / s) ** 2).sum(axis=1)
    dof = np.full(t_s.size, len(columns), np.int64)
    verdict = np.where(nis > 16, int(Verdict.GATED), int(Verdict.USED))
    return Innovations(
        t=T0 + (t_s * 1e9).astype(np.int64),
        y=y,
        s=s,
        nis=nis,
        dof=dof,
        verdict=verdict,
        z=y.copy(),
        columns=columns,
        units=tuple(UNITS[c] for c in columns),
    )


def account(source: str, kind: str, n: int, state: SensorState, **kwargs: object) -> Account:
    """An account of n records, 3 % gated, unless the keywords say otherwise."""
    gated = n * 3 // 100
    base = Account(
        source=source,
        kind=kind,
        role="fused",
        received=n,
        used=n - gated,
        malformed=0,
        by_verdict={Verdict.USED: n - gated, Verdict.GATED: gated},
        rate=n / 300,
        first=0.0,
        last=300.0,
        nis=1.07,
        state=state,
    )
    return replace(base, **kwargs)  # type: ignore[arg-type]


def full_run(n: int = 3000, lasts: float = 300.0) -> Run:
    """A run in which every section of the report has something to show."""
    t = np.linspace(0.0, lasts, n)
    pose = trajectory(t)
    local = trajectory(t, scale=0.96, turn=0.7, seed=3, sigma=0.1)
    fixes = np.linspace(0.0, lasts, 300) if lasts else np.zeros(1)
    gnss = trajectory(fixes, seed=5)
    rough = gnss.p + np.random.default_rng(7).normal(size=gnss.p.shape) * (1.2, 1.2, 0.0)
    rough[40 % len(rough)] = (-4e6, 3e6, 0.0)
    health = {
        "gnss/fix": np.array(
            [[0, 0], [5, 1], [0.35 * lasts, 2], [0.4 * lasts, 5], [0.6 * lasts, 4], [0.65 * lasts, 1]], float
        ),
        "imu/data": np.array([[0, 0], [1, 1]], float),
        "imu/yaw": np.array([[0, 0], [2, 2], [20, 3]], float),
        "husky_velocity_controller/odom": np.array([[0, 1]], float),
    }
    return Run(
        log_path="/logs/field day/husky_2025-04-02.bag",
        log_sha256="9f2c" * 16,
        config={
            "model": {"kind": "planar", "sigma_accel": 1.5, "mounts": {"imu": [0.1, 0.0, 0.3]}},
            "sources": {"gnss/fix": {"gate": 0.9999, "floor": None}, "imu/data": {"use": True, "delay": 0.0}},
            "health": {"gate_probability": 0.999},
        },
        seed=7,
        versions={"outrider": "0.1.0", "numpy": "2.1", "python": "3.11.9"},
        robot="husky",
        start=T0,
        datum=Datum(lat=np.radians(49.9), lon=np.radians(8.9), alt=112.3),
        fused=estimates(pose),
        local=estimates(local),
        innovations={
            "gnss/fix": innovations(fixes, ("x", "y")),
            "imu/yaw": innovations(fixes, ("heading",), seed=4, outliers=0.7),
            "husky_velocity_controller/odom": innovations(t, ("v_x", "w_z"), seed=2, outliers=0.001),
        },
        accounts=(
            account("gnss/fix", "GNSS", 300, SensorState.HEALTHY, malformed=2, received=302),
            account(
                "imu/data",
                "IMU",
                30000,
                SensorState.HEALTHY,
                used=30000,
                by_verdict={Verdict.INPUT: 30000},
                nis=np.nan,
                role="fused: drives the prediction",
            ),
            account(
                "imu/yaw",
                "ATTITUDE",
                300,
                SensorState.FAULTED,
                used=12,
                nis=41.0,
                by_verdict={Verdict.USED: 12, Verdict.GATED: 90, Verdict.FAULTED: 190, Verdict.NOT_FINITE: 8},
            ),
            account("husky_velocity_controller/odom", "TWIST", n, SensorState.HEALTHY, nis=0.9),
            account(
                "baro",
                "BARO",
                0,
                SensorState.SILENT,
                role="not used: the planar model has no height",
                by_verdict={},
                used=0,
                rate=np.nan,
                first=np.nan,
                last=np.nan,
                nis=np.nan,
            ),
        ),
        findings=(
            Finding(severity="info", code="clock-ok", text="All sources share one clock to within 3 ms."),
            Finding(
                severity="warning",
                code="gnss-outage",
                source="gnss/fix",
                text="No usable fix for 60 s, from 120 s to 180 s.",
                fix="Look at the sky view on that stretch; the estimate coasted on wheels and gyro.",
            ),
            Finding(
                severity="error",
                code="heading-conflict",
                source="imu/yaw",
                text="The IMU's yaw disagrees with the course over ground by 96° (median, 212 s of motion).",
                fix="Its yaw is magnetic: set `reference: magnetic` and `sense: clockwise`, or leave it out.",
            ),
        ),
        resets=(
            Reset(
                t=T0 + int(0.62 * lasts * 1e9),
                source="gnss/fix",
                state="position",
                delta=np.array([2.1, -0.7, 0.0]),
                reason="10 consistent fixes after an outage of 60 s",
            ),
            Reset(
                t=T0 + int(0.1 * lasts * 1e9),
                source="gnss/fix",
                state="heading",
                delta=np.array([0.31]),
                reason="course over ground",
            ),
        ),
        tracks={
            "gnss/fix": replace(gnss, p=rough),
            "husky_velocity_controller/odom": trajectory(t, scale=0.9, turn=0.2),
        },
        health=health,
        outcome=Outcome.DEGRADED,
        wall_seconds=1.2,
    )


def empty_run() -> Run:
    """A run that never produced anything."""
    return replace(
        full_run(10),
        log_path="",
        log_sha256="",
        config={},
        versions={},
        datum=None,
        fused=empty_estimates(LAYOUT),
        local=None,
        innovations={},
        accounts=(),
        findings=(),
        resets=(),
        tracks={},
        health={},
        outcome=Outcome.NO_DATA,
        wall_seconds=float("nan"),
    )
