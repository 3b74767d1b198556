"""What a service manager is told: ready, still well, stopping, and in which mode; systemd's sd_notify protocol.

A datagram to the socket that NOTIFY_SOCKET names, and nothing more, so no library is needed. It is sent from the loop
and never waits. The watchdog is fed by the cycle alone: a thread would feed it for a loop that stands still.
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Mapping
from typing import Final

SHARE: Final = 0.25
"""The watchdog is fed so much of its patience apart: three of the four may be lost."""
STATUS_MAX: Final = 400
"""Characters of a status; a manager shows one line."""


class SdNotifier:
    """Tells the service manager; without one it does nothing.

    Parameters
    ----------
    address : str, optional
        Path of the socket, or its abstract name after an ``@``.
    watchdog_s : float, optional
        How long the manager waits for a sign of life; None where it does not wait for any.

    Attributes
    ----------
    lost
        Messages that the manager did not take.
    last_error
        Why, the last time.
    """

    def __init__(self, address: str | None = None, watchdog_s: float | None = None) -> None:
        self._address = "\0" + address[1:] if address is not None and address.startswith("@") else address
        self._every_s = None if watchdog_s is None else SHARE * watchdog_s
        self._fed_s = float("-inf")
        self._is_ready = False
        self._status: str | None = None
        self.lost = 0
        self.last_error: str | None = None
        self._socket: socket.socket | None = None
        if self._address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.settimeout(0.0)

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] = os.environ) -> SdNotifier:
        """Return a notifier for whoever started this process."""
        pid, microseconds = environment.get("WATCHDOG_PID"), environment.get("WATCHDOG_USEC", "")
        is_meant = pid is None or pid == str(os.getpid())
        watchdog_s = int(microseconds) * 1e-6 if is_meant and microseconds.isdecimal() else 0.0
        address = environment.get("NOTIFY_SOCKET")
        return cls(address if address and address[0] in "/@" else None, watchdog_s or None)

    def alive(self, host_s: float) -> None:
        """Tell that all is well at `host_s`: at first that the service is ready, from then on to the watchdog."""
        if not self._is_ready:
            self._is_ready = True
            self._tell("READY=1")
        if self._every_s is not None and host_s - self._fed_s >= self._every_s:
            self._fed_s = host_s
            self._tell("WATCHDOG=1")

    def status(self, text: str) -> None:
        """Show a line to whoever asks the manager."""
        line = " ".join(text.split())[:STATUS_MAX]
        if line != self._status:
            self._status = line
            self._tell(f"STATUS={line}")

    def stopping(self) -> None:
        """Tell that the service ends, in good order."""
        self._tell("STOPPING=1")

    def close(self) -> None:
        """Say nothing more."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _tell(self, line: str) -> None:
        if self._socket is None or self._address is None:
            return
        try:
            self._socket.sendto(line.encode(), self._address)
        except OSError as error:
            # A manager that is busy or restarts; it asks for nothing but the next sign of life.
            self.lost += 1
            self.last_error = error.strerror or str(error)

    def __enter__(self) -> SdNotifier:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError):
            self.close()
