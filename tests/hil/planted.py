"""The command with a fault of the program or of its disk planted in it: `python -m tests.hil.planted run …`.

PLANTED names what is planted, between commas:

- ``busy``: SIGURG holds the loop in a callback for ten seconds, SIGWINCH for a little more than the deadman. The
  moment when that begins goes to standard output.
- ``fsync``: the disk takes five seconds to confirm anything.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from runtime.cli.app import main
from runtime.cycle.process import RobotProcess
from tests.hil.running import ROOT, Running

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
    env: dict[str, str] | None = None, limit: str = "",
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
    limit
        A command of the shell before all else, as ``ulimit -f 64``.
    """
    log = folder / f"{name}.jsonl" if log is None else log
    command = [sys.executable, "-m", "tests.hil.planted", *arguments, "--headless", "--set", f'log.file="{log}"']
    if limit:
        # A limit on files would cut off compiled modules, and every later start would fail on them.
        command = ["/bin/sh", "-c", f'{limit}; PYTHONDONTWRITEBYTECODE=1 exec "$@"', "sh", *command]
    with (folder / f"{name}.out").open("wb") as out, (folder / f"{name}.err").open("wb") as err:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=out, stderr=err if stderr is None else stderr,
            env={**os.environ, "PYTHONPATH": str(ROOT), "PLANTED": plants, **(env or {})},
        )  # fmt: skip
        try:
            yield Running(process, folder, name)
        finally:
            process.send_signal(signal.SIGCONT)
            process.kill()
            process.wait()


if __name__ == "__main__":
    for plant in filter(None, os.environ.get("PLANTED", "").split(",")):
        PLANTS[plant]()
    main()
