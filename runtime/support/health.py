"""No silent death: every part of the process has a name, and one question tells whether all of them still work.

A part is a task of the loop or a thread beside it. A part that has ended is not well, whatever ended it; one that
only takes long is: a thread may wait for a disk or a terminal for as long as it likes. The cycle asks before it
decides anything, so a robot with a part missing stands, and neither its deadman nor a watchdog is fed by anything but
the cycle.
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
"""Says what is wrong with a part, None while nothing is."""

ENDED: Final = (
    "the part `{}` of this program has ended ({}), likely by a fault of the program: see the log, then start it again"
)
RAISED: Final = "{} failed, likely by a fault of the program: see the log, then re-arm"
UNASKED: Final = "it was ended from outside"
_MACHINERY: Final = str(Path(asyncio.__file__).parent)


class Worker(threading.Thread):
    """A thread that can be asked how it ended; it never keeps the process from ending.

    Parameters
    ----------
    name : str
        What the part is called.
    work : callable
        What it does; it returns only when told to.
    """

    def __init__(self, name: str, work: Callable[[], None]) -> None:
        super().__init__(name=name, daemon=True)
        self._work = work
        self.failure: str | None = None
        """What ended it, None where nothing did but its own work's end."""

    def run(self) -> None:
        """Work, and keep what is raised for whoever asks."""
        try:
            self._work()
        except Exception as error:  # noqa: BLE001 - whatever it is, it must not go unseen
            self.failure = describe_exception(error)

    def probe(self) -> str | None:
        """Say how it ended; None while it runs."""
        return None if self.is_alive() else self.failure or UNASKED


class Health:
    """What is known of the parts.

    Parameters
    ----------
    log : structlog logger
        Told of every part's end, with the traceback.
    """

    def __init__(self, log: FilteringBoundLogger) -> None:
        self._log = log
        self._probes: dict[str, Probe] = {}
        self._ended: dict[str, str] = {}
        self._accident: str | None = None
        self._is_over = False

    def watch(self, name: str, probe: Probe) -> None:
        """Ask `probe` from now on."""
        self._probes[name] = probe

    def watch_task(self, name: str, task: asyncio.Task[None]) -> None:
        """Hold a task to run for as long as anybody asks."""

        def done(task: asyncio.Task[None]) -> None:
            error = None if task.cancelled() else task.exception()
            self._end(name, UNASKED if error is None else describe_exception(error), error)

        task.add_done_callback(done)

    def report(self, who: str, error: BaseException) -> None:
        """Take note of what a part has caught that it should never have met; as of a callback that raised."""
        what = f"{who} ({describe_exception(error)})"
        self._accident = RAISED.format(what)
        self._log.error("a part failed", culprit=what, exc_info=error)

    def begin_shutdown(self) -> None:
        """Let parts end from now on: the run does."""
        self._is_over = True

    def fault(self) -> str | None:
        """Return what is wrong and whose fault it is, None where all is well.

        What a callback has raised is told once: the callback is over. A part that has ended is told ever after.
        """
        accident, self._accident = self._accident, None
        for name, probe in self._probes.items():
            if name not in self._ended and (how := probe()) is not None:
                self._end(name, how)
        return next(iter(self._ended.values()), accident)

    @contextmanager
    def catching_unhandled_errors(self) -> Iterator[None]:
        """Take note of what callbacks of the loop raise, and of exceptions that nobody waited for."""
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
        error, task = context.get("exception"), context.get("future") or context.get("task")
        if isinstance(error, BaseException):
            who = f"task `{task.get_name()}`" if isinstance(task, asyncio.Task) else f"callback `{_culprit(error)}`"
            what = f"{who} ({describe_exception(error)})"
        else:
            what = str(context.get("message", "a callback"))
        self._accident = RAISED.format(what)
        self._log.error("a callback failed", culprit=what, exc_info=error)


def describe_exception(error: BaseException) -> str:
    """Return an exception in one line, with the place it came from."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f", {Path(frames[-1].filename).name}:{frames[-1].lineno} in {frames[-1].name}" if frames else ""
    return f"{type(error).__name__}: {' '.join(str(error).split())}{where}"


def _culprit(error: BaseException) -> str:
    """Return the first function below the loop's own machinery."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = (frame.name for frame in frames if not frame.filename.startswith(_MACHINERY))
    return next(ours, "unknown")
