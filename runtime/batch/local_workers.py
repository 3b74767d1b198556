"""Worker processes on this machine, of which one that died is replaced.

(Dask's own local cluster loses a worker for good that dies while it starts.)
"""

from __future__ import annotations

import contextlib
import subprocess
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Final

from runtime.support.child_process import child_environment

LOOK_PERIOD_S: Final = 1.0
"""Time until a dead worker is noticed and replaced."""
END_TIMEOUT_S: Final = 10.0
"""Time that a worker may take to end before it is killed."""


@contextlib.contextmanager
def local_workers(
    command: Sequence[str], count: int, log: Path, period_s: float = LOOK_PERIOD_S
) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Keep so many processes running during the block, and yield them; the list changes when one is replaced.

    If this process is killed, they end as their scheduler is gone.

    Parameters
    ----------
    command : sequence of str
        Starts one.
    count : int
        How many.
    log : Path
        File for what they print; it is emptied first.
    period_s : float
        Time between two looks, s.

    Raises
    ------
    OSError
        The file cannot be written, or a process cannot be started.
    """
    ends, processes = threading.Event(), list[subprocess.Popen[bytes]]()
    with log.open("wb") as output:

        def replace_dead() -> None:
            while not ends.wait(period_s):
                for i, process in enumerate(processes):
                    if process.poll() is not None:
                        with contextlib.suppress(OSError):  # no memory for another: the next look tries again
                            processes[i] = _start(command, output)

        supervisor = threading.Thread(target=replace_dead, name="worker supervisor", daemon=True)
        supervisor.start()
        try:
            for _ in range(count):
                processes.append(_start(command, output))
            yield processes
        finally:
            ends.set()
            supervisor.join()
            for process in processes:
                process.terminate()
            for process in processes:
                try:
                    process.wait(END_TIMEOUT_S)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()


def _start(command: Sequence[str], output: IO[bytes]) -> subprocess.Popen[bytes]:
    """Start a process in a session of its own: an interrupt of the terminal is for the sweep, which ends it."""
    return subprocess.Popen(  # noqa: S603 - our own command
        command,
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=output,
        start_new_session=True,
        env=child_environment(),
    )
