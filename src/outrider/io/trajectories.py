"""Trajectories and runs as files that spreadsheets, pandas and maps open: CSV, Parquet, GeoJSON; and back."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from outrider.core.geodesy import enu_to_geodetic, geodetic_to_enu
from outrider.data import Datum, Kind, Run, Stream, Trajectory
from outrider.errors import DataError, UsageError
from outrider.io.euroc import GROUND_TRUTH, read_euroc_truth
from outrider.io.files import closest, ensure_readable, is_directory, replacing
from outrider.io.kitti import are_kitti_poses, read_kitti_poses
from outrider.io.tum import FARTHEST, read_tum
from outrider.typing import Floats

POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
VELOCITY = ("v_east", "v_north", "v_up")
AXES = ("x", "y", "z", "rx", "ry", "rz")  # rows of the pose covariance: position, rotation vector in the body frame
COVARIANCE = tuple((i, k, f"cov_{AXES[i]}_{AXES[k]}") for i in range(6) for k in range(i, 6))
DATUM = ("datum_lat_deg", "datum_lon_deg", "datum_alt_m", "datum_altitude")
Columns = dict[str, Any]


def trajectory_columns(trajectory: Trajectory) -> Columns:
    """Columns by name: t_ns, pose; velocity, covariance, validity and geodetic position as far as they are known."""
    n = len(trajectory)
    columns: Columns = {"t_ns": trajectory.t}
    columns |= dict(zip(POSE, np.hstack([trajectory.p, trajectory.q]).T, strict=True))
    if len(trajectory.v) == n:
        columns |= dict(zip(VELOCITY, trajectory.v.T, strict=True))
    if len(trajectory.P) == n:
        columns |= {name: trajectory.P[:, i, k] for i, k, name in COVARIANCE}
    if len(trajectory.valid) == n:
        columns["valid"] = trajectory.valid.astype(np.int64)
    if (datum := trajectory.datum) is not None:
        lat, lon, alt = enu_to_geodetic(trajectory.p, datum.lat, datum.lon, datum.alt)
        columns |= {"lat_deg": np.degrees(lat), "lon_deg": np.degrees(lon), "alt_m": alt}
        origin = (np.degrees(datum.lat), np.degrees(datum.lon), datum.alt, datum.altitude)
        columns |= {name: np.full(n, value) for name, value in zip(DATUM, origin, strict=True)}
    return columns


def run_columns(run: Run) -> Columns:
    """The fused trajectory, then every state but the pose with its standard deviation, then the validity flags."""
    columns, fused = trajectory_columns(run.fused.pose), run.fused
    for block in fused.layout:
        names = [n for n in fused.layout.names if n == block.name or n[:-2] == block.name]
        for k, name in enumerate(names):
            if block.state.stop - block.state.start == len(names):  # a rotation stands in the pose already
                columns[name] = fused.x[:, block.state.start + k]
            columns[f"sd_{name}"] = fused.sd[:, block.error.start + k]
    for k, name in enumerate(("position", "velocity", "heading")):
        columns[f"valid_{name}"] = np.asarray(fused.valid[:, k])
    return columns


def write_table(what: Trajectory | Run, path: Path, *, force: bool = False) -> None:
    """Write as .csv or .parquet, by the ending. Numbers keep every bit, stamps every nanosecond."""
    columns = run_columns(what) if isinstance(what, Run) else trajectory_columns(what)
    if path.suffix not in (".csv", ".parquet"):
        raise UsageError(f"no table format '{path.suffix}'", where=str(path), fix="end the name in .csv or .parquet")
    with replacing(path, force=force) as part:
        if path.suffix == ".parquet":
            import pyarrow as pa
            from pyarrow import parquet

            with part.open("wb") as f:  # not by name, which for pyarrow must be UTF-8
                parquet.write_table(pa.table(columns), f)
        else:
            with part.open("w", encoding="utf-8", newline="") as f:
                writer = csv.writer(f)
                writer.writerow(columns)
                writer.writerows(zip(*(np.asarray(c).tolist() for c in columns.values()), strict=True))


def write_geojson(trajectory: Trajectory, path: Path, *, force: bool = False) -> None:
    """Write the path as an RFC 7946 LineString (longitude, latitude, height) with stamps as properties.

    Heights are above what the datum says; RFC 7946 asks for the ellipsoid, so others are left out. Positions that are
    not finite are left out.
    """
    datum = trajectory.datum
    if datum is None:
        raise UsageError("has no datum, so no latitudes", where=trajectory.name or str(path), fix="write TUM or CSV")
    keep = np.isfinite(trajectory.p).all(axis=1)
    lat, lon, alt = enu_to_geodetic(trajectory.p[keep], datum.lat, datum.lon, datum.alt)
    places = np.column_stack([np.degrees(lon).round(9), np.degrees(lat).round(9), alt.round(3)])
    points = places[:, : 3 if datum.altitude == "ELLIPSOID" else 2].tolist()
    geometry: dict[str, Any] = {"type": "LineString", "coordinates": points}
    if len(points) < 2:  # a line needs two positions
        geometry = {"type": "Point", "coordinates": points[0]} if points else {"type": "MultiPoint", "coordinates": []}
    properties = {"name": trajectory.name, "altitude": datum.altitude, "length_m": round(trajectory.length, 3)}
    properties["t_ns"] = trajectory.t[keep].tolist()
    feature = {"type": "Feature", "properties": properties, "geometry": geometry}
    with replacing(path, force=force) as part:
        part.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}), encoding="utf-8")


def read_table(path: Path) -> Trajectory:
    """Read what `write_table` wrote."""
    columns = _parquet(path) if path.suffix == ".parquet" else _csv(ensure_readable(path))
    missing = [c for c in ("t_ns", *POSE) if c not in columns]
    if missing:
        raise DataError(f"no column '{missing[0]}'", where=str(path), fix=closest(missing[0], columns))
    try:
        made = _trajectory(columns, path.stem)
    except (ValueError, OverflowError) as e:
        cell = str(e).rpartition(": ")[2][:60]
        raise DataError(f"holds {cell}, which is no number", where=str(path), fix="write the table again") from None
    if not (np.abs(made.p) < FARTHEST).all():
        row = int(np.flatnonzero(~(np.abs(made.p) < FARTHEST).all(axis=1))[0])
        what = f"row {row + 1} has no position: {made.p[row].tolist()}"
        raise DataError(what, where=str(path), fix="write the table again")
    return made


def _trajectory(columns: Columns, name: str) -> Trajectory:
    def numbers(*names: str) -> Floats:
        return np.column_stack([np.asarray(columns[c], np.float64) for c in names])

    t = np.array([int(v) for v in columns["t_ns"]], np.int64)
    pose, more = numbers(*POSE), {}
    if all(c in columns for c in VELOCITY):
        more["v"] = numbers(*VELOCITY)
    if all(c in columns for _, _, c in COVARIANCE):
        P = np.zeros((t.size, 6, 6))
        for i, k, c in COVARIANCE:
            P[:, i, k] = P[:, k, i] = np.asarray(columns[c], np.float64)
        more["P"] = P
    if "valid" in columns:
        more["valid"] = np.asarray(columns["valid"], np.float64) > 0
    datum = None
    if t.size and all(c in columns for c in DATUM):
        lat, lon, alt = (float(columns[c][0]) for c in DATUM[:3])
        datum = Datum(lat=np.radians(lat), lon=np.radians(lon), alt=alt, altitude=str(columns[DATUM[3]][0]))
    return Trajectory(t=t, p=pose[:, :3], q=pose[:, 3:], datum=datum, name=name, **more)


def _csv(path: Path) -> Columns:
    with path.open(encoding="utf-8", errors="replace", newline="") as f:
        reader = csv.reader(line.replace("\0", "") for line in f)
        header = next(reader, [])
        rows = [row for row in reader if len(row) == len(header)]  # a truncated last row is left out
    return dict(zip(header, zip(*rows, strict=True), strict=False)) if rows else dict.fromkeys(header, ())


def _parquet(path: Path) -> Columns:
    import pyarrow as pa
    from pyarrow import parquet

    try:
        with ensure_readable(path).open("rb") as f:
            table = parquet.read_table(f)
    except (pa.ArrowException, OSError):
        raise DataError("is no Parquet file, or a damaged one", where=str(path), fix="write it again") from None
    return {name: table.column(name).to_pylist() for name in table.column_names}


def estimate_trajectory(s: Stream) -> Trajectory:
    """Another estimator's answer (an ESTIMATE or POSE stream) as a trajectory; repeated stamps and holes left out.

    Where the stream has latitudes, the datum is the first of them and positions are metres from there.
    """
    if s.kind not in (Kind.ESTIMATE, Kind.POSE, Kind.ODOMETRY_POSE):
        raise DataError(f"{s.kind.name} is no trajectory", where=s.name, fix="choose an ESTIMATE or POSE stream")
    geodetic = np.column_stack([s.extra[c] for c in ("lat", "lon", "alt")]) if "lat" in s.extra else s.z[:, :3]
    geodetic = geodetic if np.isfinite(geodetic).all(axis=1).any() else s.z[:, :3]
    known = np.flatnonzero(np.isfinite(geodetic).all(axis=1))
    t, first = np.unique(s.t[known], return_index=True)
    rows, p, datum = known[first], s.z[known[first], :3], None
    if "lat" in s.extra and rows.size and np.isfinite(s.extra["lat"][rows[0]]):
        lat, lon, alt = geodetic[rows].T
        datum = Datum(lat=float(lat[0]), lon=float(lon[0]), alt=float(alt[0]), altitude=s.altitude.name)
        p = geodetic_to_enu(lat, lon, alt, datum.lat, datum.lon, datum.alt)
    v = s.z[rows, 7:10] if s.kind is Kind.ESTIMATE else np.zeros((0, 3))
    valid = s.extra["valid"][rows] > 0 if "valid" in s.extra else np.zeros(0, np.bool_)
    return Trajectory(t=t, p=p, q=s.z[rows, 3:7], v=v, valid=valid, datum=datum, name=s.name)


def read_trajectory(path: Path, *, topic: str | None = None) -> Trajectory:
    """A trajectory to compare: our CSV or Parquet, TUM, or the estimate that a log carries.

    topic : which stream of a log, if it has several (by default the first ESTIMATE, else the first POSE).
    """
    from outrider.io.registry import REPLAY_ROW, read_log

    if path.suffix == ".parquet":
        return read_table(path)
    if not is_directory(path) and path.suffix.lower() in (".csv", ".txt", ".tum"):
        with ensure_readable(path).open("rb") as f:
            first = f.read(1000).decode("utf-8", "replace")
        if first.startswith("t_ns,"):
            return read_table(path)
        if first.startswith("Timestamp,state[0]"):
            from outrider.io.replay import read_change_indication

            return read_change_indication(path)
        if REPLAY_ROW.match(first.encode()):
            fix = "give what EKF2 made of them, change_indication/*.csv, or a run's folder"
            raise DataError("holds measurements for EKF2 and no estimate", where=str(path), fix=fix)
        if GROUND_TRUTH.match(first):
            return read_euroc_truth(path)
        if are_kitti_poses(first):
            return read_kitti_poses(path)
        return read_tum(path)

    log = read_log(path, topics=None if topic is None else [topic])
    streams = log.of(Kind.ESTIMATE) or log.of(Kind.POSE, Kind.ODOMETRY_POSE)
    if not streams:
        raise DataError("carries no estimate to compare with", where=str(path), fix="give a TUM or CSV trajectory")
    return estimate_trajectory(streams[0])
