"""Errors as a zip that the programs of evo read (`evo_res`), to stand beside what they have made."""

import json
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np

from outrider.data import Trajectory
from outrider.io.files import replacing
from outrider.io.tum import write_tum
from outrider.typing import Floats


def write_evo(estimate: Trajectory, reference: Trajectory, path: Path, *, force: bool = False) -> None:
    """Write the position error in space of two trajectories with the same stamps as evo keeps a result.

    info.json, stats.json, error_array.npy [m], timestamps.npy and seconds_from_start.npy [s], distances_from_start.npy
    [m], and both trajectories as TUM.
    """
    e = np.linalg.norm(estimate.p - reference.p, axis=1)
    t, names = reference.t, (estimate.name or "estimate", reference.name or "reference")
    ways = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(reference.p, axis=0), axis=1))])
    arrays = {
        "error_array": e, "timestamps": t * 1e-9, "seconds_from_start": (t - t[0]) * 1e-9, "distances_from_start": ways,
    }  # fmt: skip
    info = {"title": f"APE w.r.t. translation part (m)\n({names[1]} to {names[0]})", "label": "APE (m)"}
    info |= {"est_name": names[0], "ref_name": names[1]}
    with replacing(path, force=force) as part, ZipFile(part, "w", ZIP_DEFLATED) as archive:
        archive.writestr("info.json", json.dumps(info))
        archive.writestr("stats.json", json.dumps(_statistics(e)))
        for name, values in arrays.items():
            kept = BytesIO()
            np.save(kept, values)
            archive.writestr(f"{name}.npy", kept.getvalue())
        with TemporaryDirectory() as folder:
            for name, of in (("estimate", estimate), ("reference", reference)):
                write_tum(of, Path(folder) / f"{name}.tum")
                archive.write(Path(folder) / f"{name}.tum", f"{name}.tum")


def _statistics(e: Floats) -> dict[str, float]:
    """The numbers that evo keeps, by its names."""
    return {
        "rmse": float(np.sqrt(np.mean(e * e))), "mean": float(e.mean()), "median": float(np.median(e)),
        "std": float(e.std()), "min": float(e.min()), "max": float(e.max()), "sse": float(np.sum(e * e)),
    }  # fmt: skip
