"""`outrider compare`: one trajectory against another, from files."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

import numpy as np

from outrider.core.attitudes import matrices_to_quats, quats_multiply
from outrider.core.geodesy import enu_to_geodetic, geodetic_to_enu, rotation_enu_ecef
from outrider.data import Datum, Trajectory
from outrider.errors import UsageError
from outrider.eval import Alignment, Comparison, compare
from outrider.io import folders
from outrider.io.runs import is_run_folder, read_fused
from outrider.io.trajectories import read_trajectory

SCHEMA = "outrider.comparison/1"
MARKER = "comparison.json"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FileComparison:
    """A comparison with what was compared, on the estimate's datum."""

    estimate: Trajectory
    reference: Trajectory
    errors: Comparison

    @property
    def flat(self) -> bool:
        """Whether the estimate has no height of its own: errors in three dimensions then mean nothing."""
        return not self.estimate.p[:, 2].any()

    def within(self, max_rmse_m: float | None) -> bool:
        """Whether the horizontal RMSE keeps a limit; always so without one."""
        return max_rmse_m is None or self.errors.position_2d.rmse <= max_rmse_m

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**self.errors.as_dict(), "estimate": self.estimate.name, "reference": self.reference.name}


def compare_files(
    estimate: Path,
    reference: Path,
    *,
    max_gap_s: float = 0.5,
    align: str = "none",
    topic: str | None = None,
    output: Path | None = None,
    force: bool = False,
) -> FileComparison:
    """Compare two trajectories, each a run's folder, TUM, CSV, Parquet, or a log that carries an estimate.

    Where both say where on Earth they are, the reference is brought to the estimate's datum. With `output`, a folder
    with comparison.json, map.png and error.png is written.

    Raises
    ------
    DataError            a file cannot be read, or the two have no stamp in common
    UsageError           `align` is none of none, yaw, se2, se3
    OutputExistsError    there is something at `output`
    """
    if align.upper() not in Alignment.__members__:
        raise UsageError(f"no alignment '{align}'", where="--align", fix="there are: none, yaw, se2, se3")
    if not max_gap_s > 0:
        raise UsageError("is not more than zero", where=f"--max-gap {max_gap_s:g}")
    if output is not None:
        folders.ensure_free(output, MARKER, SCHEMA, force=force)
    done = compare_trajectories(
        _read(estimate, topic), _read(reference, topic), max_gap_s=max_gap_s, alignment=Alignment[align.upper()]
    )
    if output is not None:
        _write(done, output, force=force)
    return done


def compare_trajectories(
    estimate: Trajectory,
    reference: Trajectory,
    *,
    max_gap_s: float = 0.5,
    alignment: Alignment = Alignment.NONE,
) -> FileComparison:
    """Compare two trajectories after bringing the reference to the estimate's datum."""
    if estimate.datum is not None:
        reference = at_datum(reference, estimate.datum)
    errors = compare(estimate, reference, alignment=alignment, max_gap_s=max_gap_s)
    return FileComparison(estimate=estimate, reference=reference, errors=errors)


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


def _write(done: FileComparison, output: Path, *, force: bool) -> None:
    from outrider.plot import compare_figures, save_png  # imports matplotlib

    names = (done.estimate.name or "estimate", done.reference.name or "reference")
    with folders.result_folder(output, MARKER, SCHEMA, force=force) as part:
        for name, figure in compare_figures(done.estimate, done.reference, names=names).items():
            save_png(figure, part / f"{name}.png")
        folders.write_marker(part, MARKER, done.as_dict())
