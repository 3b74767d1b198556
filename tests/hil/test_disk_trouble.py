"""P12: whatever a disk or a terminal does, the cycle keeps its time, and what is lost is counted and told.

Each trouble runs beside a run without any, at the same time on the same machine: that one's late cycles are the
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

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels"), pytest.mark.promise("P12")]

SECONDS = 5
FSYNC_SECONDS = 8
"""So long that an fsync of five seconds falls into it whole."""
BEYOND = 24
"""Cycles that may be late or missed beyond the control's: a machine that holds up one run and not the other
does so for a second at most. A single wait for such a disk in the loop costs a hundred."""


@contextlib.contextmanager
def beside(
    folder: Path, name: str, plants: str = "", *more: str, seconds: int = SECONDS, **how: Any
) -> Iterator[tuple[Running, Path]]:
    summary = folder / f"{name}.json"
    command = ["run", "--seconds", str(seconds), "--json", str(summary), *more]
    with planted(folder, name, plants, *command, **how) as run:
        yield run, summary


def compare(
    run: Running, summary: Path, folder: Path, code: int = DONE, seconds: int = SECONDS
) -> tuple[dict[str, Any], str]:
    """Let it end beside a control; assert that no cycle was late but for the machine; return its summary, figures."""
    with beside(folder, "control", "", "--no-record", seconds=seconds) as (control, control_summary):
        assert control.process.wait(seconds + 60.0) == DONE, control.err
        assert run.process.wait(60.0) == code, run.err
    assert "Traceback" not in run.err
    told, other = json.loads(summary.read_bytes()), json.loads(control_summary.read_bytes())
    late, own = told["late"] + told["missed"], other["late"] + other["missed"]
    assert told["cycles"] + told["missed"] >= 20 * seconds - 5
    assert late <= own + BEYOND, (told["timing"], other["timing"])
    stopped = [reason for reason in told["stop_reasons"] if reason not in other["stop_reasons"]]
    assert not stopped or other["stop_reasons"], stopped
    return told, f"{late} of {told['cycles']} cycles late or missed (control {own})"


def test_a_disk_that_takes_five_seconds(tmp_path: Path, measured: Callable[[str], None]) -> None:
    path = tmp_path / "run.mcap"
    with beside(tmp_path, "run", "fsync", "--record", str(path), seconds=FSYNC_SECONDS) as (run, summary):
        told, figures = compare(run, summary, tmp_path, seconds=FSYNC_SECONDS)
    assert told["recording"]["sync_max_s"] >= 5.0
    assert told["recording"]["dropped"] == 0
    measured(f"5 s to confirm: {figures}")


def test_a_full_disk_under_the_log_and_the_recording(tmp_path: Path, measured: Callable[[str], None]) -> None:
    full = Path("/dev/full")
    with beside(tmp_path, "run", "", "--record", str(full), log=full) as (run, summary):
        told, figures = compare(run, summary, tmp_path, FAILED)
    assert told["recording"]["dropped"] > 0
    assert told["log"]["lost"] >= 4
    assert "No space left" in told["log"]["trouble"]
    assert "log lines are missing in the file" in run.err, "where lines still arrive"
    assert f"{told['log']['lost']} lines of the log are missing: No space left" in " ".join(run.out.split())
    (complaint,) = run.complaints
    assert "No space left" in complaint
    lost = f"{told['log']['lost']} lines and {told['recording']['dropped']} messages lost, counted and told"
    measured(f"full: {figures}; {lost}")


def test_a_disk_that_fills_up_on_the_way(tmp_path: Path, measured: Callable[[str], None]) -> None:
    """A limit on the size of files: every file that grows beyond 16 KiB fails from then on."""
    (tmp_path / "runs").mkdir()
    where = ("--set", f"recording.folder={json.dumps(str(tmp_path / 'runs'))}")
    # The shell counts in blocks of 512 bytes.
    with beside(tmp_path, "run", "", *where, limit="ulimit -f 32") as (run, summary):
        told, figures = compare(run, summary, tmp_path)
    assert told["recording"]["dropped"] > 0
    assert told["recording"]["trouble"] is not None
    assert "the recording has trouble" in (tmp_path / "run.jsonl").read_text("utf-8")
    measured(f"full after 16 KiB: {figures}; {told['recording']['dropped']} messages lost, counted and told")


def test_a_folder_where_nothing_can_be_written(tmp_path: Path, measured: Callable[[str], None]) -> None:
    """A file in the folder's place refuses everybody, the superuser as well."""
    (tmp_path / "file").touch()
    where = ("--set", f"recording.folder={json.dumps(str(tmp_path / 'file'))}")
    with beside(tmp_path, "run", "", *where) as (run, summary):
        told, figures = compare(run, summary, tmp_path)
    assert told["recording"]["dropped"] > 0
    assert str(tmp_path / "file") in told["recording"]["trouble"]
    measured(f"no folder to write in: {figures}; {told['recording']['dropped']} messages lost, counted and told")


def stuck_pipe() -> tuple[int, int]:
    """Return both ends of a pipe that is full and that nobody reads."""
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
        with beside(tmp_path, "run", "", "--no-record", log=fifo, stderr=into) as (run, summary):
            told, figures = compare(run, summary, tmp_path)
            assert told["log"]["lost"] >= 3
            assert "the last items were not written" in told["log"]["trouble"]
    finally:
        for fd in (held, out, into):
            os.close(fd)
    measured(f"log and terminal that take nothing: {figures}; {told['log']['lost']} lines lost, counted and told")
    assert run.process.returncode != -signal.SIGABRT
