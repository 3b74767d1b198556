"""A ring log of a running robot: firings are queued and a thread writes them, so that no cycle waits for the disk.

Firings that a slow disk cannot accept in time are dropped and counted. A file that fails is closed as it is.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import Final, TextIO

from config.files import utf8
from drivers.messages import Firing
from runtime.recording.ring_log import RingLogError
from runtime.recording.ring_log_rows import RingLogRows, cannot_write
from runtime.recording.servo_columns import ServoColumns
from runtime.recording.writer import CLOSE_MAX_S, RecorderStatus
from runtime.support.background_writer import BackgroundWriter

QUEUE_MAX: Final = 4096
"""Firings that may wait: three minutes of a stalled disk."""


class RingLogWriter:
    """Writer of a ring log. As a context manager it starts and stops the writing.

    Parameters
    ----------
    path : Path
        Replaced if it exists.
    pairs : sequence of tuple
        The cross paths of the firing pattern, (transmitter, listener): those of a later one have no column.
    servos : ServoColumns, optional
        The bearings of the ring.
    """

    def __init__(self, path: Path, pairs: Sequence[tuple[int, int]] = (), servos: ServoColumns | None = None) -> None:
        self._path = path
        self._servos = servos
        self._pairs = pairs
        self._file: TextIO | None = None
        """None before it is opened, and after an error."""
        self._rows: RingLogRows | None = None
        self._bytes = 0
        """Size of the file; 0 before the end."""
        self.last_error: str | None = None
        """The first trouble with the file; None if there was none."""
        self._thread = BackgroundWriter[Firing](
            "ring log",
            self._write,
            begin=self._begin,
            finish=self._finish,
            capacity=QUEUE_MAX,
            close_max_s=CLOSE_MAX_S,
        )

    def __enter__(self) -> RingLogWriter:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Write what is queued, note if that failed, and keep the size of the file."""
        self._thread.close()
        if self._thread.is_stuck:
            self._note(f"{self._path}: its end was not written within {CLOSE_MAX_S:.0f} s: check the disk")
        elif self._thread.failure is not None:
            self._note(f"{self._path}: its writer failed: {self._thread.failure}")
        with contextlib.suppress(OSError):
            self._bytes = self._path.stat().st_size

    @property
    def status(self) -> RecorderStatus:
        """The state of the ring log; `messages` counts firings, and `bytes` is known at the end."""
        written = 0 if self._rows is None else self._rows.count
        return RecorderStatus(utf8(str(self._path)), 1, self._bytes, written, self._thread.lost, self.last_error)

    def put(self, firing: Firing) -> None:
        """Queue a firing."""
        if not self._thread.put(firing):
            self._note(f"{self._path}: firings come faster than the disk takes them")

    def probe(self) -> str | None:
        """Return how its thread ended; None while it runs. See `runtime.support.health`."""
        return self._thread.probe()

    def _begin(self) -> None:
        """Open the file; called in the thread, as are `_write` and `_finish`."""
        try:
            self._file = self._path.open("w", encoding="utf-8", newline="\n")
            self._rows = RingLogRows(self._file, self._path, self._pairs, self._servos)
        except OSError as error:
            self._fail(str(cannot_write(self._path, error)))

    def _write(self, firing: Firing) -> None:
        """Write a firing.

        Raises
        ------
        OSError
            It is lost: the background writer counts it.
        """
        if self._file is None or self._rows is None:
            raise OSError(self.last_error)  # counted as lost
        try:
            self._rows.write(firing)
            if self._rows.dropped:
                self._note(f"{self._path}: a later firing pattern has cross paths without a column; start a new log")
        except (OSError, RingLogError) as error:
            self._fail(str(error if isinstance(error, RingLogError) else cannot_write(self._path, error)))
            raise OSError(self.last_error) from error

    def _finish(self) -> None:
        """Close the file, and note if nothing was written."""
        if self._file is None or self._rows is None:
            return
        try:
            self._file.close()
            self._rows.check_not_empty()
        except (OSError, RingLogError) as error:
            self._fail(str(error if isinstance(error, RingLogError) else cannot_write(self._path, error)))

    def _fail(self, error: str) -> None:
        """Close the file as it is: every later firing is lost."""
        self._note(error)
        if self._file is not None:
            with contextlib.suppress(OSError):
                self._file.close()
        self._file = None

    def _note(self, error: str) -> None:
        """Keep the first error: the others follow from it."""
        self.last_error = self.last_error or utf8(error)
