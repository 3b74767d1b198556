"""Threads that no end waits for: to compile a kernel or import a package takes seconds, on a starved machine more.

`asyncio.to_thread` and the interpreter wait for their threads at the end, so that a run that was ended by Ctrl-C went
on until the kernel in work was compiled. These threads are left as they are: what they write is written whole or not
at all, and the next start goes on from there.
"""

from __future__ import annotations

import atexit
import contextlib
import contextvars
import os
import sys
import threading
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Final, NoReturn, ParamSpec, TypeVar

if TYPE_CHECKING:
    import asyncio

P = ParamSpec("P")
R = TypeVar("R")

NAME: Final = "left at the end"
"""Name of these threads."""


async def in_daemon_thread(call: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> R:
    """Call a function in a thread that no end waits for, and return what it returns."""
    import asyncio  # takes long, and `exit_process` ends every command

    loop, context = asyncio.get_running_loop(), contextvars.copy_context()
    future: asyncio.Future[R] = loop.create_future()

    def settle(outcome: Callable[[], None]) -> None:
        if not future.done():  # it was cancelled
            outcome()

    def work() -> None:
        outcome: Callable[[], None]
        try:
            outcome = partial(future.set_result, context.run(call, *args, **kwargs))
        except BaseException as error:  # noqa: BLE001 - what waits for it gets it, whatever it is
            outcome = partial(future.set_exception, error)
        with contextlib.suppress(RuntimeError):  # the loop is closed
            loop.call_soon_threadsafe(settle, outcome)

    threading.Thread(target=work, name=NAME, daemon=True).start()
    return await future


def exit_process(code: int) -> NoReturn:
    """End the process with an exit code, at once where such a thread still works.

    The interpreter's own end would take its libraries away from under the thread.
    """
    if any(thread.name == NAME for thread in threading.enumerate()):
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):  # it may be closed
                stream.flush()
        os._exit(code)
    sys.exit(code)
