"""Whatever is given: one clear line on stderr, the right exit code, no traceback, and nothing written."""

import json
import os
import shutil
import sqlite3
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small import small_patrol

from outrider.data import EventLog
from outrider.io.record import write_recording

USAGE, BAD_DATA = 2, 3
COMMAND_LINES = {
    "": "Missing argument",
    "{log} --bogus": "No such option",
    "{log} --start soon": "--start",
    "{log} --start nan": "no finite number",
    "{log} --start 5 --end 4": "ends before it starts",
    "{log} --start 1e308": "is too large (give 1e+09 or less)",
    "{log} --start -1e10": "is too large (give -1e+09 or more)",
    "{log} --mount imu": "write FRAME=x,y,z or FRAME=x,y,z,roll,pitch,yaw",
    "{log} --mount imu=1,2": "has 2 numbers",
    "{log} --mount imu=1,2,x": "no number",
    "{log} --mount imu=1,2,nan": "no finite number",
    "{log} --mount imu=1,2,1_0": "no number",
    "{log} --mount imu=1,2,3 --mount imu=3,2,1": "'imu' is there twice",
    "{log} --datum 100,2,0": "command line: datum.lat_deg: should be 90 or less, is 100.0",
    "{log} --datum 10,2": "the height is missing (write LAT,LON,ALT",
    "{log} --datum 10": "has 1 number (write LAT,LON,ALT",
    "{log} --datum 49,9,8,9,0": "has 5 numbers",
    "{log} --withhold /gnss=1": "whole number from 2",
    "{log} --withhold /gnss={digits}": "no whole number from 2",
    "{log} --seed -1": "no whole number from 0",
    "{log} --seed 1.5": "no whole number from 0",
    "{log} --seed {digits}": "no whole number from 0",
    "{log} --seed 9223372036854775808": "no whole number from 0 to 9223372036854775807",
    "{log} --end inf": "no finite number",
    "{log} --end -3": "is before the log begins",
    "none.mcap -o full": "none.mcap",  # the log before the folder
    "{log} --end -1 -o full": "is before the log begins",
    "{log} --mapping none.yaml -o full": "leave the mapping out",
    "pipe -o full": "a pipe or a device",
    "{log} -c pipe": "is a pipe",
    "loop": "too many levels of symbolic links",
    "{long}": "file name too long",
    "{log} -c {long}": "file name too long",
    "{log} -o {long}": "file name too long",
    "{log} -o loop": "not a directory",
    "{log} -o loop/run": "too many levels of symbolic links",
    "{log} -o {log}/run": "not a directory",
    "{log} --withhold /gnss": "write SOURCE=N",
    "{log} --withhold /gps=5": "no source '/gps'",
    "{log} --preset fast": "default, amr2025, robot_localization",
    "{log} -c none.yaml": "cannot be read",
    "{log} -c {log}": "no text",
    "{log} --mapping none.yaml": "mapping is for tables",
    "{log} -o {log}": "not a directory",
    "{log} -o full": "not empty",
    "{log} -o full --force": "does not overwrite",
}
CONFIGS = {
    "sources: {/gps: {use: fuse}}": "no source '/gps'",
    "sources: {/gnss: {gaet: 0.9}}": "did you mean 'gate'",
    "seed: 1\nseed: 2": "there twice",
    "seed: [": "not YAML",
    "seed: 1e9": "write 1000000000",
    "local: yes": "write true",
    "sources: {/gnss: {sigma: [1, 2]}}": "2 standard deviations",
    "outages_s: {/gnss: [[5, 4]]}": "ends before it starts",
    "sources: {/imu: {use: ignore}}\nmotion: strapdown": "needs an IMU",
}


def refused(done: Any, code: int, words: str, folder: Path, before: set[str]) -> None:
    lines = done.err.splitlines()
    assert done.code == code, done
    assert len(lines) == 1 and lines[0].startswith("outrider: ") and words in lines[0], done.err
    assert done.out == "" and {p.name for p in folder.iterdir()} == before


@pytest.mark.parametrize("line", COMMAND_LINES)
def test_command_lines(outrider: Any, recording: Path, tmp_path: Path, line: str) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "config.yaml").write_text("precious")
    (tmp_path / "loop").symlink_to("loop")
    os.mkfifo(tmp_path / "pipe")
    done = outrider("fuse", *line.format(log=recording, digits="9" * 5000, long="n" * 300).split())
    code = USAGE if line.startswith("{log}") or not line else BAD_DATA
    refused(done, code, COMMAND_LINES[line], tmp_path, {"full", "loop", "pipe"})
    assert (tmp_path / "full" / "config.yaml").read_text() == "precious"


OTHERS = {  # of other commands
    "eval {log} --outages /gnss=1e308": "no time (give more than zero seconds, and 1e+09 at most",
    "eval {log} --outages /gnss=1 --every 1e-6": "windows, one every 1e-06 s, are too many (1000 at most",
    "eval {log} --outages /gnss=1 --every 1e-300": "are too many",
    "eval {log} {log} --span 1e308s": "no span of 1e+308 s",
    "calibrate {log} -o loop": "loop: exists already (--force overwrites it)",
    "doctor {log} -o {log} --force": "is the recording itself (give another name)",
    "doctor {log} --report {log} --force": "is the recording itself (give another name)",
    "run site-patrol --film 1e300": "is too large (give 1000 or less)",
}


@pytest.mark.parametrize("line", OTHERS)
def test_command_lines_of_others(outrider: Any, recording: Path, tmp_path: Path, line: str) -> None:
    (tmp_path / "loop").symlink_to("not-there")
    log = recording.read_bytes()
    refused(outrider(*line.format(log=recording).split()), USAGE, OTHERS[line], tmp_path, {"loop"})
    assert recording.read_bytes() == log and (tmp_path / "loop").is_symlink()


@pytest.mark.parametrize("text", CONFIGS)
def test_configurations(outrider: Any, recording: Path, tmp_path: Path, text: str) -> None:
    (tmp_path / "c.yaml").write_text(text)
    refused(outrider("fuse", recording, "-c", "c.yaml"), USAGE, CONFIGS[text], tmp_path, {"c.yaml"})


EMPTY = {
    "LOG": ("fuse", ""),
    "--config": ("fuse", "{log}", "-c", ""),
    "--output": ("fuse", "{log}", "-o", ""),
    "--mapping": ("fuse", "{log}", "--mapping", ""),
    "--seed": ("fuse", "{log}", "--seed", ""),
    "--start": ("fuse", "{log}", "--start", ""),
    "--datum": ("fuse", "{log}", "--datum", ""),
    "--mount": ("fuse", "{log}", "--mount", ""),
    "--withhold": ("fuse", "{log}", "--withhold", ""),
    "preset": ("fuse", "{log}", "--preset", ""),
    "--topic": ("fuse", "{log}", "--topic", ""),
    "ESTIMATE": ("eval", "", "{log}"),
    "--outages": ("eval", "{log}", "--outages", ""),
    "--span": ("eval", "{log}", "{log}", "--span", ""),
    "--align": ("eval", "{log}", "{log}", "--align", ""),
    "--max-rmse": ("eval", "{log}", "{log}", "--max-rmse", ""),
}


@pytest.mark.parametrize("word", EMPTY)
def test_an_empty_word_is_no_file_and_no_value(outrider: Any, recording: Path, tmp_path: Path, word: str) -> None:
    """`outrider fuse "$LOG"` with an unset variable must not fuse the current folder."""
    shutil.copy(recording, tmp_path / "log.mcap")
    done = outrider(*(a.format(log="log.mcap") for a in EMPTY[word]))
    refused(done, USAGE, word, tmp_path, {"log.mcap"})


def test_a_file_name_that_breaks_lines_breaks_none(outrider: Any, tmp_path: Path) -> None:
    refused(outrider("fuse", "two\nlines \x1b[31m.mcap"), BAD_DATA, r"two\nlines \x1b[31m.mcap", tmp_path, set())


def test_a_file_name_of_any_bytes(outrider: Any, recording: Path, tmp_path: Path) -> None:
    name = os.fsdecode(b"[b]ad\xff \xc3\xbc.mcap")
    shutil.copy(recording, tmp_path / name)
    listed = outrider("sources", name, "--json")
    assert listed.code == 0 and json.loads(listed.out)["log"]["path"] == r"[b]ad\xff ü.mcap"
    done = outrider("fuse", name, "--json")
    assert done.code == 0 and json.loads(done.out)["log"]["path"] == r"[b]ad\xff ü.mcap"
    assert (tmp_path / name.replace(".mcap", "-run") / "report.html").is_file()


@pytest.mark.parametrize("words", ["demo -o", "campaign patrol --runs 1 -o", "doctor log.mcap -o", "papers -o"])
def test_what_is_written_has_a_name_in_utf_8(outrider: Any, tmp_path: Path, words: str) -> None:
    refused(outrider(*words.split(), os.fsdecode(b"out\xff")), USAGE, "--output: is no text in UTF-8", tmp_path, set())


def test_files_that_are_no_log(outrider: Any, recording: Path, tmp_path: Path) -> None:
    raw = recording.read_bytes()
    contents = {
        "empty.bag": b"",
        "tiny.mcap": raw[:20],
        "half.mcap": raw[: len(raw) // 2],
        "headless.mcap": b"\x89MCAP0\r\n",
        "noise.bin": np.random.default_rng(0).bytes(20_000),
        "words.txt": b"once upon a time\n",
        "cut.ulg": b"ULog\x01\x12\x35\x01",
        "picture.jpg": b"\xff\xd8\xff\xe0" + bytes(100),
        "table.csv": b"t,x,y\n1,2,3\n",
        "wide.csv": "t,x,y\n1,2,3\n".encode("utf-16"),
    }
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "folder").mkdir()
    before = {p.name for p in tmp_path.iterdir()}
    for name in [*contents, "folder", "missing.bag"]:
        refused(outrider("fuse", name), BAD_DATA, name, tmp_path, before)
        refused(outrider("sources", name), BAD_DATA, name, tmp_path, before)


def test_a_database_that_is_no_bag(outrider: Any, tmp_path: Path) -> None:
    sqlite3.connect(tmp_path / "phone.db3").execute("create table contacts (name text)").connection.close()
    refused(outrider("fuse", "phone.db3"), BAD_DATA, "phone.db3", tmp_path, {"phone.db3"})


def test_topics_and_times_that_are_not_there(outrider: Any, recording: Path, tmp_path: Path) -> None:
    refused(outrider("fuse", recording, "--topic", "/gns"), BAD_DATA, "did you mean '/gnss'?", tmp_path, set())
    refused(outrider("fuse", recording, "--start", 500), BAD_DATA, "time span", tmp_path, set())
    refused(outrider("fuse", recording, "--topic", ""), USAGE, "--topic", tmp_path, set())


def test_compare_with_what_is_no_trajectory(outrider: Any, recording: Path, tmp_path: Path) -> None:
    refused(outrider("eval", "a.tum", "b.tum"), BAD_DATA, "a.tum", tmp_path, set())
    refused(outrider("eval", recording, recording), BAD_DATA, "no estimate to compare", tmp_path, set())
    refused(outrider("eval", "a", "b", "--align", "some"), USAGE, "none, yaw, se2, se3, sim3", tmp_path, set())


def only(log: EventLog, name: str, records: int | None = None) -> EventLog:
    return replace(log, streams={name: log.streams[name].select(slice(0, records))})


@pytest.mark.parametrize(("name", "records"), [("imu", 1), ("gnss", 1), ("wheels", 1), ("imu", 2), ("gnss", 3)])
def test_a_log_of_almost_nothing(outrider: Any, small_log: EventLog, tmp_path: Path, name: str, records: int) -> None:
    """A graceful result or one line; never a number out of nothing."""
    write_recording(only(small_log, name, records), tmp_path / "short.mcap")
    done = outrider("fuse", "short.mcap", "--json", "--no-report")
    assert done.code in (0, 1, BAD_DATA)
    if done.code == BAD_DATA:
        assert done.err.count("\n") == 1 and not (tmp_path / "short-run").exists()
    else:
        assert json.loads(done.out)["outcome"]["code"] in (
            "ok", "degraded", "flawed", "never_aligned", "no_data", "not_credible",
        )  # fmt: skip


def test_no_gnss_at_all(outrider: Any, small_log: EventLog, tmp_path: Path) -> None:
    """Dead reckoning from the origin, and no place on Earth made up for it."""
    log = replace(small_log, streams={n: s for n, s in small_log.streams.items() if n != "gnss"})
    write_recording(log, tmp_path / "indoor.mcap")
    done = outrider("fuse", "indoor.mcap", "--json", "--no-report")
    summary = json.loads(done.out)
    assert summary["datum"] is None and summary["figures"]["distance_m"] > 1.0
    assert not (tmp_path / "indoor-run" / "track.geojson").exists()


@pytest.mark.compiled
def test_a_mount_that_gravity_contradicts_is_named(outrider: Any, tmp_path: Path) -> None:
    """An IMU lying on its side without a mount: found; an error where nothing is looked for; with its mount, none."""
    half = float(np.sqrt(0.5))
    log = small_patrol(mount=(half, 0.0, 0.0, half))  # rolled by 90 degrees
    write_recording(replace(log, mounts={}), tmp_path / "log.mcap")
    codes: list[set[str]] = []
    exits: list[int] = []
    for more in ((), ("--set", "diagnose=false"), ("--mount", "imu=0,0,0,90,0,0")):
        done = outrider("fuse", "log.mcap", "--json", "--no-report", "--force", *more)
        exits.append(done.code)
        codes.append({f["code"] for f in json.loads(done.out)["findings"]})
    assert exits == [0, 1, 0]
    assert "mount-found" in codes[0] and "mount-conflict" not in codes[0]
    assert "mount-conflict" in codes[1] and not {"mount-found", "mount-conflict"} & codes[2]


@pytest.mark.compiled
def test_interruption_leaves_nothing(
    outrider: Any, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("outrider.io.runs.write_mcap", stop)
    refused(outrider("fuse", recording, "--no-report"), 130, "interrupted", tmp_path, set())


def test_the_unexpected_is_one_line_too(
    outrider: Any, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("two\nlines")

    monkeypatch.setattr("outrider.workflows.fuse_file.fuse", broken)
    refused(outrider("fuse", recording), 1, "internal error, RuntimeError: two lines", tmp_path, set())
    shown = outrider("fuse", recording, "--debug")
    assert shown.code == 1 and "Traceback" in shown.err and "internal error" in shown.err


@pytest.mark.compiled
def test_a_full_disk(outrider: Any, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("outrider.io.runs.write_table", full)
    refused(outrider("fuse", recording, "--no-report"), USAGE, "no space left on device", tmp_path, set())


def test_a_bag_folder_is_read_and_never_written_to(outrider: Any, recording: Path, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    shutil.copy(recording, bag / "bag_0.mcap")
    refused(outrider("fuse", "bag", "-o", "bag", "--force"), USAGE, "does not overwrite", tmp_path, {"bag"})
    assert [p.name for p in bag.iterdir()] == ["bag_0.mcap"]
