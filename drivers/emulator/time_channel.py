"""The emulator's end of the channel that controls its time: time scales come in, acknowledgements go out.

In real time the emulator sends nothing. Under any other time scale it acknowledges, after each step and once the
step's bytes are on the line, up to which time it has simulated. The controlling program never lets its own clock pass
the acknowledged time, and the emulator never passes the end of the time scale. So neither runs ahead of the other,
however busy the machine is.
"""

from __future__ import annotations

import contextlib
import math
import os
from typing import Final

from drivers.emulator.time_scale import MESSAGE_MAX, REAL_TIME, TimeScale, parse_time_scale

ACKNOWLEDGED: Final = "acknowledged"
"""First word of a message ``acknowledged NUMBER RUN_S``: simulated up to RUN_S under time scale NUMBER."""
REFUSED: Final = "refused"
"""First word of a message ``refused WHY``: what came was not a time scale."""
_READ_MAX: Final = 4096


class TimeScaleFollower:
    """Follows the time scales it receives, and acknowledges; without I/O.

    Attributes
    ----------
    scale
        The time scale in force.
    """

    def __init__(self) -> None:
        self.scale: TimeScale = REAL_TIME
        self._number = 0
        """Number of the time scale in force."""
        self._simulated_s = -math.inf
        """The run's time up to which the robot has been simulated."""
        self._acknowledged_s = -math.inf
        """The time up to which that has been acknowledged to the run."""
        self._must_acknowledge = False
        """Whether the time scale in force has not been acknowledged yet."""
        self._rest = b""
        """An incomplete line."""
        self._out = bytearray()
        """Messages to send."""

    def run_at(self, host_s: float) -> float:
        """Return the run's time at a reading of the host's clock, s; never less than what has been simulated."""
        return max(self._simulated_s, self.scale.run_at(host_s))

    def receive(self, data: bytes) -> None:
        """Take bytes in any chunking; a line that is not a time scale is refused and changes nothing."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            if not line.strip():
                continue
            try:
                self._number, self.scale = parse_time_scale(line)
                self._must_acknowledge = True
            except ValueError as error:
                self._out += f"{REFUSED} {error}\n".encode()
        if len(self._rest) > MESSAGE_MAX:
            # Too long: refused when its end arrives, if ever. Until then only the excess length matters.
            self._rest = self._rest[: MESSAGE_MAX + 1]

    def acknowledge(self, run_s: float) -> bytes:
        """Note that the robot has been simulated up to `run_s`, and return the messages to send."""
        self._simulated_s = max(self._simulated_s, run_s)
        has_advanced = not self.scale.is_real_time and self._simulated_s > self._acknowledged_s
        if self._must_acknowledge or has_advanced:
            self._out += f"{ACKNOWLEDGED} {self._number} {self._simulated_s!r}\n".encode()
            self._must_acknowledge, self._acknowledged_s = False, self._simulated_s
        out = bytes(self._out)
        self._out.clear()
        return out

    def release(self, host_s: float) -> None:
        """Return to real time from here on: the controlling program is gone."""
        if not self.scale.is_real_time:
            self.scale = TimeScale(host_s, self.run_at(host_s), 1.0, math.inf)


class TimeChannel:
    """A follower of time scales that come and are acknowledged over two pipes.

    Parameters
    ----------
    read_fd, write_fd
        File descriptors. They are non-blocking while the channel is open: an acknowledgement that does not fit into
        the pipe is lost, and the emulator does not wait.

    Attributes
    ----------
    follower
        Has the time scale in force.

    Raises
    ------
    OSError
        The file descriptors cannot be used so.
    """

    def __init__(self, read_fd: int, write_fd: int) -> None:
        self.follower = TimeScaleFollower()
        self._read_fd, self._write_fd = read_fd, write_fd
        self._was_blocking = {fd: os.get_blocking(fd) for fd in (read_fd, write_fd)}
        """The mode of each pipe, to restore."""
        for fd in self._was_blocking:
            os.set_blocking(fd, False)
        self._is_open = True

    def receive(self, host_s: float) -> None:
        """Take what has come; if the controlling program is gone, return to real time from `host_s` on."""
        if not self._is_open:
            return
        try:
            data = os.read(self._read_fd, _READ_MAX)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self.follower.receive(data)
        else:
            self._is_open = False
            self.follower.release(host_s)

    def acknowledge(self, run_s: float) -> None:
        """Send up to which time the robot has been simulated, if the time scale in force asks for it."""
        out = self.follower.acknowledge(run_s)
        if out and self._is_open:
            with contextlib.suppress(OSError):
                os.write(self._write_fd, out)

    def close(self) -> None:
        """Restore the pipes' blocking mode."""
        for fd, was_blocking in self._was_blocking.items():
            with contextlib.suppress(OSError):
                os.set_blocking(fd, was_blocking)
