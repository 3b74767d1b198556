"""Tables in any convention give the firings of the clean table, or are refused with the option that settles it."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from config.load import load_settings
from config.robot import SensorConfig
from drivers.firing_pattern import firing_pattern
from drivers.messages import Firing, Floats, Pose
from runtime.recording.conventions.options import AUTO, RingLogOptions
from runtime.recording.conventions.reading import _checked, converted_firings, open_ring_log
from runtime.recording.ring_log import RingLogError, read_ring_log
from runtime.recording.ring_log_replay import replay_firings
from tests.recordings import DATA, recording
from tests.runtime.recording.conventions.tables import (
    MODELS,
    ROBOTS,
    ROW_S,
    WORLDS,
    Case,
    Convention,
    Drive,
    draw,
    latched,
    make_drive,
    written,
)

NO_LAG: Final = replace(AUTO, echo_lag="0")
DRUM_M = 0.06
"""How far a drum may lie from where the clean table has it."""


def right_options(how: Convention) -> RingLogOptions:
    """Return the options that describe a table."""
    is_mirrored = how.heading == "sensors-cw" or how.mirrored
    silence = {"zero": "0", "noisy-max": "max", "glitch-max": "max"}.get(how.silence, how.silence)
    return RingLogOptions(
        latched="yes" if how.latched else "no", heading="ccw" if how.heading == "sensors-cw" else how.heading,  # type: ignore[arg-type]
        sensor_order="mirrored" if is_mirrored else "file", angle_unit=how.angle, time_unit=how.time,  # type: ignore[arg-type]
        length_unit=how.position, range_unit=how.range_, silence=silence, not_fired=how.not_fired or "empty",  # type: ignore[arg-type]
        echo_lag="0",
    )  # fmt: skip


def check_right(got: list[Firing], drive: Drive, how: Convention) -> None:
    """Fail unless firings are those of the drive."""
    want = latched(drive) if how.latched else drive
    poses = np.array([(f.pose.x, f.pose.y, f.pose.theta, f.ring_yaw) for f in got])
    true = want.pose
    if how.latched:  # fired since the row before: half way to the first of its firings
        masks, step_s = firing_pattern(drive.settings.ring).masks, drive.settings.ring.firing.step_period_s
        back = 0.5 * max(0.0, min(ROW_S, len(masks) * step_s) - step_s) / ROW_S
        moved = np.diff(want.pose, axis=0)
        moved[:, 2:] = np.angle(np.exp(1j * moved[:, 2:]))
        true = true.copy()
        true[1:] -= back * moved
    assert np.abs(poses[:, :2] - true[:, :2]).max() < 0.01
    assert np.abs(np.angle(np.exp(1j * (poses[:, 2:] - true[:, 2:])))).max() < 0.01
    assert np.abs(np.array([f.robot_s for f in got]) - want.t).max() < 0.01
    ranges = np.array([f.ranges_m for f in got])
    both = np.isfinite(ranges) & np.isfinite(want.ranges)
    assert both.any()
    assert np.abs(ranges[both] - want.ranges[both]).max() < 0.01
    if not how.latched:
        silent = np.isposinf(want.ranges)
        assert (np.isposinf(ranges) == silent).mean() > 0.995
        assert np.array_equal(np.isnan(ranges), np.isnan(want.ranges))


def check_named(refusal: str, right: RingLogOptions) -> None:
    """Fail unless a refusal names the right value of each option that it names."""
    values = {f"--{name.replace('_', '-')}": value for name, value in vars(right).items()}
    if right.sensor_order == "mirrored":
        values.pop("--heading")
    else:
        values.pop("--sensor-order")
    named = {option: value for option, value in values.items() if f"{option} " in refusal}
    assert named
    assert all(re.search(f"{option} {re.escape(value)}\\b", refusal) for option, value in named.items()), refusal


def try_case(case: Case, path: Path) -> str:
    """Return what became of a table: right, or the option that its refusal names; fail if it is neither."""
    drive = make_drive(case.seed, case.robot, case.world, case.model)
    written(drive, case.how, np.random.default_rng(case.seed), path)
    outcome = "right"
    refusal = ""
    try:
        got = list(open_ring_log(path, drive.settings))
    except RingLogError as error:
        refusal = str(error)
    if refusal:
        outcome = "refused"
        check_named(refusal, right_options(case.how))
        got = list(open_ring_log(path, drive.settings, right_options(case.how)))
    check_right(got, drive, case.how)
    return outcome


DOUBTFUL: Final = 3149
"""Sensors the other way round, by 4.4 standard errors: too few to be sure, too many for the form's own order."""


@pytest.mark.parametrize(
    "seed", [1000, *(pytest.param(k, marks=pytest.mark.soak) for k in (DOUBTFUL, 1001, 1002, 1003))]
)
def test_a_table_in_any_convention_is_right_or_refused_with_the_option(seed: int, tmp_path: Path) -> None:
    try_case(draw(seed), tmp_path / "table.csv")


@pytest.mark.soak
def test_many_tables_in_any_convention(tmp_path: Path) -> None:
    outcomes = Counter(try_case(draw(seed), tmp_path / "table.csv") for seed in range(2000, 2200))
    assert outcomes["right"] > 100


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.soak) for seed in (1, 2, 3))])
def test_a_table_of_which_all_is_said_gives_its_drive(seed: int, tmp_path: Path) -> None:
    case = draw(seed)
    drive = make_drive(case.seed, case.robot, case.world, case.model)
    path = written(drive, case.how, np.random.default_rng(seed), tmp_path / "table.csv")
    check_right(list(open_ring_log(path, drive.settings, right_options(case.how))), drive, case.how)


def said_of(how: Convention, robot: str, path: Path, options: RingLogOptions = NO_LAG) -> str:
    """Return what is said of a table that is converted right; a lag is looked for only if the options say so."""
    drive = make_drive(12, robot, "room", "specular")
    written(drive, how, np.random.default_rng(12), path)
    said: list[str] = []
    check_right(list(open_ring_log(path, drive.settings, options, said.append)), drive, how)
    return " ".join(said)


@pytest.mark.parametrize(
    ("not_fired", "silence", "robot"),
    [
        ("-1", "999", "denning"),
        *(pytest.param(*row, marks=pytest.mark.soak) for row in
          [("nan", "max", "p3dx"), ("inf", "noisy-max", "denning"), ("0", "max", "p3dx"), ("0", "max", "denning"),
           ("-1", "999", "p3dx"), ("nan", "max", "denning"), ("inf", "noisy-max", "p3dx")]),
    ],
)  # fmt: skip
def test_a_value_for_what_did_not_fire_is_no_silence(
    not_fired: str, silence: str, robot: str, tmp_path: Path
) -> None:
    said = said_of(Convention(not_fired=not_fired, silence=silence), robot, tmp_path / "table.csv")
    assert f"--not-fired {not_fired}" in said
    assert "--silence" in said


@pytest.mark.parametrize(
    "heading",
    ["west-cw", *(pytest.param(it, marks=pytest.mark.soak) for it in ("south-ccw", "west-ccw", "south-cw"))],
)
def test_headings_may_count_from_anywhere(heading: str, tmp_path: Path) -> None:
    assert f"--heading {heading} " in said_of(Convention(heading=heading), "p3dx", tmp_path / "table.csv")


def test_times_in_nanoseconds_are_not_taken_for_microseconds(tmp_path: Path) -> None:
    said = said_of(Convention(time="ns"), "p3dx", tmp_path / "table.csv", AUTO)
    assert "--time-unit ns" in said
    assert "lag" not in said, "its ranges do not"


@pytest.mark.parametrize(
    ("how", "named"),
    [
        (Convention(heading="y-down"), ("--heading y-down ", "--sensor-order mirrored --heading cw ")),
        pytest.param(  # the same table
            Convention(heading="cw", mirrored=True), ("--heading y-down ", "--sensor-order mirrored --heading cw "),
            marks=pytest.mark.soak,
        ),
        *(pytest.param(*row, marks=pytest.mark.soak) for row in [
            (Convention(heading="y-down-north-cw"), ("--heading y-down-north-cw ", "--heading south-ccw ")),
            (Convention(shift=3), ("r00 is sensor 13 of the robot file",)),
            (Convention(shift=5), ("r00 is sensor 11 of the robot file",)),
        ]),
        pytest.param(  # as the next one
            Convention(shift=8), ("r00 is sensor 8 of the robot file", "the ring is turned"), marks=pytest.mark.soak,
        ),
        (Convention(mirrored=True, shift=8), ("or r00 is sensor 15 and the columns run the other way",)),
    ],
)  # fmt: skip
def test_a_turned_or_mirrored_ring_is_refused_with_what_it_may_be(
    how: Convention, named: tuple[str, ...], tmp_path: Path
) -> None:
    drive = make_drive(12, "p3dx", "room", "specular")
    path = written(drive, how, np.random.default_rng(12), tmp_path / "table.csv")
    with pytest.raises(RingLogError) as refused:
        list(open_ring_log(path, drive.settings))
    assert all(text in str(refused.value) for text in named), str(refused.value)
    if how.shift == 0:
        check_right(list(open_ring_log(path, drive.settings, right_options(how))), drive, how)


def refusal(drive: Drive, path: Path, options: RingLogOptions = AUTO) -> str:
    """Return why the table of a drive is refused."""
    with pytest.raises(RingLogError) as refused:
        list(open_ring_log(written(drive, Convention(), np.random.default_rng(12), path), drive.settings, options))
    return str(refused.value)


def with_angles(drive: Drive, change: Callable[[Floats], Floats]) -> Drive:
    return replace(drive, pose=np.column_stack([drive.pose[:, :2], change(drive.pose[:, 2:])]))


def test_headings_that_count_from_elsewhere_are_refused_with_the_angle(tmp_path: Path) -> None:
    drive = make_drive(12, "p3dx", "room", "specular")
    turned = with_angles(drive, lambda angles: angles + math.radians(30.0))
    text = refusal(turned, tmp_path / "table.csv")
    assert "the robot moves at -30° from its heading" in text
    assert "or say --heading ccw --angle-unit rad if the robot drives so" in text


def test_a_robot_that_drives_aslant_is_believed(tmp_path: Path) -> None:
    """Its echoes agree with its headings, and would not with those along its way."""
    drive, by = make_drive(12, "p3dx", "room", "specular"), 0.5
    c, s = math.cos(by), math.sin(by)
    sensors = tuple(
        SensorConfig(
            x_m=c * mount.x_m - s * mount.y_m,
            y_m=s * mount.x_m + c * mount.y_m,
            angle_deg=math.degrees(math.remainder(mount.angle_rad + by, 2.0 * math.pi)),
        )
        for mount in drive.settings.ring.mounts
    )
    ring = drive.settings.ring.model_copy(update={"sensors": sensors})
    aslant = with_angles(drive, lambda angles: angles - by)
    aslant = replace(aslant, settings=drive.settings.model_copy(update={"ring": ring}))
    path = written(aslant, Convention(), np.random.default_rng(12), tmp_path / "table.csv")
    assert len(list(open_ring_log(path, aslant.settings, warn=pytest.fail))) == len(aslant.t)


@pytest.mark.parametrize("factor", [1800.0 / math.pi, 1000.0], ids=["tenths of a degree", "milliradians"])
@pytest.mark.parametrize("robot", ["p3dx", pytest.param("denning", marks=pytest.mark.soak)])
def test_angles_in_no_unit_of_ours_are_refused(robot: str, factor: float, tmp_path: Path) -> None:
    drive = make_drive(12, robot, "room", "specular")
    text = refusal(with_angles(drive, lambda angles: factor * angles), tmp_path / "table.csv")
    assert re.search("theta is neither in radians nor in degrees|theta turns at|do not follow theta", text), text


@pytest.mark.soak
def test_a_robot_that_always_drives_backward_is_believed(tmp_path: Path) -> None:
    drive = make_drive(12, "p3dx", "room", "specular")
    back = replace(drive, pose=drive.pose[::-1].copy(), ranges=drive.ranges[::-1].copy())
    check_unchanged(written(back, Convention(), np.random.default_rng(12), tmp_path / "table.csv"), "p3dx")


def check_unchanged(path: Path, robot: str) -> None:
    said: list[str] = []
    got = list(open_ring_log(path, load_settings(robot=robot), warn=said.append))
    want = list(read_ring_log(path))
    assert not said
    for one, other in zip(got, want, strict=True):
        assert (one.robot_s, one.pose, one.ring_yaw) == (other.robot_s, other.pose, other.ring_yaw)
        assert np.array_equal(one.ranges_m, other.ranges_m, equal_nan=True)


def good_tables(seed: int) -> list[Drive]:
    """Return drives that are right: whole ones, parts, without silence, standing, sideways."""
    rng = np.random.default_rng([seed, 5])
    robot, world, model = (str(rng.choice(np.array(of))) for of in (ROBOTS, WORLDS, MODELS))
    drive = make_drive(seed + 10_000, robot, world, model)
    count, at = int(rng.integers(30, len(drive.t))), int(rng.integers(len(drive.t) - 30))
    closed = np.where(np.isinf(drive.ranges), np.nan, drive.ranges)
    rows = slice(at, at + int(rng.integers(5, 200)))
    standing = np.repeat(drive.pose[at : at + 1], len(drive.t[rows]), 0)
    sideways = drive.pose.copy()
    sideways[:, 2] = sideways[:, 3]
    return [
        drive,
        replace(drive, t=drive.t[:count], pose=drive.pose[:count], ranges=closed[:count]),
        replace(drive, t=drive.t[rows], pose=standing, ranges=drive.ranges[rows]),
        replace(drive, pose=sideways),
    ]


@pytest.mark.parametrize("name", ["corridor", "ring24"])
def test_a_recording_in_the_forms_own_conventions_passes_to_the_bit(name: str) -> None:
    check_unchanged(DATA / f"{name}.csv", str(DATA / f"{name}.toml"))
    assert recording(name)


SIDEWAYS: Final = 202
"""A synchro drive whose theta is its ring's: under the headings that fit its way by chance, ranges are in feet."""


@pytest.mark.soak
def test_a_way_that_does_not_follow_theta_does_not_show_the_units(tmp_path: Path) -> None:
    drive = good_tables(SIDEWAYS)[3]
    path = written(drive, Convention(), np.random.default_rng(SIDEWAYS), tmp_path / "table.csv")
    check_unchanged(path, drive.robot)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.soak) for seed in (1, 2))])
def test_a_good_table_passes_to_the_bit(seed: int, tmp_path: Path) -> None:
    for drive in good_tables(seed):
        path = written(drive, Convention(), np.random.default_rng(seed), tmp_path / "table.csv")
        check_unchanged(path, drive.robot)


@pytest.mark.soak
def test_many_good_tables_pass_to_the_bit(tmp_path: Path) -> None:
    for seed in range(100):
        for drive in good_tables(seed):
            path = written(drive, Convention(), np.random.default_rng(seed), tmp_path / "table.csv")
            check_unchanged(path, drive.robot)


def drums(drive: Drive, firings: list[Firing]) -> list[tuple[float, float]]:
    """Return where drums are reported."""
    found = replay_firings(drive.settings, firings)["objects"]
    return sorted((one["x"], one["y"]) for one in found if one["model"] == "drum" and one["score"] > 0.95)


@pytest.mark.soak
def test_a_latched_table_has_the_clean_ones_drums(tmp_path: Path) -> None:
    drive = make_drive(7, "p3dx", "hall", "cone")
    clean = written(drive, Convention(), np.random.default_rng(7), tmp_path / "clean.csv")
    how = Convention(heading="cw", angle="deg", silence="zero", latched=True)
    table = written(drive, how, np.random.default_rng(7), tmp_path / "latched.csv")
    want = drums(drive, list(open_ring_log(clean, drive.settings)))
    got = drums(drive, list(open_ring_log(table, drive.settings, right_options(how))))
    assert len(got) == len(want)
    assert all(math.dist(a, b) < DRUM_M for a, b in zip(got, want, strict=True))


def test_a_ring_that_cannot_fire_as_its_file_says_is_good_for_a_log(tmp_path: Path) -> None:
    text = (
        "[ring]\ncount = 11\nradius_m = 0.2\nresolution_m = 0.01\nbeam_half_angle_deg = 12.0\n"
        "range_min_m = 0.15\nrange_max_m = 5.0\n"
        "[body]\nradius_m = 0.25\nspeed_max_m_s = 0.5\nturn_max_rad_s = 1.0\nsynchro = false\n"
    )
    (tmp_path / "eleven.toml").write_text(text, "utf-8")
    robot = load_settings(robot=str(tmp_path / "eleven.toml"))
    rows = [Firing(0.1 * k, Pose(0.02 * k, 0.0, 0.0), 0.0, np.full(11, 2.0 + 0.01 * k)) for k in range(60)]
    assert list(converted_firings(rows, Path("log.csv"), robot, RingLogOptions(), pytest.fail)) == rows


def test_a_robot_that_stands_has_not_moved_by_what_interpolation_rounds() -> None:
    drive = make_drive(3, "p3dx", "room", "specular", 40.0)
    stands = len(drive.t) // 4
    pose = np.where(np.arange(len(drive.t))[:, None] < stands, drive.pose, drive.pose[stands])
    pose[stands:, :2] += 1e-16 * (np.arange(len(pose) - stands) % 3)[:, None]
    pose[stands:, 2:] += 0.004 * np.minimum(np.arange(len(pose) - stands), 200)[:, None]
    assert len(np.unique(pose[stands:, 0])) > 1
    rows = [
        Firing(float(t), Pose(*place[:3]), place[3], ranges)
        for t, place, ranges in zip(drive.t, pose.tolist(), drive.ranges, strict=True)
    ]
    assert list(converted_firings(rows, Path("log.csv"), drive.settings, AUTO, pytest.fail)) == rows


@pytest.mark.parametrize(("value", "number"), [(-math.inf, "nan"), (-3.0, "-300"), (-0.01, "-1")])
def test_a_range_that_is_still_none_is_refused_with_the_options_that_settle_it(value: float, number: str) -> None:
    """Of a table that mixes nan and empty cells, the data may not show what nan stands for."""
    firing = Firing(2.5, Pose(0.0, 0.0, 0.0), 0.0, np.array([1.0, value, math.nan]))
    said = f"at t = 2.5, a range is {number}; .* --not-fired {number} if .* --silence {number} if"
    with pytest.raises(RingLogError, match=said):
        list(_checked([firing], Path("log"), 0.01))
