"""Tests of the signals that come before anything has been started."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable

import pytest

from runtime.cli.first_signals import Remembered, is_remembered
from runtime.support.child_process import child_environment

AT_FIRST_IMPORT = """
import signal, sys
number = signal.Signals(int(sys.argv.pop(1)))
from runtime.cli import __main__
def hook(name, args):
    global number
    if name == "import" and signal.getsignal(signal.SIGUSR2) is not signal.SIG_DFL and number:
        number, now = None, number
        signal.raise_signal(now)
sys.addaudithook(hook)
sys.argv[1:] = ["--version"]
__main__.main()
"""
"""Raises a signal at the first import after signals are handled."""
ALLOWED = {"__future__", "echolocate", "os", "signal", "runtime", "runtime.cli", "runtime.cli.first_signals"}


@pytest.mark.promise("P19")
@pytest.mark.parametrize(
    ("number", "code"),
    [(signal.SIGINT, 130), (signal.SIGHUP, 129), (signal.SIGUSR1, 0), (signal.SIGUSR2, 0)],
)
def test_each_signal_at_the_first_import(number: signal.Signals, code: int, measured: Callable[[str], None]) -> None:
    done = subprocess.run(
        [sys.executable, "-c", AT_FIRST_IMPORT, str(int(number))], env=child_environment(), capture_output=True,
        text=True, timeout=600, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (code, "")
    measured("SIGINT, SIGHUP, SIGUSR1 and SIGUSR2 at the first import: 128 + n for the former two, 0 for the others")


@pytest.mark.promise("P19")
def test_nothing_of_ours_is_imported_before_signals_are_handled() -> None:
    """What comes before is the interpreter's own start, which no program can shorten."""
    program = (
        "import sys; import signal, os; before = set(sys.modules); import echolocate, runtime.cli.__main__; "
        "print(*sorted(set(sys.modules) - before))"
    )
    done = subprocess.run(
        [sys.executable, "-S", "-c", program], env=child_environment(), capture_output=True, text=True, check=True,
        timeout=600,
    )  # fmt: skip
    assert set(done.stdout.split()) <= ALLOWED | {"runtime.cli.__main__"}


def test_a_halt_that_came_too_early_is_remembered() -> None:
    before = signal.signal(signal.SIGUSR2, Remembered())
    try:
        assert not is_remembered(signal.getsignal(signal.SIGUSR2))
        os.kill(os.getpid(), signal.SIGUSR2)
        assert is_remembered(signal.getsignal(signal.SIGUSR2))
    finally:
        signal.signal(signal.SIGUSR2, before)
    assert not is_remembered(signal.SIG_DFL)
