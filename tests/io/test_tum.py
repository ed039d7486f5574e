"""Trajectories out and back: nothing lost, nothing overwritten."""

import json
from pathlib import Path

import numpy as np
import pytest
from flight_logs import write

from outrider.core.geodesy import enu_to_geodetic
from outrider.data import Datum, Manifold, StateLayout, Trajectory, empty_estimates
from outrider.errors import DataError, OutputExistsError, UsageError
from outrider.io.files import replacing
from outrider.io.trajectories import read_table, read_trajectory, run_columns, write_geojson, write_table
from outrider.io.tum import read_tum, write_tum


@pytest.fixture
def path_of_ten(rng: np.random.Generator) -> Trajectory:
    n = 10
    q = rng.normal(size=(n, 4))
    A = rng.normal(size=(n, 6, 6))
    return Trajectory(
        t=1_700_000_000_123_456_789 + np.arange(n) * 100_000_001,
        p=rng.normal(size=(n, 3)) * 100,
        q=q / np.linalg.norm(q, axis=1, keepdims=True),
        v=rng.normal(size=(n, 3)),
        P=A @ A.transpose(0, 2, 1),
        valid=np.arange(n) > 2,
        datum=Datum(lat=0.8, lon=0.15, alt=500.0),
        name="robot",
    )


def test_tum_keeps_every_nanosecond(tmp_path: Path, path_of_ten: Trajectory) -> None:
    write_tum(path_of_ten, tmp_path / "a.tum")
    back = read_tum(tmp_path / "a.tum")
    np.testing.assert_array_equal(back.t, path_of_ten.t)
    np.testing.assert_allclose(back.p, path_of_ten.p, atol=1e-9)
    np.testing.assert_allclose(back.q, path_of_ten.q, atol=1e-8)


def test_tum_leaves_out_what_is_damaged(tmp_path: Path) -> None:
    text = b"# t x\n1 1 2 3 0 0 0 2\n2.5 1 2 3 0 0 0 1\n3 1 2\n4 a b c d e f g\n5 nan 0 0 0 0 0 1\n"
    text += b"6 1 2 3 0 0"
    back = read_tum(write(tmp_path, "a.txt", text))
    assert back.t.tolist() == [10**9, 2_500_000_000] and back.q[0].tolist() == [0, 0, 0, 1] and back.p[1, 0] == 1
    for nothing in (b"# only a comment\n", b"\0\xff\n"):
        with pytest.raises(DataError, match="no TUM pose"):
            read_tum(write(tmp_path, "b.txt", nothing))


@pytest.mark.parametrize(("stamps", "words"), [((1, 3, 2), "back in time: pose 3"), ((1, 2, 2), "two poses at one")])
def test_tum_time_goes_on(tmp_path: Path, stamps: tuple[int, ...], words: str) -> None:
    text = "".join(f"{t} 1 2 3 0 0 0 1\n" for t in stamps)
    with pytest.raises(DataError, match=words):
        read_tum(write(tmp_path, "a.txt", text.encode()))


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_tables_keep_every_bit(tmp_path: Path, path_of_ten: Trajectory, ending: str) -> None:
    path = tmp_path / f"a.{ending}"
    write_table(path_of_ten, path)
    back = read_trajectory(path)
    for name in ("t", "p", "q", "v", "P", "valid"):
        np.testing.assert_array_equal(getattr(back, name), getattr(path_of_ten, name), err_msg=name)
    assert back.datum is not None and path_of_ten.datum is not None
    assert back.datum.lat == pytest.approx(path_of_ten.datum.lat, abs=1e-15) and back.datum.altitude == "ELLIPSOID"
    data = path.read_bytes()
    for cut in (0, 1, 10, len(data) // 2, len(data) - 1):
        try:
            assert len(read_table(write(tmp_path, f"cut.{ending}", data[:cut]))) <= 10
        except DataError as e:
            assert "\n" not in str(e)


def test_a_bare_trajectory_stays_bare(tmp_path: Path) -> None:
    bare = Trajectory(t=np.array([5, 7]), p=np.ones((2, 3)), q=np.full((2, 4), np.nan))
    write_table(bare, tmp_path / "a.csv")
    back = read_table(tmp_path / "a.csv")
    assert back.datum is None and len(back.v) == len(back.P) == len(back.valid) == 0 and np.isnan(back.q).all()


def test_geojson_puts_longitude_first(tmp_path: Path, path_of_ten: Trajectory) -> None:
    write_geojson(path_of_ten, tmp_path / "a.geojson")
    feature = json.loads((tmp_path / "a.geojson").read_text())["features"][0]
    lat, lon, alt = enu_to_geodetic(path_of_ten.p, 0.8, 0.15, 500.0)
    expected = np.column_stack([np.degrees(lon), np.degrees(lat), alt])
    np.testing.assert_allclose(feature["geometry"]["coordinates"], expected, atol=1e-3)
    assert feature["geometry"]["type"] == "LineString" and feature["properties"]["t_ns"] == path_of_ten.t.tolist()
    with pytest.raises(UsageError, match="no datum"):
        write_geojson(Trajectory(t=np.zeros(0, np.int64), p=np.zeros((0, 3)), q=np.zeros((0, 4))), tmp_path / "b")


def test_nothing_is_overwritten_or_left_half_written(tmp_path: Path, path_of_ten: Trajectory) -> None:
    path = write(tmp_path, "a.tum", b"precious")
    with pytest.raises(OutputExistsError, match="--force"):
        write_tum(path_of_ten, path)
    with pytest.raises(ZeroDivisionError), replacing(path, force=True) as part:
        part.write_text("half")
        raise ZeroDivisionError
    assert path.read_bytes() == b"precious" and list(tmp_path.iterdir()) == [path]
    write_tum(path_of_ten, path, force=True)
    assert len(read_tum(path)) == 10
    with pytest.raises(UsageError, match="cannot be written"):
        write_tum(path_of_ten, tmp_path / "no" / "folder.tum")
    with pytest.raises(UsageError, match="no table format"):
        write_table(path_of_ten, tmp_path / "a.xlsx")


def test_a_run_lists_every_state_with_its_deviation() -> None:
    from outrider.data import Run

    layout = StateLayout(("position", 3, "m"), ("attitude", Manifold.ROTATION, "rad"), ("scale", 1, ""))
    run = Run(
        log_path="", log_sha256="", config={}, seed=0, versions={}, robot="r", start=0, datum=None,
        local=None, fused=empty_estimates(layout), innovations={}, accounts=(), findings=(), resets=(),
    )  # fmt: skip
    columns = run_columns(run)
    assert {"t_ns", "qw", "position_z", "sd_position_z", "sd_attitude_x", "scale", "sd_scale", "valid_heading"} <= set(
        columns
    )
    assert "attitude_x" not in columns


LINE = "{} 1.0 2.0 3.0 0.0 0.0 0.0998 0.995"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("hello\n", "holds no TUM pose .a line is"),
        ("1 2 3 4\n", "its lines have 4 numbers, not 8"),
        ("#t [ns],p_x,p_y,p_z,q_w,q_x,q_y,q_z,v_x,v_y,v_z\n1,1,2,3,1,0,0,0,0,0,0\n", "its lines have 11 numbers"),
        (LINE.format(1403636580838555648), "its stamps, such as 1403636580838555648, are no seconds"),
        ("t,x,y,z,qw,qx,qy,qz\n1,1,2,3,1,0,0,0\n", "has the columns t x y z qw qx qy qz .a line is: seconds x y z qx"),
        ("# t x y z w x y z\n1 1 2 3 1 0 0 0\n", "has the columns t x y z w x y z"),
        ("1 0 0 0.1 0.99 100 200 3\n", "its quaternions have length 224, not 1"),
        ("1 2 3 0 0 0 1 1500\n", "its quaternions have length 1.5e.03, not 1"),
    ],
)
def test_other_columns_are_told(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "a.tum").write_text(text)
    with pytest.raises(DataError, match=words):
        read_tum(tmp_path / "a.tum")


@pytest.mark.parametrize("sign", [" ", "\t", ",", ";", ", "])
def test_any_delimiter(tmp_path: Path, sign: str) -> None:
    (tmp_path / "a.tum").write_text("\ufeff# a comment\n" + sign.join(LINE.format("1.5").split()) + "\r\n", "utf-8")
    assert read_tum(tmp_path / "a.tum").t.tolist() == [1_500_000_000]


def test_quaternions_of_zeros_are_named(tmp_path: Path) -> None:
    path = tmp_path / "unturned.tum"
    path.write_text("1.0 1 2 3 0 0 0 0\n2.0 1 2 3 0 0 0 0\n")
    with pytest.raises(DataError, match="2 quaternions are all zeros"):
        read_tum(path)
