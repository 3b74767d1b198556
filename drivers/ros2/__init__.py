"""Any robot with ROS 2: a process with ROS makes its topics a robot of the ring-and-base protocol, version 2."""
