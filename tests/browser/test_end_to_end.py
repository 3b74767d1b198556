"""The page on a real process with an emulated base: an action on the page has its effect on the base."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from playwright.async_api import expect

from drivers.messages import Flags
from tests.browser.open_page import Opened, Opener
from tests.hil.machine import TIMEOUT_S, stalls_excused
from tests.hil.running import Running, running, start_url
from tests.hil.truth import Row, Truth

pytestmark = [
    pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels"), pytest.mark.asyncio(loop_scope="session"),
]  # fmt: skip

CYCLE_S = 0.05
SLACK_S = 0.01
ATTEMPTS = 8
"""A machine that delays a key event but not its control does not do so eight times in a row."""
HALTS = 3
TURN_S = 0.002

STAMP = """addEventListener('keydown', (event) => {
  if (event.key === ' ') window.pressedAt = performance.timeOrigin + performance.now();
}, { capture: true });"""


@dataclass
class Run:
    """A running process, the address of its page, and the true state of its base."""

    command: Running
    url: str
    truth: Truth
    recording: Path

    async def sees(self, done: Callable[[Row], bool], what: str) -> Row:
        """Wait until the true state of the base fulfils a condition."""
        return await asyncio.to_thread(self.truth.wait, done, what)


@contextlib.asynccontextmanager
async def run(folder: Path, opener: Opener) -> AsyncIterator[Run]:
    trace, recording = folder / "trace.csv", folder / "run.mcap"
    more = ["--set", "console.port=0", "--trace", str(trace), "--record", str(recording)]
    with running(folder, "run", "run", *more) as command:
        url = await asyncio.to_thread(start_url, command)
        try:
            yield Run(command, url, Truth(trace), recording)
        finally:
            await opener.leave()  # before the server goes: no page reports that


@pytest.fixture(autouse=True)
def _no_fault(tmp_path: Path) -> Iterator[None]:
    yield
    for err in tmp_path.glob("**/*.err"):
        assert "Traceback" not in err.read_text("utf-8")


@stalls_excused
async def test_the_page_shows_six_recognised_drums(tmp_path: Path, opener: Opener) -> None:
    began_s = time.monotonic()
    async with run(tmp_path, opener) as robot:
        opened = await opener.open(robot.url)
        rows = opened.page.locator("#objects .name", has_text="semicircle")  # what the paper calls a drum
        await expect(rows).to_have_count(6, timeout=1000 * TIMEOUT_S)
        assert time.monotonic() - began_s < TIMEOUT_S
        await opened.says("#mode-name", "DRIVE")
        truth = await opened.world("run.session.truth.drums")
        known = await opened.world("run.state.objects.filter((o) => o.model === 'semicircle').map((o) => [o.x, o.y])")
        for x, y, _ in truth:
            assert min(abs(x - kx) + abs(y - ky) for kx, ky in known) < 0.1
        assert await opened.world("run.segments.size") > 20
        assert await opened.world("run.state.ranges.some((r) => r > 0)")
        assert await opened.world("run.chart.length") > 10
        await opened.save_screenshot("six-drums")


@stalls_excused
async def test_a_wrong_token_shows_nothing(tmp_path: Path, opener: Opener) -> None:
    async with run(tmp_path, opener) as robot:
        wrong = robot.url.split("token=", maxsplit=1)[0] + "token=" + "A" * 22
        opened = await opener.open(wrong, live=False)
        await opened.says("#banner-connection", "token is missing or wrong")
        assert not await opened.world("run.fresh")
        opened.errors.clear()  # the browser's own words on the refusal


@dataclass
class Oversleep:
    """The longest delay of a sleep: a control for time that the machine took from all processes."""

    worst_s: float = 0.0

    async def work(self) -> None:
        while True:
            before_s = time.monotonic()
            await asyncio.sleep(TURN_S)
            self.worst_s = max(self.worst_s, time.monotonic() - before_s - TURN_S)


async def halted_after(robot: Run, opened: Opened) -> tuple[float, float]:
    """Press the space bar; return the delay until the base latched, and the control's delay, s."""
    unix_minus_host_s = time.time() - time.monotonic()
    oversleep = Oversleep()
    control = asyncio.create_task(oversleep.work())
    await opened.page.keyboard.press("Space")
    await robot.sees(lambda now: bool(now.flags & Flags.LATCHED), "a base that halts")
    control.cancel()
    pressed_s = await opened.page.evaluate("() => window.pressedAt") / 1000.0 - unix_minus_host_s
    latched = next(row for row in robot.truth.rows if row.host_s > pressed_s and row.flags & Flags.LATCHED)
    return latched.host_s - pressed_s, oversleep.worst_s


@stalls_excused
async def test_the_space_bar_halts_the_base_in_time(
    tmp_path: Path, opener: Opener, measured: Callable[[str], None]
) -> None:
    waits: list[float] = []
    async with run(tmp_path, opener) as robot:
        opened = await opener.open(robot.url, script=STAMP)
        failed = 0
        while len(waits) < HALTS:
            await robot.sees(lambda now: now.driving, "a base that drives")
            waited_s, taken_s = await halted_after(robot, opened)
            await robot.sees(lambda now: now.still, "a base that stands")
            await opened.says("#mode-name", "SAFE STOP")
            failed = failed + 1 if waited_s > CYCLE_S + SLACK_S + taken_s else 0
            assert failed < ATTEMPTS, f"HALT took {1e3 * waited_s:.0f} ms (control {1e3 * taken_s:.0f})"
            if failed == 0:
                waits.append(waited_s)
            await opened.page.locator("#banner-stopped").get_by_role("button", name="Re-arm").click()
        await robot.sees(lambda now: now.driving, "a base that drives again")
        measured(f"{HALTS} times from the key to the base's latch, at worst {1e3 * max(waits):.0f} ms")


@pytest.mark.parametrize("loss", ["close", "crash"])
@stalls_excused
async def test_a_lost_page_stops_the_base(
    tmp_path: Path, opener: Opener, loss: str, measured: Callable[[str], None]
) -> None:
    async with run(tmp_path, opener) as robot:
        opened = await opener.open(robot.url)
        await robot.sees(lambda now: now.driving, "a base that drives")
        page = opened.page
        await opened.tab("Drive")
        box = await page.locator("#pad").bounding_box()
        assert box is not None
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        await page.mouse.move(x, y)
        await page.mouse.down()
        await page.mouse.move(x, y + 50, steps=4)
        backward = await robot.sees(lambda now: now.v < -0.05, "a base that is driven backwards")
        await robot.sees(lambda now: now.t_s > backward.t_s + 0.5 and now.v < -0.05, "that goes on")
        if loss == "close":
            lost_s = time.monotonic()
            await page.close()
        else:
            chrome = await page.context.new_cdp_session(page)
            lost_s = time.monotonic()
            with contextlib.suppress(Exception):
                await asyncio.wait_for(chrome.send("Page.crash"), 2.0)
        stood = await robot.sees(lambda now: now.still, "a base that stands")
        await robot.sees(lambda now: now.t_s > stood.t_s + 1.0, "more of the trace")
        assert all(row.still for row in robot.truth.since(stood.t_s)), "it moved again by itself"
        first = next(row for row in robot.truth.rows if row.host_s > lost_s and row.still)
        measured(f"{loss}: the base stood {1e3 * (first.host_s - lost_s):.0f} ms later")
        assert first.host_s - lost_s < 1.0


@stalls_excused
async def test_operator_actions_are_replayed_bit_identically(tmp_path: Path, opener: Opener) -> None:
    async with run(tmp_path, opener) as robot:
        opened = await opener.open(robot.url)
        page = opened.page
        await opened.until("run.state.objects.length >= 3 && run.segments.size > 30", "something to handle")
        await opened.steady()

        await page.keyboard.press("2")
        await page.locator("#map-front").focus()
        await page.keyboard.press("a")
        chosen = await opened.world("[...selection.segments].slice(0, 12)")
        await opened.world(f"selection.choose({json.dumps(chosen)})")
        await page.keyboard.press("p")
        await opened.until(f"{json.dumps(chosen)}.some((n) => run.segments.get(n)?.pinned)", "pins")
        await page.keyboard.press("Delete")
        await opened.until(f"{json.dumps(chosen)}.every((n) => !run.segments.has(n))", "segments that are gone")

        await page.locator("#objects li").first.click()
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
        await page.get_by_role("button", name="Clear the map", exact=True).click()
        await opened.until("run.state.objects.length < 2", "a map that is empty")
        await page.keyboard.press("Space")
        await robot.sees(lambda now: now.still, "a base that stands")
        robot.command.process.terminate()
        assert await asyncio.to_thread(robot.command.end) == 0
        await opened.says("#banner-connection", "No connection")
        await page.close()
        opened.errors.clear()  # of a server that is gone
    with running(tmp_path, "replay", "replay", str(robot.recording), "--verify") as replay:
        code = await asyncio.to_thread(replay.end)
        assert code == 0, replay.out + replay.err
