"""The directions of the way show how headings are counted, and ranges which side is left."""

from __future__ import annotations

import math

import numpy as np
import pytest

from runtime.recording.conventions.headings import (
    BLOCKS,
    KERNEL_M,
    ROWS,
    SURE,
    Angles,
    echo_places,
    echo_scores,
    motion_scores,
    nearness,
    sureness,
)
from runtime.recording.conventions.options import AUTO
from runtime.recording.conventions.table import ANGLES, HEADINGS, Table
from tests.runtime.recording.conventions.tables import Drive, make_drive


@pytest.fixture(scope="module")
def drive() -> Drive:
    return make_drive(3, "p3dx", "room", "specular")


def counted(drive: Drive, how: Angles) -> Table:
    """Return the drive with its headings counted in another way."""
    rule, unit = HEADINGS[how.heading], ANGLES[how.unit]
    pose = drive.pose.copy()
    pose[:, 1] *= rule.hand
    pose[:, 2:] = rule.turn * (rule.hand * pose[:, 2:] - rule.offset_rad) / unit
    return Table(drive.t, pose, drive.ranges)


@pytest.mark.parametrize("unit", ["rad", "deg"])
@pytest.mark.parametrize("heading", list(HEADINGS))
def test_motion_leaves_the_convention_and_its_mirror_image(drive: Drive, heading: str, unit: str) -> None:
    how = Angles(heading, unit)
    motion = motion_scores(counted(drive, how), AUTO)
    assert (motion.is_known, motion.is_related, motion.turned) == (True, True, None)
    scores = motion.scores
    same = [one for one, score in scores.items() if score > scores[how] - 1e-6 * abs(scores[how])]
    rule = HEADINGS[heading]
    assert how in same
    assert all(HEADINGS[one.heading][:2] == rule[:2] and one.unit == unit for one in same)


@pytest.mark.parametrize("how", [Angles("ccw"), Angles("cw", "deg"), Angles("north-cw")])
@pytest.mark.parametrize("degrees", [30.0, -43.0])
def test_headings_that_count_from_elsewhere_are_at_an_angle(drive: Drive, how: Angles, degrees: float) -> None:
    table = counted(drive, how)
    pose = table.pose.copy()
    pose[:, 2:] += math.radians(degrees) / ANGLES[how.unit]
    found = motion_scores(table._replace(pose=pose), AUTO).turned
    assert found is not None
    one, offset_rad = found
    rule = HEADINGS[how.heading]
    expected = rule.offset_rad - rule.turn * math.radians(degrees)
    assert (HEADINGS[one.heading].turn, one.unit) == (rule.turn, how.unit)
    assert abs(math.remainder(offset_rad - expected, 2.0 * math.pi)) < math.radians(5.0)


def test_a_straight_way_says_nothing_of_where_headings_count_from(drive: Drive) -> None:
    pose = np.zeros((300, 4))
    pose[:, 0], pose[:, 1] = 0.8 * np.arange(300), 0.6 * np.arange(300)
    motion = motion_scores(Table(np.linspace(0.0, 15.0, 300), pose, drive.ranges[:300]), AUTO)
    assert (motion.is_known, motion.turned) == (True, None)


def test_echoes_agree_in_the_true_convention_only(drive: Drive) -> None:
    choices = [Angles("ccw"), Angles("left-handed"), Angles("cw")]
    scores = echo_scores(counted(drive, Angles("ccw")), drive.settings, choices, 1.0, 1.0)
    assert all(sureness(scores[choices[0]], scores[other]) > SURE for other in choices[1:])
    assert sureness(scores[choices[0]], scores[choices[0]]) == 0.0
    assert np.isfinite(scores[choices[0]]).all()


def test_places_are_as_near_as_the_density_of_an_echo_says() -> None:
    near = nearness(
        np.array([0.0, 3.0]), np.array([0.0, 4.0]), np.array([0.0, 3.0, 3.0]), np.array([0.0, 4.0, 0.0]), 2.0
    )
    expected = [[(1.0 + (d / 2.0) ** 2) ** -1.5 for d in row] for row in ([0.0, 5.0, 3.0], [5.0, 0.0, 4.0])]
    assert near == pytest.approx(np.array(expected), rel=1e-6)


def test_echoes_agree_as_well_far_from_the_origin_and_beside_a_glitch(drive: Drive) -> None:
    """Map coordinates have 4,000 km; one row of a log may be anywhere."""
    table, choices = counted(drive, Angles("ccw")), [Angles("ccw"), Angles("cw")]
    scores = echo_scores(table, drive.settings, choices, 1.0, 1.0)
    glitch = table.pose.copy()
    glitch[40, :2] = 1e300, -1e300
    for pose in (table.pose + np.array([5e5, 4e6, 0.0, 0.0]), glitch):
        moved = echo_scores(table._replace(pose=pose), drive.settings, choices, 1.0, 1.0)
        expected = sureness(scores[choices[0]], scores[choices[1]])
        assert sureness(moved[choices[0]], moved[choices[1]]) == pytest.approx(expected, rel=0.01)


def test_each_echo_is_scored_by_those_before_it(drive: Drive) -> None:
    """By plain Python, echo after echo."""
    count = 2 * ROWS + 30
    ranges = np.where(np.isinf(drive.ranges), np.nan, drive.ranges)
    rows, sensors = (found[:count] for found in np.nonzero(np.isfinite(ranges)))
    few = np.full_like(ranges, np.nan)
    few[rows, sensors] = ranges[rows, sensors]
    mounts = np.array(drive.settings.ring.mounts)[sensors]
    x, y = echo_places(drive.pose[rows], Angles(), mounts, ranges[rows, sensors], 1.0)
    logs = []
    for k in range(1, count):
        spread = [1.0 + ((x[k] - x[i]) ** 2 + (y[k] - y[i]) ** 2) / KERNEL_M**2 for i in range(k)]
        logs.append(math.log(sum(each**-1.5 for each in spread) / k + 1e-3))
    expected = [float(np.mean(block)) for block in np.array_split(logs[count // 10 :], BLOCKS)]
    found = echo_scores(Table(drive.t, drive.pose, few), drive.settings, [Angles()], 1.0, 1.0)
    assert found[Angles()] == pytest.approx(expected, abs=1e-5)
