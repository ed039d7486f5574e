"""TUM trajectories: `t x y z qx qy qz qw` a line, seconds and metres, as evo and many SLAM tools read them."""

import re
from pathlib import Path

import numpy as np

from outrider.data import Trajectory
from outrider.errors import DataError
from outrider.io.files import ensure_readable, replacing
from outrider.io.stamps import seconds_text, to_nanoseconds

FARTHEST = 1e12  # m
SHORTEST = 1e-100  # of a quaternion
A_LINE = "a line is: seconds x y z qx qy qz qw"


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
    """Read poses; a damaged line is left out and counted.

    Raises `DataError` for a file without any pose, where time stands still or runs backwards from one pose to the next,
    and where names or numbers tell of another order of the columns.
    """
    texts: list[str] = []
    rows: list[list[float]] = []
    dropped = 0
    unturned = 0  # lines of a quaternion of zeros
    widths: set[int] = set()
    with ensure_readable(path).open(encoding="utf-8-sig", errors="replace") as f:
        for line in f:
            cells = [c.strip('"') for c in re.split(r"[,;\s]+", line.strip(" \t\r\n#,;"))]
            row = _numbers(cells)
            if row is None:
                _check_names(cells, path)
                continue
            widths.add(len(cells))
            unturned += len(row) == 8 and not any(row[4:])
            if len(row) == 8 and not line.startswith("#") and _is_pose(row):
                texts.append(cells[0])
                rows.append(row[1:])
            elif not line.startswith("#"):
                dropped += 1
    t, good = to_nanoseconds(texts, "s")
    poses = np.array(rows, np.float64).reshape(-1, 7)[good]
    if not len(poses):
        raise DataError(_why_none(widths, texts, unturned), where=str(path), fix=A_LINE)
    dropped += int((~good).sum())
    t, q = t[good], poses[:, 3:]
    if (still := np.diff(t) <= 0).any():
        k = int(np.flatnonzero(still)[0]) + 1
        what = "has two poses at one time" if t[k] == t[k - 1] else "goes back in time"
        raise DataError(f"{what}: pose {k + 1} of {t.size}", where=str(path), fix="sort it, each stamp once")
    length = np.linalg.norm(q, axis=1, keepdims=True)
    if not 0.5 < (typical := float(np.median(length))) < 2.0:  # the last four are no quaternion
        raise DataError(f"its quaternions have length {typical:.3g}, not 1", where=str(path), fix=A_LINE)
    return Trajectory(t=t, p=poses[:, :3], q=q / length, name=path.stem, dropped=dropped)


def _is_pose(row: list[float]) -> bool:
    """Whether a place and a direction can be meant by a stamp and seven numbers."""
    return all(abs(v) < FARTHEST for v in row[1:4]) and SHORTEST < max(map(abs, row[4:])) < 1.0 / SHORTEST


def _numbers(cells: list[str]) -> list[float] | None:
    try:
        return [float(c) for c in cells]
    except ValueError:
        return None


def _check_names(cells: list[str], path: Path) -> None:
    """Refuse a line of eight names of which the one of the scalar part is not the last."""
    scalar = [i for i, c in enumerate(cells) if c.lower().replace("_", "") in ("qw", "w")]
    if len(cells) == 8 and scalar and scalar != [7]:
        raise DataError(f"has the columns {' '.join(cells)}", where=str(path), fix=A_LINE)


def _why_none(widths: set[int], stamps: list[str], unturned: int) -> str:
    if unturned:
        return f"holds no TUM pose: {unturned} quaternions are all zeros, which is no orientation"
    if stamps:
        return f"holds no TUM pose: its stamps, such as {stamps[0]}, are no seconds"
    others = ", ".join(str(w) for w in sorted(widths - {8})[:3])
    return f"holds no TUM pose: its lines have {others} numbers, not 8" if others else "holds no TUM pose"
