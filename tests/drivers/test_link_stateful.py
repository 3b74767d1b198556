"""The link as a machine with a memory: whatever happens in whatever order, on a real pty."""

from __future__ import annotations

import asyncio
import contextlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

from config.robot import LinkConfig
from drivers.link import Link
from tests.drivers.pty_pair import PtyPair
from tests.hil.machine import TIMEOUT_S

WAITING_MAX = 4096


class LinkMachine(RuleBasedStateMachine):
    """A link that is kept open, and a pty whose other end is unplugged, deaf, talkative, or plugged in again.

    The model: bytes accepted since the line was last opened arrive, in order and whole; a line is reported opened and
    closed in turn; nothing that happens reaches the loop's exception handler.
    """

    def __init__(self) -> None:
        super().__init__()
        self.loop = asyncio.new_event_loop()
        self.errors: list[object] = []
        self.loop.set_exception_handler(lambda _, context: self.errors.append(context))
        self.folder = tempfile.TemporaryDirectory()
        self.pty = PtyPair(Path(self.folder.name) / "robot")
        self.plugged = True
        self.events: list[str] = []
        self.heard = bytearray()
        self.accepted = bytearray()
        self.fail_next = False
        config = LinkConfig(port=str(self.pty.path), reopen_first_s=0.001, reopen_max_s=0.004)
        self.link = Link(config, self._opened, self._data, self._closed)
        self.task: asyncio.Task[None] | None = None
        self.start()

    def _opened(self) -> None:
        self.events.append("opened")
        self.accepted.clear()

    def _data(self, data: bytes) -> None:
        if self.fail_next:
            self.fail_next = False
            raise RuntimeError("planted")
        self.heard += data

    def _closed(self, reason: str) -> None:
        assert "\n" not in reason
        self.events.append("closed")

    def until(self, done: Callable[[], bool], what: str) -> None:
        async def wait() -> None:
            async with asyncio.timeout(TIMEOUT_S):
                while not done():
                    await asyncio.sleep(0.001)

        try:
            self.loop.run_until_complete(wait())
        except TimeoutError:
            pytest.fail(f"it never came: {what}; {self.link.last_error}")

    def start(self) -> None:
        self.task = self.loop.create_task(self.link.run())
        self.until(lambda: self.link.is_open, "open")

    def drain(self) -> bytes:
        """Read what has come to the other end by now."""
        got = bytearray()
        with contextlib.suppress(BlockingIOError):
            while piece := os.read(self.pty.master, 65536):
                got += piece
        return bytes(got)

    @precondition(lambda self: self.plugged)
    @rule(sizes=st.lists(st.integers(0, 5000), min_size=1, max_size=12))
    def send(self, sizes: list[int]) -> None:
        """All of it, or nothing; more than fits is refused."""
        if not self.link.is_open:
            return
        for size in sizes:
            data = os.urandom(size)
            fits = self.link.waiting + size <= WAITING_MAX
            assert self.link.send(data) == fits
            self.accepted += data if fits else b""

    @precondition(lambda self: self.plugged)
    @rule()
    def read(self) -> None:
        """What was accepted since the line was opened has come, in order."""
        if not self.link.is_open:
            return
        got = bytearray()

        def complete() -> bool:
            got.extend(self.drain())
            return len(got) >= len(self.accepted)

        self.until(complete, "what was sent")
        assert bytes(got[len(got) - len(self.accepted) :]) == bytes(self.accepted)
        self.accepted.clear()
        assert self.link.waiting == 0

    @precondition(lambda self: self.plugged)
    @rule(data=st.binary(min_size=1, max_size=500))
    def hear(self, data: bytes) -> None:
        """Whatever bytes the other end says are handed on as they are."""
        if not self.link.is_open:
            return
        self.heard.clear()
        os.write(self.pty.master, data)
        self.until(lambda: len(self.heard) >= len(data), "what was said")
        assert bytes(self.heard) == data

    @precondition(lambda self: self.plugged)
    @rule()
    def a_handler_fails(self) -> None:
        """The line ends, is reported, and is opened again by itself."""
        self.fail_next = True
        before = self.events.count("opened")
        os.write(self.pty.master, b"x")
        self.until(lambda: self.events.count("opened") > before and self.link.is_open, "open again")
        self.drain()

    @precondition(lambda self: self.plugged)
    @rule()
    def unplug(self) -> None:
        self.pty.unplug()
        self.plugged = False
        self.until(lambda: not self.link.is_open, "lost")

    @precondition(lambda self: not self.plugged)
    @rule()
    def plug(self) -> None:
        self.pty.plug()
        self.plugged = True
        self.until(lambda: self.link.is_open, "open again")
        assert self.link.last_error is None

    @precondition(lambda self: not self.plugged)
    @rule()
    def send_into_nothing(self) -> None:
        assert not self.link.send(b"gone")
        assert not self.link.writable
        assert self.link.last_error

    @precondition(lambda self: self.plugged)
    @rule()
    def stop_and_start(self) -> None:
        """A run that is cancelled ends the line, in time, and another may follow."""
        self.cancel()
        assert not self.link.is_open
        self.drain()
        self.start()

    @rule(seconds=st.floats(0.0, 0.02))
    def hold(self, seconds: float) -> None:
        """Delays what is read and nothing else."""
        self.link.hold(seconds)

    @rule()
    def release(self) -> None:
        self.link.release()

    @rule()
    def let_time_pass(self) -> None:
        self.loop.run_until_complete(asyncio.sleep(0.002))

    def cancel(self) -> None:
        assert self.task is not None
        self.task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            self.loop.run_until_complete(asyncio.wait_for(self.task, TIMEOUT_S))

    @invariant()
    def nothing_piles_up_and_nothing_is_reported_twice(self) -> None:
        assert self.link.waiting <= WAITING_MAX
        assert self.errors == []
        assert self.events == ["opened", "closed"] * (len(self.events) // 2) + ["opened"] * (len(self.events) % 2)
        assert self.plugged or not self.link.is_open

    def teardown(self) -> None:
        try:
            self.cancel()
            assert not self.link.is_open
            assert not asyncio.all_tasks(self.loop)
            assert self.errors == []
        finally:
            self.pty.unplug()
            self.folder.cleanup()
            self.loop.close()


QUICK = settings(
    max_examples=15,
    stateful_step_count=20,
    deadline=None,
    derandomize=True,  # `make soak` looks further
    phases=(Phase.generate,),  # each step takes real time, and one that fails its whole timeout
    suppress_health_check=list(HealthCheck),
)
LinkMachine.TestCase.settings = QUICK
TestLink = LinkMachine.TestCase


@pytest.mark.soak
def test_the_link_for_longer() -> None:
    run_state_machine_as_test(LinkMachine, settings=settings(QUICK, max_examples=3000, derandomize=False))
