"""Programs of ours beside the robot's process, for work that must never cost a cycle.

A thread would share the interpreter with the cycle. A process does not; and with a lower precedence it gets what the
robot's process and its emulator leave. What those were granted (a core of their own, real-time priority) is not
theirs to inherit.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import Sequence
from typing import Final

COMMAND: Final = "runtime.support.child_process"
NICENESS: Final = 10
"""A tenth of the usual share where there is too little for all."""


def child_environment() -> dict[str, str]:
    """Return the environment in which another interpreter finds the same modules as this one."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}


async def start_child(program: str, words: Sequence[str], *, talks: bool) -> asyncio.subprocess.Process:
    """Start a program of ours; whether it steps back is its own affair.

    Parameters
    ----------
    program : str
        Its module; this one is any call of ``echolocate``, stepping back.
    words : sequence of str
        Its arguments.
    talks : bool
        Whether there are pipes to talk through; else there is one for what it complains of.
    """
    pipe, nothing = asyncio.subprocess.PIPE, asyncio.subprocess.DEVNULL
    return await asyncio.create_subprocess_exec(
        sys.executable, "-m", program, *words,
        stdin=pipe if talks else nothing, stdout=pipe if talks else nothing, stderr=pipe, start_new_session=True,
        env=child_environment(),
    )  # fmt: skip


async def end_child(process: asyncio.subprocess.Process) -> None:
    """End it now: it holds nothing that could be lost."""
    if process.returncode is None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGKILL)
    await process.wait()


def lower_priority() -> None:
    """Take a place behind everything else on this machine, and off a core that is another's own."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    pinned = os.sched_getaffinity(0)
    others = set(range(os.cpu_count() or 1)) - pinned
    if len(pinned) == 1 and others:
        with contextlib.suppress(OSError):
            os.sched_setaffinity(0, others)


def main(words: Sequence[str]) -> int:
    """Carry out a call of the command, behind everything else."""
    from runtime.cli.app import call

    lower_priority()
    return call(list(words))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
