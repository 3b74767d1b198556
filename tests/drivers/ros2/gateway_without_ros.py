"""A program: the gateway on a machine without ROS."""

from __future__ import annotations

from drivers.ros2 import gateway

if __name__ == "__main__":
    gateway.find_spec = lambda _: None  # type: ignore[attr-defined,assignment,misc]
    gateway.main()
