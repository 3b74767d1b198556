"""The emulator's end of a pseudo-terminal.

A pty differs from a serial line, and this module corrects that: bytes that the host does not read in time are lost
instead of being kept, and a line without a host is not an error.
"""

from __future__ import annotations

import contextlib
import errno
import os
import termios
import tty

from drivers.emulator.port_link import PortLink

_READ_MAX = 4096
_NO_HOST = frozenset({errno.EIO, errno.ENXIO})
"""Errors of a pty whose other end is not open."""


class PtyPort:
    """The emulator's end of a pty, and a symbolic link to the host's end.

    Parameters
    ----------
    link_path
        The symbolic link to keep pointing at the pty; None for no link.

    Attributes
    ----------
    dropped
        Number of bytes that the host did not read in time.

    Raises
    ------
    EmulatorError
        `link_path` exists and is not a link to a pty, another emulator has it, or the link cannot be made.
    """

    def __init__(self, link_path: str | None) -> None:
        self._link = None if link_path is None else PortLink(link_path)
        """None without one, and after `close`."""
        self._master: int | None = None
        """The end of this side; None while unplugged."""
        self._slave_name = ""
        """Path of the other end."""
        self._has_host = False
        """Whether a host had it open at the last read."""
        self.dropped = 0
        try:
            self.open()
        except BaseException:
            self.close()
            raise

    @property
    def path(self) -> str:
        """The path that a host opens."""
        return self._slave_name if self._link is None else str(self._link.path)

    @property
    def is_open(self) -> bool:
        """False while the line is unplugged."""
        return self._master is not None

    def open(self) -> None:
        """Plug in: open a new pty in raw mode and point the link at it."""
        master, slave = os.openpty()
        try:
            tty.setraw(slave)
            os.set_blocking(master, False)
            self._slave_name = os.ttyname(slave)
        finally:
            os.close(slave)
        self._master = master
        self._has_host = False
        if self._link is not None:
            self._link.point_at(self._slave_name)

    def unplug(self) -> None:
        """Hang up and remove the link, which stays reserved."""
        if self._master is None:
            return
        os.close(self._master)
        self._master = None
        if self._link is not None:
            self._link.remove(self._slave_name)

    def close(self) -> None:
        """Hang up for good."""
        self.unplug()
        if self._link is not None:
            self._link.close()
            self._link = None

    def read(self) -> bytes | None:
        """Return the bytes that the host wrote, without waiting; None if no host has the pty open."""
        if self._master is None:
            return None
        try:
            data = os.read(self._master, _READ_MAX)
        except BlockingIOError:
            data = b""
        except OSError as error:
            if error.errno not in _NO_HOST:
                raise
            if self._has_host:
                self._discard_unread()
            self._has_host = False
            return None
        self._has_host = True
        return data

    def write(self, data: bytes) -> None:
        """Send bytes to the host, without waiting; those that do not fit are lost, as without flow control."""
        written = 0
        if self._master is not None:
            try:
                written = os.write(self._master, data)
            except OSError as error:
                if error.errno not in {errno.EAGAIN, *_NO_HOST}:
                    raise
        self.dropped += len(data) - written

    @property
    def watched(self) -> int | None:
        """The descriptor that becomes readable when the host writes; None if no host has the pty open."""
        return self._master if self._has_host else None  # without a host it is always readable

    def _discard_unread(self) -> None:
        """Discard what the last host did not read: a pty keeps it for the next host, a serial port does not."""
        with contextlib.suppress(OSError, termios.error):
            slave = os.open(self._slave_name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            try:
                termios.tcflush(slave, termios.TCIFLUSH)
            finally:
                os.close(slave)
