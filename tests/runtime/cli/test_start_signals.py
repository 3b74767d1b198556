"""A signal at any moment of a start ends the program: exit code 128 + n, one line at most, nothing left over.

The moments are events of the interpreter (`sys.addaudithook`), so no test depends on the speed of the machine.
"""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Final

import pytest

from config.errors import UserError
from runtime.cli.start_signals import ending_in_order, ending_the_start
from runtime.support.child_process import child_environment
from tests.hil.machine import TIMEOUT_S

START_MAX_S: Final = 600.0
"""For the imports of a start, some seconds of processor time: only what hangs takes so long."""
PROGRAM: Final = """
import signal, sys
event, count, number = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
del sys.argv[1:4]

def hook(name, args):
    global count
    if name == event:
        count -= 1
        if count == 0:
            signal.raise_signal(number)

from runtime.cli.__main__ import main
from runtime.support import forked_child
if event == "subprocess.Popen":
    forked_child.can_fork = lambda: False
sys.addaudithook(hook)
main()
"""
"""Runs the command line and raises a signal at the n-th event of a kind; for Popen, it cannot fork its emulator."""
MOMENTS: Final = [
    ("import", 300, signal.SIGHUP),
    ("os.fork", 1, signal.SIGINT),
    pytest.param("import", 30, signal.SIGINT, marks=pytest.mark.soak),
    pytest.param("tempfile.mkdtemp", 1, signal.SIGTERM, marks=pytest.mark.soak),
    pytest.param("subprocess.Popen", 1, signal.SIGINT, marks=pytest.mark.soak),
]


def marked(mark: str) -> list[int]:
    """Return the processes whose environment holds a mark."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if mark.encode() in (folder / "environ").read_bytes():
                found.append(int(folder.name))
        except OSError:
            continue
    return found


@pytest.mark.promise("P19")
@pytest.mark.parametrize(("event", "count", "number"), MOMENTS)
def test_a_signal_during_the_start_leaves_nothing(
    tmp_path: Path, event: str, count: int, number: signal.Signals, measured: Callable[[str], None]
) -> None:
    mark, temporary = uuid.uuid4().hex, tmp_path / "tmp"
    temporary.mkdir()
    environment = child_environment() | {"TMPDIR": str(temporary), "MARK": mark, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, event, str(count), str(int(number)), "run", "--headless", "--no-record",
         "--no-console", "--seconds", "1"],
        env=environment, capture_output=True, text=True, timeout=START_MAX_S, check=False,
    )  # fmt: skip
    assert done.returncode == 128 + number, done.stderr
    assert "Traceback" not in done.stderr
    assert len([line for line in done.stderr.splitlines() if line.startswith("echolocate: ")]) <= 1
    end_s = time.monotonic() + TIMEOUT_S
    while left := marked(mark):
        assert time.monotonic() < end_s, f"processes {left} are left"
        time.sleep(0.05)
    assert list(temporary.iterdir()) == []
    measured(
        f"{number.name} during a start, at its {event} {count}: exit code 128 + n, no process, folder or traceback"
    )


class Late:
    """Raises a signal while it is collected, where an exception cannot leave."""

    def __del__(self) -> None:
        signal.raise_signal(signal.SIGTERM)


def test_a_signal_in_a_destructor_is_not_lost(capsys: pytest.CaptureFixture[str]) -> None:
    alarm = signal.getsignal(signal.SIGALRM)
    with ending_in_order(), pytest.raises(SystemExit) as ended:  # noqa: PT012 - first collected, then raised
        Late()
        time.sleep(TIMEOUT_S)
    signal.signal(signal.SIGALRM, alarm)
    assert ended.value.code == 128 + signal.SIGTERM
    assert capsys.readouterr().err == ""


async def test_a_second_signal_does_not_interrupt_the_cleaning_up() -> None:
    cleaned: list[str] = []

    async def start() -> None:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            await asyncio.sleep(TIMEOUT_S)
        finally:
            os.kill(os.getpid(), signal.SIGINT)
            await asyncio.sleep(0.01)
            cleaned.append("folder")

    with pytest.raises(UserError, match="ended by SIGTERM") as ended, ending_the_start():
        await start()
    assert (ended.value.exit_code, cleaned) == (128 + signal.SIGTERM, ["folder"])
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().remove_signal_handler(number)


async def test_another_cancellation_stays_one() -> None:
    with pytest.raises(asyncio.CancelledError), ending_the_start():
        raise asyncio.CancelledError
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().remove_signal_handler(number)
