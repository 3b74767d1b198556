"""Each heading convention turns the file's angle into the direction in which the robot looks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from runtime.recording.conventions.table import HEADINGS

QUARTER = 0.5 * math.pi


@pytest.mark.parametrize(
    ("heading", "angle", "x", "y"),
    [
        ("ccw", QUARTER, 0.0, 1.0),
        ("cw", QUARTER, 0.0, -1.0),
        ("north-cw", 0.0, 0.0, 1.0),
        ("north-cw", QUARTER, 1.0, 0.0),
        ("north-ccw", QUARTER, -1.0, 0.0),
        ("y-down", QUARTER, 0.0, -1.0),
        ("left-handed", QUARTER, 0.0, 1.0),
    ],
)
def test_where_the_robot_looks_in_the_files_frame(heading: str, angle: float, x: float, y: float) -> None:
    rule = HEADINGS[heading]
    (looks,) = rule.angles(np.array([angle]))
    assert (math.cos(looks), rule.hand * math.sin(looks)) == pytest.approx((x, y))
