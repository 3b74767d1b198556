"""Where lines go that nobody may wait for: a thread writes them, however long it takes."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable
from typing import Final, TextIO

from runtime.support.health import Worker

WAITING_MAX: Final = 4096
"""Lines that may wait to be written; what does not fit is dropped and counted."""
CLOSE_MAX_S: Final = 2.0
"""So long the end waits for what is left to be written."""


class BackgroundWriter:
    """Takes lines and has them written; a context in which the writing goes on.

    Parameters
    ----------
    name : str
        Of its thread.
    write : callable
        Writes a line whole, and waits for as long as that takes.
    missing : callable, optional
        Returns what is written in place of so many lost lines, once writing works again.
    close : callable, optional
        Called at the end, unless a write is still under way.

    Attributes
    ----------
    lost
        Lines that were not written.
    trouble
        Why, the last time.
    """

    def __init__(
        self,
        name: str,
        write: Callable[[bytes], None],
        missing: Callable[[int], bytes] | None = None,
        close: Callable[[], None] | None = None,
    ) -> None:
        self._write = write
        self._missing = missing
        self._close = close
        self._waiting: deque[bytes] = deque()
        self._wake = threading.Event()
        self._ending = False
        self._worker = Worker(name, self._work)
        self._told = 0
        self.lost = 0
        self.trouble: str | None = None

    def put(self, line: bytes) -> None:
        """Hand over a line."""
        if len(self._waiting) >= WAITING_MAX:
            self._lose("it takes lines more slowly than they come")
            return
        self._waiting.append(line)
        self._wake.set()

    def probe(self) -> str | None:
        """Say how its thread ended; None while it runs. See `runtime.support.health`."""
        return self._worker.probe()

    def __enter__(self) -> BackgroundWriter:
        self._worker.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending = True
        self._wake.set()
        self._worker.join(CLOSE_MAX_S)
        if self._worker.is_alive():
            # It still holds the line it writes, and the file: nothing may be closed under it.
            self.lost += len(self._waiting)
            self.trouble = f"it did not take the last lines within {CLOSE_MAX_S:.0f} s"
        elif self._close is not None:
            self._close()

    def _work(self) -> None:
        while not (self._ending and not self._waiting):
            self._wake.wait()
            self._wake.clear()
            while self._waiting:
                self._enter(self._waiting[0])
                self._waiting.popleft()

    def _enter(self, line: bytes) -> None:
        try:
            if self._missing is not None and self.lost > self._told:
                count = self.lost - self._told
                self._write(self._missing(count))
                self._told += count
            self._write(line)
        except (OSError, ValueError) as error:  # a ValueError is how a closed stream refuses
            self._lose(getattr(error, "strerror", None) or str(error))

    def _lose(self, why: str) -> None:
        self.lost += 1
        self.trouble = why


def to_file(name: str, fd: int, missing: Callable[[int], bytes]) -> BackgroundWriter:
    """Return a sink into an open file, which it closes; a line that was torn by a full disk is ended."""
    torn = False

    def write(line: bytes) -> None:
        nonlocal torn
        rest = memoryview(b"\n" + line if torn else line)
        while rest:
            count = os.write(fd, rest)
            torn = count < len(rest)
            rest = rest[count:]

    return BackgroundWriter(name, write, missing, lambda: os.close(fd))


def to_terminal(name: str, stream: TextIO) -> BackgroundWriter:
    """Return a sink onto a stream that stays open; past its buffer, whose lock is no thread's to die with."""
    try:
        fd = stream.fileno()
    except OSError:

        def write(line: bytes) -> None:
            stream.write(line.decode())
            stream.flush()

        return BackgroundWriter(name, write)

    def write_whole(line: bytes) -> None:
        rest = memoryview(line)
        while rest:
            rest = rest[os.write(fd, rest) :]

    return BackgroundWriter(name, write_whole)
