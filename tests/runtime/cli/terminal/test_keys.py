"""Tests of the keys of the terminal."""

from __future__ import annotations

import asyncio
import contextlib
import os
import pty
import signal
import sys
import termios
from collections.abc import Iterator
from pathlib import Path

import pytest

from runtime.cli.terminal.keys import keys
from runtime.cycle.inputs import Request
from tests.hil.machine import TIMEOUT_S


@pytest.fixture
def keyboard(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    master, slave = pty.openpty()
    with contextlib.ExitStack() as stack:
        stack.callback(os.close, master)
        monkeypatch.setattr(sys, "stdin", stack.enter_context(os.fdopen(slave, "r")))
        yield master


async def test_keys_arm_halt_and_quit_and_leave_the_terminal_as_it_was(keyboard: int) -> None:
    before = termios.tcgetattr(sys.stdin.fileno())
    asked: list[Request] = []
    quits = asyncio.Event()
    with keys(asked.append, quits.set):
        os.write(keyboard, b"ax h")
        async with asyncio.timeout(TIMEOUT_S):
            while len(asked) < 3:  # keys that came together are all taken at once
                await asyncio.sleep(0.01)
        os.write(keyboard, b"q")
        await asyncio.wait_for(quits.wait(), TIMEOUT_S)
    assert asked == [Request.ARM, Request.HALT, Request.HALT]
    assert termios.tcgetattr(sys.stdin.fileno()) == before


async def test_letters_of_a_key_that_sends_several_do_not_arm(keyboard: int) -> None:
    """Alt+a is ESC a, and Shift+Up of some terminals ends in a; the space bar halts whatever came before it."""
    asked: list[Request] = []
    with keys(asked.append, lambda: pytest.fail("q of a sequence")):
        for pressed in (b"\x1ba", b"\x1b[a", b"\x1bq", b"\x1b "):
            os.write(keyboard, pressed)
            await asyncio.sleep(0.02)
    assert asked == [Request.HALT]


async def test_after_it_was_stopped_and_continued_it_takes_keys_again(
    keyboard: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A shell sets its own mode of the terminal while the program is stopped."""
    fd = sys.stdin.fileno()
    line_mode, is_in_front = termios.tcgetattr(fd), False
    monkeypatch.setattr(os, "tcgetpgrp", lambda _fd: os.getpgrp() if is_in_front else -1)
    asked: list[Request] = []
    returns: list[None] = []
    with keys(asked.append, lambda: None, on_return=lambda: returns.append(None)):
        termios.tcsetattr(fd, termios.TCSANOW, line_mode)
        os.kill(os.getpid(), signal.SIGCONT)
        await asyncio.sleep(0.05)
        assert termios.tcgetattr(fd)[3] & termios.ICANON
        assert not returns
        is_in_front = True
        os.kill(os.getpid(), signal.SIGCONT)
        os.write(keyboard, b" ")
        async with asyncio.timeout(TIMEOUT_S):
            while not asked:
                await asyncio.sleep(0.01)
    assert asked == [Request.HALT]
    assert returns
    assert termios.tcgetattr(fd) == line_mode


async def test_in_the_background_what_is_typed_is_left_to_the_shell(
    keyboard: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A program that reads or changes its terminal from the background is stopped; fg signals nothing to it."""
    fd = sys.stdin.fileno()
    line_mode, is_in_front = termios.tcgetattr(fd), False
    monkeypatch.setattr(os, "tcgetpgrp", lambda _fd: os.getpgrp() if is_in_front else -1)
    monkeypatch.setattr("runtime.cli.terminal.keys.BACKGROUND_S", 0.01)
    asked: list[Request] = []
    returns: list[None] = []
    with keys(asked.append, lambda: None, on_return=lambda: returns.append(None)):
        assert termios.tcgetattr(fd) == line_mode
        os.write(keyboard, b"a\n")
        await asyncio.sleep(0.05)
        assert not asked
        assert os.read(fd, 10) == b"a\n"  # as the shell does
        is_in_front = True
        async with asyncio.timeout(TIMEOUT_S):
            while not returns:
                await asyncio.sleep(0.01)
            os.write(keyboard, b" ")
            while not asked:
                await asyncio.sleep(0.01)
        is_in_front = False
        os.write(keyboard, b"a")
        await asyncio.sleep(0.05)
        termios.tcsetattr(fd, termios.TCSANOW, line_mode)
        monkeypatch.setattr(termios, "tcsetattr", lambda *_: pytest.fail("changed from the background"))
    assert asked == [Request.HALT]


async def test_without_a_terminal_there_are_no_keys(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "in").write_text("qqq")
    with (tmp_path / "in").open() as file:
        monkeypatch.setattr(sys, "stdin", file)
        asked: list[Request] = []
        with keys(asked.append, lambda: asked.append(Request.HALT)):
            await asyncio.sleep(0)
        assert asked == []


async def test_what_was_typed_before_it_took_the_terminal_is_dropped(keyboard: int) -> None:
    """An a that was meant for the shell arms no robot."""
    asked: list[Request] = []
    os.write(keyboard, b"aq")
    assert os.read(keyboard, 2) == b"aq"  # its echo: now the terminal has it
    with keys(asked.append, lambda: pytest.fail("it was typed before")):
        await asyncio.sleep(0.05)
        os.write(keyboard, b" ")
        async with asyncio.timeout(TIMEOUT_S):
            while not asked:
                await asyncio.sleep(0.01)
    assert asked == [Request.HALT]
