"""The page on a real process with an emulated base: an action on the page has its effect on the base.

On a busy machine the base's own deadman may stop it at any time; an operator then re-arms it, and so do these tests.
"""

from __future__ import annotations

import asyncio
import json
import time
from pathlib import Path

import pytest
from playwright.async_api import expect

from drivers.messages import Flags
from tests.browser.open_page import Opened, Opener, until
from tests.browser.real_run import Run, run
from tests.browser.test_drive import press_pad
from tests.hil.machine import TIMEOUT_S
from tests.hil.running import running

pytestmark = [
    pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels"), pytest.mark.asyncio(loop_scope="session"),
]  # fmt: skip

REFUSED = r"WebSocket connection to .* failed|Failed to load resource"
BACKWARDS_M_S = -0.05
AGAIN_S = 5.0
"""After so long without a change an operator tries again, s."""
NEAR_M = 0.1
KNOWN_DRUMS = f"""run.state.objects.filter((o) => o.model === 'drum'
    && run.session.truth.drums.some(([x, y]) => Math.hypot(o.x - x, o.y - y) < {NEAR_M})).length"""
"""Recognised where they are."""


async def drives(robot: Run, opened: Opened, expression: str, what: str) -> None:
    """Wait until an expression of the page is true; re-arm the robot meanwhile if it was stopped."""
    end_s = time.monotonic() + TIMEOUT_S
    while not await opened.world(f"Boolean({expression})"):
        assert time.monotonic() < end_s, (what, robot.command.modes(), robot.command.err)
        await opened.world("run.state.mode === 'SAFE_STOP' && connection.send({ type: 'arm' })")
        await asyncio.sleep(0.05)


async def drive_backwards(robot: Run, opened: Opened) -> None:
    """Hold the pad until the base drives backwards, and go on holding it."""
    end_s = time.monotonic() + TIMEOUT_S
    while True:
        await drives(robot, opened, "run.state.mode === 'DRIVE'", "DRIVE")
        pressed = robot.truth.read()[-1]
        await press_pad(opened, 0.0, -0.6)
        while await opened.world("teleoperation.holding"):
            if any(row.v < BACKWARDS_M_S for row in robot.truth.since(pressed.t_s)):
                return
            assert time.monotonic() < end_s, "the base never drove backwards"
            await asyncio.sleep(0.01)
        await opened.page.mouse.up()
        assert time.monotonic() < end_s, "the base never drove backwards"


async def delete(opened: Opened, chosen: list[int]) -> None:
    """Delete segments, again where a page that was kept waiting lost its connection, and with it the selection."""

    again_s = time.monotonic()

    async def are_gone() -> bool:
        nonlocal again_s
        left = await opened.world(f"{json.dumps(chosen)}.filter((n) => run.segments.has(n))")
        if left and time.monotonic() >= again_s:
            again_s = time.monotonic() + AGAIN_S
            await opened.world(f"selection.choose({json.dumps(left)})")
            await opened.page.keyboard.press("Delete")
        return not left

    await until(are_gone, "segments that are gone")


async def edit_the_map(opened: Opened) -> None:
    """Delete and pin segments, confirm and reject an object, and place a model."""
    page = opened.page
    await opened.steady()
    await page.keyboard.press("2")
    await page.locator("#map-front").focus()
    await page.keyboard.press("a")
    chosen = await opened.world("[...selection.segments].slice(0, 12)")
    await opened.world(f"selection.choose({json.dumps(chosen)})")
    await page.keyboard.press("p")
    await opened.until(f"{json.dumps(chosen)}.some((n) => run.segments.get(n)?.pinned)", "pins")
    await delete(opened, chosen)

    await page.locator("#objects li", has_text="drum").first.click()  # what no model explains cannot be confirmed
    await opened.says("#evidence", "for it")
    await opened.save_screenshot("evidence")
    number = await opened.world("selection.object")
    await page.get_by_role("button", name="Confirm").click()
    await opened.says("#toasts", "confirmed")
    await page.get_by_role("button", name="Reject").click()
    await opened.until(f"!run.state.objects.some((o) => o.number === {number})", "an object that is gone")

    await page.keyboard.press("4")
    await page.mouse.click(*await opened.screen(1.5, 0.9))
    await opened.says("#toasts", "placed")
    await page.keyboard.press("1")


async def tune_and_send_away(opened: Opened) -> None:
    """Change a gain, be refused another, set a goal, undo, and clear the map."""
    page = opened.page
    await opened.tab("Drive")
    gain = page.locator("#drive-gains").get_by_label("avoid obstacle gain")
    await gain.fill("0.7")
    await gain.press("Enter")
    await expect(page.locator("#drive-gains .changed")).to_have_count(1)
    await gain.fill("-5")
    await gain.press("Enter")
    await expect(gain).to_have_attribute("aria-invalid", "true")
    await page.locator("#goal-x").fill("1")
    await page.locator("#goal-y").fill("0")
    await page.locator("#goal-y").press("Enter")
    await opened.says("#drive-request-text", "goal at 1.00, 0.00")
    await opened.tab("Tune")
    await page.get_by_role("button", name="Undo").click()
    await expect(page.locator("#drive-gains .changed")).to_have_count(0)
    await opened.tab("Objects")
    await page.get_by_role("button", name="Clear the map…").click()
    before_s = await opened.world("run.state.robot_s")
    await page.get_by_role("button", name="Clear the map", exact=True).click()
    await opened.until(f"[...run.segments.values()].every(({{ t }}) => t > {before_s})", "a map without old segments")


async def test_an_operator_watches_edits_drives_halts_and_is_lost(tmp_path: Path, opener: Opener) -> None:
    """Operate one run from its start to its end, then replay it: every action comes out bit-identically."""
    async with run(tmp_path, opener) as robot:
        wrong = robot.url.split("token=", maxsplit=1)[0] + "token=" + "A" * 22
        stranger = await opener.open(wrong, live=False, real_time=True, drawn_seldom=True, expected_errors=REFUSED)
        await stranger.says("#banner-connection", "token is missing or wrong")
        assert not await stranger.world("run.fresh")
        await stranger.page.close()

        opened = await opener.open(robot.url, real_time=True, drawn_seldom=True)
        await drives(robot, opened, f"{KNOWN_DRUMS} >= 3 && run.segments.size > 30", "something to handle")
        assert await opened.world("run.state.ranges.some((r) => r > 0)")
        await drives(robot, opened, "run.chart.length > 10", "a chart of some seconds")
        await opened.save_screenshot("drums")
        await edit_the_map(opened)
        await tune_and_send_away(opened)

        await opened.page.keyboard.press("Space")
        await robot.sees(lambda now: bool(now.flags & Flags.LATCHED) and now.still, "a base that halts")
        await opened.says("#mode-name", "SAFE STOP")
        await opened.page.locator("#banner-stopped").get_by_role("button", name="Re-arm").click()

        await drive_backwards(robot, opened)
        await opened.crash()
        lost = robot.truth.read()[-1]
        await robot.sees(
            lambda now: now.t_s > lost.t_s + 1.0 and all(row.still for row in robot.truth.since(now.t_s - 1.0)),
            "a base that stands for a second",
        )

        robot.command.process.terminate()
        assert await asyncio.to_thread(robot.command.end) == 0
    with running(tmp_path, "replay", "replay", str(robot.recording), "--verify") as replay:
        code = await asyncio.to_thread(replay.end)
        assert code == 0, replay.out + replay.err
