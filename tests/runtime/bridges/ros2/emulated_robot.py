"""A program: a robot that has nothing but ROS topics, our emulator's body and ring behind a node, among six drums."""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path

import numpy as np
import rclpy
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import Range

from config.load import load_robot, load_world
from drivers import ros_tf
from drivers.emulator.body import Body
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Pose, Twist

TICK_S, ODOMETRY_TICKS, FIRING_TICKS = 0.01, 5, 5
DEADMAN_S = 0.5


class Robot:
    """The node, in real time."""

    def __init__(self) -> None:
        robot, world = load_robot("denning"), load_world("hallway")
        limits = robot.body.model_copy(update={"synchro": False, "radius_m": 0.3})
        scene, self.start = compile_scene(world), Pose(world.start.x_m, world.start.y_m, 0.0)
        self.ring = robot.ring
        self.body = Body(limits, scene, self.start, world.odometry, np.random.default_rng(1))
        self.sonar = Sonar(self.ring, scene, world.acoustics, np.random.default_rng(2))
        self.node = rclpy.create_node("robot", namespace="/other")
        self.target, self.commanded_s, self.ticks = Twist(0.0, 0.0), -math.inf, 0
        self.ranges = self.node.create_publisher(Range, "ultrasound", qos_profile_sensor_data)
        self.odometry = self.node.create_publisher(Odometry, "odom", 10)
        self.node.create_subscription(TwistStamped, "cmd_vel", self.obey, 10)
        static = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.frames = ros_tf.create_publisher(self.node, "/tf_static", static)
        now = self.node.get_clock().now().nanoseconds
        rows = [ros_tf.planar(now, "base", f"us{k}", *mount) for k, mount in enumerate(self.ring.mounts)]
        self.frames.publish(ros_tf.encode(rows))

    def obey(self, message: TwistStamped) -> None:
        self.target, self.commanded_s = Twist(message.twist.linear.x, message.twist.angular.z), time.monotonic()

    def tick(self) -> None:
        self.ticks += 1
        late = time.monotonic() - self.commanded_s > DEADMAN_S
        self.body.step(TICK_S, Twist(0.0, 0.0) if late else self.target, within_s=None)
        stamp = self.node.get_clock().now().to_msg()
        if self.ticks % FIRING_TICKS == 0:
            fired = [k for k in range(24) if k % 3 == self.ticks // FIRING_TICKS % 3]
            heard = self.sonar.fire(self.body.pose, self.body.ring_yaw, fired, self.ring.window_m)
            for k in fired:
                message = Range(
                    radiation_type=0, field_of_view=math.radians(24.0), min_range=self.ring.range_min_m,
                    max_range=self.ring.range_max_m, range=float(heard[k]),
                )  # fmt: skip
                message.header.stamp, message.header.frame_id = stamp, f"us{k}"
                self.ranges.publish(message)
        if self.ticks % ODOMETRY_TICKS == 2:
            message, pose = Odometry(), self.body.odometry_pose
            message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, "odom", "base"
            message.pose.pose.position.x, message.pose.pose.position.y = pose.x, pose.y
            turn = message.pose.pose.orientation
            turn.z, turn.w = math.sin(0.5 * pose.theta), math.cos(0.5 * pose.theta)
            message.twist.twist.linear.x, message.twist.twist.angular.z = self.body.twist.v, self.body.twist.w
            self.odometry.publish(message)


def main() -> None:
    rclpy.init()
    robot = Robot()
    for _ in range(FIRING_TICKS):  # loads the compiled kernels
        robot.tick()
    Path(sys.argv[1]).write_text("ready")
    due_s = time.monotonic()
    while True:
        due_s += TICK_S
        while (left_s := due_s - time.monotonic()) > 0.0:
            rclpy.spin_once(robot.node, timeout_sec=left_s)
        robot.tick()


if __name__ == "__main__":
    main()
