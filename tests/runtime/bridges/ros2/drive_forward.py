"""A program: a node that sends cmd_vel 20 times a second until it is killed."""

from __future__ import annotations

import sys
import time

import rclpy
from geometry_msgs.msg import TwistStamped

if __name__ == "__main__":
    rclpy.init()
    node = rclpy.create_node("driver")
    publisher = node.create_publisher(TwistStamped, "cmd_vel", 10)
    message = TwistStamped()
    message.header.frame_id = "base_link"
    message.twist.linear.x = float(sys.argv[1])
    while True:
        message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)
        time.sleep(0.05)
