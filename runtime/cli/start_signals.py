"""Signals that end the program before a run handles them: exit code 128 + n, no traceback, nothing left over.

While modules are imported nothing has been started, so the process ends at once. Afterwards a signal is raised as an
exception, which ends child processes and removes temporary folders on its way out; within the event loop of a run it
cancels the start.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Iterator
from types import FrameType
from typing import TYPE_CHECKING, Final

from config.errors import UserError

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

ENDING: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a start. A run handles them itself: see `runtime.cli.commands.run.signals`."""
EXIT_CODE_BASE: Final = 128
"""Exit code of a program that a signal ended, less the signal's number, as shells count."""
RETRY_S: Final = 0.01
"""Time until an exception is raised again that a destructor has swallowed."""


def end_at_once() -> None:
    """From now on end the process without any further step when one of these signals comes."""
    for number in _not_ignored():
        signal.signal(number, lambda number, _frame: os._exit(EXIT_CODE_BASE + number))


@contextlib.contextmanager
def ending_in_order() -> Iterator[None]:
    """Raise SystemExit with the exit code where the program is when one of these signals comes."""
    before = {number: signal.signal(number, _raise) for number in _not_ignored()}
    hook, sys.unraisablehook = sys.unraisablehook, _raise_again
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def ending_the_start() -> Iterator[None]:
    """Cancel the current task, once, when one of these signals comes; a UserError then names the signal.

    Raises
    ------
    UserError
        A signal came; its exit code is 128 + n.
    """
    import asyncio  # takes so long that `end_at_once` comes first

    loop, task = asyncio.get_running_loop(), asyncio.current_task()
    received: list[signal.Signals] = []

    def end(number: signal.Signals) -> None:
        received.append(number)
        if task is not None and len(received) == 1:  # a second one must not interrupt the cleaning up
            task.cancel()

    for number in _not_ignored():
        loop.add_signal_handler(number, end, number)
    try:
        yield
    except asyncio.CancelledError:
        if not received:
            raise
        raise UserError(f"ended by {received[0].name}", EXIT_CODE_BASE + received[0]) from None


def _not_ignored() -> list[signal.Signals]:
    """Return the signals that end the program; `nohup` and a shell's background jobs ignore some of them."""
    return [number for number in ENDING if signal.getsignal(number) is not signal.SIG_IGN]


def _raise(number: int, _frame: FrameType | None) -> None:
    raise SystemExit(EXIT_CODE_BASE + number)


def _raise_again(unraisable: UnraisableHookArgs) -> None:
    """Raise the exception of a signal a moment later if it met a destructor or a callback of the collector."""
    ended = unraisable.exc_value
    if not isinstance(ended, SystemExit):
        sys.__unraisablehook__(unraisable)
        return
    number = int(str(ended.code)) - EXIT_CODE_BASE
    signal.signal(signal.SIGALRM, lambda _alarm, frame: _raise(number, frame))
    signal.setitimer(signal.ITIMER_REAL, RETRY_S)
