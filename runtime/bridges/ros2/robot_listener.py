"""Listens to a robot with ROS for its ranges, odometry and frames, for its robot file. Needs ROS."""

from __future__ import annotations

import time
from typing import Any, Final

import rclpy
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import Range

from drivers import ros_tf
from runtime.bridges.ros2.robot_file import Heard

SENSOR_DATA: Final = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
STATIC: Final = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
DYNAMIC: Final = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
DISCOVERY_S: Final = 10.0
RANGE, ODOMETRY, STAMPED = "sensor_msgs/msg/Range", "nav_msgs/msg/Odometry", "geometry_msgs/msg/TwistStamped"


def listen(seconds: float) -> Heard:
    """Return what is heard of a robot in some seconds.

    The seconds begin with its first range and odometry, for which it waits 10 s: finding topics takes its time.
    """
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("echolocate_listener")
    heard, known = Heard(), set[str]()
    for topic, qos in (("/tf", DYNAMIC), ("/tf_static", STATIC)):
        ros_tf.subscribe(node, topic, lambda message: _take_frames(heard, message), qos)
    end_s, begins = time.monotonic() + DISCOVERY_S, True
    try:
        while (left_s := end_s - time.monotonic()) > 0.0:
            if begins and heard.ranges and heard.odometry is not None:
                end_s, begins = time.monotonic() + seconds, False
            for topic, kinds in node.get_topic_names_and_types():
                if topic in known:
                    continue
                known.add(topic)
                if RANGE in kinds:
                    _subscribe_range(node, heard, topic)
                elif ODOMETRY in kinds and heard.odometry is None:
                    _subscribe_odometry(node, heard, topic)
                elif topic.endswith("/cmd_vel"):
                    heard.cmd_vel, heard.is_stamped = topic, STAMPED in kinds
            for _ in range(50):
                rclpy.spin_once(node, timeout_sec=min(0.01, left_s))
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    return heard


def _take_frames(heard: Heard, message: bytes) -> None:
    for frame in ros_tf.decode(message):
        heard.frames[frame.child.lstrip("/")] = frame


def _subscribe_range(node: Any, heard: Heard, topic: str) -> None:  # noqa: ANN401 - a node of ROS
    """Note in `heard` the frame, limits and stamps of the ranges on a topic."""

    def take(message: Any) -> None:  # noqa: ANN401 - a message of ROS
        name = message.header.frame_id.lstrip("/")
        heard.topics[name] = topic
        heard.ranges[name] = (message.min_range, message.max_range, message.field_of_view)
        heard.stamps_s.setdefault(name, []).append(_seconds(message.header.stamp))

    node.create_subscription(Range, topic, take, SENSOR_DATA)


def _subscribe_odometry(node: Any, heard: Heard, topic: str) -> None:  # noqa: ANN401 - a node of ROS
    """Note in `heard` the frame and stamps of the odometry on a topic."""

    def take(message: Any) -> None:  # noqa: ANN401 - a message of ROS
        heard.odometry = topic
        heard.base = message.child_frame_id.lstrip("/") or heard.base
        heard.odometry_s.append(_seconds(message.header.stamp))

    node.create_subscription(Odometry, topic, take, SENSOR_DATA)


def _seconds(stamp: Any) -> float:  # noqa: ANN401 - a message of ROS
    return float(stamp.sec + 1e-9 * stamp.nanosec)
