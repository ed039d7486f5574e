"""TUM trajectories: `t x y z qx qy qz qw` a line, seconds and metres, as evo and many SLAM tools read them."""

from pathlib import Path

import numpy as np

from outrider.data import Trajectory
from outrider.errors import DataError
from outrider.io.files import ensure_readable, replacing
from outrider.io.stamps import seconds_text, to_nanoseconds


def write_tum(trajectory: Trajectory, path: Path, *, force: bool = False) -> None:
    """Write poses; stamps keep every nanosecond. Rows without a finite pose are left out: the format cannot say so.

    Velocity, covariance, datum and validity are not part of the format: use `write_table` to keep them.
    """
    poses = np.hstack([trajectory.p, trajectory.q])
    with replacing(path, force=force) as part, part.open("w", encoding="ascii", newline="\n") as f:
        f.write("# timestamp x y z qx qy qz qw\n")
        for t, row in zip(trajectory.t.tolist(), poses.tolist(), strict=True):
            if np.isfinite(row).all():
                f.write(f"{seconds_text(t)} {' '.join(f'{v:.9f}' for v in row)}\n")


def read_tum(path: Path) -> Trajectory:
    """Read poses, sorted by stamp; a damaged line or a repeated stamp is left out, a file without any pose refused."""
    texts: list[str] = []
    rows: list[list[float]] = []
    with ensure_readable(path).open(encoding="utf-8", errors="replace") as f:
        for line in f:
            cells = line.replace(",", " ").split()
            if len(cells) != 8 or line.startswith("#"):
                continue
            try:
                row = [float(c) for c in cells[1:]]
            except ValueError:
                continue
            if np.isfinite(row).all() and any(row[3:]):
                texts.append(cells[0])
                rows.append(row)
    t, good = to_nanoseconds(texts, "s")
    poses = np.array(rows, np.float64).reshape(-1, 7)[good]
    if not len(poses):
        raise DataError("holds no TUM pose", where=str(path), fix="a line is: seconds x y z qx qy qz qw")
    t, first = np.unique(t[good], return_index=True)
    q = poses[first, 3:]
    return Trajectory(t=t, p=poses[first, :3], q=q / np.linalg.norm(q, axis=1, keepdims=True), name=path.stem)
