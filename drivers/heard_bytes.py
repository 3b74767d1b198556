"""The bytes that a line brings in place of a robot's frames, and what they say about the device that sends them.

Three kinds of strangers are common on a serial port: a device that sends text, as a board that prints or a GPS
receiver, one that sends back what it gets, as a loopback, a terminal or a modem, and a robot of another family. Their
bytes alone distinguish them from the robot.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final

from config.files import one_line

_KEPT: Final = 512
"""Newest bytes that are looked at."""
_TEXT_SHARE: Final = 0.8
"""Bytes are text if at least this share of them stands in runs of printable ones.

Of random bytes, as at a wrong speed of the line, 4 % do; of a boot message with colours or odd bytes more than 90 %.
"""
_TEXT_MIN: Final = 8
"""Fewest bytes that are judged."""
_RUN: Final = re.compile(rb"[\r\n]*[\t\x20-\x7e]{6,}[\r\n]*")
_PRINTABLE_SHARE: Final = 0.9
_PRINTABLE_MIN: Final = 24
"""So many characters are text, too, if this share of them is printable: short lines, as of numbers, other alphabets.

Of random bytes 38 % are.
"""
_QUOTED_MAX: Final = 60
"""Longest quotation, characters."""
_ECHO_MIN: Final = 6
"""Shortest write that counts when it comes back, bytes."""
_ECHOES: Final = (
    "what this program sends comes back; the other end echoes it, as a loopback, a terminal or a modem does: give "
    "the robot's own port"
)


class HeardBytes:
    """The newest bytes of a line.

    Attributes
    ----------
    total
        Number of bytes received since `clear`.
    has_frames
        Whether valid frames were among them; set by the driver, which decodes them.
    find_robot
        Returns which robot of another family sends these bytes, as a phrase; None if none does.
    """

    def __init__(self) -> None:
        self.total, self.has_frames = 0, False
        self.find_robot: Callable[[bytes], str | None] | None = None
        self._received = self._sent = b""
        self._stranger: str | None = None

    def clear(self) -> None:
        """Forget all bytes: the robot has sent what it should, or this is another line."""
        self.total, self.has_frames, self._received, self._stranger = 0, False, b"", None

    def begin_speed(self) -> None:
        """Forget the bytes, as those to come have another speed; keep what was found out."""
        self._stranger, self._received = self.stranger, b""

    def sent(self, data: bytes) -> None:
        """Take a write that no robot of the protocol sends back; what was found out before it stays."""
        if len(data) >= _ECHO_MIN:
            self._stranger, self._sent = self._device(), data

    def received(self, data: bytes) -> None:
        """Take bytes from the line."""
        self.total += len(data)
        self._received = (self._received + data)[-_KEPT:]

    @property
    def stranger(self) -> str | None:
        """What device sends these bytes, likely cause, next action; None if they may be the robot's."""
        device = self._device()
        if device is not None or self.find_robot is None or (robot := self.find_robot(self._received)) is None:
            return device
        return (
            f"another robot answers: these are frames of {robot}; run that robot's file with --robot, or give the "
            f"port of the robot that was named"
        )

    def _device(self) -> str | None:
        """Return what device that is no robot sends these bytes."""
        data = self._received
        if self._sent and self._sent in data:
            return _ECHOES
        line = _last_line(data) if self._stranger is None else None
        if line is None:
            return self._stranger
        return (
            f"a device sends text, as {_quoted(line)}; it is not the robot, or the robot runs another firmware: "
            f"give the robot's own port, or install its firmware"
        )


def _last_line(data: bytes) -> str | None:
    """Return the last whole line, or the rest, of bytes that are text; None if they are not."""
    runs = _RUN.findall(data)
    if len(data) >= _TEXT_MIN and sum(map(len, runs)) >= _TEXT_SHARE * len(data):
        return str(runs[-1].decode("ascii").strip())
    if len(data) < _PRINTABLE_MIN:  # so it is at each command that the robot gets
        return None
    text = data.decode(errors="replace")
    printable = sum(c in "\t\r\n" or (c.isprintable() and c != "\ufffd") for c in text)
    if printable < _PRINTABLE_MIN or printable < _PRINTABLE_SHARE * len(text):
        return None
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-2 if len(lines) > 1 and text[-1] not in "\r\n" else -1] if lines else None


def _quoted(line: str) -> str:
    """Return printable text in quotation marks, cut to a length that fits into a message."""
    text = one_line(line.replace("\t", " "))
    return f"'{text if len(text) <= _QUOTED_MAX else text[: _QUOTED_MAX - 1] + '…'}'"
