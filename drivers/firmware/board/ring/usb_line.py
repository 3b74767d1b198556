"""The line to the host on the board's USB socket. Neither read nor write waits."""

import sys
from select import POLLIN, POLLOUT, poll

import micropython


class UsbLine:
    """The console on USB, without its meaning of Ctrl-C, which is a byte like any other in a frame."""

    def __init__(self) -> None:
        micropython.kbd_intr(-1)
        self._in, self._out = poll(), poll()
        self._in.register(sys.stdin, POLLIN)
        self._out.register(sys.stdout, POLLOUT)
        self._byte = bytearray(1)

    def read(self) -> int:
        """Return the next byte, -1 if there is none."""
        for _, event in self._in.ipoll(0):
            if event & POLLIN and sys.stdin.buffer.readinto(self._byte) == 1:
                return self._byte[0]
        return -1

    def write(self, data: memoryview) -> None:
        """Send a frame; drop it if the host does not read."""
        for _, event in self._out.ipoll(0):
            if event & POLLOUT:
                sys.stdout.buffer.write(data)

    def release(self) -> None:
        """Give Ctrl-C back to the console."""
        micropython.kbd_intr(3)
