"""Commands typed wrongly, with spoilt files, into places that cannot be: each answers, or says in one line why not."""

import io
import json
import os
import re
import shutil
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from itertools import pairwise
from pathlib import Path

import numpy as np
from fuzzing import CAP_S, WAYS, HangError, Seed, limited, spoilt
from numpy.random import Generator

from outrider.cli import main
from outrider.scenarios.files import load_scenario, scenario_text

FUSE = ("--json", "--no-report", "-q", "-o", "new")
SCENE = ("--duration", "0.5", "--json", "--no-report", "-q", "-o", "new")
TRIALS = ("--runs", "1", "--workers", "0", "--set", "duration_s=0.5", "--json", "-q")
FILES: dict[str, tuple[str, tuple[str, ...]]] = {  # which file of the place is spoilt, and what is typed
    "sources": ("log.mcap", ("sources", "log.mcap", "--json", "-q")),
    "sources, ulog": ("x.ulg", ("sources", "x.ulg", "--json", "-q")),
    "sources -c": ("fuse.yaml", ("sources", "log.mcap", "-c", "fuse.yaml", "--json", "-q")),
    "fuse": ("log.mcap", ("fuse", "log.mcap", *FUSE)),
    "fuse, nmea": ("x.nmea", ("fuse", "x.nmea", *FUSE)),
    "fuse, ekf2 replay": ("x.csv", ("fuse", "x.csv", *FUSE)),
    "fuse -c": ("fuse.yaml", ("fuse", "log.mcap", "-c", "fuse.yaml", *FUSE)),
    "fuse -c ekf.yaml": ("ekf.yaml", ("fuse", "log.mcap", "-c", "ekf.yaml", *FUSE)),
    "sources --mapping": ("m.yaml", ("sources", "table.csv", "--mapping", "m.yaml", "--json", "-q")),
    "doctor": ("log.mcap", ("doctor", "log.mcap", "--json", "-q")),
    "doctor --report": ("log.mcap", ("doctor", "log.mcap", "--json", "-q", "--report", "page.html")),
    "doctor -c": ("fuse.yaml", ("doctor", "log.mcap", "-c", "fuse.yaml", "--json", "-q")),
    "calibrate": ("log.mcap", ("calibrate", "log.mcap", "--json", "-q", "-o", "new.yaml")),
    "calibrate -c": ("fuse.yaml", ("calibrate", "log.mcap", "-c", "fuse.yaml", "--json", "-q")),
    "eval ESTIMATE": ("a.tum", ("eval", "a.tum", "b.tum", "--json", "-q")),
    "eval REFERENCE": ("b.tum", ("eval", "a.tum", "b.tum", "--align", "se2", "--json", "-q")),
    "eval TABLE": ("a.csv", ("eval", "a.csv", "b.csv", "--json", "-q")),
    "eval --outages": ("fuse.yaml", ("eval", "log.mcap", "--outages", "/gnss=1", "--every", "1", "-c",
                                                      "fuse.yaml", "--json", "-q")),
    "map": ("site.yaml", ("map", "site.yaml", "--json", "--no-report", "-q", "--resolution", "0.5", "-o",
                                  "new")),
    "map, GeoJSON": ("site.geojson", ("map", "site.geojson", "--json", "--no-report", "-q", "-o",
                                                       "new", "--resolution", "0.5")),
    "map, a map's": ("map.yaml", ("map", "map.yaml", "--json", "--no-report", "-q", "-o", "new")),
    "map --control-points": ("p.yaml", ("map", "x.png", "--control-points", "p.yaml", "--json",
                                                          "--no-report", "-q", "-o", "new")),
    "run": ("scene.yaml", ("run", "scene.yaml", *SCENE)),
    "run --dry-run": ("scene.yaml", ("run", "scene.yaml", "--dry-run", "--json")),
    "run, following": ("follow-leader.yaml", ("run", "follow-leader.yaml", "--dry-run", "--json")),
    "run, tracks": ("airliner-tour.yaml", ("run", "airliner-tour.yaml", "--dry-run", "--json")),
    "run, goals": ("amr2025-map1.yaml", ("run", "amr2025-map1.yaml", "--dry-run", "--json")),
    "run, patrol": ("guard.yaml", ("run", "guard.yaml", "--dry-run", "--json")),
    "run, the site of a patrol": ("yard.yaml", ("run", "guard.yaml", "--dry-run", "--json")),
    "campaign": ("scene.yaml", ("campaign", "scene.yaml", *TRIALS, "-o", "new")),
    "campaign, of logs": ("logs/log.mcap", ("campaign", "logs", "--runs", "1", "--workers", "0", "--json", "-q",
                                                    "-o", "new")),
    "campaign report, campaign.json": ("trials/campaign.json", ("campaign", "report", "trials", "--json", "-q")),
    "campaign report, rows.jsonl": ("trials/rows.jsonl", ("campaign", "report", "trials", "--json", "-q")),
    "campaign replay, campaign.json": ("trials/campaign.json", ("campaign", "replay", "trials", "1", "-q", "-o",
                                                                    "new")),
    "campaign replay, rows.jsonl": ("trials/rows.jsonl", ("campaign", "replay", "trials", "1", "-q", "-o", "new")),
    "campaign --resume, campaign.json": ("trials/campaign.json", ("campaign", "scene.yaml", "--runs", "2", "--set",
                                         "duration_s=0.5", "--workers", "0", "--json", "-q", "--resume", "-o",
                                         "trials")),
    "campaign --resume, rows.jsonl": ("trials/rows.jsonl", ("campaign", "scene.yaml", "--runs", "2", "--set",
                                      "duration_s=0.5", "--workers", "0", "--json", "-q", "--resume", "-o", "trials")),
    "eval, summary.json": ("fused/summary.json", ("eval", "fused", "fused/fused.tum", "--json", "-q")),
    "eval, estimates.parquet": ("fused/estimates.parquet", ("eval", "fused", "fused/fused.tum", "--json", "-q")),
}  # fmt: skip
LINES: dict[str, tuple[str, ...]] = {  # sound command lines, to be typed wrongly
    "fuse": ("fuse", "log.mcap", "-c", "fuse.yaml", "--seed", "3", "--preset", "default", "--mount",
             "imu=0,0,0,0,0,90", "--datum", "52.5,13.3,40", "--withhold", "/gnss=5", "--topic", "/gnss", "--topic",
             "/imu", "--topic", "/wheels", "--start", "0.5", "--end", "2.5", "--set", "history_s=1", *FUSE),
    "sources": ("sources", "log.mcap", "-c", "fuse.yaml", "--start", "0.5", "--end", "2.5", "--json", "-q"),
    "sources --mapping": ("sources", "table.csv", "--mapping", "m.yaml", "--json", "-q"),
    "doctor": ("doctor", "log.mcap", "-c", "fuse.yaml", "--start", "0.5", "--end", "2.5", "-o", "new.yaml", "--json",
               "-q"),
    "doctor --self": ("doctor", "--self", "--json"),
    "calibrate": ("calibrate", "log.mcap", "-c", "fuse.yaml", "--start", "0.5", "--end", "2.5", "-o", "new.yaml",
                  "--json", "-q"),
    "calibrate --tune": ("calibrate", "log.mcap", "--tune", "-o", "new.yaml", "--json", "-q"),
    "eval": ("eval", "a.tum", "b.tum", "--align", "se2", "--span", "10s", "--max-gap", "0.5", "--nearest", "0.1",
             "--max-rmse", "5", "--format", "json", "-q", "-o", "new"),
    "eval --outages": ("eval", "log.mcap", "--outages", "/gnss=1", "--every", "1", "-c", "fuse.yaml", "--json", "-q"),
    "run": ("run", "scene.yaml", "--set", "radio.loss=0.1", "--seed", "4", *SCENE),
    "run, by name": ("run", "site-patrol", "--set", "seed=2", "--dry-run", "--json"),
    "run --list": ("run", "--list", "--json"),
    "campaign": ("campaign", "scene.yaml", "--vary", "radio.loss=0.1,0.2", "--sampling", "lhs", "--seed", "3",
                 "--engine", "processes", *TRIALS, "-o", "new"),
    "campaign --vary": ("campaign", "scene.yaml", "--vary", "team.rover.sensors.0.rate_hz=20:50", "--vary",
                        "radio.latency_s=0.01:0.03:2", *TRIALS, "-o", "new"),
    "campaign report": ("campaign", "report", "trials", "--value", "duration_s", "--json", "-q"),
    "campaign replay": ("campaign", "replay", "trials", "1", "-q", "-o", "new"),
    "campaign --resume": ("campaign", "scene.yaml", "--runs", "2", "--set", "duration_s=0.5", "--workers", "0",
                          "--json", "-q", "--resume", "-o", "trials"),
    "swarm": ("swarm", "circle", "--drones", "4", "--duration", "1", "--seed", "1", "--loss", "0.1", "--late", "0.2",
              "--separation", "1.5", "--no-report", "--json", "-q", "-o", "new"),
    "swarm column": ("swarm", "column", "--drones", "3", "--duration", "120", "--silent", "2,60,90", "--no-report",
                     "--json", "-q", "-o", "new"),
    "map": ("map", "site.yaml", "--resolution", "0.5", "--robot-radius", "0.3", "--json", "--no-report", "-q", "-o",
            "new"),
    "map --control-points": ("map", "x.png", "--control-points", "p.yaml", "--robot-radius", "0.3", "--json",
                             "--no-report", "-q", "-o", "new"),
    "papers": ("papers", "coop2024", "--seeds", "0", "--workers", "0", "--format", "json", "-q", "-o", "new"),
    "papers --list": ("papers", "--list", "--format", "json"),
    "schema": ("schema", "fuse"),
}  # fmt: skip
REFUSED: dict[str, tuple[str, ...]] = {  # sound ones take long: only what cannot be is typed
    "demo": ("demo", "--seed", "5", "-q", "--json", "-o", "new"),
    "demo --team": ("demo", "--team", "--seed", "5", "-q", "--json", "-o", "new"),
}
NONE = ("nan", "inf", "-1", "-0.5", "1e308", "", "abc", "1_000", "0x10", "1,2,3", "[1, 2]", "{a: 1}", "null", "- 1",
        "\udcff", "a=b=c", "1:2:0", "x" * 3000, "99999999999999999999999", "1.5.2", "'")  # fmt: skip
ODD = ("0", "1e-320", "true", " ", "é", "1:1", "9223372036854775807", "--", "-", ".", "..", "a.b=1", "*", "%s", "\t\n")
PLACES = ("missing.yaml", "nowhere/x", "folder", "blank", "binary.yaml", "/dev/null", "blank/x", "y" * 300, "link",
          "fused", "trials", "log.mcap", "scene.yaml", "fuse.yaml", "table.csv", "x.png")  # fmt: skip
OUTPUTS = ("folder", "blank", "blank/x", "y" * 300, "link", "/dev/null", "/dev/null/x", "/proc/x", "fused", "trials",
           "log.mcap", "scene.yaml")  # fmt: skip


def spoilt_line(line: Sequence[str], rng: Generator, *, surely: bool = False) -> tuple[str, list[str]]:
    """A way to type a command wrongly, and its words; `surely` so that it cannot be done."""
    words, options = list(line), [k for k, w in enumerate(line) if w.startswith("-") and len(w) > 2]
    valued = [k for k in range(1, len(line)) if not line[k].startswith("-")]
    how = str(rng.choice(["value", "place", "option", "twice", "left out", "more", "output", "swapped"]))
    if surely and how not in ("option", "output"):
        how, valued = "value", [line.index("--seed") + 1]
    how = how if options or how != "option" else "more"
    how = how if valued or how not in ("value", "place", "swapped") else "more"
    if how == "value":
        k, word = int(rng.choice(valued)), str(rng.choice(NONE if surely or rng.random() < 0.6 else ODD))
        numbers = list(re.finditer(r"(?<![\w/])-?\d+\.?\d*", words[k]))
        part = numbers[int(rng.integers(len(numbers)))].span() if numbers else (0, len(words[k]))
        a, b = part if rng.random() < 0.5 and not surely else (0, len(words[k]))
        words[k] = words[k][:a] + word + words[k][b:]
    elif how == "place":
        words[int(rng.choice(valued))] = str(rng.choice(PLACES))
    elif how == "option":
        k = int(rng.choice(options))
        at = int(rng.integers(2, len(words[k])))
        words[k] = words[k][:at] + str(rng.choice(["", "x", words[k][at]])) + words[k][at + 1 :] + "q" * surely
    elif how == "twice":
        k = int(rng.integers(1, len(words)))
        words[k:k] = words[k : k + int(rng.integers(1, 3))]
    elif how == "left out":
        del words[int(rng.integers(1, len(words))) :][: int(rng.integers(1, 2))]
    elif how == "more":
        words.insert(int(rng.integers(1, len(words) + 1)), str(rng.choice([*NONE, *ODD, *PLACES])))
    elif how == "output":
        words = [w for k, w in enumerate(words) if w != "-o" and (k == 0 or words[k - 1] != "-o")]
        words += ["-o", str(rng.choice(OUTPUTS)), *(["--force"] if rng.random() < 0.5 else [])]
    else:
        a, b = rng.choice(valued, 2).tolist()
        words[a], words[b] = words[b], words[a]
    return how, words


def spoilt_file(path: Path, rng: Generator, others: list[bytes]) -> tuple[str, bytes]:
    """A way to spoil a file, and its bytes; of a text written by hand every other time one number or one key."""
    data = path.read_bytes()
    if path.suffix in (".yaml", ".json", ".jsonl", ".geojson") and rng.random() < 0.5:
        how = str(rng.choice(["wrong words", "wrong keys"]))
        return how, WAYS[how](data, rng, others)
    return spoilt(data, rng, others)


@contextmanager
def inside(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def make_place(folder: Path, kinds: dict[str, Seed]) -> None:
    """A folder of a user: sound files of each kind, results of earlier runs, and what is nobody's business."""
    named = {"log.mcap": "mcap", "x.ulg": "ulog", "x.nmea": "nmea", "x.csv": "ekf2 replay", "a.tum": "tum",
             "b.tum": "tum", "a.csv": "table", "b.csv": "table", "fuse.yaml": "configuration", "p.yaml":
             "control points", "ekf.yaml": "robot_localization", "m.yaml": "mapping", "table.csv": "csv",
             "site.geojson": "site, GeoJSON", "site.yaml": "site", "yard.yaml": "site", "map.yaml": "map",
             "x.png": "map image", "scene.yaml": "scenario"}  # fmt: skip
    for name, kind in named.items():
        (folder / name).write_bytes(kinds[kind].data)
    for name in ("follow-leader", "airliner-tour", "amr2025-map1"):
        (folder / f"{name}.yaml").write_text(scenario_text(load_scenario(name)[0]), encoding="utf-8")
    (folder / "guard.yaml").write_text(PATROL, encoding="utf-8")
    (folder / "fuse.yaml").write_bytes(CONFIGURATION)
    (folder / "logs").mkdir()
    (folder / "logs" / "log.mcap").write_bytes(kinds["mcap"].data)
    (folder / "folder").mkdir()
    (folder / "folder" / "mine.txt").write_text("mine", encoding="utf-8")
    (folder / "blank").write_bytes(b"")
    (folder / "binary.yaml").write_bytes(np.random.default_rng(2).bytes(300))
    (folder / "link").symlink_to("not-there/at-all")
    with inside(folder), redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        words = ["fuse", "log.mcap", "--json", "--no-report", "-q", "-o", "fused"]
        assert main(words) in (0, 1)
        words = ["campaign", "scene.yaml", "--runs", "2", "--set", "duration_s=0.5", "--workers", "0", "--json", "-q"]
        assert main([*words, "-o", "trials"]) == 0


def content(folder: Path) -> dict[str, object]:
    """What a folder holds, in depth."""
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else p.is_symlink() for p in folder.rglob("*")}


def ended(words: Sequence[str], place: Path, *, patient: bool = False) -> str:
    """`read` for an answer, `refused` for one clear line, a documented code and a place as it was; or what is wrong."""
    before = content(place)
    out, err = io.StringIO(), io.StringIO()
    try:
        with limited(600.0 if patient else CAP_S), warnings.catch_warnings(), inside(place):
            warnings.simplefilter("error")
            with redirect_stdout(out), redirect_stderr(err):
                code = main(list(words))
    except HangError:
        return "hangs"
    except Exception as e:
        return f"{type(e).__name__}: {e}"[:300]
    after, said = content(place), err.getvalue().strip()
    if "internal error" in said or code not in (0, 1, 2, 3):
        return f"code {code}: {said[-300:]}"
    gone = [p for p, data in before.items() if after.get(p) != data]
    if gone and (code in (2, 3) or not all(may_change(p, words) for p in gone)):
        return f"overwritten: {sorted(gone)[:5]}"
    if code in (2, 3):
        clear = said.startswith("outrider: ") and "\n" not in said and not out.getvalue() and len(said) < 4000
        left = sorted(set(after) - set(before))
        return f"no clear line: {said[:300]!r}" if not clear else f"left behind: {left[:5]}" if left else "refused"
    if out.getvalue().startswith("{"):
        try:
            json.loads(out.getvalue(), parse_constant=no_number)
        except ValueError as e:
            return f"no JSON: {e}"
    return "read"


def may_change(path: str, words: Sequence[str]) -> bool:
    """Whether a file is a result, which `--force` replaces, `--resume` goes on with, and a report is written into; or
    the one file that `--force` replaces. A recording is never."""
    if path.split("/")[0] in ("fused", "trials", "new"):
        return any(w in words for w in ("--force", "--resume", "report"))
    named = [w for before, w in pairwise(words) if before in ("-o", "--output", "--report")]
    return "--force" in words and path in named and path not in ("log.mcap", "x.ulg")


def no_number(word: str) -> float:
    raise ValueError(f"{word} in the answer")


def fresh(place: Path, folder: Path) -> Path:
    """A copy of a place, for one case."""
    shutil.rmtree(folder, ignore_errors=True)
    return Path(shutil.copytree(place, folder, symlinks=True))


CONFIGURATION = b"""seed: 3
mounts: {imu: {rpy_deg: [0, 0, 90]}}
sources:
  /gnss: {delay_s: 0.1, sigma: [1, 1, 2], gate: 0.99}
  /imu: {rate_gain: 1.01, rows: "111111"}
  /wheels: {speed_gain: 1.02, scale: 2}
withhold: {/gnss: 5}
outages_s: {/gnss: [[1, 2]]}
beacons:
  - {id: 1, xyz_m: [0, 1, 2]}
planar: {lateral: 0.2}
output_period_s: 0.1
"""
PATROL = """name: guard
duration_s: 30
world:
  place: {type: site, file: yard.yaml, resolution: 0.2}
team:
  station:
    mission: {type: station, near: 2, far: 6, alerts: [{t_s: 3, at: [20, 0], sigma: 0.5}]}
  rover:
    vehicle: {type: differential, radius: 0.4}
    start: {x: 3}
    sensors:
      - {type: imu, rate_hz: 50}
      - {type: body_twist, name: wheels}
      - {type: gnss_receiver, lever: [0.1, 0, 0.6], latency_s: 0.1}
      - {type: lidar, beams: 90}
    mission: {type: patrol, stops: [[3, 0], [14, 0]]}
"""
