"""Tests of real-time requests: granted or refused, the run continues, and a refusal names the remedy."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from config.settings import RealtimeConfig
from runtime.timing.realtime import apply_realtime

ROOT = Path(__file__).parents[3]
NOTHING = RealtimeConfig()

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="these requests are Linux's own")


class Libc:
    """A C library that refuses every call and counts it."""

    def __init__(self) -> None:
        self.calls: list[str] = []

    def mlockall(self, _flags: int) -> int:
        self.calls.append("mlockall")
        return -1

    def syscall(self, *_arguments: object) -> int:
        self.calls.append("syscall")
        return -1


@pytest.fixture
def refusing(monkeypatch: pytest.MonkeyPatch) -> Libc:
    libc = Libc()

    def refuse(*_arguments: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr("runtime.timing.realtime.ctypes.CDLL", lambda *_a, **_k: libc)
    monkeypatch.setattr("runtime.timing.realtime.ctypes.get_errno", lambda: 1)
    monkeypatch.setattr("runtime.timing.realtime.os.sched_setscheduler", refuse)
    monkeypatch.setattr("runtime.timing.realtime.os.sched_setaffinity", refuse)
    return libc


def test_only_configured_settings_are_requested(refusing: Libc) -> None:
    assert apply_realtime(NOTHING) == []
    assert refusing.calls == []


def test_nothing_is_requested_by_default() -> None:
    default = RealtimeConfig()
    assert (default.slice_s, default.priority, default.core, default.lock_memory) == (None, None, None, False)


@pytest.mark.usefixtures("refusing")
def test_every_refusal_names_the_setting_the_reason_and_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runtime.timing.realtime.platform.machine", lambda: "x86_64")
    core = min(os.sched_getaffinity(0))
    refusals = apply_realtime(RealtimeConfig(slice_s=0.001, priority=7, core=core, lock_memory=True))
    names = [line.split(" ")[0] for line in refusals]
    assert names == ["realtime.slice_s", "realtime.core", "realtime.lock_memory", "realtime.priority"]
    assert all("Operation not permitted" in line and "leave it out" in line for line in refusals)
    assert all("\n" not in line for line in refusals)
    assert "ulimit -r 7" in refusals[3]
    assert "ulimit -l" in refusals[2]


def test_a_missing_core_is_refused_with_the_list_of_present_ones() -> None:
    (line,) = apply_realtime(RealtimeConfig(core=4_000))
    assert line.startswith("realtime.core = 4000 is not a core this process may use (")
    assert str(min(os.sched_getaffinity(0))) in line


def test_no_system_call_on_an_unknown_machine(refusing: Libc, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runtime.timing.realtime.platform.machine", lambda: "abacus")
    assert apply_realtime(RealtimeConfig()) == []
    assert refusing.calls == []


REAL_REQUESTS = """
import os, sys
from config.settings import RealtimeConfig
from runtime.timing.realtime import apply_realtime
core = min(os.sched_getaffinity(0))
refusals = apply_realtime(RealtimeConfig(slice_s=0.001, priority=5, core=core, lock_memory=True))
policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
named = {line.split(" ")[0] for line in refusals}
assert ("realtime.priority" in named) == (policy != os.SCHED_FIFO), (refusals, policy)
assert ("realtime.core" in named) == (os.sched_getaffinity(0) != {core}), refusals
"""


def test_on_this_system_granted_requests_take_effect() -> None:
    """In a process of its own, so that later tests are not affected."""
    done = subprocess.run(
        [sys.executable, "-c", REAL_REQUESTS], cwd=ROOT, text=True, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr
