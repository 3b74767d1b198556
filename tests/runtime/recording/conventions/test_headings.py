"""The directions of the way show how headings are counted, and ranges which side is left."""

from __future__ import annotations

import numpy as np
import pytest

from runtime.recording.conventions.headings import SURE, Angles, echo_scores, motion_scores, sureness
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
    scores, is_related = motion_scores(counted(drive, how), AUTO)
    assert is_related
    same = [one for one, score in scores.items() if score > scores[how] - 1e-6 * abs(scores[how])]
    rule = HEADINGS[heading]
    assert how in same
    assert all(HEADINGS[one.heading][:2] == rule[:2] and one.unit == unit for one in same)


def test_echoes_agree_in_the_true_convention_only(drive: Drive) -> None:
    choices = [Angles("ccw"), Angles("left-handed"), Angles("cw")]
    scores = echo_scores(counted(drive, Angles("ccw")), drive.settings, choices, 1.0, 1.0)
    assert all(sureness(scores[choices[0]], scores[other]) > SURE for other in choices[1:])
    assert sureness(scores[choices[0]], scores[choices[0]]) == 0.0
    assert np.isfinite(scores[choices[0]]).all()
