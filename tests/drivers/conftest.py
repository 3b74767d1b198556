"""A line over a pty, and a driver after its handshake, for the tests of the drivers."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest

from tests.drivers.driver_harness import DriverHarness
from tests.drivers.pty_pair import PtyPair


@pytest.fixture
def pty(tmp_path: Path) -> Iterator[PtyPair]:
    pty = PtyPair(tmp_path / "robot")
    yield pty
    pty.unplug()


@pytest.fixture
async def loop_errors() -> AsyncIterator[None]:
    """Fail on any exception that the event loop would print as a traceback."""
    errors: list[object] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: errors.append(context))
    yield
    assert errors == []


@pytest.fixture
def harness() -> DriverHarness:
    ready = DriverHarness()
    ready.open()
    ready.handshake()
    return ready
