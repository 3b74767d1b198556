"""Threads that no end waits for: results, errors, and an end in the middle of a call."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import threading
from typing import Any

import pytest

from runtime.support.daemon_thread import exit_process, in_daemon_thread
from tests.hil.machine import TIMEOUT_S

ENDED = """
import asyncio, atexit, threading, time
from runtime.support.daemon_thread import exit_process, in_daemon_thread

started = threading.Event()

def work():
    started.set()
    time.sleep(1e6)

async def main():
    task = asyncio.create_task(in_daemon_thread(work))
    while not started.is_set():
        await asyncio.sleep(0.001)
    task.cancel()

asyncio.run(main())
atexit.register(print, "the folder is removed")
print("the summary", end=" ")
exit_process(7)
"""


async def test_what_the_call_returns_or_raises() -> None:
    assert await in_daemon_thread(int, "7f", base=16) == 127
    with pytest.raises(ZeroDivisionError):
        await in_daemon_thread(lambda: 1 // 0)
    assert await in_daemon_thread(threading.current_thread) is not threading.main_thread()


async def test_a_result_that_comes_after_the_waiting_was_cancelled_is_dropped() -> None:
    begin, end = threading.Event(), threading.Event()

    def work() -> None:
        begin.set()
        end.wait(TIMEOUT_S)

    task = asyncio.create_task(in_daemon_thread(work))
    while not begin.is_set():
        await asyncio.sleep(0.001)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    end.set()
    assert await in_daemon_thread(len, "four") == 4


def test_a_process_ends_in_the_middle_of_a_call_with_its_code_its_output_and_its_cleaning_up() -> None:
    call = [sys.executable, "-c", ENDED]
    ended = subprocess.run(call, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (7, "the summary the folder is removed\n", "")


def test_without_such_a_thread_the_interpreter_ends_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    left: list[Any] = []
    monkeypatch.setattr(threading, "enumerate", lambda: left)
    with pytest.raises(SystemExit) as ended:
        exit_process(3)
    assert ended.value.code == 3
