"""The latency trace: when whole echoes left for the host, and when whole drive commands came back.

Both moments are taken by one clock in one process, on the robot's side of the line, so that what lies between them is
everything the host took: its kernel, its loop, its cycle. An echo counts from just before its last byte was handed
over, a command from just after its last byte was read.
"""

from __future__ import annotations

from typing import TextIO

from drivers.denning.codec import Decoder
from drivers.denning.frames import Drive, Echo

HEADER = "host_s,frame"


class LatencyTrace:
    """Writes a row ``host_s,echo`` or ``host_s,drive`` for each such frame that crossed the line.

    Parameters
    ----------
    file
        Where to; stays the caller's to close. It is not flushed: a disk shall not delay the robot.
    """

    def __init__(self, file: TextIO) -> None:
        self._file = file
        self._sent = Decoder("robot", midway=True)
        self._heard = Decoder("host", midway=True)
        file.write(HEADER + "\n")

    def sent(self, data: bytes, host_s: float) -> None:
        """Take bytes that left for the host."""
        for frame in self._sent.feed(data):
            if isinstance(frame, Echo):
                self._file.write(f"{host_s:.6f},echo\n")

    def heard(self, data: bytes, host_s: float) -> None:
        """Take bytes that came from the host."""
        for frame in self._heard.feed(data):
            if isinstance(frame, Drive):
                self._file.write(f"{host_s:.6f},drive\n")
