"""ROS 2 as a robot: its topics on the line of the ring-and-base protocol."""
