"""The two ends of a serial line over a real pty, and waiting for their reports; shared by the tests of the line."""

from __future__ import annotations

import asyncio
import contextlib
import os
import tty
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import TypeVar

from config.robot import LinkConfig
from drivers.link import Link
from drivers.serial_port import Port
from tests.hil.machine import TIMEOUT_S

T = TypeVar("T")


class PtyPair:
    """Both ends of a pty; a link at `path` comes and goes like a device that is plugged in and unplugged."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.master = -1
        self.slave = -1
        self.plug()

    def plug(self) -> None:
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        self.path.symlink_to(os.ttyname(self.slave))

    def unplug(self) -> None:
        if self.master >= 0:
            self.path.unlink()
            os.close(self.master)
            os.close(self.slave)
            self.master = -1

    async def read(self, count: int) -> bytes:
        loop, got, full = asyncio.get_running_loop(), bytearray(), asyncio.Event()

        def ready() -> None:
            got.extend(os.read(self.master, 4096))
            if len(got) >= count:
                full.set()

        loop.add_reader(self.master, ready)
        try:
            await asyncio.wait_for(full.wait(), TIMEOUT_S)
        finally:
            loop.remove_reader(self.master)
        return bytes(got)


class Host:
    """The handlers of a link, each feeding a queue."""

    def __init__(self) -> None:
        self.opened: asyncio.Queue[None] = asyncio.Queue()
        self.data: asyncio.Queue[bytes] = asyncio.Queue()
        self.closed: asyncio.Queue[str] = asyncio.Queue()

    def link(
        self, path: Path | str | None, *, baud: int = 115200, **options: Callable[[LinkConfig], Port] | float
    ) -> Link:
        port = None if path is None else str(path)
        config = LinkConfig(port=port, baud=baud, reopen_first_s=0.005, reopen_max_s=0.02)
        return Link(
            config,
            lambda: self.opened.put_nowait(None),
            self.data.put_nowait,
            self.closed.put_nowait,
            **options,  # type: ignore[arg-type]
        )


async def soon(queue: asyncio.Queue[T]) -> T:
    return await asyncio.wait_for(queue.get(), TIMEOUT_S)


@contextlib.asynccontextmanager
async def running(link: Link) -> AsyncIterator[asyncio.Task[None]]:
    task = asyncio.create_task(link.run())
    try:
        yield task
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.wait_for(task, TIMEOUT_S)
        assert not link.is_open
