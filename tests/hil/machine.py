"""State of the machine during a test: whether it stalled, and how long a bare start takes.

Real-time tests check a program, not the machine that runs it. A virtual machine that stalls for half a second stops
the robot, as it must, and fails a test although the program is correct. So a witness that only sleeps and wakes runs
during each trial. A failed trial during which the machine stalled is repeated; any other failure counts.
"""

from __future__ import annotations

import functools
import inspect
import logging
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar, cast

TIMEOUT_S: Final = float(os.environ.get("ECHOLOCATE_TEST_TIMEOUT_S", "300"))
"""For what must come at once on an idle machine: on a busy one only what hangs takes so long. `tests.changed` waits
less, as what it runs mostly hangs because of the change."""

LOOK_S: Final = 0.03
"""Between two looks at what is waited for: who looks more often takes the processor from it."""

TRIALS: Final = 4

STALL_S: Final = 0.1
"""Ten programs that compute on two cores let the witness wait for 20 ms. The emulator gives up following the clock
after 0.1 s, the robot's base stops after 0.5 s."""

AnyTest = TypeVar("AnyTest", bound=Callable[..., Any])

WITNESS: Final = """
import os, sys, time
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {int(sys.argv[1])})
before_s = time.monotonic()
while True:
    time.sleep(0.02)
    host_s = time.monotonic()
    if host_s - before_s - 0.02 > float(sys.argv[2]):
        sys.stdout.write(f"{host_s - before_s - 0.02:.3f}\\n")
        sys.stdout.flush()
    before_s = host_s
"""


class Witness:
    """Notes, on each core, for how long a program that asks for nothing was kept from running."""

    def __init__(self) -> None:
        # Appended to by several processes, and read from its beginning here.
        self._notes = tempfile.TemporaryFile("a+")  # noqa: SIM115 - closed by __exit__
        cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else [0]
        # Isolated and without site packages: it starts at once.
        command = [sys.executable, "-I", "-S", "-c", WITNESS]
        self._processes = [
            subprocess.Popen([*command, str(core), str(STALL_S)], stdin=subprocess.DEVNULL, stdout=self._notes)
            for core in cores[:4]
        ]

    def __enter__(self) -> Witness:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            process.kill()
            process.wait()
        self._notes.close()

    def stalls_s(self) -> list[float]:
        """Return how long each standstill so far was."""
        self._notes.seek(0)
        return [float(line) for line in self._notes.read().split()]


def _may_repeat(witness: Witness, number: int, error: Exception) -> bool:
    stalls_s = witness.stalls_s()
    if not stalls_s or number == TRIALS:
        return False
    logging.getLogger(__name__).warning("the machine stood still for %s s, so this says nothing: %r", stalls_s, error)
    return True


def _arguments_of_trial(arguments: dict[str, Any], number: int) -> dict[str, Any]:
    """Give a repeated trial a folder of its own."""
    if number == 1 or not isinstance(arguments.get("tmp_path"), Path):
        return arguments
    folder = arguments["tmp_path"] / f"trial{number}"
    folder.mkdir()
    return {**arguments, "tmp_path": folder}


def stalls_excused(test: AnyTest) -> AnyTest:
    """Repeat a test that failed while the machine itself stood still; see above."""
    if inspect.iscoroutinefunction(test):

        @functools.wraps(test)
        async def repeated_async(**arguments: Any) -> None:
            for number in range(1, TRIALS + 1):
                with Witness() as witness:
                    try:
                        await test(**_arguments_of_trial(arguments, number))
                    except Exception as error:
                        if not _may_repeat(witness, number, error):
                            raise
                    else:
                        return

        return cast(AnyTest, repeated_async)

    @functools.wraps(test)
    def repeated(**arguments: Any) -> None:
        for number in range(1, TRIALS + 1):
            with Witness() as witness:
                try:
                    test(**_arguments_of_trial(arguments, number))
                except Exception as error:
                    if not _may_repeat(witness, number, error):
                        raise
                else:
                    return

    return cast(AnyTest, repeated)


class BareStarts:
    """Starts Python and imports numba, repeatedly, during a trial: the start-up time of the machine itself.

    Attributes
    ----------
    longest_s
        The longest of them, s; also of one that has not come to its end.
    """

    def __init__(self) -> None:
        self.longest_s = 0.0
        self._done = threading.Event()
        self._worker = threading.Thread(target=self._work, name="bare starts")

    def __enter__(self) -> BareStarts:
        self._worker.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._worker.join()

    def _work(self) -> None:
        while not self._done.is_set():
            begin_s = time.monotonic()
            subprocess.run([sys.executable, "-c", "import numba"], stdin=subprocess.DEVNULL, check=True)
            self.longest_s = max(self.longest_s, time.monotonic() - begin_s)
            # One a second: a control is no load.
            self._done.wait(1.0)
