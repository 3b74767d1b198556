"""The health of the process: every task and thread has a name, and one call returns whether all of them still run.

A part that has ended is a fault, whatever the cause. A slow part is not a fault: a thread may wait for a disk or a
terminal for any time. The cycle checks for faults before it makes any decision, so if a part is missing the robot
halts. Only the cycle feeds the deadman and the watchdog.
"""

from __future__ import annotations

import asyncio
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

Probe: TypeAlias = Callable[[], str | None]
"""Returns what is wrong with a part, None while nothing is."""

ENDED: Final = (
    "the part `{}` of this program has ended ({}), likely through a program error: see the log, then restart it"
)
RAISED: Final = "{} failed, likely through a program error: see the log, then re-arm"
NO_ERROR: Final = "it ended without an error"
_ASYNCIO_FOLDER: Final = str(Path(asyncio.__file__).parent)


class Worker(threading.Thread):
    """A daemon thread that keeps the exception that ended it.

    Parameters
    ----------
    name : str
        Name of the part.
    work : callable
        What the thread does; it returns only at the end of the run.
    """

    def __init__(self, name: str, work: Callable[[], None]) -> None:
        super().__init__(name=name, daemon=True)
        self._work = work
        self.failure: str | None = None
        """The exception that ended it, in one line; None if there was none."""
        self._has_ended = False

    def run(self) -> None:
        """Do the work; keep the exception that it raises."""
        try:
            self._work()
        except Exception as error:  # noqa: BLE001 - any exception must be reported
            self.failure = describe_exception(error)
        finally:
            self._has_ended = True

    def probe(self) -> str | None:
        """Return how the thread ended; None while it runs."""
        # Not `is_alive`, which takes a lock: each cycle asks each thread.
        return (self.failure or NO_ERROR) if self._has_ended else None


class Health:
    """The health of all parts of the process; the log gets a line with the traceback when one ends or fails."""

    def __init__(self, log: FilteringBoundLogger) -> None:
        self._log = log
        self._probes: dict[str, Probe] = {}
        self._ended: dict[str, str] = {}
        self._unhandled_error: str | None = None
        self._is_over = False

    def watch(self, name: str, probe: Probe) -> None:
        """Check the part with this probe from now on."""
        self._probes[name] = probe

    def watch_task(self, name: str, task: asyncio.Task[None]) -> None:
        """Treat the end of this task as a fault."""

        def done(task: asyncio.Task[None]) -> None:
            error = None if task.cancelled() else task.exception()
            self._end(name, NO_ERROR if error is None else describe_exception(error), error)

        task.add_done_callback(done)

    def report(self, part: str, error: BaseException) -> None:
        """Report an unexpected exception that a part has caught."""
        what = f"{part} ({describe_exception(error)})"
        self._unhandled_error = RAISED.format(what)
        self._log.error("a part failed", source=what, exc_info=error)

    def begin_shutdown(self) -> None:
        """Allow parts to end from now on, because the run ends."""
        self._is_over = True

    def fault(self) -> str | None:
        """Return what is wrong, with the name of the part; None if nothing is.

        A callback's exception is returned once, as the callback is over; a part that has ended, at every call.
        """
        unhandled_error, self._unhandled_error = self._unhandled_error, None
        for name, probe in self._probes.items():
            if name not in self._ended and (how := probe()) is not None:
                self._end(name, how)
        return next(iter(self._ended.values()), unhandled_error)

    @contextmanager
    def catching_unhandled_errors(self) -> Iterator[None]:
        """Report exceptions of the loop's callbacks, and of tasks that nothing awaits, during the block."""
        loop = asyncio.get_running_loop()
        before = loop.get_exception_handler()
        loop.set_exception_handler(self._on_unhandled_error)
        try:
            yield
        finally:
            loop.set_exception_handler(before)

    def _end(self, name: str, how: str, error: BaseException | None = None) -> None:
        if self._is_over:
            return
        self._ended[name] = ENDED.format(name, how)
        self._log.error("a part has ended", part=name, how=how, exc_info=error)

    def _on_unhandled_error(self, _loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Keep an exception that the loop reports for the next call of `fault`, and log it."""
        error, task = context.get("exception"), context.get("future") or context.get("task")
        if isinstance(error, BaseException):
            source = f"callback `{_first_own_function(error)}`"
            if isinstance(task, asyncio.Task):
                source = f"task `{task.get_name()}`"
            what = f"{source} ({describe_exception(error)})"
        else:
            what = str(context.get("message", "a callback"))
        self._unhandled_error = RAISED.format(what)
        self._log.error("a callback failed", source=what, exc_info=error)


def describe_exception(error: BaseException) -> str:
    """Return an exception in one line, with file, line and function that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f", {Path(frames[-1].filename).name}:{frames[-1].lineno} in {frames[-1].name}" if frames else ""
    return f"{type(error).__name__}: {' '.join(str(error).split())}{where}"


def _first_own_function(error: BaseException) -> str:
    """Return the first function in the traceback that is not part of asyncio."""
    frames = traceback.extract_tb(error.__traceback__)
    own = (frame.name for frame in frames if not frame.filename.startswith(_ASYNCIO_FOLDER))
    return next(own, "unknown")
