"""Innovations as Parquet: nothing lost, nothing invented, and small."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet
from test_runs import T0, small_run

from outrider.data import Innovations, Verdict
from outrider.errors import OutputExistsError
from outrider.io import innovations as module
from outrider.io.innovations import write_innovations


def made(n: int, rng: np.random.Generator) -> Innovations:
    y = rng.normal(size=(n, 3))
    y[:, 2] = np.nan  # a planar vehicle does not use the height
    y[1, 1] = np.nan
    verdict = rng.choice([int(Verdict.USED), int(Verdict.GATED), int(Verdict.WITHHELD)], n)
    return Innovations(
        t=T0 + np.sort(rng.integers(0, 10**12, n)), y=y, s=np.abs(y) + 0.1, nis=np.nansum(y**2, axis=1),
        dof=np.full(n, 2), verdict=verdict, z=y + 1e5, columns=("east", "north", "up"), units=("m", "m", "m"),
    )  # fmt: skip


@pytest.mark.parametrize("chunk", [module.CHUNK, 7])
def test_every_record_comes_back(
    tmp_path: Path, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch, chunk: int
) -> None:
    monkeypatch.setattr(module, "CHUNK", chunk)
    fix, wheels = made(30, rng), replace(made(20, rng), columns=("v_x", "v_y", "w_z"), units=("m/s", "m/s", "rad/s"))
    path = tmp_path / "innovations.parquet"
    write_innovations(replace(small_run(), innovations={"/fix": fix, "wheels": wheels}), path)
    table = parquet.read_table(path).to_pydict()
    assert len(table["t_ns"]) == 2 * 30 + 2 * 20  # without the heights
    assert set(zip(table["source"], table["component"], table["unit"], strict=True)) == {
        ("/fix", "east", "m"), ("/fix", "north", "m"), ("wheels", "v_x", "m/s"), ("wheels", "v_y", "m/s"),
    }  # fmt: skip
    north = [k for k, c in enumerate(table["component"]) if c == "north"]
    column = {name: np.array([table[name][k] for k in north]) for name in table}
    np.testing.assert_array_equal(column["t_ns"], fix.t)
    np.testing.assert_array_equal(column["z"], fix.z[:, 1])
    np.testing.assert_allclose(column["innovation"], fix.y[:, 1], rtol=1e-6)
    np.testing.assert_allclose(column["sigma"], fix.s[:, 1], rtol=1e-6)
    np.testing.assert_allclose(column["nis"], fix.nis, rtol=1e-6)
    assert column["verdict"].tolist() == [Verdict(v).name.lower() for v in fix.verdict] and set(column["dof"]) == {2}


def test_a_run_without_innovations_has_an_empty_table(tmp_path: Path) -> None:
    path = tmp_path / "innovations.parquet"
    write_innovations(small_run(), path)
    table = parquet.read_table(path)
    assert table.num_rows == 0 and table.column_names[:4] == ["source", "component", "unit", "t_ns"]
    with pytest.raises(OutputExistsError):
        write_innovations(small_run(), path)


def test_an_hour_at_100_hz_stays_small(tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / "innovations.parquet"
    write_innovations(replace(small_run(), innovations={"wheels": made(360_000, rng)}), path)
    assert path.stat().st_size < 30 * 360_000 * 2  # bytes a row, of pure noise
