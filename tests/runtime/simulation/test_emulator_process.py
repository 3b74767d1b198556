"""Tests of the emulator as a child process, with a short program in its place: its port, its time, its end."""

from __future__ import annotations

import asyncio
import contextlib
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from config.errors import FAILED, WRONG_CALL, UserError
from runtime.simulation import emulator_process
from runtime.simulation.emulator_process import start_emulator

FOLLOWS = """
import sys
print("ready on", sys.argv[3], flush=True)
for line in sys.stdin:
    keyword, number, host_s, run_s, factor, until_s = line.split()
    print("acknowledged", number, until_s, flush=True)
"""
"""Reports each time scale as reached."""
IGNORES_SIGTERM = """
import signal, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
print("ready", flush=True)
time.sleep(600)
"""
FAILS = "import sys; sys.stderr.write('echolocate: no world: name one with --world\\n'); sys.exit({})"
KILLED = "import os; os.kill(os.getpid(), 9)"
SILENT = "import time; time.sleep(600)"


class Children:
    """Starts a program in place of the emulator, and keeps the processes."""

    def __init__(self) -> None:
        self.program = FOLLOWS
        self.arguments: list[str] = []
        self.environment: dict[str, str] = {}
        self.started: list[asyncio.subprocess.Process] = []

    async def start(
        self, _module: str, arguments: Sequence[str], *, pipes: bool, environment: Mapping[str, str]
    ) -> asyncio.subprocess.Process:
        assert pipes
        self.arguments = list(arguments)
        self.environment = dict(environment)
        pipe = asyncio.subprocess.PIPE
        child = await asyncio.create_subprocess_exec(
            sys.executable, "-S", "-c", self.program, *arguments, stdin=pipe, stdout=pipe, stderr=pipe
        )
        self.started.append(child)
        return child


@pytest.fixture
def children(monkeypatch: pytest.MonkeyPatch) -> Children:
    made = Children()
    monkeypatch.setattr(emulator_process, "start_child", made.start)
    return made


async def test_the_emulator_s_time_is_controlled_while_it_runs(
    children: Children, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("runtime.timing.time_control.ANSWER_MAX_S", 60.0)  # only a hang takes so long
    async with start_emulator(["--seed", "7"]) as emulator:
        folder = Path(emulator.port).parent
        assert folder.is_dir()
        assert children.arguments == [
            "emulate", "--link", emulator.port, "--end-with-parent", "--control", "--seed", "7",
        ]  # fmt: skip
        assert children.environment == {}
        emulator.control.clock.expect(emulator.control.clock() + 0.05)
        assert await emulator.control.pause() is None
        assert emulator.control.is_paused
        assert emulator.control.clock.is_still, "its acknowledgement was read"
    assert children.started[0].returncode is not None
    assert not folder.exists()


async def test_an_emulator_without_kernels_runs_in_plain_python(children: Children) -> None:
    async with start_emulator([], compiled=False):
        assert children.environment == {"NUMBA_DISABLE_JIT": "1"}


async def test_where_no_copy_of_this_process_can_be_made_the_emulator_is_a_program_of_its_own(
    children: Children, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def refuse(*_: object) -> None:
        raise BlockingIOError("too many processes")

    monkeypatch.setattr(emulator_process, "can_fork", lambda: True)
    monkeypatch.setattr(emulator_process, "fork", refuse)
    async with start_emulator([], main=lambda: None):
        assert len(children.started) == 1


async def test_an_emulator_that_does_not_end_is_killed(children: Children, monkeypatch: pytest.MonkeyPatch) -> None:
    children.program = IGNORES_SIGTERM
    monkeypatch.setattr(emulator_process, "END_MAX_S", 0.05)
    with contextlib.suppress(ZeroDivisionError):
        async with start_emulator([]):
            raise ZeroDivisionError
    assert children.started[0].returncode == -9


@pytest.mark.parametrize(("status", "code"), [(WRONG_CALL, WRONG_CALL), (FAILED, FAILED), (7, FAILED)])
async def test_an_emulator_that_does_not_start_is_reported_in_its_own_words(
    children: Children, status: int, code: int
) -> None:
    children.program = FAILS.format(status)
    with pytest.raises(UserError, match=r"^the emulator did not start: no world: name one with --world$") as caught:
        async with start_emulator([]):
            pass
    assert caught.value.exit_code == code
    assert children.started[0].returncode == status


@pytest.mark.promise("P19")
async def test_an_emulator_that_is_killed_while_it_starts_is_reported(children: Children) -> None:
    children.program = KILLED
    with pytest.raises(UserError, match=r"^the emulator did not start: it ended by SIGKILL$"):
        async with start_emulator([]):
            pass


async def test_an_emulator_that_says_nothing_is_given_up(children: Children, monkeypatch: pytest.MonkeyPatch) -> None:
    children.program = SILENT
    monkeypatch.setattr(emulator_process, "START_MAX_S", 0.05)
    with pytest.raises(UserError, match=r"no answer within 0 s; .*: end other programs"):
        async with start_emulator([]):
            pass
    assert children.started[0].returncode == -9


async def test_without_a_place_for_its_folder_nothing_is_started(
    children: Children, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_arguments: Any) -> str:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tempfile, "mkdtemp", refuse)
    with pytest.raises(UserError, match="no temporary folder can be created for the emulator: No space left"):
        async with start_emulator([]):
            pass
    assert children.started == []
