"""Notify the service manager (systemd's sd_notify protocol) that the service is ready, alive, or stopping.

A message is one datagram to the socket named by NOTIFY_SOCKET. It is sent from the loop and never waits; libraries
for this protocol block or ignore errors. Only the cycle feeds the watchdog: a thread would do so for a hanging loop.
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Mapping
from typing import Final

SHARE: Final = 0.25
"""Interval of watchdog messages, as a share of the watchdog's timeout: three of four may be lost."""
STATUS_MAX: Final = 400
"""Longest status, characters; a manager shows one line."""


class SdNotifier:
    """Sends messages to the service manager; does nothing without one.

    Parameters
    ----------
    address : str, optional
        Path of the socket, or its abstract name after an ``@``.
    watchdog_s : float, optional
        Timeout of the manager's watchdog; None without a watchdog.
    """

    def __init__(self, address: str | None = None, watchdog_s: float | None = None) -> None:
        self._address = "\0" + address[1:] if address is not None and address.startswith("@") else address
        self._watchdog_interval_s = None if watchdog_s is None else SHARE * watchdog_s
        self._watchdog_sent_s = float("-inf")
        self._is_ready = False
        self._status: str | None = None
        self.lost = 0
        """Messages that could not be sent."""
        self.last_error: str | None = None
        """Why, the last time."""
        self._socket: socket.socket | None = None
        if self._address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.settimeout(0.0)

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] = os.environ) -> SdNotifier:
        """Return a notifier for the service manager that started this process, if one did."""
        pid, microseconds = environment.get("WATCHDOG_PID"), environment.get("WATCHDOG_USEC", "")
        is_for_us = pid is None or pid == str(os.getpid())
        watchdog_s = int(microseconds) * 1e-6 if is_for_us and microseconds.isdecimal() else 0.0
        address = environment.get("NOTIFY_SOCKET")
        return cls(address if address and address[0] in "/@" else None, watchdog_s or None)

    def alive(self, host_s: float) -> None:
        """Report that the service works at the time `host_s`: READY until it is sent, WATCHDOG at its interval."""
        if not self._is_ready:
            self._is_ready = self._send("READY=1")
        if self._watchdog_interval_s is not None and host_s - self._watchdog_sent_s >= self._watchdog_interval_s:
            self._watchdog_sent_s = host_s
            self._send("WATCHDOG=1")

    def status(self, text: str) -> None:
        """Set the status line that the manager shows."""
        line = " ".join(text.split())[:STATUS_MAX]
        if line != self._status and self._send(f"STATUS={line}"):
            self._status = line

    def stopping(self) -> None:
        """Report that the service is stopping."""
        self._send("STOPPING=1")

    def close(self) -> None:
        """Close the socket; later messages are dropped."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send(self, line: str) -> bool:
        """Send a message without waiting; return whether it needs not be sent again. A failure is counted."""
        if self._socket is None or self._address is None:
            return True
        try:
            self._socket.sendto(line.encode(), self._address)
        except OSError as error:
            self.lost += 1  # the manager is busy or restarts
            self.last_error = error.strerror or str(error)
            return False
        return True

    def __enter__(self) -> SdNotifier:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError):
            self.close()
