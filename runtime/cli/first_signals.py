"""Signals before anything has been started. Imported first, so this module imports as little as possible."""

from __future__ import annotations

import os
import signal

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a start. A run handles them itself: see `runtime.cli.commands.run.run_process.signals`."""
EXIT_CODE_BASE = 128
"""Exit code of a program that a signal ended, less the signal's number, as shells count."""


class Remembered:
    """Handler of a signal that only notes that it came."""

    is_received = False

    def __call__(self, _number: int, _frame: object) -> None:
        """Note the signal."""
        self.is_received = True


def handle_first_signals() -> None:
    """From now on end the process at once when one of `ENDING` comes; let SIGUSR1 and SIGUSR2 do no harm.

    A run halts the robot by SIGUSR2, so one that comes too early counts: see `is_remembered`. An early SIGUSR1 is
    dropped, for no robot is armed later than it was asked for.
    """
    for number in not_ignored():
        signal.signal(number, lambda number, _frame: os._exit(EXIT_CODE_BASE + number))
    for number in (signal.SIGUSR1, signal.SIGUSR2):
        signal.signal(number, Remembered())


def not_ignored() -> list[signal.Signals]:
    """Return the signals that end the program; `nohup` and a shell's background jobs ignore some of them."""
    return [number for number in ENDING if signal.getsignal(number) is not signal.SIG_IGN]


def is_remembered(handler: object) -> bool:
    """Return whether the signal of a handler has come, if the handler is one that remembers it."""
    return isinstance(handler, Remembered) and handler.is_received
