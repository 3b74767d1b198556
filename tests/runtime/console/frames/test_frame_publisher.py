"""When frames are encoded: while clients are connected, at a bounded rate, not while cycles overrun."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from runtime.console.frames.frame_encoder import EncodedFrame
from tests.runtime.console.console_case import open_console


async def test_frames_are_encoded_once_for_all_clients_if_there_are_any(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with open_console() as case:
        made: list[int] = []
        encode = case.console._publisher._encoder.frame

        def counted(*how: Any) -> EncodedFrame:
            made.append(1)
            return encode(*how)

        monkeypatch.setattr(case.console._publisher._encoder, "frame", counted)
        case.cycles(50)
        await asyncio.sleep(0.0)
        assert sum(made) == 0
        page, another = await case.page(), await case.page()
        case.cycles()
        await page.next("state")
        await another.next("state")
        assert sum(made) == 1, "once for all clients"


async def test_at_most_twenty_frames_a_second() -> None:
    async with open_console() as case:
        page = await case.page()
        before = case.console._publisher._encoder._number
        for _ in range(200):
            case.cycles(step_s=0.005)
            await asyncio.sleep(0.0)
        assert 19 <= case.console._publisher._encoder._number - before <= 22
        before = case.console._publisher._encoder._number
        for _ in range(40):
            case.cycles(step_s=0.051)
            await asyncio.sleep(0.0)
        assert case.console._publisher._encoder._number - before == 40, "a slightly late cycle gets a frame"
        await page.next("state")


async def test_no_frame_while_cycles_overrun() -> None:
    async with open_console() as case:
        page = await case.page()
        before = case.console._publisher._encoder._number
        case.run.timing_monitor.overruns_in_a_row = 1
        for _ in range(10):
            case.cycles()
            await asyncio.sleep(0.0)
        assert case.console._publisher._encoder._number == before
        case.run.timing_monitor.overruns_in_a_row = 0
        case.cycles()
        assert (await page.next("state"))["cycle"] == 11


async def test_frames_continue_while_no_cycle_ends() -> None:
    async with open_console(idle_period_s=0.02) as case:
        page = await case.page()
        case.clock[0] += 1.0
        assert (await page.next("state"))["cycle"] == 0


@pytest.mark.parametrize("where", ["frame", "take"])
async def test_a_failure_is_logged_once_and_reported_as_a_fault(where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fault in the display neither stays silent nor ends the loop."""
    async with open_console() as case:
        page = await case.page()
        monkeypatch.setattr(case.console._publisher._encoder, where, lambda *_: 1 / 0)
        assert case.run.health.fault() is None
        case.cycles(3)
        await asyncio.sleep(0.0)
        case.cycles(3)
        fault = case.run.health.fault()
        assert fault is not None
        assert "the part `console` of this program has ended (ZeroDivisionError" in fault
        assert len([line for line in case.log if "cannot show the run" in str(line["event"])]) == 1
        assert (await page.ask(type="halt"))["ok"], "HALT still works"
        case.console._publisher.failure = None
        case.run.health._ended.clear()
