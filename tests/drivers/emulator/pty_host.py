"""An emulated robot served on a pty inside the test's process, by a clock that the test controls, and its host."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
from collections.abc import AsyncIterator, Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

from config.robot import BodyConfig, LinkConfig, RobotConfig
from config.world import WallConfig, WorldConfig
from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import Frame
from drivers.emulator.faults import Fault
from drivers.emulator.pty_transport import PtyPort
from drivers.emulator.server import EmulatorPort, Service, serve
from drivers.emulator.truth_trace import HEADER
from tests.drivers.ring import RING
from tests.hil.machine import TIMEOUT_S

F = TypeVar("F", bound=Frame)

TICK_S = 0.01
WORLD = WorldConfig(wall=(WallConfig(x1_m=90.0, y1_m=-9.0, x2_m=90.0, y2_m=9.0),))


class TickingClock:
    """A clock that advances by `TICK_S` at each reading: the emulated time depends on the turns of the loop alone."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        self.now_s += TICK_S
        return self.now_s


class Emulator:
    """A served robot.

    Attributes
    ----------
    path
        What it is ready on.
    task
        Ends when the emulator does.
    """

    def __init__(self, path: str, task: asyncio.Task[None], clock: TickingClock) -> None:
        self.path = path
        self.task = task
        self.clock = clock

    async def until(self, done: Callable[[], bool], what: str) -> None:
        """Run the emulator until a condition holds."""
        async with asyncio.timeout(TIMEOUT_S):
            while not done():
                assert not self.task.done(), f"the emulator ended before {what}"
                await asyncio.sleep(0.001)


@contextlib.asynccontextmanager
async def emulator(
    link: Path | None,
    *,
    make_port: Callable[[], EmulatorPort] | None = None,
    trace: Path | None = None,
    latency: Path | None = None,
    baud: int = 115200,
    faults: Sequence[Fault] = (),
    exit_with_parent: bool = False,
) -> AsyncIterator[Emulator]:
    """Serve a robot with no surface in range while the context lasts, and yield it when it is ready."""
    robot = RobotConfig(
        ring=RING, body=BodyConfig(radius_m=0.381, speed_max_m_s=0.6, turn_max_rad_s=1.5), link=LinkConfig(baud=baud)
    )
    make_port = make_port or partial(PtyPort, None if link is None else str(link))
    ready: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    clock = TickingClock()
    task = asyncio.create_task(
        serve(
            robot,
            WORLD,
            make_port=make_port,
            faults=faults,
            seed=1,
            ready=ready.set_result,
            service=Service(
                trace_path=None if trace is None else str(trace),
                latency_path=None if latency is None else str(latency),
                exit_with_parent=exit_with_parent,
            ),
            clock=clock,
        )
    )
    try:
        while not ready.done():
            if task.done():
                task.result()  # raises what prevented the start
            await asyncio.sleep(0.001)
        yield Emulator(ready.result(), task, clock)
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


class Host:
    """A plain file descriptor on the pty, and what was read from it."""

    def __init__(self, robot: Emulator) -> None:
        self._robot = robot
        self.fd = os.open(robot.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        # The emulator does not wait for a host: it may be in the middle of a frame.
        self.decoder = Decoder("robot", midway=True)
        self.heard: list[Frame] = []
        self.bytes = 0

    def __enter__(self) -> Host:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self.fd)

    def send(self, *frames: Frame) -> None:
        os.write(self.fd, b"".join(map(encode, frames)))

    def read(self) -> None:
        """Read what has come; raises OSError when the line is hung up."""
        try:
            data = os.read(self.fd, 65536)
        except BlockingIOError:
            return
        if not data:
            raise OSError(errno.EIO, "hung up")
        self.bytes += len(data)
        self.heard += self.decoder.feed(data)

    def of(self, kind: type[F]) -> list[F]:
        return [frame for frame in self.heard if isinstance(frame, kind)]

    async def until(self, done: Callable[[], bool], what: str) -> None:
        """Run the emulator and read what it sends until a condition holds."""

        def is_done() -> bool:
            self.read()
            return done()

        await self._robot.until(is_done, what)


def rows(trace: Path) -> list[dict[str, float]]:
    """Return the complete rows of a truth trace so far."""
    lines = trace.read_text().split("\n")[:-1]
    return [dict(zip(HEADER.split(","), map(float, line.split(",")), strict=True)) for line in lines[1:]]
