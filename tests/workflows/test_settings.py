"""Configuration files: faults in one line with key, remedy and line; command line over file; saved and read again."""

from pathlib import Path

import pytest
import yaml

from outrider.errors import ConfigError, ExitCode
from outrider.io.config import merged
from outrider.workflows.config import FuseConfig
from outrider.workflows.settings import load_config, parse_config, schema

FAULTS = {
    "sources:\n  /fix:\n    gaet: 0.9\n": (3, r"sources\./fix\.gaet: unknown key .did you mean 'gate'\?"),
    "sourcs: {}\n": (1, r"did you mean 'sources'\?"),
    "seed: 1\nx: 1\ny: 2\n": (2, r"x: unknown key, and 1 more fault .there are: preset, robot"),
    "datum:\n  lat_deg: 120\n  lon_deg: 1\n": (2, r"datum\.lat_deg: should be 90 or less, is 120"),
    "datum:\n  lat_deg: 12\n": (1, r"datum\.lon_deg: is missing .all keys here: lat_deg, lon_deg, alt_m"),
    "preset: amr\n": (1, r"preset: cannot be 'amr' .did you mean 'amr2025'\?"),
    "sources: {/fix: {use: fus}}\n": (1, r"use: cannot be 'fus' .did you mean 'fuse'\?"),
    "sources: {/fix: {track_m: -1}}\n": (1, r"sources\./fix\.track_m: should be more than 0, is -1"),
    "sources: {/fix: {gate: 1.5}}\n": (1, r"gate: should be 1 or less, is 1.5"),
    "mounts:\n  imu:\n    xyz_m: [0, 0]\n": (3, r"mounts\.imu\.xyz_m: needs more numbers than 2"),
    "sources: {/uwb: {range_gain: -1}}\n": (1, r"sources\./uwb\.range_gain: should be more than 0, is -1"),
    "sources: {/uwb: {range_gain: 0}}\n": (1, r"range_gain: should be more than 0, is 0"),
    "sources: {/imu: {rate_gain: 0}}\n": (1, r"rate_gain: leaves nothing of it .write `use: ignore`"),
    "beacons:\n  - {id: 1, xyz_m: [1, 2, 3]}\n  - {id: 2}\n": (3, r"beacons\.1\.xyz_m: is missing"),
    "outages_s: {/fix: [[9, 3]]}\n": (1, r"outages_s\./fix\.0: ends before it starts .write \[start, end\]"),
    "withhold: {/fix: 1}\n": (1, r"withhold\./fix: should be 2 or more, is 1"),
    "local: perhaps\n": (1, r"local: should be true or false, is 'perhaps'"),
    "history_s: .nan\n": (1, r"history_s: should be"),
    "output_period_s: 1e-9\n": (1, r"output_period_s: should be 0.001 or more, is 1e-09"),
    "output_period_s: 0\n": (1, r"output_period_s: should be 0.001 or more, is 0"),
    "output_period_s: -1\n": (1, r"output_period_s: should be 0.001 or more, is -1"),
    "output_period_s: '0.1'\n": (1, r"should be a number, is '0.1' .write 0.1, without quotes"),
    "output_period_s: 0,1\n": (1, r"should be a number, is '0,1' .write 0.1, without quotes"),
    "output_period_s: fast\n": (1, r"should be a number, is 'fast' .write it like 12.5"),
    "output_period_s: true\n": (1, r"should be a number, is true"),
    "seed: 1.0\n": (1, r"seed: should be a whole number, is 1.0 .write 1\)"),
    "seed: 1e9\n": (1, r"seed: should be a whole number, is 1000000000.0 .write 1000000000\)"),
    "seed: 1_000\n": (1, r"seed: should be a whole number, is '1_000' .write 1000, without quotes"),
    "seed: -1\n": (1, r"seed: should be 0 or more, is -1"),
    "seed: true\n": (1, r"seed: should be a whole number, is true"),
    "seed: 99999999999999999999\n": (1, r"seed: should be less than 9.22337e\+18"),
    "local: yes\n": (1, r"local: should be true or false, is 'yes' .write true"),
    "local: off\n": (1, r"local: should be true or false, is 'off' .write false"),
    "local: 1\n": (1, r"local: should be true or false, is 1 .write true"),
    "robot: 7\n": (1, r"robot: should be text, is 7 .put it in quotes: '7'"),
    "robot: ''\n": (1, r"robot: should be 1 letter or more"),
    "mounts:\n": (1, r"mounts: is empty .write something after it, or leave the key out"),
    "mounts: imu\n": (1, r"mounts: should be a mapping of keys to values, is 'imu'"),
    "mounts: {1: {xyz_m: [0, 0, 0]}}\n": (1, r"mounts.1: should be text, is 1 .put it in quotes: '1'"),
    "1: 2\n": (1, r"1: should be text, is 1 .put it in quotes: '1'"),
    "mounts: {imu: {xyz_m: 3}}\n": (1, r"xyz_m: should be a list, like \[1, 2\], is 3"),
    "mounts: {imu: {xyz_m: [1, 2, 3, 4]}}\n": (1, r"xyz_m: has 4 entries, takes 3"),
    "mounts: {imu: {xyz_m: [1, 2, 1e300]}}\n": (1, r"xyz_m.2: should be 1e\+06 or less, is 1e\+300"),
    "sources: {/fix: {sigma: [1, x]}}\n": (1, r"sigma.1: should be a number, is 'x'"),
    "sources: {/fix: {sigma: big}}\n": (1, r"sigma: should be a number, is 'big'"),
    "outages_s: {/fix: [5, 9]}\n": (1, r"outages_s./fix.0: should be a list"),
    "withhold: {/fix: 2.5}\n": (1, r"withhold./fix: should be a whole number, is 2.5"),
    "planar: {heading_walk: -1}\n": (1, r"heading_walk: should be 0 or more"),
    "sources: {/fix: {delay_s: .inf}}\n": (1, r"delay_s: should be a finite number, is inf"),
}  # fmt: skip


@pytest.mark.parametrize("text", FAULTS)
def test_a_fault_names_key_remedy_and_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "fusion.yaml"
    path.write_text(text)
    line, words = FAULTS[text]
    with pytest.raises(ConfigError, match=words) as caught:
        load_config(path)
    assert str(caught.value).startswith(f"{path}:{line}: " if line else f"{path}: ")
    assert "\n" not in str(caught.value) and caught.value.exit_code == ExitCode.USAGE


def test_the_command_line_stands_over_the_file(tmp_path: Path) -> None:
    path = tmp_path / "fusion.yaml"
    path.write_text("seed: 4\nrobot: husky\nmounts: {imu: {rpy_deg: [0, 0, 90]}, gps: {xyz_m: [1, 0, 0]}}\n")
    config = load_config(path, {"seed": 9, "mounts": {"imu": {"rpy_deg": [0, 0, 45.0]}}})
    assert (config.seed, config.robot) == (9, "husky")
    assert config.mounts["imu"].rpy_deg == (0, 0, 45) and config.mounts["gps"].xyz_m == (1, 0, 0)
    with pytest.raises(ConfigError, match=r"^command line: preset"):
        load_config(None, {"preset": "fast"})


def test_merging_leaves_its_arguments_alone() -> None:
    base, over = {"a": {"b": 1}, "c": [1]}, {"a": {"d": 2}, "c": [2]}
    assert merged(base, over) == {"a": {"b": 1, "d": 2}, "c": [2]}
    assert base == {"a": {"b": 1}, "c": [1]} and over == {"a": {"d": 2}, "c": [2]}


def test_what_is_saved_is_read_as_the_same(tmp_path: Path) -> None:
    config = parse_config(
        {"datum": {"lat_deg": 45, "lon_deg": 7}, "sources": {"/fix": {"sigma": [1, 2, 3], "gate": 1.0}},
         "outages_s": {"/fix": [[1, 2]]}, "beacons": [{"id": 3, "xyz_m": [1, 2, 3]}]}
    )  # fmt: skip
    path = tmp_path / "config.yaml"
    path.write_text(yaml.safe_dump(config.model_dump(mode="json")))
    assert load_config(path) == config


def test_the_schema_knows_and_explains_every_key() -> None:
    whole = schema()
    assert set(whole["properties"]) == set(FuseConfig.model_fields)
    gate = whole["$defs"]["SourceSection"]["properties"]["gate"]
    assert "chi-square" in gate["description"] and gate["maximum"] == 1.0
