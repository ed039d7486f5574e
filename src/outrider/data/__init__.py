"""The nouns: frozen dataclasses of arrays. They know their shapes and names, and nothing about files or filters."""

from outrider.data.belief import Block, Ensemble, Gaussian, Manifold, StateLayout
from outrider.data.events import Altitude, EventLog, Fix, Kind, Stream, joined, stream
from outrider.data.grid import Grid
from outrider.data.run import (
    REASONS,
    Account,
    Estimates,
    Finding,
    Innovations,
    Outcome,
    Reset,
    Run,
    SensorState,
    Trouble,
    Verdict,
    empty_estimates,
    reason,
)
from outrider.data.trajectory import Datum, Trajectory

__all__ = [
    "REASONS", "Account", "Altitude", "Block", "Datum", "Ensemble", "Estimates", "EventLog", "Finding", "Fix",
    "Gaussian", "Grid", "Innovations", "Kind", "Manifold", "Outcome", "Reset", "Run", "SensorState", "StateLayout",
    "Stream", "Trajectory", "Trouble", "Verdict", "empty_estimates", "joined", "reason", "stream",
]  # fmt: skip
