"""Signals that end the program before a run handles them: exit code 128 + n, no traceback, nothing left over.

While modules are imported nothing has been started, so the process ends at once: see `runtime.cli.first_signals`.
Afterwards a signal is raised as an exception, which ends child processes and removes temporary folders on its way
out; within the event loop of a run it cancels the start.
"""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from types import FrameType
from typing import TYPE_CHECKING, Final

from config.errors import UserError
from runtime.cli.first_signals import EXIT_CODE_BASE, not_ignored

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

RETRY_S: Final = 0.01
"""Time until an exception is raised again that a destructor has swallowed."""


@contextlib.contextmanager
def ending_in_order() -> Iterator[None]:
    """Raise SystemExit with the exit code where the program is when one of these signals comes."""
    before = {number: signal.signal(number, _raise) for number in not_ignored()}
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
    import asyncio  # takes long, and not every command needs it

    loop, task = asyncio.get_running_loop(), asyncio.current_task()
    received: list[signal.Signals] = []

    def end(number: signal.Signals) -> None:
        received.append(number)
        if task is not None and len(received) == 1:  # a second one must not interrupt the cleaning up
            task.cancel()

    before = {number: signal.getsignal(number) for number in not_ignored()}
    for number in before:
        loop.add_signal_handler(number, end, number)
    try:
        yield
    except asyncio.CancelledError:
        if not received:
            raise
        raise UserError(f"ended by {received[0].name}", EXIT_CODE_BASE + received[0]) from None
    finally:
        for number, handler in before.items():
            loop.remove_signal_handler(number)
            signal.signal(number, handler)


@contextlib.contextmanager
def handled_by_loop(handlers: Mapping[signal.Signals, Callable[[], object]]) -> Iterator[None]:
    """Let the running loop handle signals; afterwards one of `ENDING` is raised: a second Ctrl-C ends a slow end."""
    import asyncio

    loop = asyncio.get_running_loop()
    raised = not_ignored()
    afterwards = {number: _raise if number in raised else signal.getsignal(number) for number in handlers}
    for number, handler in handlers.items():
        loop.add_signal_handler(number, handler)
    try:
        yield
    finally:
        for number, after in afterwards.items():
            loop.remove_signal_handler(number)
            signal.signal(number, after)


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
