"""A small synthetic run, written as MCAP and read back by rosbags and by our own reader."""

from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from outrider.core.attitudes import quats_exp, quats_log, quats_multiply, quats_to_matrices, rpy_to_quats
from outrider.core.geodesy import enu_to_geodetic
from outrider.data import (
    Account,
    Datum,
    Estimates,
    Finding,
    Kind,
    Manifold,
    Reset,
    Run,
    SensorState,
    StateLayout,
    Trajectory,
    Verdict,
    empty_estimates,
)
from outrider.errors import OutputExistsError, OutriderError
from outrider.io.mcap import ros_covariance, write_mcap
from outrider.io.rosbags import read_rosbag

T0 = 1_700_000_000_000_000_000
LAYOUT = StateLayout(("position", 3, "m"), ("attitude", Manifold.ROTATION, "rad"), ("rate", 3, "rad/s"))
DATUM = Datum(lat=0.8, lon=0.2, alt=300.0)


def estimates(n: int, rng: np.random.Generator, drift: float = 0.0) -> Estimates:
    s = np.linspace(0.0, 1.0, n)
    t = T0 + 10**7 * np.arange(n, dtype=np.int64) + 123
    q = rpy_to_quats(np.stack([0.1 * s, -0.2 * s, 2.0 * s + drift], axis=1))
    p = np.stack([10 * s + drift, 5 * s**2, 0.1 * s], axis=1)
    A = rng.normal(size=(n, 6, 6))
    P = A @ np.swapaxes(A, 1, 2)
    x = np.hstack([p, q, rng.normal(size=(n, 3))])
    pose = Trajectory(t=t, p=p, q=q, v=rng.normal(size=(n, 3)), P=P, valid=np.ones(n, np.bool_), name="fused")
    return Estimates(layout=LAYOUT, t=t, x=x, sd=np.ones((n, 9)), valid=np.ones((n, 3), np.int64), pose=pose)


def run_of(fused: Estimates, local: Estimates | None = None, **changes: Any) -> Run:
    account = Account(
        source="/fix", kind="GNSS", role="fused as position", received=10, used=9, malformed=0,
        by_verdict={Verdict.USED: 9, Verdict.GATED: 1}, rate=2.5, first=0.0, last=4.0, nis=0.9,
        state=SensorState.SUSPECT,
    )  # fmt: skip
    made = Run(
        log_path="log.bag", log_sha256="abc", config={}, seed=1, versions={"outrider": "0"}, robot="robot", start=T0,
        datum=DATUM, fused=fused, local=local, innovations={}, accounts=(account,),
        findings=(Finding(severity="error", code="heading-conflict", text="two headings", source="/imu"),),
        resets=(Reset(t=T0 + 5 * 10**7, source="/fix", state="position", delta=np.array([1.0, 2.0]), reason="gap"),),
        health={"/fix": np.array([[0.0, 0.0], [0.02, 1.0]])},
    )  # fmt: skip
    return replace(made, **changes)


def read(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """All messages by topic, and a check that they are in the order of their times."""
    out: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    with AnyReader([path]) as reader:
        last = 0
        for connection, t, raw in reader.messages():
            assert t >= last
            last = t
            out[connection.topic].append((t, reader.deserialize(raw, connection.msgtype)))
    return out


def of(v: Any) -> list[float]:
    return [getattr(v, axis) for axis in "xyzw" if hasattr(v, axis)]


def test_everything_is_there(tmp_path: Path, rng: np.random.Generator) -> None:
    fused = estimates(3000, rng)
    path = tmp_path / "run.mcap"
    write_mcap(run_of(fused), path, robot_frame="husky")
    assert [p.name for p in tmp_path.iterdir()] == ["run.mcap"]
    got = read(path)
    assert set(got) == {
        "/outrider/odometry/global", "/tf", "/tf_static", "/outrider/path", "/outrider/fix", "/diagnostics",
    }  # fmt: skip
    pose, R = fused.pose, quats_to_matrices(fused.pose.q)
    assert [t for t, _ in got["/outrider/odometry/global"]] == pose.t.tolist()
    for i in (0, 1, 2047, 2048, 2999):
        m = got["/outrider/odometry/global"][i][1]
        assert (m.header.frame_id, m.child_frame_id) == ("map", "husky")
        assert m.header.stamp.sec * 10**9 + m.header.stamp.nanosec == pose.t[i]
        assert of(m.pose.pose.position) == pose.p[i].tolist() and of(m.pose.pose.orientation) == pose.q[i].tolist()
        np.testing.assert_allclose(of(m.twist.twist.linear), R[i].T @ pose.v[i], rtol=1e-12)
        assert of(m.twist.twist.angular) == fused.x[i, 7:].tolist()
        fix = got["/outrider/fix"][i][1]
        lat, lon, alt = enu_to_geodetic(pose.p[i], DATUM.lat, DATUM.lon, DATUM.alt)
        np.testing.assert_allclose(np.radians([fix.latitude, fix.longitude]), [lat, lon], rtol=1e-14)
        assert fix.altitude == pytest.approx(alt, abs=1e-9) and fix.status.status == 0
        np.testing.assert_allclose(fix.position_covariance.reshape(3, 3), pose.P[i, :3, :3])
    assert len(got["/outrider/path"][0][1].poses) == 2000


def test_covariance_is_about_fixed_axes(rng: np.random.Generator) -> None:
    """Monte Carlo: R_hat Exp(d) = Exp(R_hat d) R_hat, so fixed-axis errors have covariance R P R'."""
    n, q0 = 20000, rpy_to_quats(np.array([0.4, -0.3, 2.0]))
    A = 0.02 * rng.normal(size=(6, 6))
    P = A @ A.T
    pose = Trajectory(t=np.array([T0]), p=np.zeros((1, 3)), q=q0[None], P=P[None])
    d = rng.multivariate_normal(np.zeros(6), P, size=n)
    turned = quats_multiply(q0, quats_exp(d[:, 3:]))
    fixed = quats_log(quats_multiply(turned, q0 * [-1, -1, -1, 1]))
    sample = np.cov(np.hstack([d[:, :3], fixed]).T)
    scale = np.sqrt(np.outer(np.diag(sample), np.diag(sample)))
    assert np.max(np.abs(ros_covariance(pose)[0] - sample) / scale) < 0.05
    assert np.max(np.abs(P - sample) / scale) > 0.2  # the body-axis covariance is not the same thing


def test_transforms_close_the_loop(tmp_path: Path, rng: np.random.Generator) -> None:
    """map -> odom times odom -> base_link is the global estimate, at every global stamp."""
    fused, local = estimates(50, rng, drift=0.7), estimates(50, rng)
    path = tmp_path / "run.mcap"
    write_mcap(run_of(fused, local), path)
    got = read(path)
    assert len(got["/outrider/odometry/local"]) == 50 and "/tf_static" not in got
    links: dict[str, list[Any]] = defaultdict(list)
    for _, message in got["/tf"]:
        (link,) = message.transforms
        links[f"{link.header.frame_id} {link.child_frame_id}"].append(link.transform)
    for i, (mo, ob) in enumerate(zip(links["map odom"], links["odom base_link"], strict=True)):
        R_mo = quats_to_matrices(np.array(of(mo.rotation)))
        np.testing.assert_allclose(
            R_mo @ of(ob.translation) + of(mo.translation), fused.pose.p[i], atol=1e-9
        )  # fmt: skip
        R = R_mo @ quats_to_matrices(np.array(of(ob.rotation)))
        np.testing.assert_allclose(R, quats_to_matrices(fused.pose.q[i]), atol=1e-9)


def test_diagnostics(tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / "run.mcap"
    write_mcap(run_of(estimates(20, rng)), path)
    messages = read(path)["/diagnostics"]
    texts = [(s.name, s.message, s.level) for _, m in messages for s in m.status]
    assert ("outrider: /fix", "healthy", 0) in texts
    assert ("outrider: heading-conflict", "two headings", 2) in texts
    assert ("outrider: reset of position", "gap", 1) in texts
    account = next(s for s in messages[-1][1].status if s.message == "fused as position")
    assert account.level == 1 and {v.key: v.value for v in account.values}["received"] == "10"
    assert messages[0][0] == T0  # health counts from the log's first event, not from the first estimate


def test_unknown_heading_and_nan(tmp_path: Path, rng: np.random.Generator) -> None:
    fused = estimates(10, rng)
    p, q, P = fused.pose.p.copy(), fused.pose.q.copy(), fused.pose.P.copy()
    q[:4], p[5], P[6] = np.nan, np.nan, np.nan
    valid = np.arange(10) > 2
    pose = replace(fused.pose, p=p, q=q, P=P, valid=valid)
    path = tmp_path / "run.mcap"
    track = Trajectory(t=pose.t[:2], p=pose.p[:2], q=pose.q[:2])
    write_mcap(run_of(replace(fused, pose=pose), tracks={"/gps/fix#a": track}), path)
    got = read(path)
    rows = [m for _, m in got["/outrider/odometry/global"]]
    assert len(rows) == 9 and len(got["/tf"]) == 5 and len(got["/outrider/tracks/gps/fix_a"]) == 2
    assert of(rows[0].pose.pose.orientation) == [0, 0, 0, 1]
    assert np.diag(rows[0].pose.covariance.reshape(6, 6))[3:].tolist() == [np.pi**2] * 3
    assert not rows[5].pose.covariance.any()  # the row after the one without a position
    assert all(
        np.isfinite([*of(m.pose.pose.position), *of(m.twist.twist.linear), *m.pose.covariance]).all() for m in rows
    )
    assert [m.status.status for _, m in got["/outrider/fix"]][:4] == [-1, -1, -1, 0]


def test_own_reader_sees_estimates_not_sensors(tmp_path: Path, rng: np.random.Generator) -> None:
    fused = estimates(30, rng)
    path = tmp_path / "run.mcap"
    write_mcap(run_of(fused), path)
    s = read_rosbag(path).streams["/outrider/odometry/global"]
    assert s.kind is Kind.ESTIMATE and s.t.tolist() == fused.pose.t.tolist()
    np.testing.assert_allclose(s.z[:, :7], np.hstack([fused.pose.p, fused.pose.q]), rtol=1e-15)
    np.testing.assert_allclose(s.z[:, 7:], fused.pose.v, rtol=1e-9, atol=1e-12)


def test_nothing_half_written(tmp_path: Path, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(b"mine")
    run = run_of(estimates(5, rng))
    with pytest.raises(OutputExistsError):
        write_mcap(run, path)
    assert path.read_bytes() == b"mine"
    monkeypatch.setattr(
        "rosbags.rosbag2.writer.Writer.write", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left"))
    )
    with pytest.raises(OutriderError, match="no space left"):
        write_mcap(run, path, force=True)
    assert path.read_bytes() == b"mine" and list(tmp_path.iterdir()) == [path]
    monkeypatch.undo()
    write_mcap(run, path, force=True)
    assert len(read(path)["/tf"]) == 5
    with pytest.raises(OutriderError, match="cannot be written"):
        write_mcap(run, tmp_path / "no" / "where.mcap")


def test_empty_run(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    empty = empty_estimates(LAYOUT)
    write_mcap(run_of(empty, resets=(), health={}), path)
    assert len(read(path)["/diagnostics"]) == 1


def test_stamps_before_zero(tmp_path: Path, rng: np.random.Generator) -> None:
    """A clock that starts at power-on, and a delay: the first stamps are negative, times of recording cannot be."""
    fused = estimates(5, rng)
    t = fused.t - T0 - 123 - 25 * 10**6
    path = tmp_path / "run.mcap"
    write_mcap(run_of(replace(fused, t=t, pose=replace(fused.pose, t=t)), start=-(10**8), resets=(), health={}), path)
    rows = read(path)["/outrider/odometry/global"]
    assert [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for _, m in rows] == t.tolist()
    assert [at for at, _ in rows] == np.maximum(t, 0).tolist()
