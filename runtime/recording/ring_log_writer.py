"""A ring log while the robot drives: firings are handed over, a thread writes them, and no cycle waits for the disk.

What a slow disk cannot take in time is dropped and counted, so that it costs neither a cycle nor memory without end;
a file that fails is left as far as it came.
"""

from __future__ import annotations

import contextlib
import queue
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from drivers.messages import Firing
from runtime.recording.ring_log import RingLogError, write_ring_log
from runtime.recording.writer import CLOSE_MAX_S, RecorderStatus
from runtime.support.health import Worker

WAITING_MAX: Final = 4096
"""Firings that may wait to be written: three minutes of a disk that does nothing."""


class RingLogWriter:
    """Takes firings and has them written; a context in which the writing goes on.

    Parameters
    ----------
    path : Path
        Replaced if it exists.

    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._waiting: queue.SimpleQueue[Firing | None] = queue.SimpleQueue()
        self._taken = self._refused = self._unwritten = self._bytes = 0
        self._trouble: str | None = None
        self._worker = Worker("ring log", self._work)

    def __enter__(self) -> RingLogWriter:
        self._worker.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._waiting.put(None)
        self._worker.join(CLOSE_MAX_S)
        if self._worker.is_alive():
            self._unwritten += self._waiting.qsize()
            self._tell(f"{self._path}: the disk did not take the end within {CLOSE_MAX_S:.0f} s")
        elif self._worker.failure is not None:
            self._tell(f"{self._path}: its writer failed: {self._worker.failure}")
        with contextlib.suppress(OSError):
            self._bytes = self._path.stat().st_size

    @property
    def status(self) -> RecorderStatus:
        """How the ring log stands; its messages are firings, its size is told at the end."""
        dropped = self._refused + self._unwritten
        return RecorderStatus(str(self._path), 1, self._bytes, self._taken, dropped, self._trouble)

    def put(self, firing: Firing) -> None:
        """Hand over a firing."""
        if self._waiting.qsize() < WAITING_MAX:
            self._waiting.put(firing)
        else:
            self._refused += 1
            self._tell(f"{self._path}: the disk takes firings more slowly than they come")

    def probe(self) -> str | None:
        """Say how its thread ended; None while it runs. See `runtime.support.health`."""
        return self._worker.probe()

    def _work(self) -> None:
        firings = self._firings()
        try:
            write_ring_log(self._path, firings)
        except RingLogError as error:
            self._tell(str(error))
            # The disk's trouble is not the drive's: what comes from now on is taken, and is missing.
            for _ in firings:
                self._unwritten += 1

    def _firings(self) -> Iterator[Firing]:
        while (firing := self._waiting.get()) is not None:
            self._taken += 1
            yield firing

    def _tell(self, trouble: str) -> None:
        """Keep what was wrong first: the rest follows from it."""
        self._trouble = self._trouble or trouble
