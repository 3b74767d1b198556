"""The process that holds ROS: subscribes to a robot's ranges and odometry, sends velocities, and serves one line.

It is started by `drivers.ros2.gateway_port` with the descriptor of its end of the line and the robot file. It ends
with the line, and stops the robot before. The only module of this folder that needs ROS.
"""

from __future__ import annotations

import contextlib
import math
import secrets
import socket
import sys
import threading
import time
from importlib.util import find_spec
from typing import Any, Final

from config.robot import RobotConfig
from drivers.messages import Pose, Twist
from drivers.ros2.gateway_port import READY
from drivers.ros2.range_meaning import Limits
from drivers.ros2.robot_side import STILL, RobotSide

ODOMETRY_MAX_S: Final = 15.0
"""Longest wait for the first odometry: finding topics takes a second or two."""
TICK_S: Final = 0.02
STOPS: Final = 5
"""Velocities of zero at the end."""
NO_ROS: Final = (
    "ROS 2 is not installed here: source its setup.bash and run echolocate with its version of Python, or "
    "pip install 'echolocate[ros2]'"
)


class Gateway:
    """The node and its line to the driver."""

    def __init__(self, config: RobotConfig, line: socket.socket) -> None:
        import rclpy
        from geometry_msgs.msg import Twist as TwistMessage
        from geometry_msgs.msg import TwistStamped
        from nav_msgs.msg import Odometry
        from rclpy.event_handler import PublisherEventCallbacks
        from rclpy.qos import QoSProfile, ReliabilityPolicy
        from rclpy.signals import SignalHandlerOptions
        from sensor_msgs.msg import Range

        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        ros, self._line = config.ros2, line
        self._node = rclpy.create_node("echolocate_robot")
        self._side = RobotSide(config, secrets.randbelow(2**31) + 1)
        self._lock = threading.Lock()
        """Guards `_side`, which the thread of ROS uses, too."""
        self._base, self._odometry, self._is_stamped = ros.base_frame, ros.odometry, ros.cmd_vel_stamped
        self._is_open = False
        """Whether frames go to the host: from the first odometry on."""
        self._message = TwistStamped if ros.cmd_vel_stamped else TwistMessage
        sensor_data = QoSProfile(depth=20, reliability=ReliabilityPolicy.BEST_EFFORT)  # matches every publisher
        for topic in dict.fromkeys(ros.ranges):
            self._node.create_subscription(Range, topic, self._on_range, sensor_data)
        self._node.create_subscription(Odometry, ros.odometry, self._on_odometry, sensor_data)
        events = PublisherEventCallbacks(
            incompatible_qos=lambda _: self._warn(
                f"QoS mismatch on {ros.cmd_vel}: the base asks for more than reliable, volatile and gets no velocity"
            ),
            use_default_callbacks=False,
        )
        self._publisher = self._node.create_publisher(self._message, ros.cmd_vel, 1, event_callbacks=events)

    def run(self) -> None:
        """Wait for the robot, then serve the line until it is closed, and stop the robot."""
        import rclpy

        spinning = threading.Thread(target=rclpy.spin, args=(self._node,), daemon=True)
        spinning.start()
        try:
            if not self._wait_for_odometry():
                return
            self._line.settimeout(TICK_S)
            while self._take_from_host():
                pass
        except OSError:
            pass  # the driver has gone
        finally:
            for _ in range(STOPS):
                self._publish(STILL)
                time.sleep(TICK_S)
            rclpy.try_shutdown()
            spinning.join(1.0)

    def _wait_for_odometry(self) -> bool:
        """Return whether the robot's odometry has come; otherwise say on the line why not."""
        end_s = time.monotonic() + ODOMETRY_MAX_S
        while not self._side.has_odometry:
            if time.monotonic() > end_s:
                kinds = self._node.get_topic_names_and_types()
                known = ", ".join(name for name, types in kinds if "nav_msgs/msg/Odometry" in types) or "none"
                with self._lock:
                    notes = "; ".join(self._side.take_notes())
                text = (
                    f"no odometry on {self._odometry} within {ODOMETRY_MAX_S:g} s; topics of odometry: {known}"
                    f"{notes and f' ({notes})'}; start the robot, or correct ros2.odometry or ROS_DOMAIN_ID"
                )
                self._line.sendall(f"{text}\n".encode())
                return False
            time.sleep(TICK_S)
        with self._lock:
            self._side.take_output()
            self._line.sendall(READY)  # before any frame, which the lock holds back
            self._is_open = True
        return True

    def _take_from_host(self) -> bool:
        """Take what the driver sends, or let a tick pass; return False at the end of the line."""
        try:
            data = self._line.recv(4096)
            if not data:
                return False
        except TimeoutError:
            data = b""
        with self._lock:
            self._side.receive(data, time.monotonic())
            self._side.tick(time.monotonic())
            self._pass_on()
        return True

    def _on_range(self, message: Any) -> None:  # noqa: ANN401 - a message of ROS
        """Take a range; called by the thread of ROS."""
        with self._lock:
            limits = Limits(message.min_range, message.max_range)
            self._side.reading(message.header.frame_id, message.range, _seconds(message.header.stamp), limits)
            self._pass_on()

    def _on_odometry(self, message: Any) -> None:  # noqa: ANN401 - a message of ROS
        """Take a sample; called by the thread of ROS."""
        where, turn, twist = message.pose.pose.position, message.pose.pose.orientation, message.twist.twist
        yaw = math.atan2(2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y**2 + turn.z**2))
        with self._lock:
            self._side.odometry(
                message.child_frame_id,
                _seconds(message.header.stamp),
                Pose(where.x, where.y, yaw),
                Twist(twist.linear.x, twist.angular.z),
                time.monotonic(),
            )
            self._pass_on()

    def _pass_on(self) -> None:
        """Send what the robot's side has for the host, the base and the operator. `_lock` must be held."""
        for note in self._side.take_notes():
            self._warn(note)
        velocity = self._side.take_velocity()
        if velocity is not None:
            self._publish(velocity)
        if self._is_open and (output := self._side.take_output()):
            with contextlib.suppress(OSError):  # the host does not read, or has gone: the frames are lost
                self._line.send(output, socket.MSG_DONTWAIT)

    def _publish(self, velocity: Twist) -> None:
        """Send a velocity to the base."""
        message = self._message()
        twist = message
        if self._is_stamped:
            message.header.stamp = self._node.get_clock().now().to_msg()
            message.header.frame_id = self._base
            twist = message.twist
        twist.linear.x, twist.angular.z = velocity.v, velocity.w
        self._publisher.publish(message)

    def _warn(self, text: str) -> None:
        self._node.get_logger().warning(text)


def _seconds(stamp: Any) -> float:  # noqa: ANN401 - a message of ROS
    return float(stamp.sec + 1e-9 * stamp.nanosec)


def main() -> None:
    """Serve the line whose descriptor is the first argument, for the robot file that is the second."""
    line = socket.socket(fileno=int(sys.argv[1]))
    config = RobotConfig.model_validate_json(sys.argv[2])
    if find_spec("rclpy") is None:
        line.sendall(f"{NO_ROS}\n".encode())
        return
    Gateway(config, line).run()


if __name__ == "__main__":
    main()
