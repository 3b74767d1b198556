"""A line over a pty, and a robot that has greeted, for the tests of the drivers."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest

from tests.drivers.ends import Ends
from tests.drivers.scripted import Bench


@pytest.fixture
def ends(tmp_path: Path) -> Iterator[Ends]:
    pty = Ends(tmp_path / "robot")
    yield pty
    pty.unplug()


@pytest.fixture
async def loop_errors() -> AsyncIterator[None]:
    """Fail on whatever would reach a user as a traceback from the loop."""
    errors: list[object] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: errors.append(context))
    yield
    assert errors == []


@pytest.fixture
def bench() -> Bench:
    ready = Bench()
    ready.open()
    ready.greet()
    return ready
