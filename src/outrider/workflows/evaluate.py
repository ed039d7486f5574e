"""`outrider eval`: trajectories against a reference, from files."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final, final

import numpy as np

from outrider.core.attitudes import matrices_to_quats, quats_multiply
from outrider.core.geodesy import enu_to_geodetic, geodetic_to_enu, rotation_enu_ecef
from outrider.data import Datum, Trajectory
from outrider.errors import UsageError
from outrider.eval import Alignment, Association, Comparison, Span, Test, average_test, causes, compare_pairs, pairs_of
from outrider.eval.associate import MAX_GAP_S
from outrider.eval.spans import USUAL_SPAN
from outrider.io import folders
from outrider.io.evo import write_evo
from outrider.io.innovations import read_nis
from outrider.io.runs import INNOVATIONS, is_run_folder, read_fused
from outrider.io.trajectories import read_trajectory

LEAST: Final = 20  # records of a source below which its NIS is no statistic
SCHEMA = "outrider.evaluation/1"
MARKER = "evaluation.json"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """How errors are counted. max_gap_s : longest gap to interpolate over;  nearest_s : pair with the nearest pose
    within so many seconds instead;  alignment : what is taken out before;  span : over which drift is counted."""

    max_gap_s: float = MAX_GAP_S
    nearest_s: float | None = None
    alignment: Alignment = Alignment.NONE
    span: Span = USUAL_SPAN

    def __post_init__(self) -> None:
        if not self.max_gap_s > 0:
            raise UsageError("is not more than zero", where=f"--max-gap {self.max_gap_s:g}")
        if self.nearest_s is not None and not self.nearest_s >= 0:
            raise UsageError("is less than zero", where=f"--nearest {self.nearest_s:g}")


def alignment_named(name: str) -> Alignment:
    """By its name on the command line."""
    if name.upper() not in Alignment.__members__:
        known = ", ".join(n.lower() for n in Alignment.__members__)
        raise UsageError(f"no alignment '{name}'", where="--align", fix=f"there are: {known}")
    return Alignment[name.upper()]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FileComparison:
    """A comparison with what was compared, on the estimate's datum.

    nis : innovations of a run's folder against chi-square bounds, by source;  causes : what may explain a large error.
    """

    estimate: Trajectory
    reference: Trajectory
    pairs: Association
    errors: Comparison
    nis: Mapping[str, Test] = field(default_factory=dict[str, Test])
    causes: tuple[str, ...] = ()

    @property
    def flat(self) -> bool:
        """Whether the estimate has no height of its own: errors in three dimensions then mean nothing."""
        return not self.estimate.p[:, 2].any()

    def within(self, max_rmse_m: float | None) -> bool:
        """Whether the horizontal RMSE keeps a limit; always so without one."""
        return max_rmse_m is None or self.errors.position_2d.rmse <= max_rmse_m

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        nis = {name: asdict(test) for name, test in self.nis.items()}
        return {
            **self.errors.as_dict(),
            "estimate": self.estimate.name,
            "reference": self.reference.name,
            "nis": nis,
            "causes": list(self.causes),
        }


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """One or more estimates against one reference."""

    reference: str
    of: tuple[FileComparison, ...]

    def within(self, max_rmse_m: float | None) -> bool:
        """Whether every one keeps a limit."""
        return all(one.within(max_rmse_m) for one in self.of)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"schema": SCHEMA, "reference": self.reference, "estimates": [one.as_dict() for one in self.of]}


def evaluate_files(
    estimates: Sequence[Path],
    reference: Path,
    rules: Rules = Rules(),
    *,
    topic: str | None = None,
    output: Path | None = None,
    force: bool = False,
) -> Evaluation:
    """Compare trajectories with a reference, each a run's folder, TUM, CSV, Parquet, or a log that carries an estimate.

    Where both say where on Earth they are, the reference is brought to the estimate's datum. With `output`, a folder
    with evaluation.json and, of each estimate, a map, its errors over time and a zip that `evo_res` reads is written.

    Raises
    ------
    DataError            a file cannot be read, goes back in time, or has no stamp in common with the reference
    OutputExistsError    there is something at `output`
    """
    if output is not None:
        folders.ensure_free(output, MARKER, SCHEMA, force=force)
    read = [_read(path, topic) for path in (*estimates, reference)]
    truth, made = read.pop(), list[FileComparison]()
    for path, estimate in zip(estimates, read, strict=True):
        one = compare_trajectories(estimate, truth, rules)
        made.append(replace(one, nis=_nis(path)) if is_run_folder(path) else one)
    done = Evaluation(reference=truth.name, of=tuple(made))
    if output is not None:
        _write(done, output, force=force)
    return done


def compare_trajectories(estimate: Trajectory, reference: Trajectory, rules: Rules = Rules()) -> FileComparison:
    """Compare two trajectories after bringing the reference to the estimate's datum."""
    if estimate.datum is not None:
        reference = at_datum(reference, estimate.datum)
    pairs = pairs_of(estimate, reference, max_gap_s=rules.max_gap_s, nearest_s=rules.nearest_s)
    errors, pairs = compare_pairs(pairs, rules.alignment, rules.span)
    whole = estimate if rules.alignment is Alignment.NONE else pairs.estimate
    return FileComparison(
        estimate=estimate, reference=reference, pairs=pairs, errors=errors, causes=causes(pairs, whole)
    )  # fmt: skip


def at_datum(of: Trajectory, datum: Datum) -> Trajectory:
    """The same path in the tangent plane of another datum; unchanged if its own is unknown.

    Heights keep their reference: a geoid model is not applied.
    """
    if of.datum is None or of.datum == datum:
        return of
    lat, lon, alt = enu_to_geodetic(of.p, of.datum.lat, of.datum.lon, of.datum.alt)
    p = geodetic_to_enu(lat, lon, alt, datum.lat, datum.lon, datum.alt)
    R = rotation_enu_ecef(datum.lat, datum.lon) @ rotation_enu_ecef(of.datum.lat, of.datum.lon).T
    q = quats_multiply(np.broadcast_to(matrices_to_quats(R), of.q.shape), of.q)
    T = np.eye(6)
    T[:3, :3] = R  # the error of the attitude is in the body and stays
    return replace(of, p=p, q=q, v=of.v @ R.T, P=T @ of.P @ T.T, datum=datum)


def _read(path: Path, topic: str | None) -> Trajectory:
    if is_run_folder(path):
        return read_fused(path)
    return read_trajectory(path, topic=topic)


def _nis(folder: Path) -> dict[str, Test]:
    """NIS of the records that a run fused or withheld, by source; bounds for 95 %, correlation accounted for."""
    out: dict[str, Test] = {}
    for source, (nis, dof) in read_nis(folder / INNOVATIONS).items():
        width = round(float(np.median(dof))) if dof.size else 0
        values = nis[(dof == width) & np.isfinite(nis)]
        if width and values.size >= LEAST:
            out[source] = average_test(values.astype(np.float64), width, probability=0.95, independent=False)
    return out


def _write(done: Evaluation, output: Path, *, force: bool) -> None:
    from outrider.plot import compare_figures, save_png  # imports matplotlib

    with folders.result_folder(output, MARKER, SCHEMA, force=force) as part:
        for k, one in enumerate(done.of):
            prefix = "" if len(done.of) == 1 else f"{k + 1}-{one.estimate.name or 'estimate'}-"
            names = (one.estimate.name or "estimate", one.reference.name or "reference")
            for name, figure in compare_figures(one.estimate, one.reference, names=names).items():
                save_png(figure, part / f"{prefix}{name}.png")
            write_evo(one.pairs.estimate, one.pairs.reference, part / f"{prefix}evo.zip")
        folders.write_marker(part, MARKER, done.as_dict())
