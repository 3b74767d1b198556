"""A bounded queue and a thread that writes what is put into it, so that the control loop never waits for a disk.

What does not fit, or cannot be written, is counted as lost. The log, the ring log and the recording are written so.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Final, Generic, TypeVar

from runtime.support.health import Worker

Item = TypeVar("Item")

CAPACITY: Final = 4096
"""Items that may wait: at 20 a second, three minutes of a stalled disk."""
CLOSE_MAX_S: Final = 2.0
"""Longest wait for the queue to be written when the writer is closed."""
BATCH: Final = 256
"""Items written between two pauses while there is a backlog."""
BATCH_PAUSE_S: Final = 0.002
"""Pause between batches of a backlog, in which the control loop gets the interpreter."""


class BackgroundWriter(Generic[Item]):
    """Write items on a thread. As a context manager, start the thread and at the end write what is left.

    All callables but `put`'s caller run on the thread. An OSError or ValueError (a closed stream raises one) from
    `write` or `write_gap` counts the item as lost; any other exception ends the thread, which `probe` then reports.

    Parameters
    ----------
    name : str
        Name of the thread.
    write : callable
        Writes one item completely; it may block for any time.
    write_gap : callable, optional
        Called with the number of items lost since its last call, before the next item is written.
    begin : callable, optional
        Called before the first item.
    tick : callable, optional
        Called after each batch of items, and with `poll_s` also when there was none.
    finish : callable, optional
        Called after the last item, unless the thread failed.
    poll_s : float, optional
        Look for items at this interval, s, and at each `wake`. Without it each `put` wakes the thread at once, which
        costs more.
    capacity : int
        Items that may wait.
    close_max_s : float
        Longest wait for the queue to be written when the writer is closed, s.
    """

    def __init__(
        self,
        name: str,
        write: Callable[[Item], None],
        *,
        write_gap: Callable[[int], None] | None = None,
        begin: Callable[[], None] | None = None,
        tick: Callable[[], None] | None = None,
        finish: Callable[[], None] | None = None,
        poll_s: float | None = None,
        capacity: int = CAPACITY,
        close_max_s: float = CLOSE_MAX_S,
    ) -> None:
        self._write = write
        self._write_gap = write_gap
        self._begin = begin
        self._tick = tick
        self._finish = finish
        self._poll_s = poll_s
        self._capacity = capacity
        self._close_max_s = close_max_s
        self._queue: deque[Item] = deque()
        self._wake = threading.Event()
        self._is_closing = False
        self._worker = Worker(name, self._work)
        # Each is counted by one thread only.
        self._refused = self._unwritten = self._left = 0
        self._gap_written = 0
        self.last_error: str | None = None
        """Why items were lost, the last time."""
        self.is_stuck = False
        """Whether the thread was still writing when the writer was closed."""

    @property
    def lost(self) -> int:
        """Number of items that were not written."""
        return self._refused + self._unwritten + self._left

    @property
    def is_full(self) -> bool:
        """Whether the next item would be lost."""
        return len(self._queue) >= self._capacity

    @property
    def failure(self) -> str | None:
        """The exception that ended the thread, in one line; None if there was none."""
        return self._worker.failure

    def put(self, item: Item, *, always: bool = False) -> bool:
        """Queue an item and return True; count it as lost and return False if the queue is full.

        Parameters
        ----------
        item : Item
            What to write; it must not change any more.
        always : bool
            Queue it even if the queue is full: for the few items without which later ones cannot be read.
        """
        if len(self._queue) >= self._capacity and not always:
            self._refused += 1
            self.last_error = "items come faster than they can be written"
            return False
        self._queue.append(item)
        if self._poll_s is None:
            self._wake.set()
        return True

    def wake(self) -> None:
        """Write what is queued now: at a moment at which the interpreter is free for this thread."""
        self._wake.set()

    def probe(self) -> str | None:
        """Return how the thread ended; None while it runs. See `runtime.support.health`."""
        return self._worker.probe()

    def start(self) -> None:
        """Start the thread."""
        self._worker.start()

    def close(self) -> None:
        """Write what is queued and end the thread; give up after `close_max_s`."""
        self._is_closing = True
        self._wake.set()
        self._worker.join(self._close_max_s)
        self._left = len(self._queue)
        if self._worker.is_alive():
            # The thread still holds the item it writes, and the file: nothing may be closed under it.
            self.is_stuck = True
            self.last_error = f"the last items were not written within {self._close_max_s:.0f} s"
        elif self.failure is not None:
            self.last_error = f"its thread failed: {self.failure}"

    def __enter__(self) -> BackgroundWriter[Item]:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _work(self) -> None:
        """Write what is queued, in batches if there is a backlog, until the writer is closed and the queue empty."""
        if self._begin is not None:
            self._begin()
        has_backlog = is_closing = False
        while self._queue or not is_closing:
            self._wake.wait(BATCH_PAUSE_S if has_backlog else self._poll_s)
            self._wake.clear()
            is_closing = self._is_closing
            if is_closing:
                self._wake.set()  # from here on nothing waits
            count = len(self._queue)
            has_backlog = count > BATCH
            for _ in range(min(BATCH, count)):
                self._write_one(self._queue[0])
                self._queue.popleft()
            if self._tick is not None:
                self._tick()
        if self._finish is not None:
            self._finish()

    def _write_one(self, item: Item) -> None:
        """Write an item, and before it the number of those lost; it is lost itself if the disk refuses."""
        try:
            gap = self._refused + self._unwritten - self._gap_written
            if self._write_gap is not None and gap:
                self._write_gap(gap)
                self._gap_written += gap
            self._write(item)
        except (OSError, ValueError) as error:
            self._unwritten += 1
            self.last_error = getattr(error, "strerror", None) or str(error)
