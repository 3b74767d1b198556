"""Tests of a forked child, in an interpreter of their own: this one has threads, so that it must not fork."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from runtime.support.child_process import INTERPRETER, child_environment
from runtime.support.forked_child import OPEN_FILES, can_fork, fork

PROGRAM: Final = """
import asyncio, gc, json, os, signal, sys, threading
from runtime.support.forked_child import can_fork, fork

def child():
    word = sys.argv[1]
    if word == "echo":
        files = sorted(map(int, os.listdir("/proc/self/fd")))
        print(json.dumps([os.environ["WORD"], os.getsid(0) == os.getpid(), gc.isenabled(), files]), flush=True)
        for line in sys.stdin:
            print(line.strip()[::-1], flush=True)
    elif word == "exit":
        sys.exit(7)
    elif word == "fail":
        raise LookupError("no such world")
    elif word == "sleep":
        print("warning", file=sys.stderr)
        print("ready", flush=True)
        signal.pause()

async def main():
    signals, found = [], {"can": can_fork()}
    loop = asyncio.get_running_loop()
    loop.add_signal_handler(signal.SIGTERM, signals.append, "parent")
    gc.disable()
    sys.stdout.write("{")  # not written yet: the child must not write it
    echo = await fork(child, ["echo"], {"WORD": "given"})
    found["facts"] = json.loads(await echo.stdout.readline())
    echo.stdin.write(b"one\\ntwo\\n")
    found["echo"] = [(await echo.stdout.readline()).decode().strip() for _ in range(2)]
    echo.stdin.close()
    found["codes"] = [await echo.wait(), await (await fork(child, ["exit"], {})).wait()]
    failed = await fork(child, ["fail"], {})
    found["codes"].append(await failed.wait())
    found["error"] = (await failed.stderr.read()).decode().splitlines()[-1]
    asleep = await fork(child, ["sleep"], {})
    await asleep.stdout.readline()
    found["warned"] = (await asleep.stderr.readline()).decode().strip()
    found["running"] = asleep.returncode
    os.kill(asleep.pid, signal.SIGTERM)
    found["codes"].append(await asleep.wait())
    await asyncio.sleep(0.0)
    found["signals"] = signals
    await asyncio.to_thread(lambda: found.update(threaded=can_fork()))
    sys.stdout.write(json.dumps(found)[1:])

asyncio.run(main())
"""


def test_a_forked_child_has_its_own_streams_signals_and_end() -> None:
    run = subprocess.run(
        [*INTERPRETER, "-c", PROGRAM],
        env=child_environment(),
        capture_output=True,
        text=True,
        check=True,
        timeout=60.0,
    )
    found = json.loads(run.stdout)
    word, has_session, collects, files = found["facts"]
    assert (word, has_session, collects) == ("given", True, True)
    assert files[:3] == [0, 1, 2]
    assert len(files) == 4, "and that of the list of files itself"
    assert found["echo"] == ["eno", "owt"]
    assert found["codes"] == [0, 7, 1, -15]
    assert found["error"] == "LookupError: no such world"
    assert found["warned"] == "warning", "it is written by line"
    assert (found["running"], found["signals"]) == (None, []), "its signals are not its parent's"
    assert (found["can"], found["threaded"]) == (True, False)


def test_a_process_whose_libraries_may_have_threads_does_not_fork(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("threading.active_count", lambda: 1)
    assert "numpy" in sys.modules
    assert not can_fork()


def test_a_process_whose_system_refuses_descriptors_of_processes_does_not_fork(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("threading.active_count", lambda: 1)
    monkeypatch.setattr("runtime.support.forked_child.THREADS", ())
    assert can_fork()

    def refuse(_pid: int) -> int:
        raise OSError(errno.ENOSYS, "not implemented")

    monkeypatch.setattr(os, "pidfd_open", refuse)
    assert not can_fork()


async def test_a_fork_that_the_system_refuses_leaves_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> int:
        raise OSError(errno.EAGAIN, "too many processes")

    monkeypatch.setattr(os, "fork", refuse)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ()), len(list(Path(OPEN_FILES).iterdir()))
    with pytest.raises(OSError, match="too many processes"):
        await fork(lambda: None, [], {})
    assert (signal.pthread_sigmask(signal.SIG_BLOCK, ()), len(list(Path(OPEN_FILES).iterdir()))) == before
