"""A command as a copy of the process of the tests, which has imported everything and loaded its kernels.

A new interpreter takes five seconds of processor time until a run recognises anything. What a start itself does is
tested with interpreters of their own: `running(..., fresh=True)`, and tests/runtime/cli.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from subprocess import TimeoutExpired

from runtime.cli.__main__ import main as command_main
from runtime.support import forked_child
from tests.hil.machine import LOOK_S


class ForkedCommand:
    """The process, used as `subprocess.Popen` is.

    Parameters
    ----------
    arguments : sequence of str
        Of the command.
    streams : tuple of int
        Descriptors of its standard input, output and error.
    environment : mapping
        Variables of its environment beside those of this process.
    prepare : callable, optional
        Is called in the process before the command.
    """

    def __init__(
        self, arguments: Sequence[str], streams: tuple[int, int, int], environment: Mapping[str, str],
        prepare: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        self.args = list(arguments)
        self.returncode: int | None = None
        """Its exit code, or less than zero the signal that ended it; None while it runs."""

        def main() -> None:
            atexit._clear()  # those of the tests
            warnings.simplefilter("ignore")  # in tests they are errors
            forked_child.THREADS = ()  # type: ignore[misc, assignment]  # numba is loaded, and has started no thread
            prepare()
            command_main()

        sys.stdout.flush()
        sys.stderr.flush()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # threads of the tests, none of which holds a lock
            self.pid = os.fork()
        if self.pid == 0:
            forked_child._be_child(main, arguments, environment, streams)

    def poll(self) -> int | None:
        """Return the exit code, None while it runs."""
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end, and return the exit code."""
        end_s = None if timeout is None else time.monotonic() + timeout
        while (code := self.poll()) is None:
            if end_s is not None and timeout is not None and time.monotonic() > end_s:
                raise TimeoutExpired(self.args, timeout)
            time.sleep(LOOK_S)
        return code

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill it."""
        self.send_signal(signal.SIGKILL)

    def terminate(self) -> None:
        """Ask it to end."""
        self.send_signal(signal.SIGTERM)
