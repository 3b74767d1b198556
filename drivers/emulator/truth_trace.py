"""The truth trace: the true states of the emulated robot as a CSV file, for comparison with the program's reports.

Rows are flushed as they are written, so that a test can read them while the emulator runs and after it was killed.
"""

from __future__ import annotations

from typing import TextIO

from drivers.emulator.robot_device import GroundTruth

HEADER = "t_s,host_s,x_m,y_m,heading_rad,ring_yaw_rad,v_m_s,w_rad_s,flags"
PERIOD_S = 0.01
"""Time between rows, s."""


class TruthTrace:
    """Writes the true state as CSV.

    Parameters
    ----------
    file
        Where to write; the caller closes it.
    """

    def __init__(self, file: TextIO) -> None:
        self._file = file
        self._due_s = 0.0
        file.write(HEADER + "\n")
        file.flush()

    def write(self, truth: GroundTruth, host_s: float) -> None:
        """Write a row if one is due; `host_s` is the host's monotonic clock at that time."""
        if truth.emulated_s < self._due_s:
            return
        self._due_s = truth.emulated_s + PERIOD_S
        pose, twist = truth.pose, truth.twist
        self._file.write(
            f"{truth.emulated_s:.6f},{host_s:.6f},{pose.x:.6f},{pose.y:.6f},{pose.theta:.6f},{truth.ring_yaw:.6f},"
            f"{twist.v:.6f},{twist.w:.6f},{int(truth.flags)}\n"
        )
        self._file.flush()
