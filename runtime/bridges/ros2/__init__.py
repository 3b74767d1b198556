"""The ROS 2 bridge: a run as a node, with topics, frames and services as ROS users expect them."""
