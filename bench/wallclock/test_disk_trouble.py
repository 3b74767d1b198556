"""P12 by the wall clock: whatever a disk or a terminal does, the cycle keeps its time.

Each trouble runs next to a run without any, at the same time on the same machine: that one's late cycles are the
machine's own.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from config.errors import DONE, FAILED
from tests.hil.planted import planted
from tests.hil.running import Running

pytestmark = pytest.mark.usefixtures("warm_kernels")

SECONDS = 5
FSYNC_SECONDS = 8
"""So long that an fsync of five seconds falls into it whole."""
BEYOND = 24
"""Cycles that may be late or missed beyond the control's: a machine that holds up one run and not the other
does so for a second at most. A single wait for such a disk in the loop costs a hundred."""


@contextlib.contextmanager
def run_with(
    folder: Path, name: str, plants: str = "", *more: str, seconds: int = SECONDS, **how: Any
) -> Iterator[tuple[Running, Path]]:
    summary = folder / f"{name}.json"
    command = ["run", "--seconds", str(seconds), "--json", str(summary), *more]
    with planted(folder, name, plants, *command, **how) as run:
        yield run, summary


def compare(
    run: Running, summary: Path, folder: Path, code: int = DONE, seconds: int = SECONDS
) -> tuple[dict[str, Any], str]:
    """Wait for the run and a control; assert that only the machine delayed cycles; return the summary and figures."""
    with run_with(folder, "control", "", "--no-record", seconds=seconds) as (control, control_summary):
        assert control.process.wait(seconds + 60.0) == DONE, control.err
        assert run.process.wait(60.0) == code, run.err
    assert "Traceback" not in run.err
    own, control_figures = json.loads(summary.read_bytes()), json.loads(control_summary.read_bytes())
    late, control_late = own["late"] + own["missed"], control_figures["late"] + control_figures["missed"]
    assert own["cycles"] + own["missed"] >= 20 * seconds - 5
    assert late <= control_late + BEYOND, (own["timing"], control_figures["timing"])
    stopped = [reason for reason in own["stop_reasons"] if reason not in control_figures["stop_reasons"]]
    assert not stopped or control_figures["stop_reasons"], stopped
    return own, f"{late} of {own['cycles']} cycles late or missed (control {control_late})"


def test_a_disk_that_takes_five_seconds(tmp_path: Path, measured: Callable[[str], None]) -> None:
    path = tmp_path / "run.mcap"
    with run_with(tmp_path, "run", "fsync", "--record", str(path), seconds=FSYNC_SECONDS) as (run, summary):
        written, figures = compare(run, summary, tmp_path, seconds=FSYNC_SECONDS)
    assert written["recording"]["sync_max_s"] >= 5.0
    assert written["recording"]["dropped"] == 0
    measured(f"5 s to confirm: {figures}")


def test_a_full_disk_under_the_log_and_the_recording(tmp_path: Path, measured: Callable[[str], None]) -> None:
    full = Path("/dev/full")
    with run_with(tmp_path, "run", "", "--record", str(full), log=full) as (run, summary):
        written, figures = compare(run, summary, tmp_path, FAILED)
    assert written["recording"]["dropped"] > 0
    assert written["log"]["lost"] >= 4
    assert "No space left" in written["log"]["last_error"]
    assert "log lines are missing in the file" in run.err, "where lines still arrive"
    assert f"{written['log']['lost']} lines of the log are missing: No space left" in " ".join(run.out.split())
    (error,) = run.error_lines
    assert "No space left" in error
    lost = f"{written['log']['lost']} lines and {written['recording']['dropped']} messages lost and reported"
    measured(f"full: {figures}; {lost}")


def test_a_disk_that_fills_up_on_the_way(tmp_path: Path, measured: Callable[[str], None]) -> None:
    """A limit on the size of files: every file that grows beyond 16 KiB fails from then on."""
    (tmp_path / "runs").mkdir()
    where = ("--set", f"recording.folder={json.dumps(str(tmp_path / 'runs'))}")
    # The shell counts in blocks of 512 bytes.
    with run_with(tmp_path, "run", "", *where, file_bytes=16384) as (run, summary):
        written, figures = compare(run, summary, tmp_path)
    assert written["recording"]["dropped"] > 0
    assert written["recording"]["last_error"] is not None
    assert "the recording is incomplete" in (tmp_path / "run.jsonl").read_text("utf-8")
    measured(f"full after 16 KiB: {figures}; {written['recording']['dropped']} messages lost and reported")


def test_a_folder_where_nothing_can_be_written(tmp_path: Path, measured: Callable[[str], None]) -> None:
    """A file in the folder's place refuses everybody, the superuser as well."""
    (tmp_path / "file").touch()
    where = ("--set", f"recording.folder={json.dumps(str(tmp_path / 'file'))}")
    with run_with(tmp_path, "run", "", *where) as (run, summary):
        written, figures = compare(run, summary, tmp_path)
    assert written["recording"]["dropped"] > 0
    assert str(tmp_path / "file") in written["recording"]["last_error"]
    measured(f"no folder to write in: {figures}; {written['recording']['dropped']} messages lost and reported")


def stuck_pipe() -> tuple[int, int]:
    """Return both ends of a pipe that is full and has no reader."""
    out, into = os.pipe()
    return out, fill(into)


def fill(into: int) -> int:
    fcntl.fcntl(into, fcntl.F_SETPIPE_SZ, 4096)
    os.set_blocking(into, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(into, b"#" * 4096)
    os.set_blocking(into, True)
    return into


def test_a_log_and_a_terminal_that_take_nothing(tmp_path: Path, measured: Callable[[str], None]) -> None:
    """The log is a pipe that is full, and so is what stands for the terminal: each write to them waits forever."""
    fifo = tmp_path / "log"
    os.mkfifo(fifo)
    held = fill(os.open(fifo, os.O_RDWR))
    out, into = stuck_pipe()
    try:
        with run_with(tmp_path, "run", "", "--no-record", log=fifo, stderr=into) as (run, summary):
            written, figures = compare(run, summary, tmp_path)
            assert written["log"]["lost"] >= 3
            assert "the last items were not written" in written["log"]["last_error"]
    finally:
        for fd in (held, out, into):
            os.close(fd)
    measured(f"log and terminal that take nothing: {figures}; {written['log']['lost']} lines lost and reported")
    assert run.process.returncode != -signal.SIGABRT
