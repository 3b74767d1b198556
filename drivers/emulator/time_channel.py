"""The emulator's side of having its time held: laws come in as lines, and out goes how far the robot has lived.

While time is free nothing is said. Under any other law the robot tells after each stretch of its life up to when it
has lived, with its bytes already on the line; the program that drives it never lets its own clock go beyond that. And
the robot never lives beyond the law's end. So neither gets ahead of the other, however busy the machine is.
"""

from __future__ import annotations

import contextlib
import math
import os
from typing import Final

from drivers.emulator.time_scale import LINE_MAX, REAL, TimeScale, pace_in

LIVED: Final = "at"
REFUSED: Final = "refused"
_READ_MAX: Final = 4096


class Governor:
    """Obeys laws of time; no I/O.

    Attributes
    ----------
    pace
        The law in force.
    """

    def __init__(self) -> None:
        self.pace: TimeScale = REAL
        self._number = 0
        self._lived_s = -math.inf
        self._told_s = -math.inf
        self._owes = False
        self._rest = b""
        self._out = bytearray()

    def now_s(self, host_s: float) -> float:
        """Return the run's time at a moment of the host's clock; what has been lived is not unlived."""
        return max(self._lived_s, self.pace.at(host_s))

    def take(self, data: bytes) -> None:
        """Take what came, any chunking; a line that is no law is refused and changes nothing."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            if not line.strip():
                continue
            try:
                self._number, self.pace = pace_in(line)
                self._owes = True
            except ValueError as error:
                self._out += f"{REFUSED} {error}\n".encode()
        if len(self._rest) > LINE_MAX:
            # It is refused when it ends, if it ever does; until then it need not be kept.
            self._rest = self._rest[: LINE_MAX + 1]

    def lived(self, run_s: float) -> bytes:
        """Take note that the robot has lived up to `run_s`, and return what is to be said."""
        self._lived_s = max(self._lived_s, run_s)
        news = not self.pace.is_free and self._lived_s > self._told_s
        if self._owes or news:
            self._out += f"{LIVED} {self._number} {self._lived_s!r}\n".encode()
            self._owes, self._told_s = False, self._lived_s
        out = bytes(self._out)
        self._out.clear()
        return out

    def release(self, host_s: float) -> None:
        """Let time go by freely from here: nobody is there any more to hold it."""
        if not self.pace.is_free:
            self.pace = TimeScale(host_s, self.now_s(host_s), 1.0, math.inf)


class ControlChannel:
    """A governor at the ends of two pipes.

    Parameters
    ----------
    read_fd, write_fd
        Made non-blocking while the channel is open: what nobody reads in time is lost, and the robot does not wait.

    Raises
    ------
    OSError
        They are no files that can be used so.
    """

    def __init__(self, read_fd: int, write_fd: int) -> None:
        self.governor = Governor()
        self._read_fd, self._write_fd = read_fd, write_fd
        self._before = {fd: os.get_blocking(fd) for fd in (read_fd, write_fd)}
        for fd in self._before:
            os.set_blocking(fd, False)
        self._is_open = True

    def listen(self, host_s: float) -> None:
        """Take what has come; where whoever held the time is gone, time goes by freely from `host_s` on."""
        if not self._is_open:
            return
        try:
            data = os.read(self._read_fd, _READ_MAX)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self.governor.take(data)
        else:
            self._is_open = False
            self.governor.release(host_s)

    def lived(self, run_s: float) -> None:
        """Tell how far the robot has lived, where that is to be told."""
        out = self.governor.lived(run_s)
        if out and self._is_open:
            with contextlib.suppress(OSError):
                os.write(self._write_fd, out)

    def close(self) -> None:
        """Leave the pipes as they were."""
        for fd, was in self._before.items():
            with contextlib.suppress(OSError):
                os.set_blocking(fd, was)
