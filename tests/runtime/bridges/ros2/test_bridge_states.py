"""What a bridge says when a run, its map or another node is not as expected, beside real nodes: `make ros2`."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path
from typing import Any

import pytest

from config.errors import UserError
from drivers import ros_tf
from runtime.support.console_address import find_console
from tests.runtime.bridges.ros2.test_real_nodes import latched

pytestmark = [
    pytest.mark.soak,
    pytest.mark.ros2,
    pytest.mark.realtime,
    pytest.mark.filterwarnings("default::DeprecationWarning"),  # of ROS's own packages
]


def test_what_others_see_of_a_run_without_a_map_until_it_is_dead(tmp_path: Path) -> None:
    """No frame of a map, static frames without moving ones, each odometry once, one line a problem, DISCONNECTED."""
    from geometry_msgs.msg import PoseStamped, Twist
    from nav_msgs.msg import Odometry
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import LaserScan, Range
    from std_msgs.msg import String

    from tests.runtime.bridges.ros2.ros_case import START_MAX_S, Node, program

    options = ("publish_odom_tf:=false", "no_echo_as_max_range:=true", "publish_scan:=true")
    arguments = [word for option in options for word in ("-p", option)]
    log = tmp_path / "ros2.log"
    with program(tmp_path, "ros2", "--ros-args", *arguments):
        node = Node()
        try:
            node.look("mode", String, latched())
            node.until(lambda: "mode" in node.newest, START_MAX_S, "mode")
            assert node.newest["mode"].data == "DISCONNECTED", "there is no run yet"
            stamps, frames, ranges = list[Any](), list[ros_tf.Frame](), list[Any]()
            node.node.create_subscription(Odometry, "odom", lambda m: stamps.append(m.header.stamp), 10)
            ros_tf.subscribe(node.node, "/tf", lambda data: frames.extend(ros_tf.decode(data)), 100)
            ros_tf.subscribe(node.node, "/tf_static", node.keep("/tf_static"), latched())
            node.node.create_subscription(Range, "sonar/s00", ranges.append, qos_profile_sensor_data)
            node.look("scan", LaserScan, qos_profile_sensor_data)
            goals = node.node.create_publisher(PoseStamped, "goal_pose", 10)
            velocities = node.node.create_publisher(Twist, "cmd_vel", 1)
            with program(tmp_path, "run", "--headless", "--no-record", "--seconds", "300") as run:
                node.until(lambda: node.newest["mode"].data == "DRIVE", START_MAX_S, "DRIVE")
                goal = PoseStamped()
                goal.header.frame_id, goal.pose.position.x = "map", 1.0
                goals.publish(goal)
                velocities.publish(Twist())
                node.until(lambda: "scan" in node.newest and len(ranges) > 20, START_MAX_S, "a scan")
                node.spin(3.0)
                run.kill()
                killed_s = time.monotonic()
                node.until(lambda: node.newest["mode"].data == "DISCONNECTED", 15.0, "DISCONNECTED")
                assert time.monotonic() - killed_s < 3.0
        finally:
            node.close()
    assert len({(stamp.sec, stamp.nanosec) for stamp in stamps}) == len(stamps) > 30
    assert {frame.parent for frame in frames} == {"base_link"}
    assert len(ros_tf.decode(node.newest["/tf_static"])) == 24
    assert all(0.0 < message.range <= message.max_range for message in ranges)
    assert len(node.newest["scan"].ranges) == 360
    text = log.read_text()
    assert text.count("goal_pose is not carried out: the run has no map") == 1
    assert text.count("cmd_vel_stamped:=false") == 1


def test_two_bridges_of_one_run_are_one_line_each(tmp_path: Path) -> None:
    from tests.runtime.bridges.ros2.ros_case import START_MAX_S, program

    folders = [tmp_path / "one", tmp_path / "two"]
    logs = [folder / "ros2.log" for folder in folders]
    for folder in folders:
        folder.mkdir()
    with program(tmp_path, "run", "--headless", "--no-record", "--seconds", "300"):
        end_s, url = time.monotonic() + START_MAX_S, ""
        while not url and time.monotonic() < end_s:
            with contextlib.suppress(UserError):  # not there yet
                url = find_console(tmp_path / "echolocate")
            time.sleep(0.5)
        with program(folders[0], "ros2", "--connect", url), program(folders[1], "ros2", "--connect", url):
            while time.monotonic() < end_s and not all("another bridge" in log.read_text() for log in logs):
                time.sleep(0.5)
            time.sleep(3.0)
    assert [log.read_text().count("another bridge publishes /mode") for log in logs] == [1, 1]
