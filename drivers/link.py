"""One serial line for life: opened, opened again after each loss, never waited for, and truthful about its end.

The only importer of `serial_asyncio`, because that library needs watching: its write buffer has no bound, an
exception in a data handler leaves the port up and deaf, and its `close()` on a stalled peer never ends. So writes
are refused beyond a bound, handlers are guarded, and a line is ended by `abort()` alone.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import termios
import threading
import traceback
from collections.abc import Callable

import serial
import serial_asyncio

from config.robot import LinkConfig
from drivers.serial_port import OPENING_ERRORS, LinkError, OpenPort, open_port, opening_error

__all__ = ["Link", "LinkError"]

_WRITABLE_MAX = 256
"""Bytes waiting in this process beyond which the line is not `writable`: the system's own buffer is full then."""
_BUFFER_MAX = 4096
"""Bytes waiting beyond which nothing is accepted; the room above `_WRITABLE_MAX` is for a HALT."""
_OPEN_TIMEOUT_S = 3.0
_FLUSH_S = 0.2
_FLUSH_POLL_S = 0.002


class Link:
    """A serial line that is kept open.

    Parameters
    ----------
    config
        Port, baud rate, and the waits between attempts to open it.
    on_opened, on_data, on_closed
        Called in the loop: the line is open; bytes came; the line is gone, and why. What they raise ends the line,
        not the program; it is opened again after a wait.
    opener
        Opens the port, in a thread; for tests.
    open_timeout_s
        Patience with an opening.
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
        self._on_opened = on_opened
        self._on_data = on_data
        self._on_closed = on_closed
        self._opener = opener
        self._open_timeout_s = open_timeout_s
        self._line: _Line | None = None
        self._last_error: str | None = None

    @property
    def config(self) -> LinkConfig:
        """The line's settings."""
        return self._config

    @property
    def is_open(self) -> bool:
        """True while bytes can go and come."""
        return self._line is not None and self._line.up

    @property
    def writable(self) -> bool:
        """True while what is sent leaves without waiting for the peer to read."""
        return self._line is not None and self._line.up and self._line.waiting <= _WRITABLE_MAX

    @property
    def waiting(self) -> int:
        """Bytes sent that have not left this process; never more than 4 KiB."""
        return 0 if self._line is None else self._line.waiting

    @property
    def last_error(self) -> str | None:
        """Why the line was lost or could not be opened the last time, in one line; None while all is well."""
        return self._last_error

    def send(self, data: bytes) -> bool:
        """Put bytes on the line; return False where it is not open or the peer has long stopped reading.

        Bytes are taken whole or not at all, so that frames stay whole.
        """
        line = self._line
        if line is None or not line.up or line.waiting + len(data) > _BUFFER_MAX:
            return False
        if data:
            line.transport.write(data)
        return True

    async def open_once(self) -> None:
        """Open the line, unless it is open.

        Raises
        ------
        LinkError
            It cannot be opened; the message says why in one line.
        """
        if self._line is not None:
            return
        try:
            port = await _open_off_loop(self._config, self._opener, self._open_timeout_s)
            line = _Line(self, port)
        except LinkError as e:
            self._last_error = str(e)
            raise
        self._line = line
        await line.made.wait()

    async def run(self) -> None:
        """Keep the line open until cancelled, then end it.

        The wait before the next attempt doubles with each failure and begins anew once bytes have come.
        """
        wait_s = self._config.reopen_first_s
        try:
            while True:
                with contextlib.suppress(LinkError):
                    await self.open_once()
                line = self._line
                if line is not None:
                    await line.gone.wait()
                    if line.fruitful:
                        wait_s = self._config.reopen_first_s
                await asyncio.sleep(wait_s)
                wait_s = min(2.0 * wait_s, self._config.reopen_max_s)
        finally:
            await self.stop()

    async def stop(self) -> None:
        """End the line: give what has been sent a fifth of a second to leave, then abort."""
        line = self._line
        if line is None:
            return
        drained = False
        try:
            drained = await line.flush(_FLUSH_S)
        finally:
            line.end("it was closed at this end", drained=drained)
        await line.gone.wait()

    def _made(self) -> None:
        self._last_error = None
        self._guard("opening", self._on_opened)

    def _received(self, data: bytes) -> None:
        self._guard("received data", lambda: self._on_data(data))

    def _lost(self, reason: str) -> None:
        self._line = None
        self._last_error = reason
        self._guard("closing", lambda: self._on_closed(reason))

    def _guard(self, what: str, call: Callable[[], None]) -> None:
        """Call a handler; what it raises becomes the end of the line, with the culprit named."""
        try:
            call()
        except Exception as e:  # noqa: BLE001 - a handler may raise anything, and the line must not stay up and deaf
            culprit = traceback.extract_tb(e.__traceback__)[-1]
            reason = (
                f"the handler of {what} failed with {type(e).__name__}: {e} ({culprit.filename}:{culprit.lineno}, in "
                f"{culprit.name}); a fault of this program: report it with this line"
            )
            self._last_error = reason
            if self._line is not None:
                self._line.end(reason)


class _Transport(serial_asyncio.SerialTransport):  # type: ignore[misc]  # the library has no types
    """The library's transport, minus three habits.

    What is written leaves at once, as far as the line takes it: bytes that waited for the loop's next turn would
    leave after whatever holds that turn up, and a command that was right then may be wrong by minutes. An unplugged
    cable is no program error. And an end is an end.
    """

    def write(self, data: bytes) -> None:
        if self._closing:
            return
        if not self.get_write_buffer_size():
            try:
                data = data[os.write(self._serial.fileno(), data) :]
            except BlockingIOError:
                pass  # the peer does not read: it has to wait after all
            except OSError as e:
                self._fatal_error(e)
                return
        if data:
            super().write(data)

    def _fatal_error(self, exc: BaseException, _message: str = "") -> None:
        self._abort(exc)

    def _close(self, exc: BaseException | None = None) -> None:
        # After a failed read the library would wait for its writes to leave, on a line that is gone.
        self._abort(exc)


class _Line(asyncio.Protocol):
    """One opening of the line, from open to lost."""

    def __init__(self, link: Link, port: serial.Serial) -> None:
        self.fruitful = False
        self.made = asyncio.Event()
        self.gone = asyncio.Event()
        self._link = link
        self._drained = asyncio.Event()
        self._drained.set()
        self._reason: str | None = None
        self._port = port
        try:
            self.transport = _Transport(asyncio.get_running_loop(), self, port)
        except OPENING_ERRORS as e:  # it sets the port up anew, which may be gone again
            port.close()
            raise opening_error(link.config, e) from e
        # Any byte that waits counts as not drained.
        self.transport.set_write_buffer_limits(high=0, low=0)

    @property
    def up(self) -> bool:
        """True from its beginning to its end."""
        return self.made.is_set() and not self.transport.is_closing()

    @property
    def waiting(self) -> int:
        """Bytes that have not left this process."""
        return int(self.transport.get_write_buffer_size())

    def connection_made(self, _transport: asyncio.BaseTransport) -> None:
        self.made.set()
        if self.up:
            self._link._made()

    def data_received(self, data: bytes) -> None:
        if self.up:
            self.fruitful = True
            self._link._received(data)

    def pause_writing(self) -> None:
        self._drained.clear()

    def resume_writing(self) -> None:
        self._drained.set()

    def connection_lost(self, exc: BaseException | None) -> None:
        text = " ".join(str(exc).split()) if exc is not None else "it ended without a word"
        reason = self._reason or (
            f"the line {self._link.config.port} was lost ({text}); likely it was unplugged or the robot's side "
            f"ended: plug it in again, it is opened again by itself"
        )
        self.made.set()
        self.gone.set()
        self._drained.set()
        self._link._lost(reason)

    def end(self, reason: str, *, drained: bool = False) -> None:
        """Abort, once: `connection_lost` follows soon, with `reason`."""
        if self.transport.is_closing():
            return
        self._reason = reason
        if not drained:
            # The library drains the port before it closes it, for as long as a stalled peer likes.
            with contextlib.suppress(OSError, termios.error):
                self._port.reset_output_buffer()
        self.transport.abort()

    async def flush(self, timeout_s: float) -> bool:
        """Wait until all bytes have left the machine, for `timeout_s` at most; return whether they have."""
        with contextlib.suppress(TimeoutError, OSError, termios.error):
            async with asyncio.timeout(timeout_s):
                await self._drained.wait()
                while self.up and self._port.out_waiting:
                    await asyncio.sleep(_FLUSH_POLL_S)
                return True
        return False


async def _open_off_loop(config: LinkConfig, opener: OpenPort, timeout_s: float) -> serial.Serial:
    """Open the port in a thread of its own.

    The thread is a daemon, so that a port that never opens keeps neither the loop nor the process from ending; one
    that opens after all when nobody waits any more is closed again.

    Raises
    ------
    LinkError
        It cannot be opened, or not within `timeout_s`.
    """
    if config.port is None:
        raise LinkError("no serial port is named; give it as --port or link.port")
    loop = asyncio.get_running_loop()
    opened: asyncio.Future[serial.Serial] = loop.create_future()

    def hand_over(port: serial.Serial | None, error: BaseException | None) -> None:
        if port is None:
            if not opened.done():
                opened.set_exception(error or OSError("it opened as nothing"))
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
