"""Units are found by what the robot can do and its ring can hear."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from config.load import load_settings
from drivers.messages import Firing, Pose
from runtime.recording.conventions.options import AUTO
from runtime.recording.conventions.reading import converted_firings
from runtime.recording.conventions.silence import Silence
from runtime.recording.conventions.table import LENGTHS, TIMES, Table
from runtime.recording.conventions.units import (
    APART_NAT,
    EDGE_NAT,
    PROOF_NAT,
    Units,
    _check_ways,
    _edge_score,
    _Facts,
    _range_score,
    _reason,
    _way_score,
    find_units,
)
from runtime.recording.conventions.way_ratios import way_ratios
from runtime.recording.ring_log import RingLogError
from tests.runtime.recording.conventions.tables import Drive, make_drive


@pytest.fixture(scope="module")
def drive() -> Drive:
    return make_drive(3, "p3dx", "room", "specular")


def in_units(drive: Drive, units: Units) -> Table:
    length, reach = LENGTHS[units.length], LENGTHS[units.range_]
    pose = drive.pose / [length, length, 1.0, 1.0]
    return Table(drive.t / TIMES[units.time], pose, drive.ranges / reach)


@pytest.mark.parametrize("length", ["m", "cm", "ft"])
def test_ranges_change_with_the_way_by_the_ratio_of_the_units(drive: Drive, length: str) -> None:
    table = in_units(drive, Units("s", length, "m"))
    ratios = way_ratios(table, drive.settings, table.pose[:, 3], 1)
    assert float(np.median(ratios)) == pytest.approx(LENGTHS[length], rel=0.05)


@pytest.mark.parametrize("bias", [0.78, 1.0, 1.25])
def test_ratios_of_a_wide_beam_leave_units_that_are_near(bias: float) -> None:
    """A log whose echoes all come aslant is no log in other units; one by another factor is."""
    ratios = bias * np.exp(0.05 * np.random.default_rng(3).standard_normal(800))
    scores = {name: _way_score(ratios / LENGTHS["in"], 1.0 / LENGTHS[name]) for name in ("in", "cm", "ft")}
    near = _way_score(ratios / LENGTHS["in"], LENGTHS["ft"] / LENGTHS["cm"])
    assert near - scores["in"] < APART_NAT
    assert min(scores["in"] - scores["cm"], scores["in"] - scores["ft"]) > 12.0


def found(drive: Drive, table: Table) -> Units:
    ratios = way_ratios(table, drive.settings, table.pose[:, 3], 1)
    return find_units(table, Silence(), drive.settings, AUTO, "rad", ratios)[0]


@pytest.mark.parametrize(("place", "reach"), [(1.0, 2.0), (0.5, 1.0), (100.0, 200.0)], ids=["path", "half-way", "cm"])
def test_ranges_that_are_the_whole_path_of_the_sound_are_refused(drive: Drive, place: float, reach: float) -> None:
    """There and back is twice the way; no unit of length that fits by chance may take its place."""
    table = Table(drive.t, drive.pose * [place, place, 1.0, 1.0], drive.ranges * reach)
    with pytest.raises(RingLogError, match=r"halve them if.* or say --time-unit s --length-unit"):
        found(drive, table)
    with pytest.raises(RingLogError, match="halve them if"):
        found(drive, in_units(replace(drive, ranges=2.0 * drive.ranges), Units("ms", "mm", "mm")))


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_inches_beside_cm_are_found(seed: int) -> None:
    """Their ratio of 2.54 is near 2, that of a path there and back; few ratios say nothing of either."""
    drive, units = make_drive(seed, "p3dx", "room", "specular"), Units("s", "in", "cm")
    table = in_units(drive, units)
    assert found(drive, table) == units
    ratios = way_ratios(table, drive.settings, table.pose[:, 3], 1)
    for few in (units, Units("s", "m", "ft"), Units("s", "cm", "in")):
        scaled = ratios[:: len(ratios) // 4] / 2.54 * LENGTHS[few.length] / LENGTHS[few.range_]
        _check_ways(few, scaled)


def test_units_of_length_that_are_said_are_not_doubted(drive: Drive) -> None:
    table, options = in_units(replace(drive, ranges=2.0 * drive.ranges), Units()), AUTO
    ratios = way_ratios(table, drive.settings, table.pose[:, 3], 1)
    with pytest.raises(RingLogError, match="halve them if"):
        find_units(table, Silence(), drive.settings, replace(options, range_unit="cm"), "rad", ratios)
    said = replace(options, length_unit="in", range_unit="cm")
    assert find_units(table, Silence(), drive.settings, said, "rad", ratios)[0][1:] == ("in", "cm")


@pytest.mark.parametrize("unit", ["min", "h", "d"])
def test_times_in_minutes_and_days_are_no_lengths_in_inches(drive: Drive, unit: str) -> None:
    """A speed that is 60 times too large is one of inches, too; the ranges say which."""
    assert found(drive, in_units(drive, Units(unit))) == Units(unit)


@pytest.mark.parametrize("length", ["m", "cm", "ft"])
def test_feet_beside_metres_are_found(drive: Drive, length: str) -> None:
    units = Units("s", length, "ft")
    assert found(drive, in_units(drive, units)) == units


def test_ranges_that_end_at_the_rings_greatest_one_are_evidence() -> None:
    rng = np.random.default_rng(4)
    cut = np.minimum(rng.uniform(0.0, 2.0, 4000), 1.0)
    cut = cut[cut < 1.0]
    assert _edge_score(cut) == EDGE_NAT
    assert _edge_score(0.394 * cut) == 0.0, "units that are too small"
    assert _edge_score(2.54 * cut) == 0.0, "units that are too large"
    assert _edge_score(np.append(cut, 1.01)) > 0.9 * EDGE_NAT, "a glitch beyond"


def test_options_say_what_units_are() -> None:
    assert Units("ms", "cm", "in").options == "--time-unit ms --length-unit cm --range-unit in"


ROBOT = load_settings("hallway")
LOG = Path("log.csv")
HALF_S = 3.0


def test_ranges_far_below_the_resolution_are_no_multiples_of_it() -> None:
    """In units that are too small every range is nearly zero steps: that is no evidence for them."""
    ring = ROBOT.ring.model_copy(update={"resolution_m": 0.0})
    fine = ROBOT.model_copy(update={"ring": ring})
    echoes = ROBOT.ring.resolution_m * np.random.default_rng(5).integers(10, 200, 100).astype(float)
    facts = _Facts(0.05, 0.2, 0.1, echoes, None)
    bonus = [_range_score(facts, unit, ROBOT) - _range_score(facts, unit, fine) for unit in (1.0, 1e-3)]
    assert bonus == pytest.approx([PROOF_NAT, 0.0])


def test_the_reason_for_other_units_is_a_fact() -> None:
    echoes = np.linspace(0.3, 7.0, 100)
    facts = _Facts(0.05, 0.2, 0.1, echoes, None)
    near, slow = facts._replace(echoes=0.01 * echoes), facts._replace(period=50.0)
    cases = (
        (facts._replace(echoes=100.0 * echoes), Units(range_="cm"), "beyond ring.range_max_m"),
        (near, Units(range_="ft"), "below half of ring.range_min_m"),
        (facts._replace(speed=20.0), Units(length="cm"), "move at 20 m/s"),
        (facts._replace(rate=90.0), Units(time="ms"), "turns at 90 rad/s"),
        (slow, Units(time="ms"), "the firings are 50 s apart"),
        (facts, Units(range_="ft"), "far better in other units"),
    )
    for found, best, text in cases:
        assert text in _reason(Units(), best, found, ROBOT)


def drive_along(count: int = 300, turn: float = 0.2, heading: float = 0.4) -> Iterator[Firing]:
    """Yield a drive along an arc at 0.2 m/s, with an eighth of the ring firing at a time."""
    rng, dt = np.random.default_rng(1), 0.05
    x, y, theta = 0.0, 0.0, heading
    for k in range(count):
        ranges = np.full(24, np.nan)
        ranges[k % 8 :: 8] = rng.uniform(0.3, 7.0, 3)
        ranges[(k + 8) % 24 if k % 3 else k % 24] = np.inf
        yield Firing(dt * k, Pose(x, y, theta), theta, ranges)
        x, y = x + 0.2 * dt * math.cos(theta), y + 0.2 * dt * math.sin(theta)
        theta += turn * dt


def in_other_units(
    firing: Firing, *, t: float = 1.0, place: float = 1.0, angle: float = 1.0, reach: float = 1.0
) -> Firing:
    """Return a firing whose numbers are multiplied."""
    pose = Pose(place * firing.pose.x, place * firing.pose.y, angle * firing.pose.theta)
    return Firing(t * firing.robot_s, pose, angle * firing.ring_yaw, reach * firing.ranges_m)


def turns_on_the_spot(firing: Firing) -> Firing:
    return replace(firing, pose=Pose(0.0, 0.0, 3.0 * firing.pose.theta))


def straight_first(firing: Firing) -> Firing:
    """Return a firing of a drive whose first half leads along x, where degrees and radians are the same."""
    along = 0.2 * min(firing.robot_s, HALF_S)
    if firing.robot_s <= HALF_S:
        return replace(firing, pose=Pose(along, 0.0, 0.0), ring_yaw=0.0)
    angle = 0.2 * (firing.robot_s - HALF_S)  # an arc of a radius of 1 m
    return replace(firing, pose=Pose(along + math.sin(angle), 1.0 - math.cos(angle), angle), ring_yaw=angle)


@pytest.mark.parametrize("count", [1, 50, *(pytest.param(count, marks=pytest.mark.soak) for count in (300, 407))])
def test_a_log_in_metres_and_radians_passes_unchanged(count: int) -> None:
    given, said = list(drive_along(count)), list[str]()
    changes: list[Callable[[Firing], Firing]] = [
        lambda f: f, turns_on_the_spot, straight_first,
        lambda f: in_other_units(f, place=0.0), lambda f: in_other_units(f, place=-1.0),
    ]  # fmt: skip
    for change in changes:
        changed = [change(firing) for firing in given]
        assert list(converted_firings(changed, LOG, ROBOT, AUTO, said.append)) == changed, "on the spot, or backwards"
    assert not said


def test_leaps_of_the_odometry_are_no_unit() -> None:
    leaps = [replace(f, pose=replace(f.pose, x=f.pose.x + 40.0 * (k // 60))) for k, f in enumerate(drive_along())]
    assert list(converted_firings(leaps, LOG, ROBOT, AUTO, lambda _: None)) == leaps


@pytest.mark.parametrize("count", [300, pytest.param(450, marks=pytest.mark.soak)])
@pytest.mark.parametrize(
    ("change", "option"),
    [
        (lambda f: in_other_units(f, reach=1e3), "--range-unit mm"),
        (lambda f: in_other_units(f, reach=100.0), "--range-unit cm"),
        (lambda f: in_other_units(f, reach=1.0 / 0.3048), "--range-unit ft"),
        (lambda f: in_other_units(f, place=1e3), "--length-unit mm"),
        (lambda f: in_other_units(f, place=1e3, reach=1e3, angle=180.0 / math.pi), "deg"),
        (lambda f: in_other_units(f, angle=180.0 / math.pi), "--angle-unit deg"),
        (lambda f: in_other_units(straight_first(f), angle=180.0 / math.pi), "--angle-unit deg"),
        (lambda f: in_other_units(turns_on_the_spot(f), angle=180.0 / math.pi), "--angle-unit deg"),
        (lambda f: in_other_units(f, t=1e3), "--time-unit ms"),
    ],
    ids=["mm", "cm", "ft", "mm-places", "all", "degrees", "degrees-after-a-straight", "degrees-on-the-spot", "ms"],
)
def test_a_log_in_other_units_is_converted_or_refused(
    change: Callable[[Firing], Firing], option: str, count: int
) -> None:
    said: list[str] = []
    refused, options = None, replace(AUTO, echo_lag="0")
    try:
        got = list(converted_firings(map(change, drive_along(count)), LOG, ROBOT, options, said.append))
    except RingLogError as error:
        refused = error
    if refused is not None:
        assert refused.exit_code == 2
        assert option in str(refused)
        assert str(LOG) in str(refused)
        return
    (text,) = said
    assert option in text
    assert len(got) == count
    assert max(math.hypot(f.pose.x, f.pose.y) for f in got) < 10.0
    assert max(abs(f.pose.theta) for f in got) < 20.0
    assert max(float(f.ranges_m[np.isfinite(f.ranges_m)].max()) for f in got) < 8.0
    assert got[-1].robot_s < 30.0
