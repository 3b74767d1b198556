"""The fleet page on three emulated runs: HALT one, HALT all, and a frozen run is shown as not confirmed."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import time
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from playwright.async_api import Locator, Page, expect

from runtime.bridges.fleet import Fleet
from runtime.bridges.fleet_server import serve_fleet
from runtime.cycle.modes import NOT_HALTED
from tests.browser.open_page import PHONE, Opener, until
from tests.browser.real_run import Run, run
from tests.hil.machine import TIMEOUT_S
from tests.hil.running import ARM_AGAIN_S

pytestmark = [
    pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels"), pytest.mark.asyncio(loop_scope="session"),
]  # fmt: skip

HALTS_MAX = 10
"""A busy machine may have stopped the robot by itself just before a HALT comes; it does not do so ten times."""
UNCONFIRMED = "HALT not confirmed: use the robot's own stop"


@contextlib.asynccontextmanager
async def fleet_page(runs: list[Run]) -> AsyncIterator[str]:
    """Serve the fleet page of these runs; yield its address."""
    lines: asyncio.Queue[str] = asyncio.Queue()
    fleet = Fleet(time.monotonic, list)
    urls = [one.url for one in runs]
    serving = asyncio.create_task(serve_fleet(fleet, "127.0.0.1", 0, urls, lines.put_nowait))
    try:
        yield (await asyncio.wait_for(lines.get(), TIMEOUT_S)).removeprefix("fleet: ")
    finally:
        serving.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await serving


async def test_halt_one_halt_all_and_a_frozen_run(tmp_path: Path, opener: Opener) -> None:
    async with contextlib.AsyncExitStack() as stack:
        runs = []
        for name in ("one", "two", "three"):
            (tmp_path / name).mkdir()
            runs.append(await stack.enter_async_context(run(tmp_path / name, opener)))
        url = await stack.enter_async_context(fleet_page(runs))
        opened = await opener.open(url, real_time=True, drawn_seldom=True, live=False)
        await operate(opened.page, runs)
        await opened.save_screenshot("fleet")


async def test_the_page_fits_a_phone(opener: Opener) -> None:
    async with fleet_page([]) as url:
        opened = await opener.open(url, PHONE, real_time=True, drawn_seldom=True, live=False)
        await expect(opened.page.locator("#fleet-none")).to_be_visible()
        await opened.save_screenshot("fleet-phone")
        wide = await opened.page.evaluate(
            "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        )
        assert wide == 0
        for part in ("#halt-all", "#fleet-url", "#fleet-add button"):
            box = await opened.page.locator(part).bounding_box()
            assert box is not None
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= PHONE[0]


async def test_a_halt_that_was_not_sent_stays_said_until_one_is(opener: Opener) -> None:
    async with fleet_page([]) as url:
        opened = await opener.open(
            url, real_time=True, drawn_seldom=True, live=False, expected_errors="Failed to load resource"
        )
        page, alarm = opened.page, opened.page.locator("#fleet-alarm")
        await page.route("**/halt", lambda route: route.fulfill(status=500, body="broken"))
        await page.locator("#halt-all").click()
        await expect(alarm).to_contain_text("HALT was not sent (broken)")
        await asyncio.sleep(0.5)  # the page has asked for the runs again, and got them
        await expect(alarm).to_contain_text("HALT was not sent (broken)")
        await page.unroute("**/halt")
        await page.locator("#halt-all").click()
        await expect(alarm).to_be_hidden()


async def drives(one: Run, card: Locator) -> None:
    """Arm a robot until the page shows that it drives; a busy machine may stop any robot at any time."""

    async def does() -> bool:
        mode = await card.get_attribute("data-mode")
        if mode == "FAULT" and any(event.get("reason") == NOT_HALTED for event in one.command.events()):
            pytest.skip("the machine was too busy for an emulated robot to halt in time, which ends its drives")
        if mode in {"READY", "SAFE_STOP"}:
            one.command.signal(signal.SIGUSR1)
            await asyncio.sleep(ARM_AGAIN_S)
        return mode == "DRIVE"

    await until(does, "a robot that drives")


def stops(one: Run) -> int:
    """Return how often a run has stopped its robot so far."""
    return one.command.modes().count("SAFE_STOP")


async def stopped_again(one: Run, before: int) -> bool:
    return stops(one) > before


def was_halted(one: Run) -> bool:
    """Whether the log of a run has an operator's halt."""
    return any("halted by the operator" in str(event.get("reason")) for event in one.command.events())


async def cards(page: Page) -> list[Locator]:
    """Return the cards in the order of the runs."""
    return await page.locator("#fleet-runs > li").all()


async def operate(page: Page, runs: list[Run]) -> None:
    await expect(page.locator("#fleet-runs > li")).to_have_count(3)
    first, second, third = await cards(page)
    for _ in range(HALTS_MAX):
        await drives(runs[0], first)
        before = stops(runs[0])
        await first.get_by_role("button", name="HALT").click()
        await expect(first.locator(".halt-state")).to_have_text("HALT confirmed")
        assert await first.get_attribute("data-mode") == "SAFE_STOP"
        await expect(first.locator(".mode-word")).to_have_text("SAFE STOP")  # as on its own page
        await until(lambda before=before: stopped_again(runs[0], before), "a stop in the log")  # type: ignore[misc]
        if was_halted(runs[0]):
            break
    assert [was_halted(one) for one in runs] == [True, False, False]

    frozen = runs[2].command
    frozen.signal(signal.SIGSTOP)
    try:
        await page.locator("#halt-all").click()
        await expect(third.locator(".halt-state")).to_have_text(UNCONFIRMED)
        await expect(page.locator("#fleet-alarm")).to_contain_text("HALT not confirmed")
        await expect(second.locator(".halt-state")).to_have_text("HALT confirmed")
    finally:
        frozen.signal(signal.SIGCONT)
    await expect(third.locator(".halt-state")).to_have_text("HALT confirmed")
    await expect(page.locator("#fleet-alarm")).to_be_hidden()
