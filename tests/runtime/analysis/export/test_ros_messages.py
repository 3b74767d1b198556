"""ROS messages in plain data; `test_rosbag` and the tests of the bridge compare whole messages."""

from __future__ import annotations

import math

from drivers.messages import Pose, Twist
from runtime.analysis.export.ros_messages import QOS, Frames, Messages, Qos, covariance

SAY = Messages(Frames(prefix="r1/"))


def test_a_prefix_is_before_every_frame_but_the_map() -> None:
    frame = SAY.map_frame(Pose(0.0, 0.0, 0.0), 5)
    assert (frame.parent, frame.child) == ("map", "r1/odom")
    assert [f.child for f in SAY.static([[0.1, 0.0, 0.0]], (), 5)] == ["r1/sonar_00"]
    assert SAY.static([[0.1, 0.0, 0.0]], (0,), 5)[0].parent == "r1/base_link", "a sensor that turns with the wheels"


def test_the_odometry_lies_in_the_map_at_the_inverse_of_the_map_in_odometry() -> None:
    frame = SAY.map_frame(Pose(1.0, 0.0, 0.5 * math.pi), 5)
    assert math.isclose(frame.translation[1], 1.0)


def test_a_velocity_that_is_not_known_has_no_number() -> None:
    fields = SAY.odometry(Pose(0.0, 0.0, 0.0), Twist(math.nan, math.nan), 5).fields
    assert fields["twist"]["twist"] == {}
    assert fields["twist"]["covariance"][0] == 1e6


def test_what_a_robot_in_the_plane_does_not_measure_is_not_certain() -> None:
    matrix = covariance(1.0, 2.0, 3.0, 4.0)
    assert [matrix[k] for k in (0, 1, 6, 7, 14, 21, 28, 35)] == [1.0, 2.0, 2.0, 3.0, 1e6, 1e6, 1e6, 4.0]


def test_what_is_sent_once_is_kept_for_receivers_that_come_later() -> None:
    assert {kind for kind, qos in QOS.items() if qos is Qos.LATCHED} == {"nav_msgs/OccupancyGrid", "std_msgs/String"}
