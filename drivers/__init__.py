"""Bytes to robot and back: the messages any robot speaks, the line they travel on, one folder a robot."""
