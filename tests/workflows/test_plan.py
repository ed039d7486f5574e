"""What each stream is used for, and what a configuration may not say. Nothing is fused here."""

import re
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError
from scoring import only

from outrider.data import Altitude, EventLog, Fix, Kind, Stream, Verdict, stream
from outrider.errors import ConfigError, DataError
from outrider.filters.channels import Records, records
from outrider.filters.screen import stuck, turn_rate
from outrider.models.motion import Motion
from outrider.models.sensors import Sensor
from outrider.sim import drone_log, wheeled_log
from outrider.sim.truth import EPOCH
from outrider.workflows.config import FuseConfig
from outrider.workflows.discover import Plan, plan

ROVER, _ = wheeled_log(3, 4.0, rate_hz=25.0)
DRONE, _ = drone_log(3, 4.0, rate_hz=25.0)
SECOND = 1_000_000_000


def told(**config: object) -> FuseConfig:
    return FuseConfig.model_validate(config)


def add(log: EventLog, kind: Kind, z: np.ndarray, name: str = "extra", **rest: object) -> EventLog:
    """The log with one more stream, of one record a tenth of a second."""
    z = np.atleast_2d(z)
    return log.with_streams(stream(name, kind, EPOCH + np.arange(len(z)) * SECOND // 10, z, **rest))


def measured(chosen: Plan, name: str) -> Records:
    c = next(c for c in chosen.whole.channels if c.name == name)
    return records(c, chosen.log.streams[c.stream], chosen.verdicts[c.stream], chosen.datum)


def sensors(chosen: Plan, source: str) -> set[Sensor | None]:
    return {c.sensor for c in chosen.whole.channels if c.stream == source}


# ------------------------------------------------------------------------------------------------------------- vehicles


@pytest.mark.parametrize(
    ("log", "motion"),
    [
        (ROVER, Motion.PLANAR),
        (only(ROVER, "imu", "gnss"), Motion.STRAPDOWN),
        (only(ROVER, "gnss"), Motion.FOLLOWER),
        (DRONE, Motion.STRAPDOWN),
    ],
)
def test_the_vehicle_is_known_by_its_sensors(log: EventLog, motion: Motion):
    assert plan(log, FuseConfig()).whole.motion is motion


def test_only_wheels_and_imu_go_into_the_local_estimate():
    chosen = plan(ROVER, FuseConfig())
    assert chosen.local is not None
    assert {c.stream for c in chosen.local.channels} == {"imu", "wheels"}
    assert plan(ROVER, told(local=False)).local is None
    assert plan(DRONE, FuseConfig()).local is None


def test_every_stream_has_a_role():
    log = add(ROVER, Kind.ODOMETRY_POSE, np.zeros((3, 7)), "odom")
    log = add(log, Kind.WHEELS, np.ones((3, 2)), "rims")
    log = add(log, Kind.RANGE, np.ones((3, 2)), "beacons")
    chosen = plan(log, FuseConfig())
    assert set(chosen.roles) == set(log.streams)
    assert "it drifts" in chosen.roles["odom"]
    assert "sources.rims.track_m" in chosen.roles["rims"]
    assert "(1) are unknown: give `beacons`" in chosen.roles["beacons"]


def test_geometry_and_beacons_bring_their_sources_in():
    log = add(ROVER, Kind.WHEELS, np.ones((9, 2)), "rims")
    log = add(log, Kind.ACKERMANN, np.ones((9, 2)), "steer")
    log = add(log, Kind.RANGE, np.ones((9, 2)), "tags")
    chosen = plan(log, told(
        sources={"rims": {"track_m": 0.5}, "steer": {"wheel_base_m": 1.2}},
        beacons=[{"id": 1, "xyz_m": (1, 2, 3)}],
    ))  # fmt: skip
    assert sensors(chosen, "rims") == {Sensor.WHEELS_DIFFERENTIAL}
    assert sensors(chosen, "steer") == {Sensor.ACKERMANN}
    assert sensors(chosen, "tags") == {Sensor.RANGE}
    assert {f.code for f in plan(log, FuseConfig()).findings} >= {"steering-unused"}


def test_the_fastest_usable_imu_drives():
    slow = replace(DRONE.streams["imu"].select(slice(0, None, 4)), name="aux")
    log = DRONE.with_streams(slow)
    assert None in sensors(plan(log, FuseConfig()), "imu")
    assert None in sensors(plan(log, told(sources={"imu": {"use": "ignore"}})), "aux")
    broken = replace(DRONE.streams["imu"], z=np.full_like(DRONE.streams["imu"].z, np.nan))
    assert None in sensors(plan(log.with_streams(broken), FuseConfig()), "aux")


# ----------------------------------------------------------------------------------------------------------------- GNSS


def fixes(log: EventLog, *types: Fix) -> EventLog:
    s = log.streams["gnss"]
    column = np.array([types[i % len(types)].value for i in range(len(s))], np.float64)
    return log.with_streams(replace(s, extra={**s.extra, "fix": column}))


@pytest.mark.parametrize(
    ("types", "used"),
    [
        ((Fix.FIXED,), {Sensor.POSITION}),
        ((Fix.SINGLE,), {Sensor.GNSS_POSITION}),
        ((Fix.FIXED, Fix.FLOAT), {Sensor.POSITION, Sensor.GNSS_POSITION}),
        ((Fix.FIXED, Fix.NONE), {Sensor.POSITION}),
    ],
)
def test_fixed_solutions_are_positions_others_have_a_slow_error(types: tuple[Fix, ...], used: set[Sensor]):
    log = fixes(ROVER, *types)
    chosen = plan(log, FuseConfig())
    assert sensors(chosen, "gnss") == used
    parts = [measured(chosen, c.name) for c in chosen.whole.channels if c.stream == "gnss"]
    assert sum(p.t.size for p in parts) == len(log.streams["gnss"])  # each record is counted, and once
    refused = sum(int((p.flag == Verdict.NO_FIX).sum()) for p in parts)
    assert refused == int((log.streams["gnss"].extra["fix"] == Fix.NONE.value).sum())


def test_the_datum_is_the_first_fix_of_the_better_receiver():
    s = ROVER.streams["gnss"]
    worse = replace(s, name="a", z=s.z + 1e-5, extra={**s.extra, "fix": np.full(len(s), float(Fix.SINGLE.value))})
    datum = plan(ROVER.with_streams(worse), FuseConfig()).datum
    assert datum is not None
    assert datum.lat == s.z[0, 0]


def test_altitudes_of_two_references_are_never_mixed():
    s = DRONE.streams["gnss"]
    other = replace(s, name="z-other", altitude=Altitude.MSL if s.altitude is not Altitude.MSL else Altitude.ELLIPSOID)
    log = DRONE.with_streams(replace(s, altitude=Altitude.ELLIPSOID), replace(other, altitude=Altitude.MSL))
    chosen = plan(log, FuseConfig())
    rows = {c.stream: c.rows.tolist() for c in chosen.whole.channels if c.stream in ("gnss", "z-other")}
    assert rows == {"gnss": [True, True, True], "z-other": [True, True, False]}
    assert "altitude-reference" in {f.code for f in chosen.findings}


def test_a_far_datum_is_remarked():
    far = plan(ROVER, told(datum={"lat_deg": 10, "lon_deg": 10}))
    assert "datum-far" in {f.code for f in far.findings}
    assert "datum-far" not in {f.code for f in plan(ROVER, FuseConfig()).findings}


# ---------------------------------------------------------------------------------------------------------------- noise


def test_scale_multiplies_every_deviation_whoever_states_it():
    plain = measured(plan(ROVER, FuseConfig()), "gnss")
    scaled = measured(plan(ROVER, told(sources={"gnss": {"scale": 3.0}})), "gnss")
    used = np.isfinite(plain.r)
    assert scaled.r[used] == pytest.approx(9.0 * plain.r[used])


def test_a_given_sigma_replaces_claims_floors_and_defaults():
    given = measured(plan(ROVER, told(sources={"gnss": {"sigma": 0.001}})), "gnss")
    assert given.r[np.isfinite(given.r)] == pytest.approx(1e-6)
    per_row = measured(plan(ROVER, told(sources={"gnss": {"sigma": (1.0, 2.0, 3.0)}})), "gnss")
    assert per_row.r[0, :3] == pytest.approx([1.0, 4.0, np.inf])  # the height of a rover is not used


def test_standing_still_is_no_reading_of_the_wheels():
    still = next(c for c in plan(ROVER, told(sources={"wheels": {"sigma": 0.5}})).whole.channels if c.still)
    assert still.sigma[5] == pytest.approx(0.003)


@pytest.mark.parametrize("use", ["auto", "fuse", "score", "ignore"])
def test_how_a_source_is_used(use: str):
    chosen = plan(ROVER, told(sources={"imu_attitude": {"use": use}}))
    channel = next((c for c in chosen.whole.channels if c.stream == "imu_attitude"), None)
    if use == "ignore":
        assert channel is None
        assert "switched off" in chosen.roles["imu_attitude"]
    else:
        assert channel is not None
        assert channel.scored == (use != "fuse")


# ------------------------------------------------------------------------------------------------------- contradictions


@pytest.mark.parametrize(
    ("config", "complaint"),
    [
        ({"sources": {"gps": {"use": "fuse"}}}, "no source 'gps' in the log.*it has gnss, imu"),
        ({"withhold": {"gps": 5}}, "withhold: no source 'gps'"),
        ({"outages_s": {"gps": [(1, 2)]}}, "outages_s: no source 'gps'"),
        ({"sources": {"gnss": {"use": "ignore"}}, "withhold": {"gnss": 5}}, "cannot be withheld"),
        ({"sources": {"gnss": {"use": "ignore"}}, "outages_s": {"gnss": [(1, 2)]}}, "cannot be withheld"),
        ({"preset": "amr2025", "motion": "strapdown"}, "moves as planar, not as strapdown"),
        ({"preset": "robot_localization", "motion": "planar"}, "moves as omnidirectional"),
        ({"sources": {"gnss": {"sigma": (1, 2, 3, 4)}}}, "4 standard deviations for a source of 3 rows"),
        ({"sources": {n: {"use": "score"} for n in ROVER.streams}}, "nothing is left to fuse"),
        ({"motion": "strapdown", "sources": {"imu": {"use": "ignore"}}}, "needs an IMU"),
        ({"beacons": [{"id": 1, "xyz_m": (0, 0, 0)}, {"id": 1, "xyz_m": (1, 0, 0)}]}, "two beacons have one id"),
        ({"motion": "follower", "sources": {"imu": {"use": "fuse"}}}, "it cannot be fused"),
    ],
)
def test_a_contradiction_is_one_line_with_its_place(config: dict[str, object], complaint: str):
    with pytest.raises(ConfigError, match=complaint) as caught:
        plan(ROVER, told(**config))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "config",
    [
        {"sources": {"gnss": {"sigma": 0.0}}},
        {"sources": {"gnss": {"sigma": float("nan")}}},
        {"sources": {"gnss": {"sigma": 1e300}}},
        {"sources": {"gnss": {"scale": -1.0}}},
        {"sources": {"gnss": {"delay_s": float("inf")}}},
        {"sources": {"gnss": {"gain": 1.0}}},
        {"outages_s": {"gnss": [(5, 2)]}},
        {"withhold": {"gnss": 1}},
        {"datum": {"lat_deg": 91, "lon_deg": 0}},
        {"history_s": 0},
    ],
)
def test_impossible_values_never_get_that_far(config: dict[str, object]):
    with pytest.raises(ValidationError):
        told(**config)


def test_a_mount_for_nobody_is_remarked():
    chosen = plan(ROVER, told(mounts={"gps_link": {}}))
    (remark,) = [f for f in chosen.findings if f.code == "mount-unused"]
    assert "gps_link" in remark.text
    assert "gnss" in remark.fix


SETTINGS = {
    "rate_gain": (-1.0, "angular rates (IMU, TWIST)"), "force_gain": (9.8, "accelerations (IMU)"),
    "speed_gain": (0.3, "speeds (TWIST, WHEELS, ACKERMANN)"), "range_gain": (0.9, "ranges (RANGE, RANGE_BEARING)"),
    "track_m": (0.5, "speeds of wheels (WHEELS)"), "mecanum_xy_m": ((0.2, 0.2), "speeds of wheels (WHEELS)"),
    "wheel_base_m": (2.0, "steering (ACKERMANN)"), "steering_zero_deg": (1.0, "steering (ACKERMANN)"),
    "hard_iron": ((1, 0, 0), "magnetometers (MAG)"), "soft_iron": ((2, 0, 0, 0, 1, 0, 0, 0, 1), "magnetometers (MAG)"),
}  # fmt: skip


@pytest.mark.parametrize("key", SETTINGS)
def test_a_setting_for_sources_of_other_kinds_is_remarked(key: str):
    value, purpose = SETTINGS[key]
    found = plan(ROVER, told(sources={"gnss": {key: value}})).findings
    (remark,) = [f for f in found if f.code == "setting-unused"]
    assert remark.text == f"`{key}` of gnss changes nothing: it is for {purpose}"
    assert (remark.severity, remark.source) == ("warning", "gnss") and "GNSS" in remark.fix


def test_a_setting_for_its_kind_or_at_its_default_or_of_a_source_that_is_off_is_no_remark():
    log = add(ROVER, Kind.WHEELS, np.ones((40, 2)))
    log = add(log, Kind.MAG, np.tile([1.0, 2.0, 3.0], (40, 1)), "mag")
    log = add(log, Kind.ACKERMANN, np.zeros((40, 2)), "axle")
    log = add(log, Kind.RANGE, np.tile([7.0, 3.0], (40, 1)), "uwb")
    fits = {"imu": ("rate_gain", "force_gain"), "wheels": ("speed_gain", "rate_gain"), "extra": ("track_m",),
            "axle": ("wheel_base_m", "steering_zero_deg"), "mag": ("hard_iron", "soft_iron"),
            "uwb": ("range_gain",)}  # fmt: skip
    told_all = {name: {key: SETTINGS[key][0] for key in keys} for name, keys in fits.items()}
    assert set(told_all["extra"]) | {k for keys in fits.values() for k in keys} == {*SETTINGS} - {"mecanum_xy_m"}
    for sources in (
        told_all,
        {"gnss": FuseConfig.model_validate({"sources": {"x": {}}}).sources["x"].model_dump()},
        {"gnss": {"use": "ignore", "range_gain": 0.9}},
    ):
        found = plan(log, told(sources=sources)).findings
        assert "setting-unused" not in {f.code for f in found}


def test_a_log_without_motion_or_position_is_refused():
    with pytest.raises(DataError, match="nothing in this log can be fused"):
        plan(only(ROVER, "imu_attitude"), FuseConfig())


def test_a_receiver_that_never_had_a_fix_is_the_reason():
    s = only(ROVER, "gnss").streams["gnss"]
    blind = replace(s, extra={**s.extra, "fix": np.zeros(len(s))})
    with pytest.raises(DataError, match=f"gnss: {len(s)} of {len(s)} records refused: the receiver reports no fix"):
        plan(EventLog(streams={"gnss": blind}), FuseConfig())


# --------------------------------------------------------------------------------------------------------- stuck wheels


def wheels_and_gyro(twist: np.ndarray, yaw_rate: np.ndarray) -> tuple[Stream, Stream]:
    t = np.arange(len(twist), dtype=np.int64) * SECOND // 10
    gyro = np.zeros((len(twist), 6))
    gyro[:, 2], gyro[:, 5] = yaw_rate, 9.81
    return stream("wheels", Kind.TWIST, t, twist), stream("imu", Kind.IMU, t, gyro)


def test_wheels_that_repeat_while_the_robot_turns_are_stuck():
    n = 100
    rate = 0.5 * np.sin(np.arange(n) * 0.1)
    twist = np.zeros((n, 6))
    twist[:, 0], twist[:, 5] = 1.0, rate
    wheels, imu = wheels_and_gyro(twist, rate)
    assert not stuck(wheels, turn_rate(imu)).any()
    frozen = twist.copy()
    frozen[40:] = frozen[40]
    hit = stuck(replace(wheels, z=frozen), turn_rate(imu))
    assert hit[41:].all()
    assert not hit[:41].any()


def test_repeats_at_rest_or_at_constant_speed_are_no_fault():
    n = 100
    twist = np.zeros((n, 6))
    wheels, imu = wheels_and_gyro(twist, 0.5 * np.sin(np.arange(n) * 0.1))
    assert not stuck(wheels, turn_rate(imu)).any()  # standing, and lifted or shaken
    twist[:, 0], twist[:, 5] = 1.0, 0.3
    wheels, imu = wheels_and_gyro(twist, np.full(n, 0.3))
    assert not stuck(wheels, turn_rate(imu)).any()  # a roundabout


@pytest.mark.parametrize(
    ("config", "code", "words"),
    [
        ({"withhold": {"gnss": 1000}}, "withhold-all", "only the first of .* records of gnss"),
        ({"outages_s": {"gnss": [(90.0, 95.0)]}}, "outage-empty", "between 90 and 95 s"),
        ({"outages_s": {"gnss": [(0.0, 2.0), (-9.0, -1.0)]}}, "outage-empty", "between -9 and -1 s"),
        ({"withhold": {"gnss": 2}, "outages_s": {"gnss": [(1.0, 2.0)]}}, "", ""),
    ],
)
def test_what_is_withheld_in_vain_is_told(config: dict[str, object], code: str, words: str) -> None:
    found = {f.code: f for f in plan(ROVER, told(**config)).findings}
    assert {c for c in found if c in ("withhold-all", "outage-empty")} == ({code} if code else set())
    if code:
        assert re.search(words, found[code].text) and found[code].source == "gnss" and found[code].fix
