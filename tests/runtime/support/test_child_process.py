"""Tests of child processes: the same modules, a session of their own, low priority, and an end without traces."""

from __future__ import annotations

import os
import sys

import pytest

from runtime.support import child_process
from runtime.support.child_process import NICENESS, ROOT, child_environment, kill_child, lower_priority, start_child


async def test_a_child_finds_this_program_runs_in_its_own_session_and_is_killed() -> None:
    """The module `code` reads statements from standard input."""
    child = await start_child("code", ["-q"], pipes=True, low_priority=True)
    assert child.stdin is not None
    assert child.stdout is not None
    child.stdin.write(b"import os, runtime.support.child_process as c\n")
    child.stdin.write(b"print(os.getsid(0) == os.getpid(), os.getpriority(os.PRIO_PROCESS, 0), c.__file__)\n")
    answer = (await child.stdout.readline()).decode().split()[-3:]  # after prompts
    assert answer == ["True", str(NICENESS), child_process.__file__]
    await kill_child(child)
    assert child.returncode == -9
    await kill_child(child)  # one that has ended is left alone


async def test_without_pipes_only_errors_are_read() -> None:
    child = await start_child("no_such_module_here", [], pipes=False)
    assert (child.stdin, child.stdout) == (None, None)
    assert child.stderr is not None
    assert b"no_such_module_here" in await child.stderr.read()
    assert await child.wait() == 1


def test_another_interpreter_gets_the_path_of_this_one_and_our_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", ["/a", "", "/b"])
    assert child_environment()["PYTHONPATH"] == os.pathsep.join(("/a", "/b", ROOT))
    monkeypatch.setattr(sys, "path", [ROOT, "/a"])
    assert child_environment()["PYTHONPATH"] == os.pathsep.join((ROOT, "/a"))


@pytest.mark.parametrize(("pinned", "moved"), [({1}, [{0, 2, 3}]), ({0, 1, 2, 3}, []), ({1, 2}, [])])
def test_a_processor_reserved_for_the_parent_is_left(
    monkeypatch: pytest.MonkeyPatch, pinned: set[int], moved: list[set[int]]
) -> None:
    asked: list[object] = []
    monkeypatch.setattr(os, "setpriority", lambda *words: asked.append(words))
    monkeypatch.setattr(os, "sched_getaffinity", lambda _pid: pinned)
    monkeypatch.setattr(os, "sched_setaffinity", lambda _pid, others: asked.append(others))
    monkeypatch.setattr(os, "cpu_count", lambda: 4)
    lower_priority()
    assert asked == [(os.PRIO_PROCESS, 0, NICENESS), *moved]
