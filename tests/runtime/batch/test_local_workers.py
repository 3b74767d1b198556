"""Worker processes: one that is killed is replaced, also while it starts, and none is left at the end."""

from __future__ import annotations

import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import IO

import pytest

from runtime.batch.local_workers import local_workers

SLEEPER = ("sleep", "60")


def replaced(processes: list[subprocess.Popen[bytes]], dead: subprocess.Popen[bytes]) -> bool:
    """Wait until another process stands in the place of a dead one."""
    pause = threading.Event()
    return any(dead not in processes or pause.wait(0.01) for _ in range(12_000))


def test_a_killed_worker_is_replaced_and_none_is_left(tmp_path: Path) -> None:
    seen: list[subprocess.Popen[bytes]] = []
    with local_workers(SLEEPER, 2, tmp_path / "log", period_s=0.01) as processes:
        for _ in range(3):
            dead = processes[0]
            seen += [dead, processes[1]]
            dead.kill()
            assert replaced(processes, dead)
            assert len(processes) == 2
        seen += processes
    assert all(process.poll() is not None for process in seen)


def test_where_one_cannot_be_started_none_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started = list[subprocess.Popen[bytes]]()

    def start(command: Sequence[str], output: IO[bytes]) -> subprocess.Popen[bytes]:
        if started:
            raise BlockingIOError("no more processes")
        started.append(subprocess.Popen(command, stdout=output))
        return started[0]

    monkeypatch.setattr("runtime.batch.local_workers._start", start)
    with pytest.raises(BlockingIOError), local_workers(SLEEPER, 2, tmp_path / "log"):
        pass
    assert started[0].poll() is not None


def test_what_workers_print_is_in_the_log(tmp_path: Path) -> None:
    (tmp_path / "log").write_text("of an earlier call")
    with local_workers(("echo", "no such module"), 1, tmp_path / "log", period_s=60.0) as (process,):
        process.wait()
    assert (tmp_path / "log").read_text() == "no such module\n"
