"""A TCP connection in place of a serial port: `--port socket://host:8101`, as of an on-board bridge or a simulator.

It has what `drivers.link` uses of a `serial.Serial`, so that a line over TCP keeps every promise of a serial one.
"""

from __future__ import annotations

import contextlib
import fcntl
import socket
import struct
import termios
from typing import Final
from urllib.parse import urlsplit

import serial

SCHEME: Final = "socket://"
_CONNECT_S: Final = 1.4
"""Longest wait for each address of the host, s: two of them within the 3 s in which `drivers.link` opens a port."""
_SEND_BYTES: Final = 4096
"""The system's buffer for bytes to send: as small as a serial line's, so that no stale command waits in it."""
_RECEIVE_BYTES: Final = 16_384
"""The system's buffer for bytes that have come: what a suspended process finds there is old."""
_DEAD_AFTER_S: Final = 5
"""A peer whose system confirms nothing for this long is gone, s; the line is then opened again."""
_KEEPALIVE: Final = (("TCP_KEEPIDLE", 2), ("TCP_KEEPINTVL", 1), ("TCP_KEEPCNT", _DEAD_AFTER_S - 2))
_RESET_ON_CLOSE: Final = struct.pack("ii", 1, 0)


def is_tcp(port: str | None) -> bool:
    """Return whether `port` names a TCP connection and not a serial port."""
    return port is not None and port.startswith(SCHEME)


class TcpPort:
    """An open connection; opening blocks for some seconds at most.

    The URL is ``socket://host:port``.

    Attributes
    ----------
    timeout, write_timeout
        Always 0: no call waits.
    baudrate
        May be set, and has no effect.

    Raises
    ------
    ValueError
        `url` names no host or no port.
    OSError
        The connection cannot be made.
    """

    def __init__(self, url: str) -> None:
        self.timeout = self.write_timeout = self.baudrate = 0
        self._socket = socket.create_connection(_address(url), timeout=_CONNECT_S)
        self._socket.settimeout(0.0)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BYTES)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BYTES)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        with contextlib.suppress(OSError, AttributeError):  # not on every system; without them a loss is seen later
            for name, value in _KEEPALIVE:
                self._socket.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, 1000 * _DEAD_AFTER_S)

    def fileno(self) -> int:
        """Return the descriptor for reads and writes."""
        return self._socket.fileno()

    @property
    def out_waiting(self) -> int:
        """Number of bytes that the other end's system has not confirmed."""
        answer = fcntl.ioctl(self._socket.fileno(), termios.TIOCOUTQ, bytes(4))  # SIOCOUTQ has the same number
        return int(struct.unpack("i", answer)[0])

    def write(self, data: bytes) -> int:
        """Send what the system takes now and return how many bytes that is.

        Raises
        ------
        BlockingIOError
            It takes none.
        serial.SerialException
            The connection is lost.
        """
        try:
            return self._socket.send(data)
        except BlockingIOError:
            raise
        except OSError as error:
            raise serial.SerialException(error.errno, str(error)) from error

    def flush(self) -> None:
        """Do nothing: the system sends what it has."""

    def reset_output_buffer(self) -> None:
        """Have the system drop what it has not sent, when the connection is closed."""
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET_ON_CLOSE)

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


def _address(url: str) -> tuple[str, int]:
    """Return host and port of a URL.

    Raises
    ------
    ValueError
        It is not of the form socket://host:port.
    """
    parts = urlsplit(url)
    if not parts.hostname or not parts.port or parts.path.strip("/") or parts.query or parts.username:
        raise ValueError("not of the form socket://host:port")
    return parts.hostname, parts.port


def explain_hang_up(url: str) -> str:
    """Return the message for a connection that ended before a robot answered, in one line."""
    return (
        f"{url}: its other end ends the connection before a robot answers; likely it is another program's port, or "
        "serves one client at a time: give the robot's port, or end the other client"
    )


def explain_tcp(url: str, error: BaseException) -> str:
    """Return the message for a connection that could not be made, in one line."""
    text = " ".join(str(error).split())
    if isinstance(error, ValueError | OverflowError):
        return f"{url}: {text}; give a host and a port, as socket://192.168.1.11:8101"
    if isinstance(error, socket.gaierror):
        return f"{url}: no such host ({text}); correct its name, or give its number"
    if isinstance(error, ConnectionRefusedError):
        return (
            f"{url} refuses the connection; likely the robot's side does not run, or serves another client: start "
            f"it, or end the other client"
        )
    if isinstance(error, TimeoutError):
        return f"{url} does not answer ({text}); likely the robot is off or in another network: check both"
    return f"cannot connect to {url} ({text}); check the network and the robot's address"
