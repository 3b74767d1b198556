"""The operator console: a page served by the robot's own process, to watch, edit and drive.

After a cycle one frame is encoded for all clients. Each client has one slot for the newest frame and one task that
sends, so the cycle waits for none of them. A command becomes an input of the next cycle; only HALT is sent at once.
"""
