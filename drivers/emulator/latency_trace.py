"""The latency trace: the times at which complete echoes were sent and complete drive commands were received.

Both times are read from one clock in one process, on the robot's side of the line. The time between them is therefore
what the host took: its kernel, its event loop, its cycle. An echo's time is just before its last byte is written, a
command's time just after its last byte is read.
"""

from __future__ import annotations

from typing import Protocol, TextIO

HEADER = "host_s,frame"


class FrameCounter(Protocol):
    """Counts a protocol's whole frames in the bytes that cross a line; keeps what is incomplete for the next call."""

    def echoes(self, sent: bytes) -> int:
        """Return how many echo frames the bytes sent to the host complete."""

    def drives(self, received: bytes) -> int:
        """Return how many drive commands the bytes received from the host complete."""


class LatencyTrace:
    """Writes a row ``host_s,echo`` or ``host_s,drive`` for each such frame that crosses the line.

    Parameters
    ----------
    file
        Where to write; the caller closes it. It is not flushed, because a disk must not delay the robot.
    counter
        Recognises the protocol's frames.
    """

    def __init__(self, file: TextIO, counter: FrameCounter) -> None:
        self._file = file
        self._counter = counter
        file.write(HEADER + "\n")

    def sent(self, data: bytes, host_s: float) -> None:
        """Write a row for each echo that the bytes sent to the host complete."""
        self._file.write(f"{host_s:.6f},echo\n" * self._counter.echoes(data))

    def received(self, data: bytes, host_s: float) -> None:
        """Write a row for each drive command that the bytes received from the host complete."""
        self._file.write(f"{host_s:.6f},drive\n" * self._counter.drives(data))
