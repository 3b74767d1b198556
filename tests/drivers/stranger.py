"""A device on a pty that is no robot."""

from __future__ import annotations

import contextlib
import os
import random
import select
import threading
import tty


class Stranger:
    """The other end of a pty, in a thread: it reads, and sends noise at a rate.

    Attributes
    ----------
    path
        The port to open.
    heard
        What was received.
    """

    def __init__(self, *, bytes_per_s: int = 0, seed: int = 1, hangs_up: bool = False) -> None:
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        self._slave = slave
        os.set_blocking(self._master, False)
        self.heard = bytearray()
        self._rate, self._random, self._hangs_up = bytes_per_s, random.Random(seed), hangs_up
        self._done = threading.Event()
        self._worker = threading.Thread(target=self._work, name="stranger")

    def _work(self) -> None:
        while not (self._done.is_set() or (self._hangs_up and self.heard)):
            with contextlib.suppress(OSError):
                if select.select([self._master], [], [], 0.02)[0]:
                    self.heard += os.read(self._master, 4096)
                if self._rate:
                    os.write(self._master, self._random.randbytes(max(1, self._rate // 50)))
        os.close(self._slave)
        os.close(self._master)

    def __enter__(self) -> Stranger:
        self._worker.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._worker.join()
