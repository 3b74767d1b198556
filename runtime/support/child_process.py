"""Start Python modules in processes of their own, for work that must not cost the control loop any time.

A thread would share the interpreter with the loop; a process does not. At low priority it gets only the processor
time that the robot's process and its emulator leave.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import runpy
import signal
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Final

ECHOLOCATE: Final = "runtime.cli"
"""The module that is the command `echolocate`."""
LOW_PRIORITY: Final = "runtime.support.child_process"
"""This module, run as a program: runs the module named by its first argument at low priority."""
NICENESS: Final = 10
"""About a tenth of the usual share of a busy processor."""


INTERPRETER: Final = (sys.executable, "-P")
"""How a child is started: without the current folder in its path, which may hold modules of the same names."""
ROOT: Final = str(Path(__file__).resolve().parents[2])
"""The folder of our packages."""


def child_environment() -> dict[str, str]:
    """Return an environment in which another interpreter finds the same modules as this one."""
    paths = [path for path in sys.path if path]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths if ROOT in paths else [*paths, ROOT])}


async def start_child(
    module: str,
    arguments: Sequence[str],
    *,
    pipes: bool,
    low_priority: bool = False,
    environment: Mapping[str, str] = MappingProxyType({}),
) -> asyncio.subprocess.Process:
    """Start a module as a program, in a session of its own, and return its process.

    Parameters
    ----------
    module : str
        The module, as after ``python -m``.
    arguments : sequence of str
        Its arguments.
    pipes : bool
        Whether standard input and output are pipes to this process; standard error always is one.
    low_priority : bool
        Whether it runs at low priority; see `lower_priority`.
    environment : mapping, optional
        Variables of its environment beside those of this process.
    """
    pipe, nothing = asyncio.subprocess.PIPE, asyncio.subprocess.DEVNULL
    program = [LOW_PRIORITY, module] if low_priority else [module]
    return await asyncio.create_subprocess_exec(
        *INTERPRETER,
        "-m",
        *program,
        *arguments,
        stdin=pipe if pipes else nothing,
        stdout=pipe if pipes else nothing,
        stderr=pipe,
        start_new_session=True,
        env={**child_environment(), **environment},
    )


async def kill_child(process: asyncio.subprocess.Process) -> None:
    """Kill a process of `start_child`, with its own children, and wait for its end; it holds nothing to be lost."""
    if process.returncode is None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # its session is a process group
    await process.wait()


def lower_priority() -> None:
    """Lower the priority of this process, and leave a processor that its parent has to itself.

    A process inherits the processor that was reserved for its parent; at low priority it must not use it.
    """
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    pinned = os.sched_getaffinity(0)
    others = set(range(os.cpu_count() or 1)) - pinned
    if len(pinned) == 1 and others:
        with contextlib.suppress(OSError):
            os.sched_setaffinity(0, others)


def main() -> None:
    """Run the module named by the first argument at low priority, with the arguments after it."""
    lower_priority()
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
