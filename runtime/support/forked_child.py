"""A child that begins as a copy of this process: it has imported what this one has, which saves a third of a second.

A copy of a process with several threads may wait for ever for a lock that one of the others held. So a process forks
at its start only, see `can_fork`; else a child is an interpreter of its own, see `runtime.support.child_process`.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import io
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Final

FAILED: Final = 1
STANDARD: Final = 3
"""Standard input, output and error."""
OPEN_FILES: Final = "/proc/self/fd"
"""Lists the descriptors that this process has open."""
FILES_MAX: Final = 65536
"""So many descriptors are closed where none are listed: the limit may be a thousand million, which takes minutes."""
THREADS: Final = ("numba", "numpy")
"""Modules whose libraries may have started threads that Python does not know."""


def can_fork() -> bool:
    """Return whether this process has one thread, and the system can follow a child by a descriptor."""
    if not hasattr(os, "pidfd_open") or threading.active_count() > 1 or any(name in sys.modules for name in THREADS):
        return False
    try:
        os.close(os.pidfd_open(os.getpid()))
    except OSError:  # an older kernel, or a container that forbids it
        return False
    return True


class ForkedChild:
    """A child with pipes, used as `asyncio.subprocess.Process` is; `fork` starts it."""

    def __init__(
        self, pid: int, stdin: asyncio.WriteTransport, stdout: asyncio.StreamReader, stderr: asyncio.StreamReader
    ) -> None:
        self.pid, self.stdin, self.stdout, self.stderr = pid, stdin, stdout, stderr
        self.returncode: int | None = None
        """Its exit code, or less than zero the signal that ended it; None while it runs."""
        self._ended = asyncio.Event()
        self._loop, self._descriptor = asyncio.get_running_loop(), os.pidfd_open(pid)
        self._loop.add_reader(self._descriptor, self._on_end)

    def _on_end(self) -> None:
        self._loop.remove_reader(self._descriptor)
        os.close(self._descriptor)
        self.returncode = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        self._ended.set()

    async def wait(self) -> int:
        """Wait until it has ended, and return its exit code."""
        await self._ended.wait()
        return self.returncode or 0


async def fork(main: Callable[[], None], arguments: Sequence[str], environment: Mapping[str, str]) -> ForkedChild:
    """Call `main` in a copy of this process, in a session of its own, with pipes as its standard streams.

    Parameters
    ----------
    main : callable
        Runs the program, as if it had just been started; its end is that of the process.
    arguments : sequence of str
        Of the program, without its name.
    environment : mapping
        Variables of its environment beside those of this process.

    Raises
    ------
    OSError
        The system makes no further process, or no further files.
    """
    (inputs, to_child), (from_child, outputs), (errors_of_child, errors) = os.pipe(), os.pipe(), os.pipe()
    for stream in (sys.stdout, sys.stderr):
        stream.flush()  # else both would write it
    before = signal.pthread_sigmask(
        signal.SIG_BLOCK, signal.valid_signals()
    )  # the loop's handlers are not the child's
    try:
        pid = os.fork()
    except OSError:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for descriptor in (inputs, to_child, from_child, outputs, errors_of_child, errors):
            os.close(descriptor)
        raise
    if pid == 0:
        _be_child(main, arguments, environment, (inputs, outputs, errors))
    signal.pthread_sigmask(signal.SIG_SETMASK, before)
    for descriptor in (inputs, outputs, errors):
        os.close(descriptor)
    loop, readers = asyncio.get_running_loop(), (asyncio.StreamReader(), asyncio.StreamReader())
    try:
        for reader, descriptor in zip(readers, (from_child, errors_of_child), strict=True):
            await loop.connect_read_pipe(partial(asyncio.StreamReaderProtocol, reader), io.FileIO(descriptor))
        stdin, _ = await loop.connect_write_pipe(asyncio.BaseProtocol, io.FileIO(to_child, "w"))
        return ForkedChild(pid, stdin, *readers)
    except BaseException:  # nothing else would end it
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        raise


def _be_child(
    main: Callable[[], None], arguments: Sequence[str], environment: Mapping[str, str], streams: tuple[int, ...]
) -> None:
    """Become the child: what this process has of its parent's loop, signals and files is given up first."""
    code = FAILED
    try:
        os.setsid()
        signal.set_wakeup_fd(-1)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2):
            signal.signal(number, signal.SIG_DFL)
        for target, stream in enumerate(streams):
            os.dup2(stream, target)
        _close_files()
        signal.pthread_sigmask(signal.SIG_SETMASK, ())
        gc.enable()
        sys.stdin = io.TextIOWrapper(io.FileIO(0, closefd=False), encoding="utf-8")
        sys.stdout, sys.stderr = (_text(1), _text(2, is_by_line=True))
        sys.argv[1:] = arguments
        os.environ.update(environment)
        main()
        code = 0
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else FAILED if ended.code else 0
    except BaseException:  # noqa: BLE001 - it must not go on as its parent would
        traceback.print_exc()
    finally:
        for written in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                written.flush()
        os._exit(code)


def _close_files() -> None:
    """Close all files that are open but the standard streams."""
    try:
        descriptors = [int(one.name) for one in Path(OPEN_FILES).iterdir()]
    except OSError:
        os.closerange(STANDARD, min(os.sysconf("SC_OPEN_MAX"), FILES_MAX))
        return
    for descriptor in descriptors:
        if descriptor >= STANDARD:
            with contextlib.suppress(OSError):  # the list's own is closed already
                os.close(descriptor)


def _text(descriptor: int, *, is_by_line: bool = False) -> io.TextIOWrapper:
    return io.TextIOWrapper(io.FileIO(descriptor, "w", closefd=False), encoding="utf-8", line_buffering=is_by_line)
