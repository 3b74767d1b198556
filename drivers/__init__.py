"""Bytes to robot and back: the messages of any robot, its line, and a folder for each robot family."""
