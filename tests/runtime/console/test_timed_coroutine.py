"""Every step of a coroutine is measured, and results, errors and cancellation pass through."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from runtime.console.timed_coroutine import timed_coroutine


class StepCounter:
    """Counts the measured steps."""

    def __init__(self) -> None:
        self.steps: list[str] = []

    def timed(self, name: str, call: Callable[..., Any], /) -> Callable[..., Any]:
        def measured(*args: Any) -> Any:
            self.steps.append(name)
            return call(*args)

        return measured


async def test_each_step_is_measured_and_the_result_is_returned() -> None:
    async def work() -> int:
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        return 3

    counter = StepCounter()
    assert await timed_coroutine(counter.timed, "console send", work()) == 3
    assert counter.steps == ["console send"] * 3


async def test_errors_and_cancellation_reach_the_work() -> None:
    ended: list[str] = []

    async def fail() -> None:
        raise ValueError("broken")

    async def wait() -> None:
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            ended.append("cancelled")
            raise

    with pytest.raises(ValueError, match="broken"):
        await timed_coroutine(StepCounter().timed, "x", fail())

    async def waiting() -> None:
        await timed_coroutine(StepCounter().timed, "x", wait())

    task = asyncio.create_task(waiting())
    await asyncio.sleep(0)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert ended == ["cancelled"]
