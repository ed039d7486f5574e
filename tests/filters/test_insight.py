"""What an estimate tells of its sensors: honest draws agree, wrong ones do not, and what nobody measures is named."""

from dataclasses import replace

import numpy as np
import pytest
from test_cooperation import points

from outrider.filters.cooperative import Method, agreements, fuse_team, unobserved


def test_honest_records_agree_and_a_noisier_sensor_does_not(rng: np.random.Generator) -> None:
    members, sources, _ = points(rng, 2, 120, 5)
    t = np.array([11.9])
    rows = agreements(fuse_team(members, sources, Method.JOINT, t, start=0.0), sources)
    assert [(r.robot, r.sensor, r.partner) for r in rows] == [
        ("r0", "position", ""), ("r1", "position", ""), ("r0", "relative_pose", "r1"), ("r1", "relative_pose", "r0"),
    ]  # fmt: skip
    for r in rows:
        assert r.refused == 0 and r.nis == pytest.approx(1.0, abs=0.25) and r.inside > 0.85
    off = replace(sources[1], z=sources[1].z + 0.8 * rng.normal(size=sources[1].z.shape))
    bad = agreements(fuse_team(members, [sources[0], off, *sources[2:]], Method.JOINT, t, start=0.0), sources)
    assert bad[1].nis > 2.0 and bad[1].inside < 0.8


def test_a_robot_without_fixes_or_partners_is_named(rng: np.random.Generator) -> None:
    members, sources, _ = points(rng, 2, 60, 5, fixes=(0,))
    t = np.array([5.9])
    alone = unobserved(fuse_team(members, sources, Method.LOCAL, t, start=0.0))
    assert [line.split(":")[0] for line in alone] == ["position of r1", "velocity of r1"]
    assert not unobserved(fuse_team(members, sources, Method.DISTRIBUTED, t, start=0.0))
