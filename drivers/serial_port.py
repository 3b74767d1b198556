"""Opening of a serial port, or of a TCP connection in its place, with a one-line error if that fails.

Opening blocks, without limit on a lost USB adapter or a driver that waits for a modem line. So `link` does it in a
thread.
"""

from __future__ import annotations

import asyncio
import errno
import socket
import termios
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import serial

from config.errors import FAILED, WRONG_CALL, UserError
from config.robot import LinkConfig
from drivers.tcp_port import TcpPort, explain_tcp, is_tcp

Port: TypeAlias = serial.Serial | TcpPort
OpenPort: TypeAlias = Callable[[LinkConfig], Port]


OPENING_ERRORS = (OSError, ValueError, OverflowError, termios.error)
"""The exceptions of the serial library if a port cannot be opened or configured."""


class GatewayError(OSError):
    """A line that a process of its own serves cannot be opened; the text is the whole message."""


class LinkError(UserError):
    """The port cannot be opened: one line with what happened, the likely cause and the next action."""

    exit_code = WRONG_CALL


def open_port(config: LinkConfig) -> Port:
    """Return the opened port, locked for this process; blocks until it is open."""
    if config.port is not None and is_tcp(config.port):
        return TcpPort(config.port)
    return serial.Serial(config.port, config.baud, exclusive=True, timeout=0, write_timeout=0)


def is_missing(config: LinkConfig) -> bool:
    """Return whether there is no such serial port, as when the robot is not plugged in."""
    if config.port is None or is_tcp(config.port):
        return False
    try:
        return not Path(config.port).exists()
    except OSError:  # no permission, or too long a name: opening it says so
        return False


_IN_USE = (errno.EAGAIN, errno.EBUSY, errno.EWOULDBLOCK)


def opening_error(config: LinkConfig, error: BaseException) -> LinkError:
    """Return the error for the user: a port in use, or that does not open in time, is a failure; others are wrong."""
    if config.port is not None and is_tcp(config.port):
        wrong = isinstance(error, ValueError | OverflowError | socket.gaierror)
        return LinkError(explain_tcp(config.port, error), WRONG_CALL if wrong else FAILED)
    if isinstance(error, GatewayError):
        return LinkError(" ".join(str(error).split()), FAILED)
    is_there = isinstance(error, TimeoutError) or getattr(error, "errno", None) in _IN_USE
    return LinkError(explain(config, error), FAILED if is_there else WRONG_CALL)


def explain(config: LinkConfig, error: BaseException) -> str:
    """Return the message for a serial port that could not be opened, in one line."""
    port = config.port
    number = getattr(error, "errno", None)
    text = " ".join(str(error).split())
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.ENOTDIR):
        if port is not None and "://" in port:
            return (
                f"{port}: no such kind of port; give a serial device, or socket://host:port of a server that passes "
                "bytes on as they are (ser2net: raw)"
            )
        return (
            f"no such port {port}; likely the robot is not plugged in or the name is another: look for it with "
            f"`ls /dev/tty* /dev/serial/by-id`, and name that one"
        )
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"no permission to open {port}; likely this user is not in the port's group (dialout on most systems): "
            f"add the user to it and log in again"
        )
    if number in _IN_USE:
        return (
            f"port {port} is in use by another program; find it with `fuser {port}` and end it, or use another port"
        )
    not_a_tty = isinstance(error, termios.error) or "Could not configure port" in text
    if number in (errno.EISDIR, errno.ENOTTY) or not_a_tty:
        return f"{port} is not a serial port ({text}); give the serial device of the robot as --port or link.port"
    if isinstance(error, TimeoutError):
        return f"opening {port} takes too long ({text}); likely its adapter hangs: unplug and plug it again"
    if isinstance(error, ValueError | OverflowError):
        return f"{port} cannot be set to {config.baud} baud ({text}); correct link.baud"
    return f"cannot open {port} ({text}); check the cable and the port's name"


async def open_off_loop(config: LinkConfig, opener: OpenPort, timeout_s: float) -> Port:
    """Open the port in a thread of its own.

    The thread is a daemon, so that a port that never opens blocks neither the loop nor the end of the process. A port
    that opens after the timeout is closed again.

    Raises
    ------
    LinkError
        The port cannot be opened, or not within `timeout_s`.
    """
    if config.port is None:
        raise LinkError("no serial port is named; give it as --port or link.port")
    loop = asyncio.get_running_loop()
    opened: asyncio.Future[Port] = loop.create_future()

    def hand_over(port: Port | None, error: BaseException | None) -> None:
        if port is None:
            if not opened.done():
                opened.set_exception(error or OSError("the opener returned no port"))
        elif opened.done():
            port.close()
        else:
            opened.set_result(port)

    def work() -> None:
        port, error = None, None
        try:
            port = opener(config)
        except OPENING_ERRORS as e:
            error = e
        try:
            loop.call_soon_threadsafe(hand_over, port, error)
        except RuntimeError:  # the loop has been closed meanwhile
            if port is not None:
                port.close()

    threading.Thread(target=work, name=f"open {config.port}", daemon=True).start()
    taken = False
    try:
        # Not `wait_for`: before Python 3.12 it swallows a cancellation that comes together with the result.
        async with asyncio.timeout(timeout_s):
            port = await opened
        taken = True
    except TimeoutError as e:
        raise opening_error(config, TimeoutError(f"{timeout_s:g} s so far")) from e
    except OPENING_ERRORS as e:
        raise opening_error(config, e) from e
    finally:
        if not taken and opened.done() and not opened.cancelled() and opened.exception() is None:
            opened.result().close()
    return port
