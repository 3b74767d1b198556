"""The command with a fault of the program or of its disk planted in it.

What may be planted:

- ``busy``: SIGURG holds the loop in a callback for ten seconds, SIGWINCH for a little more than the deadman. The
  moment when that begins goes to standard output.
- ``fsync``: the disk takes five seconds to confirm anything.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import resource
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from runtime.cycle.process import RobotProcess
from tests.hil.forked_command import ForkedCommand
from tests.hil.running import ROOT, Running, ended

LONG_S, SHORT_S = 10.0, 1.2
FSYNC_S = 5.0
HELD = "held from"
"""Before the moment, by the host's monotonic clock, from which on the loop is held."""


def plant_busy() -> None:
    """Have two signals hold the loop."""
    run = RobotProcess.run

    def hold(seconds: float) -> None:
        begin_s = time.monotonic()
        os.write(sys.stdout.fileno(), f"{HELD} {begin_s:.6f}\n".encode())
        while time.monotonic() < begin_s + seconds:
            pass

    async def held(self: RobotProcess, **how: Any) -> Any:
        loop = asyncio.get_running_loop()
        loop.add_signal_handler(signal.SIGURG, hold, LONG_S)
        loop.add_signal_handler(signal.SIGWINCH, hold, SHORT_S)
        return await run(self, **how)

    RobotProcess.run = held  # type: ignore[method-assign]


def plant_fsync() -> None:
    """Have the disk take its time."""
    sync = os.fsync

    def slowly(fd: int) -> None:
        time.sleep(FSYNC_S)
        sync(fd)

    os.fsync = slowly  # type: ignore[assignment]


PLANTS = {"busy": plant_busy, "fsync": plant_fsync}


@contextlib.contextmanager
def planted(
    folder: Path, name: str, plants: str, *arguments: str, log: Path | None = None, stderr: int | None = None,
    env: dict[str, str] | None = None, file_bytes: int | None = None,
) -> Iterator[Running]:  # fmt: skip
    """Run the command so; whatever is left of it at the end is killed.

    Parameters
    ----------
    folder, name, arguments
        As for `running`.
    plants
        Names, between commas.
    log
        Its log, where that is not FOLDER/NAME.jsonl.
    stderr
        Its standard error, where that is not FOLDER/NAME.err.
    env
        Added to the environment.
    file_bytes
        Where its files end.
    """
    log = folder / f"{name}.jsonl" if log is None else log
    command = [*arguments, "--headless", "--set", f'log.file="{log}"']

    def prepare() -> None:
        for plant in filter(None, plants.split(",")):
            PLANTS[plant]()
        if file_bytes is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (file_bytes, file_bytes))

    with (
        Path(os.devnull).open("rb") as nothing,
        (folder / f"{name}.out").open("wb") as out,
        (folder / f"{name}.err").open("wb") as err,
    ):
        streams = (nothing.fileno(), out.fileno(), err.fileno() if stderr is None else stderr)
        environment = {"PYTHONPATH": str(ROOT), **(env or {})}
        yield from ended(Running(ForkedCommand(command, streams, environment, prepare), folder, name))
