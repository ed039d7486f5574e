"""The outage protocol on a recording: fuse it again and again, each time with a source withheld for a while, and score
what the estimate did meanwhile on the withheld records, or on a reference."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, final

import numpy as np

from outrider.data import EventLog, Run, Trajectory, Verdict
from outrider.errors import UsageError
from outrider.eval import OutageScore, Test, associate, average_test, outage_windows, position_errors, score_outages
from outrider.io import folders
from outrider.io.checked import remedy
from outrider.io.trajectories import read_trajectory
from outrider.typing import Floats, Ints
from outrider.workflows.config import FuseConfig
from outrider.workflows.evaluate import Rules, at_datum
from outrider.workflows.fuse import fuse
from outrider.workflows.fuse_file import Input, Progress

SCHEMA: Final = "outrider.outages/1"
MARKER: Final = "outages.json"
SETTLED_S: Final = 60.0  # s before the first window, in a log of five minutes and more


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Outages:
    """What became of the estimate while a source was away. nis : of the withheld records, None against a reference."""

    log: str
    source: str
    length_s: float
    every_s: float
    start: int
    score: OutageScore
    nis: Test | None

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        s = self.score
        rows = zip(((s.windows - self.start) * 1e-9).tolist(), s.rmse, s.worst, s.last, s.count, strict=True)
        windows = [
            {"start_s": a, "end_s": b, "rmse_m": rmse, "worst_m": worst, "last_m": last, "records": int(count)}
            for (a, b), rmse, worst, last, count in rows
        ]
        told = {"log": self.log, "source": self.source, "length_s": self.length_s, "every_s": self.every_s}
        nis = None if self.nis is None else asdict(self.nis)
        return {"schema": SCHEMA, **told, "summary": s.as_dict(), "nis": nis, "by_window": windows}


def outage_protocol(
    source: Input,
    config: FuseConfig,
    withheld: str,
    length_s: float,
    *,
    every_s: float = 10.0,
    reference: Path | None = None,
    rules: Rules = Rules(),
    output: Path | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Outages:
    """Withhold a source for `length_s`, once in each window that begins every `every_s`, the first after a minute, or
    a fifth of a shorter log.

    Raises UsageError for a source that the log does not hold or that tells no position (without a reference), and where
    no window fits; whatever `fuse` raises.
    """
    if output is not None:
        folders.ensure_free(output, MARKER, SCHEMA, force=force)
    log = source.read(config.robot, progress)
    if withheld not in log.streams:
        raise UsageError(f"no source '{withheld}'", where="--outages", fix=remedy(withheld, list(log.streams)))
    first, last = log.span[0], int(log.streams[withheld].t.max())
    lasts = (last - first) * 1e-9
    settled = min(SETTLED_S, 0.2 * lasts)
    windows = outage_windows(first, last, length_s, every_s=every_s, after_s=settled)
    if not len(windows):
        raise UsageError(
            f"no window of {length_s:g} s fits into {lasts:.0f} s, of which the first {settled:.0f} are left to settle",
            where="--outages",
            fix="a shorter one",
        )
    truth = None if reference is None else read_trajectory(reference)
    parts: list[tuple[Ints, Floats, Floats]] = []
    for k, window in enumerate(windows):
        if progress is not None:
            progress("fusing", k / len(windows))
        span = ((int(window[0]) - first) * 1e-9, (int(window[1]) - first) * 1e-9)
        parts.append(_errors(_fused(log, config, withheld, span), withheld, truth, rules))
    done = Outages(
        log=source.log.name, source=withheld, length_s=length_s, every_s=every_s, start=first,
        score=score_outages(windows, [p[0] for p in parts], [p[1] for p in parts]), nis=_pooled([p[2] for p in parts]),
    )  # fmt: skip
    if output is not None:
        with folders.result_folder(output, MARKER, SCHEMA, force=force) as part:
            folders.write_marker(part, MARKER, done.as_dict())
    return done


def _fused(log: EventLog, config: FuseConfig, withheld: str, span: tuple[float, float]) -> Run:
    given = {**config.outages_s, withheld: (*config.outages_s.get(withheld, ()), span)}
    return fuse(log, config.model_copy(update={"outages_s": given, "local": False}))


def _errors(run: Run, withheld: str, truth: Trajectory | None, rules: Rules) -> tuple[Ints, Floats, Floats]:
    """Stamps [ns], horizontal errors (n, 2) m and NIS of what was kept from the filter, or of the reference."""
    if truth is not None:
        pose = replace(run.fused.pose, datum=run.datum, valid=np.zeros(0, np.bool_))
        pairs = associate(pose, truth if run.datum is None else at_datum(truth, run.datum), max_gap_s=rules.max_gap_s)
        return pairs.reference.t, position_errors(pairs, 2), np.zeros(0)
    found = [i for name, i in run.innovations.items() if name == withheld or name.startswith(f"{withheld} ")]
    found = [i for i in found if {"east", "north"} <= set(i.columns)]
    if not found:
        raise UsageError(f"'{withheld}' tells no position", where="--outages", fix="give a reference to score against")
    t, e, nis = [], [], []
    for i in found:
        held = i.verdict == Verdict.WITHHELD
        columns = [i.columns.index(name) for name in ("east", "north")]
        t.append(i.t[held])
        e.append(i.y[held][:, columns].astype(np.float64))
        nis.append(np.where(i.dof[held] == len(columns), i.nis[held], np.nan))
    return np.concatenate(t), np.concatenate(e), np.concatenate(nis)


def _pooled(nis: list[Floats]) -> Test | None:
    """Of all windows; correlated within each, and windows overlap: bounds take that into account as far as they can."""
    values = np.concatenate(nis)
    values = values[np.isfinite(values)]
    return average_test(values, 2, probability=0.95, independent=False) if values.size > 1 else None
