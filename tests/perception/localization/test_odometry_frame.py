"""Odometry's frame as the map frame: everything is where it is, and the robot is nowhere else."""

from __future__ import annotations

import numpy as np

from drivers.messages import Firing, Pose
from perception.detected_object import DetectedObject
from perception.edits import Evidence, MoveObject
from perception.localization.localized_pose import Moment
from perception.localization.odometry_frame import OdometryFrame
from perception.polyline import Polyline

FRAME = OdometryFrame()


def test_nothing_is_moved() -> None:
    firing = Firing(0.0, Pose(1.0, 2.0, 3.0), 0.5, np.array([1.0]))
    seen, geometry = (DetectedObject("drum", 1.0, 2.0, 0.0, 0.01, 20, 1.0, 1.0),), np.ones((2, 5))
    FRAME.move(())
    assert FRAME.follow(firing, seen, print) is firing
    assert FRAME.in_map(seen) is seen
    assert FRAME.objects_in_odometry(seen) is seen
    assert FRAME.segments_in_odometry(geometry) is geometry
    assert FRAME.areas_in_odometry(()) == ()
    polylines = (Polyline(1, np.ones((2, 2)), 0.9),)
    assert FRAME.polylines_in_odometry(polylines) is polylines
    edit, evidence = MoveObject(1, 1.0, 2.0, 0.0), Evidence(1, "drum")
    assert FRAME.edit_in_filter(edit) is edit
    assert FRAME.evidence_in_odometry(evidence) is evidence


def test_the_robot_has_no_place_of_its_own_there() -> None:
    assert not FRAME.is_applied
    assert FRAME.localized() is None
    assert FRAME.odometry_from_map() == FRAME.moved_since(Moment(1, np.ones(3), 0.0)) == Pose(0.0, 0.0, 0.0)
