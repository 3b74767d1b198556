"""The emulator's end of a TCP port: one host at a time, as an on-board bridge serves it; others are refused.

Like a bridge it packs what leaves the robot's transmitter until that pauses, so that a host mostly gets whole frames.
"""

from __future__ import annotations

import contextlib
import os
import socket

from config.errors import WRONG_CALL
from drivers.emulator.port_link import EmulatorError

LOCALHOST = "127.0.0.1"
"""Where it listens unless another address is given: nothing asks a host who it is."""
PORT_MAX = 65_535
_READ_MAX = 4096
_PACKET_MAX = 512
"""Bytes packed at most; a line that never pauses is sent in pieces of this size."""
_BUFFER_BYTES = 16_384
"""The system's buffer for bytes to the host; what a stalled host does not take beyond it is lost."""


def parse_address(text: str) -> tuple[str, int]:
    """Return host and port of ``PORT``, ``HOST:PORT`` or ``[HOST]:PORT``; port 0 is any free one.

    Raises
    ------
    EmulatorError
        The text is none of these.
    """
    host, _, port = text.rpartition(":")
    if not (port.isascii() and port.isdigit()) or int(port) > PORT_MAX or text.startswith(":"):
        raise EmulatorError(f"--tcp {text}: must be a port from 0 to {PORT_MAX}, or HOST:PORT", WRONG_CALL)
    return host.removeprefix("[").removesuffix("]") or LOCALHOST, int(port)


class TcpServerPort:
    """A listening TCP port, and the connection of the one host that has it.

    While a host is connected nothing listens, so that a second one is refused at once.

    Parameters
    ----------
    host, port
        Where to listen; with port 0 at any free port.

    Attributes
    ----------
    dropped
        Number of bytes that the host did not read in time.

    Raises
    ------
    EmulatorError
        The address is taken or not of this machine.
    """

    def __init__(self, host: str, port: int) -> None:
        self._host, self._port = host, port
        self._listener: socket.socket | None = None
        self._connection: socket.socket | None = None
        self.dropped = 0
        self._packet = bytearray()
        """Bytes to send in one packet."""
        self._is_growing = False
        """Whether some were added since the last `read`: it is sent at a pause."""
        self.open()

    @property
    def path(self) -> str:
        """What a host gives as its port."""
        host = f"[{self._host}]" if ":" in self._host else self._host
        return f"socket://{host}:{self._port}"

    @property
    def is_open(self) -> bool:
        """False while the line is unplugged."""
        return self._listener is not None or self._connection is not None

    @property
    def watched(self) -> int | None:
        """The descriptor that becomes readable when a host connects or writes."""
        end = self._connection or self._listener
        return None if end is None else end.fileno()

    def open(self) -> None:
        """Plug in: listen for a host.

        Raises
        ------
        EmulatorError
            The address is taken or not of this machine.
        """
        try:
            family = socket.AF_INET6 if ":" in self._host else socket.AF_INET
            self._listener = socket.create_server((self._host, self._port), family=family, backlog=1)
        except OSError as error:
            reason = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
            raise EmulatorError(
                f"cannot listen on {self._host}:{self._port}: {reason}; choose another port with --tcp"
            ) from error
        self._listener.settimeout(0.0)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
        self._port = self._listener.getsockname()[1]

    def unplug(self) -> None:
        """Hang up, and refuse hosts."""
        for end in (self._connection, self._listener):
            if end is not None:
                end.close()
        self._connection = self._listener = None
        self._packet.clear()

    def close(self) -> None:
        """Hang up for good."""
        self.unplug()

    def read(self) -> bytes | None:
        """Return the bytes that the host wrote, None without one; send the packed ones once they pause."""
        if not self._is_growing:
            self._flush()
        self._is_growing = False
        if self._connection is None:
            self._accept()
        if self._connection is None:
            return None
        try:
            data = self._connection.recv(_READ_MAX)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self.unplug()
            self.open()
            return None
        return data

    def write(self, data: bytes) -> None:
        """Pack bytes for the host; those that do not fit when they are sent are lost."""
        self._packet += data
        self._is_growing = True
        if len(self._packet) > _PACKET_MAX:
            self._flush()

    def _flush(self) -> None:
        """Send the packed bytes; those that do not fit, or all without a host, count as dropped."""
        if not self._packet:
            return
        written = 0
        if self._connection is not None:
            with contextlib.suppress(OSError):  # full, or lost, which the next read reports
                written = self._connection.send(self._packet)
        self.dropped += len(self._packet) - written
        self._packet.clear()

    def _accept(self) -> None:
        """Take the host that waits, if there is one, and listen no longer."""
        if self._listener is None:
            return
        try:
            self._connection, _ = self._listener.accept()
        except OSError:  # no one, or gone already
            return
        self._listener.close()
        self._listener = None
        self._connection.settimeout(0.0)
        self._connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
