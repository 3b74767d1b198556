"""P12 on a real pty: a process whose disk, log and terminal take nothing drives, reports its losses and ends.

Each trouble by itself is tested in virtual time (tests/runtime/cycle/test_disk_trouble.py), and by the wall clock in
bench/wallclock/test_disk_trouble.py. Here all of them meet in one process, which has to come to its end as well.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from config.errors import DONE
from tests.hil.machine import TIMEOUT_S
from tests.hil.planted import planted
from tests.hil.running import PATIENT, emulated, wait_for
from tests.hil.truth import Truth

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels"), pytest.mark.promise("P12")]

FILE_BYTES = 65536


def filled_pipe(into: int) -> int:
    """Fill a pipe until it takes nothing, and return its writing end."""
    fcntl.fcntl(into, fcntl.F_SETPIPE_SZ, 4096)
    os.set_blocking(into, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(into, b"#" * 4096)
    os.set_blocking(into, True)
    return into


def test_a_disk_that_fills_up_and_a_log_and_a_terminal_that_take_nothing(
    tmp_path: Path, measured: Callable[[str], None]
) -> None:
    """Files end at 64 KiB, which the start alone does not fill.

    The log and what stands for the terminal are full pipes: a write to them never ends.
    """
    fifo, runs, summary = tmp_path / "log", tmp_path / "runs", tmp_path / "summary.json"
    os.mkfifo(fifo)
    runs.mkdir()
    held = filled_pipe(os.open(fifo, os.O_RDWR))
    out, into = os.pipe()
    filled_pipe(into)
    command = ["run", "--json", str(summary), "--set", f"recording.folder={json.dumps(str(runs))}", *PATIENT]
    try:
        with (
            emulated(tmp_path) as robot,
            planted(
                tmp_path, "run", "", *command, "--port", robot.port, log=fifo, stderr=into,
                file_bytes=FILE_BYTES,
            ) as run,
        ):  # fmt: skip
            wait_for(lambda: any(path.stat().st_size >= FILE_BYTES for path in runs.iterdir()), "a full disk")
            truth = Truth(robot.trace)
            assert all(row.still for row in truth.read()), "it was not armed"
            run.signal(signal.SIGTERM)
            assert run.process.wait(3.0 * TIMEOUT_S) == DONE
    finally:
        for fd in (held, out, into):
            os.close(fd)
    written = json.loads(summary.read_bytes())
    assert written["recording"]["dropped"] > 0
    assert "File too large" in written["recording"]["last_error"]
    assert written["log"]["lost"] >= 3
    assert "the last items were not written" in written["log"]["last_error"]
    assert f"{written['log']['lost']} lines of the log are missing: the last items" in " ".join(run.out.split())
    lost = f"{written['log']['lost']} lines and {written['recording']['dropped']} messages lost and reported"
    measured(f"disk full after 64 KiB, log and terminal that take nothing: {lost}")
