"""Two receivers that cannot both be right: named, exit code 1; two that agree, or one that claims little, are not."""

from dataclasses import replace

import numpy as np
import pytest

from outrider.data import EventLog, Kind, Outcome
from outrider.errors import ExitCode
from outrider.sim.logs import wheeled_log
from outrider.workflows.config import FuseConfig
from outrider.workflows.fuse import fuse
from outrider.workflows.summary import exit_code

pytestmark = pytest.mark.compiled

EARTH = 6_378_137.0


def second(log: EventLog, north: float, claim: float = 1.0) -> EventLog:
    """The same with another receiver so far off [m], which claims so many times what the first does."""
    (g,) = log.of(Kind.GNSS)
    z = g.z + np.array([north / EARTH, 0.0, 0.0])
    extra = {k: v * claim if k in ("hacc", "vacc") else v for k, v in g.extra.items()}
    return log.with_streams(replace(g, name="other", z=z, var=g.var * claim**2, extra=extra))


@pytest.fixture(scope="module")
def log() -> EventLog:
    return wheeled_log(5, 40.0)[0]


@pytest.mark.parametrize("north", [20.0, -4.0])
def test_receivers_apart_are_named_and_nothing_is_called_valid(log: EventLog, north: float) -> None:
    run = fuse(second(log, north), FuseConfig(local=False))
    assert run.findings[0].code == "contradiction"
    assert "gnss and other contradict each other" in run.findings[0].text
    assert run.findings[0].evidence is not None
    assert np.median(run.findings[0].evidence.curves[0].y) == pytest.approx(abs(north), rel=0.02)
    assert (run.outcome, exit_code(run)) == (Outcome.NOT_CREDIBLE, ExitCode.FAILED_CHECK)


@pytest.mark.parametrize(("north", "claim"), [(0.0, 1.0), (0.5, 1.0), (20.0, 1000.0)])
def test_receivers_that_can_both_be_right_are_not(log: EventLog, north: float, claim: float) -> None:
    run = fuse(second(log, north, claim), FuseConfig(local=False))
    assert "contradiction" not in {f.code for f in run.findings}


def test_who_leaves_one_out_gets_an_answer(log: EventLog) -> None:
    cfg = FuseConfig.model_validate({"sources": {"other": {"use": "score"}}, "local": False})
    run = fuse(second(log, 20.0), cfg)
    assert "contradiction" not in {f.code for f in run.findings}
    assert exit_code(run) is ExitCode.OK
    assert "contradicted" in {f.code for f in run.findings}


@pytest.mark.parametrize("names", [("gps_a", "gps_b"), ("gps_b", "gps_a")])
def test_of_two_that_drift_apart_neither_is_accused_whatever_its_name(log: EventLog, names: tuple[str, str]) -> None:
    (g,) = log.of(Kind.GNSS)
    late = (g.t - g.t[0])[:, None] * 1e-9
    away = replace(g, z=g.z + late * np.array([0.3 / EARTH, 0.0, 0.0]))
    told = log.with_streams(replace(g, name=names[0]), replace(away, name=names[1]))
    run = fuse(told, FuseConfig.model_validate({"sources": {g.name: {"use": "ignore"}}, "local": False}))
    assert run.outcome is Outcome.NOT_CREDIBLE
    assert "gps_a and gps_b contradict each other" in run.findings[0].text
    assert not {f.code for f in run.findings} & {"overconfident", "faulted", "jump", "refused"}


def test_two_that_drift_by_less_than_antennas_may_lie_apart_count_alike_whatever_their_names(log: EventLog) -> None:
    """Each by what it claims, the gate would refuse either, and the heading between the two would be anything. Which is
    fused first moves the point of linearisation: some 0.1 mm."""
    (g,) = log.of(Kind.GNSS)
    late = (g.t - g.t[0])[:, None] * 1e-9
    away = replace(g, z=g.z + late * np.array([0.025 / EARTH, 0.0, 0.0]))
    cfg = FuseConfig.model_validate({"sources": {g.name: {"use": "ignore"}}, "local": False})
    runs = [
        fuse(log.with_streams(replace(g, name=one), replace(away, name=other)), cfg)
        for one, other in (("gps_a", "gps_b"), ("gps_b", "gps_a"))
    ]
    for run in runs:
        assert run.outcome is Outcome.DEGRADED
        (named,) = (f for f in run.findings if f.severity != "info")
        assert named.code == "apart" and "gps_a and gps_b lie 0.5 m apart" in named.text
        assert named.evidence is not None and np.max(named.evidence.curves[0].y) == pytest.approx(1.0, abs=0.1)
        assert {a.source: a.used for a in run.accounts if a.kind == "GNSS"} == {"gps_a": 200, "gps_b": 200, g.name: 0}
    alone = fuse(log, FuseConfig(local=False))
    settled = alone.fused.pose.t > alone.start + 10_000_000_000
    for run in runs:
        np.testing.assert_allclose(run.fused.pose.p, runs[0].fused.pose.p, rtol=0, atol=1e-3)
        turned = np.angle(np.exp(1j * (run.fused.pose.yaw - alone.fused.pose.yaw)))
        assert np.sqrt(np.mean(turned[settled] ** 2)) < np.radians(3.0)


def test_antennas_whose_places_are_told_may_be_apart(log: EventLog) -> None:
    (g,) = log.of(Kind.GNSS)
    mounts = {
        **log.mounts,
        "behind": log.mounts[g.frame] @ np.array([[1, 0, 0, -1.0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
    }
    heading = np.interp(g.t, *course(log))
    back = np.column_stack([-np.sin(heading), -np.cos(heading) / np.cos(g.z[:, 0]), np.zeros(len(g))]) / EARTH
    told = replace(log, mounts=mounts).with_streams(replace(g, name="rear", frame="behind", z=g.z + back))
    run = fuse(told, FuseConfig(local=False))
    assert not {f.code for f in run.findings} & {"apart", "contradiction", "overconfident", "refused", "jump"}


def course(log: EventLog) -> tuple[np.ndarray, np.ndarray]:
    """Stamps and heading [rad] of a fused log."""
    pose = fuse(log, FuseConfig(local=False)).fused.pose
    return pose.t, np.unwrap(pose.yaw)


def test_one_that_two_others_contradict_stays_accused(log: EventLog) -> None:
    (g,) = log.of(Kind.GNSS)
    late = (g.t - g.t[0])[:, None] * 1e-9
    away = replace(g, name="away", z=g.z + late * np.array([0.3 / EARTH, 0.0, 0.0]))
    run = fuse(log.with_streams(replace(g, name="also"), away), FuseConfig(local=False))
    assert sum(f.code == "contradiction" for f in run.findings) == 2
    accused = {f.source for f in run.findings if f.code in ("overconfident", "faulted", "jump", "refused")}
    assert accused == {"away"}


def test_one_that_leaps_is_named(log: EventLog) -> None:
    other = second(log, 20.0)
    g, far = other.of(Kind.GNSS)
    k = len(g) // 3
    leaps = replace(far, z=np.concatenate([g.z[:k], far.z[k:]]))
    run = fuse(other.with_streams(leaps), FuseConfig(local=False))
    jump = next(f for f in run.findings if f.code == "jump")
    assert jump.source == "other"
    assert "% of it is refused" in jump.fix
    assert "rare" not in jump.fix
