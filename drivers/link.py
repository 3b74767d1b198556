"""A serial line that is reopened after each loss, never blocks the loop, and reports why it was lost.

A TCP connection can take the place of the serial port, and is the same to this module.

The only importer of `serial_asyncio`, because that library needs care: its write buffer is unbounded, an exception in
a data handler leaves the port open but no longer read, and its `close()` never returns if the peer has stalled. So
writes are refused beyond a bound, handlers are guarded, and a line is ended by `abort()` only.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import select
import termios
import traceback
from collections.abc import Callable
from typing import ParamSpec

import serial_asyncio

from config.robot import LinkConfig
from drivers.serial_port import OPENING_ERRORS, LinkError, OpenPort, Port, open_off_loop, open_port, opening_error

__all__ = ["Link", "LinkError"]

P = ParamSpec("P")

_WRITABLE_MAX = 256
"""Bytes waiting in this process beyond which the line is not `writable`: the system's own buffer is then full."""
_BUFFER_MAX = 4096
"""Bytes waiting beyond which nothing is accepted; the room above `_WRITABLE_MAX` is for a HALT."""
_OPEN_TIMEOUT_S = 3.0
"""Longest time to open a port, s; a good one takes milliseconds, some USB adapters a second."""
_READ_MAX = 4096
"""Most bytes of one read: as many as a terminal's buffer holds."""
_HELD_BYTES_MAX = 1024
"""Most bytes that may arrive while the line is not read: a quarter of what a terminal's buffer holds."""
_BITS_PER_BYTE = 10
"""On the line: a start bit, eight data bits, a stop bit."""
_HOLD_MIN_S = 0.005
"""Shortest hold, s: a shorter one costs more than it saves."""
_FLUSH_S = 0.2
"""Longest time to send what is waiting when the line is closed, s."""
_FLUSH_POLL_S = 0.002
"""Time between looks at the system's own buffer, s."""


class Link:
    """A serial line that is kept open.

    Nothing is opened before `open_once` or `run`. A failed opening calls no handler: see `last_error`.

    Parameters
    ----------
    config
        Port, baud rate, and the waits between attempts to open it.
    on_opened, on_data, on_closed
        Called in the loop: the line is open; bytes arrived; the line is lost, with the reason. An exception in one of
        them ends the line, not the program; the line is opened again after a wait.
    opener
        Opens the port, in a thread. A family with a line of its own replaces it (`drivers.registry.line_options`).
    open_timeout_s
        Longest time to open the port, s.
    """

    def __init__(
        self,
        config: LinkConfig,
        on_opened: Callable[[], None],
        on_data: Callable[[bytes], None],
        on_closed: Callable[[str], None],
        *,
        opener: OpenPort = open_port,
        open_timeout_s: float = _OPEN_TIMEOUT_S,
    ) -> None:
        self._config = config
        self._on_opened, self._on_data, self._on_closed = on_opened, on_data, on_closed
        self.opener = opener
        self._open_timeout_s = open_timeout_s
        self._line: _Connection | None = None
        self._last_error: str | None = None
        self.has_hung_up = False
        """Whether the other end ended or reset the line that was lost last."""
        self._baud = config.baud

    @property
    def config(self) -> LinkConfig:
        """The settings of the line."""
        return self._config

    @property
    def is_open(self) -> bool:
        """True while the line can send and receive."""
        return self._line is not None and self._line.is_open

    @property
    def writable(self) -> bool:
        """True while bytes leave this process at once, so that nothing sent now is late."""
        return self._line is not None and self._line.is_open and self._line.waiting <= _WRITABLE_MAX

    @property
    def waiting(self) -> int:
        """Number of bytes sent that have not left this process; never more than 4 KiB."""
        return 0 if self._line is None else self._line.waiting

    @property
    def last_error(self) -> str | None:
        """Why the line was lost or could not be opened, in one line; None while it is open."""
        return self._last_error

    def send(self, data: bytes) -> bool:
        """Send bytes; return False if the line is not open or the peer has long stopped reading.

        All bytes are accepted or none, so that frames stay whole.
        """
        line = self._line
        if line is None or not line.is_open or line.waiting + len(data) > _BUFFER_MAX:
            return False
        if data:
            line.transport.write(data)
        return True

    def set_baud(self, baud: int | None) -> None:
        """Set the line's speed, bits per second, or back to that of the settings; a line without a speed ignores it.

        Without effect while closed. Bytes not transmitted yet may be lost. If the port refuses, the line is ended.
        """
        baud = self._config.baud if baud is None else baud
        if baud == self._baud or self._line is None:
            return
        self._baud = baud
        self._line.set_baud(baud)

    def hold(self, seconds: float) -> None:
        """Read nothing for this long, so that one wake-up takes what arrives meanwhile; sending is not affected.

        The line's own buffer keeps the bytes, so that a hold never lasts longer than it takes to fill a part of it.
        """
        seconds = min(seconds, _HELD_BYTES_MAX * _BITS_PER_BYTE / self._baud)
        if self._line is not None and seconds > _HOLD_MIN_S:
            self._line.transport.hold(seconds)

    def release(self) -> None:
        """Read again at once."""
        if self._line is not None:
            self._line.transport.release()

    async def open_once(self) -> None:
        """Open the line, unless it is already open.

        Raises
        ------
        LinkError
            The line cannot be opened; the message says why.
        """
        if self._line is not None:
            return
        try:
            port = await open_off_loop(self._config, self.opener, self._open_timeout_s)
            line = _Connection(self, port)
        except LinkError as e:
            self._last_error = str(e)
            raise
        self._line, self._baud = line, self._config.baud
        await line.opened.wait()

    async def run(self) -> None:
        """Keep the line open until cancelled, then end it.

        The wait before the next attempt doubles with each failure, and is short again once bytes have arrived.
        """
        wait_s = self._config.reopen_first_s
        try:
            while True:
                with contextlib.suppress(LinkError):
                    await self.open_once()
                line = self._line
                if line is not None:
                    await line.lost.wait()
                    if line.has_received:
                        wait_s = self._config.reopen_first_s
                await asyncio.sleep(wait_s)
                wait_s = min(2.0 * wait_s, self._config.reopen_max_s)
        finally:
            await self.stop()

    async def stop(self) -> None:
        """End the line: wait up to 0.2 s for sent bytes to leave, then abort."""
        line = self._line
        if line is None:
            return
        drained = False
        try:
            drained = await line.flush(_FLUSH_S)
        finally:
            line.end("closed by this program", drained=drained)
        await line.lost.wait()

    def _opened(self) -> None:
        self._last_error = None
        self._guard("opening", self._on_opened)

    def _received(self, data: bytes) -> None:
        self._guard("received data", self._on_data, data)

    def _lost(self, reason: str, *, has_hung_up: bool) -> None:
        self._line = None
        self._last_error, self.has_hung_up = reason, has_hung_up
        self._guard("closing", self._on_closed, reason)

    def _guard(self, what: str, call: Callable[P, None], *args: P.args, **kwargs: P.kwargs) -> None:
        """Call a handler; an exception in it ends the line, with its place in the reason."""
        try:
            call(*args, **kwargs)
        except Exception as e:  # noqa: BLE001 - a handler may raise anything, and the line must not stay open unread
            place = traceback.extract_tb(e.__traceback__)[-1]
            reason = (
                f"the handler of {what} failed with {type(e).__name__}: {e} ({place.filename}:{place.lineno}, in "
                f"{place.name}); a fault of this program: report it with this line"
            )
            self._last_error = reason
            if self._line is not None:
                self._line.end(reason)


class _Transport(serial_asyncio.SerialTransport):  # type: ignore[misc]  # the library has no types
    """The library's transport with four changes.

    Bytes are written at once, as far as the line accepts them: if they waited for the loop's next turn, whatever
    delays that turn would delay a command, which may then be wrong. Bytes are read by one system call in place of
    three, and not at all while the line is held. An unplugged cable is not reported as a program error. And every end
    is an abort.

    The loop watches the line through an epoll of the line's own: to close and open that one is a tenth of the work of
    removing a reader from the loop and adding it again. Systems without epoll do not hold the line.
    """

    _has_reader: bool
    _held: asyncio.TimerHandle | None = None
    _gate: select.epoll | None = None

    def _ensure_reader(self) -> None:
        """Have the loop watch the line; the library calls it to begin or go on reading."""
        if not hasattr(select, "epoll"):
            super()._ensure_reader()
        elif not self._has_reader and not self._closing:
            self._gate = select.epoll()
            self._gate.register(self._serial.fileno(), select.EPOLLIN)
            self._loop.add_reader(self._gate.fileno(), self._read_ready)
            self._has_reader = True

    def _remove_reader(self) -> None:
        """End that; the library calls it to pause reading and to close."""
        if self._gate is None:
            super()._remove_reader()
            return
        self._loop.remove_reader(self._gate.fileno())
        self._gate.close()
        self._gate, self._has_reader = None, False

    def hold(self, seconds: float) -> None:
        """Read nothing for this long."""
        if self._gate is not None and self._held is None:
            self._gate.modify(self._serial.fileno(), 0)
            self._held = self._loop.call_later(seconds, self.release)

    def release(self) -> None:
        """End a hold: read what has arrived, and whatever arrives from now on."""
        if self._held is None:
            return
        self._held.cancel()
        self._held = None
        if self._gate is not None:
            self._gate.modify(self._serial.fileno(), select.EPOLLIN)
            self._read_ready(is_certain=False)

    def _read_ready(self, *, is_certain: bool = True) -> None:
        """Read what has arrived; `is_certain` if the system reports that there is something."""
        try:
            data = os.read(self._serial.fileno(), _READ_MAX)
        except (BlockingIOError, InterruptedError):
            return
        except OSError as e:
            self._abort(e)
            return
        if data:
            self._protocol.data_received(data)
        elif is_certain:
            self._abort(ConnectionResetError("its other end is closed"))

    def write(self, data: bytes) -> None:
        """Send bytes at once as far as the line accepts them; the rest waits in the buffer of the library."""
        if self._closing:
            return
        if not self.get_write_buffer_size():
            try:
                data = data[os.write(self._serial.fileno(), data) :]
            except BlockingIOError:
                pass  # the peer does not read: the bytes have to wait
            except OSError as e:
                self._fatal_error(e)
                return
        if data:
            super().write(data)

    def _fatal_error(self, exc: BaseException, _message: str = "") -> None:
        self._abort(exc)

    def _close(self, exc: BaseException | None = None) -> None:
        # After a failed read the library would wait for its writes to leave, on a line that is lost.
        self._abort(exc)


class _Connection(asyncio.Protocol):
    """One connection: the line from its opening to its loss."""

    def __init__(self, link: Link, port: Port) -> None:
        self.has_received = False
        self.opened, self.lost = asyncio.Event(), asyncio.Event()
        self._link = link
        self._drained = asyncio.Event()
        """Set while no byte waits in this process."""
        self._drained.set()
        self._reason: str | None = None
        self._port = port
        try:
            self.transport = _Transport(asyncio.get_running_loop(), self, port)
        except OPENING_ERRORS as e:  # it configures the port again, which may be lost by now
            port.close()
            raise opening_error(link.config, e) from e
        # Any waiting byte counts as not drained.
        self.transport.set_write_buffer_limits(high=0, low=0)

    @property
    def is_open(self) -> bool:
        """True from the opening to the loss."""
        return self.opened.is_set() and not self.transport.is_closing()

    @property
    def waiting(self) -> int:
        """Number of bytes that have not left this process."""
        return int(self.transport.get_write_buffer_size())

    def connection_made(self, _transport: asyncio.BaseTransport) -> None:
        self.opened.set()
        if self.is_open:
            self._link._opened()

    def data_received(self, data: bytes) -> None:
        if self.is_open:
            self.has_received = True
            self._link._received(data)

    def pause_writing(self) -> None:
        self._drained.clear()

    def resume_writing(self) -> None:
        self._drained.set()

    def connection_lost(self, exc: BaseException | None) -> None:
        """Wake all who wait for this connection, and report why it was lost."""
        text = " ".join(str(exc).split()) if exc is not None else "no reason given"
        reason = self._reason or (
            f"the line {self._link.config.port} was lost ({text}); likely it was unplugged or the robot's side "
            f"ended: plug it in again; it is then opened again automatically"
        )
        self.opened.set()
        self.lost.set()
        self._drained.set()
        self._link._lost(reason, has_hung_up=self._reason is None and isinstance(exc, ConnectionError))

    def set_baud(self, baud: int) -> None:
        """Set the port's speed; end the connection if it refuses."""
        try:
            self._port.baudrate = baud
        except OPENING_ERRORS as e:
            self.end(f"the line {self._link.config.port} cannot be set to {baud} baud ({e}); correct link.baud")

    def end(self, reason: str, *, drained: bool = False) -> None:
        """Abort the connection, once; `connection_lost` follows soon, with `reason`."""
        if self.transport.is_closing():
            return
        self._reason = reason
        if not drained:
            # The library drains the port before it closes it, without limit if the peer has stalled.
            with contextlib.suppress(OSError, termios.error):
                self._port.reset_output_buffer()
        self.transport.abort()

    async def flush(self, timeout_s: float) -> bool:
        """Wait up to `timeout_s` until all bytes have left the machine; return whether they have on an open line."""
        with contextlib.suppress(TimeoutError, OSError, termios.error):
            async with asyncio.timeout(timeout_s):
                await self._drained.wait()
                while self.is_open and self._port.out_waiting:
                    await asyncio.sleep(_FLUSH_POLL_S)
                return self.is_open
        return False
