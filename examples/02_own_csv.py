# ruff: noqa: T201
"""
A CSV of one's own
==================

A CSV of one's own: write a table and its mapping, fuse it, read the run's folder back.
"""

import csv
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from outrider.io.runs import read_fused, read_summary
from outrider.plot.motion import motion_figure
from outrider.plot.style import save_png
from outrider.sim import wheeled_log
from outrider.workflows.fuse_file import Input, fuse_file

MAPPING = """
time: {column: stamp_us, unit: us}
streams:
  gyro:
    kind: IMU
    columns: {gyro_x: wx, gyro_y: wy, gyro_z: wz}
    units: {gyro_x: deg/s, gyro_y: deg/s, gyro_z: deg/s}
    where: {sensor: gyro}
  wheels:
    kind: TWIST
    columns: {v_x: speed}
    where: {sensor: wheels}
    sigma: 0.05
  fix:
    kind: GNSS
    columns: {lat: latitude, lon: longitude, alt: height}
    units: {lat: deg, lon: deg}
    altitude: ELLIPSOID
    where: {sensor: gnss}
    sigma: 0.02
"""
COLUMNS = ("stamp_us", "sensor", "wx", "wy", "wz", "speed", "latitude", "longitude", "height")

log, _ = wheeled_log(seed=2, duration_s=60.0, rate_hz=50.0)
imu, wheels, gnss = (log.streams[name] for name in ("imu", "wheels", "gnss"))

with TemporaryDirectory() as room:
    table, mapping, output = (Path(room) / name for name in ("drive.csv", "mapping.yaml", "run"))
    with table.open("w", newline="") as f:
        writer = csv.DictWriter(f, COLUMNS)
        writer.writeheader()
        for t, (wx, wy, wz) in zip(imu.t // 1000, np.degrees(imu.z[:, :3]), strict=True):
            writer.writerow({"stamp_us": t, "sensor": "gyro", "wx": wx, "wy": wy, "wz": wz})
        for t, speed in zip(wheels.t // 1000, wheels.z[:, 0], strict=True):
            writer.writerow({"stamp_us": t, "sensor": "wheels", "speed": speed})
        for t, (lat, lon, alt) in zip(gnss.t // 1000, gnss.z, strict=True):
            place = {"latitude": np.degrees(lat), "longitude": np.degrees(lon), "height": alt}
            writer.writerow({"stamp_us": t, "sensor": "gnss", **place})
    mapping.write_text(MAPPING)

    run = fuse_file(Input(log=table, mapping=mapping), output, report=False)

    summary, fused = read_summary(output), read_fused(output)
    print(summary["outcome"]["text"])
    for account in summary["accounts"]:
        print(f"{account['source']:10} {account['role']:8} {account['used']} of {account['received']} used")
    print(f"{len(fused)} poses over {fused.length:.1f} m")

figure = motion_figure(run)
assert figure is not None  # there are poses
save_png(figure, Path("02_own_csv.png"))
print("finished")
