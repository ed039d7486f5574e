"""Lengths that others have computed on their maps: a sample here, every line in the evidence."""

from pathlib import Path

import pytest

from moving_ai_cases import ARENA, CITY, ROOMS, misses
from outrider.planning.astar import AStar


@pytest.mark.compiled
@pytest.mark.parametrize("jumps", [True, False])
@pytest.mark.parametrize("files", [CITY, ROOMS, ARENA], ids=["city", "rooms", "arena"])
def test_a_sample_of_the_optimal_lengths(recordings: Path, files: tuple[str, str, bool], jumps: bool) -> None:
    assert misses(recordings, files, AStar(jumps=jumps), every=45) == []
