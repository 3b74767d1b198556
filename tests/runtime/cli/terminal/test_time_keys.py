"""Tests of the keys that control the time of a run."""

from __future__ import annotations

import asyncio

from structlog import get_logger
from structlog.testing import capture_logs

from runtime.cli.terminal.time_keys import TimeKeys, noting_what_waits
from runtime.cycle.inputs import Request
from runtime.timing.time_control import REAL_ROBOT, NoTimeControl


class Control:
    """Notes each request, which takes a turn of the loop."""

    def __init__(self) -> None:
        self.is_paused = False
        self.speed = 1.0
        self.asked: list[str] = []

    async def pause(self) -> str | None:
        await asyncio.sleep(0)
        self.asked.append("pause")
        self.is_paused = True
        return None

    async def resume(self) -> str | None:
        await asyncio.sleep(0)
        self.asked.append("resume")
        self.is_paused = False
        return None

    async def single_step(self) -> str | None:
        await asyncio.sleep(0)
        self.asked.append("step")
        return None

    async def set_speed(self, factor: float) -> str | None:
        raise AssertionError(factor)


async def settle() -> None:
    for _ in range(5):
        await asyncio.sleep(0)


async def test_keys_control_time_one_after_the_other() -> None:
    control = Control()
    keys = TimeKeys(control, get_logger())
    for key in ("p", "s", "s", "p", "x", "p"):
        keys.press(key)
        await settle()
    assert control.asked == ["pause", "step", "step", "resume", "pause"]


async def test_of_the_keys_pressed_meanwhile_the_newest_follows() -> None:
    control = Control()
    keys = TimeKeys(control, get_logger())
    for pressed in ("pp", "psp", "p", "pxs"):
        keys.press(pressed[0])
        await asyncio.sleep(0)  # it is under way
        for key in pressed[1:]:
            keys.press(key)
        await settle()
    assert control.asked == ["pause", "resume", "pause", "resume", "pause", "resume", "step"]


async def test_a_key_that_waits_for_the_end_of_a_pause_says_so() -> None:
    control, passed, lines = Control(), list[Request](), list[str]()
    on_key = noting_what_waits(passed.append, control, lines.append)
    on_key(Request.HALT)
    assert lines == []
    control.is_paused = True
    on_key(Request.HALT)
    on_key(Request.ARM)
    assert passed == [Request.HALT, Request.HALT, Request.ARM]
    assert [line.split()[0] for line in lines] == ["HALT", "ARM"]


async def test_a_refusal_is_logged() -> None:
    with capture_logs() as lines:
        keys = TimeKeys(NoTimeControl(), get_logger())
        for key in ("p", "s"):
            keys.press(key)
            await settle()
    assert [line["reason"] for line in lines] == [REAL_ROBOT, REAL_ROBOT]
