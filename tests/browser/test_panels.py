"""What the page says beside the map: units, object list, ring, charts, facts, log."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.browser.fake_server import FakeServer
from tests.browser.open_page import Opener
from tests.browser.synthetic_run import DRUMS, Hall

pytestmark = pytest.mark.asyncio(loop_scope="session")

MARKS = """() => {
    const canvas = document.getElementById('phases');
    const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, 12).data;
    let inked = 0;
    for (let i = 3; i < data.length; i += 4) inked += data[i] > 200 ? 1 : 0;
    return inked;
}"""


async def test_objects_are_listed_as_text_in_feet_or_metres(server: FakeServer, opener: Opener) -> None:
    server.cycle = 170
    opened = await opener.open(server.url)
    page = opened.page
    rows = page.locator("#objects li")
    await expect(rows).to_have_count(6)
    await expect(rows.nth(0)).to_contain_text("drum")
    await expect(rows.nth(0)).to_contain_text("97 %")
    await expect(rows.nth(0)).to_contain_text("± 0.013 ft")
    await page.locator("#objects").focus()
    await page.keyboard.press("ArrowDown")
    await page.keyboard.press("ArrowDown")
    assert await server.wait("evidence", 2) == {"object": 2}
    await expect(page.locator("#object-name")).to_have_text("2 drum")
    await opened.says("#object-facts", "95 % ellipse")
    await opened.says("#evidence", "21.4 nats")
    await opened.says("#evidence", "2.4 nats")
    await opened.says("#evidence", "3 of them against")
    await opened.save_screenshot("picked")

    x = DRUMS[0][0] + 0.01
    await opened.says("#objects", f"{x / 0.3048:.2f}, ")
    await page.get_by_role("button", name="Units: feet").click()
    await opened.sync()
    await opened.says("#objects", f"{x:.2f}, ")
    await page.keyboard.press("u")
    await expect(page.locator("#units")).to_have_text("ft")


@pytest.mark.parametrize("hall", [Hall(segments=60, objects=12)], ids=["walls"])
async def test_objects_without_a_model_are_shown(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await expect(opened.page.locator("#objects li")).to_have_count(12)
    await opened.says("#objects", "wall")
    await opened.save_screenshot("walls")


async def test_ring_charts_and_facts(server: FakeServer, opener: Opener) -> None:
    server.cycle = 160
    opened = await opener.open(server.url)
    await server.advance(9)
    await opened.sync()
    assert await opened.world("run.chart.every((one) => one.missed === 0)")
    server.recording = {"file": "runs/now.mcap", "bytes": 1_200_000, "dropped": 2}
    await server.advance(2)
    await opened.sync()
    await opened.drawn()
    await opened.says("#ring-text", "nearest")
    await opened.says("#ring-text", "not trusted: 17 (weak)")
    for phase in ("gather", "perceive", "decide", "command", "refine", "observers"):
        await opened.says("#phases-legend", phase)
    await opened.says("#late-legend", "1 missed")
    await opened.says("#late-legend", "then no time left")
    assert await opened.world("run.chart.filter((one) => one.missed === 1).length") == 1
    assert await opened.page.evaluate(MARKS) > 10, "a miss has no mark above its column"
    await opened.says("#fact-link", "1 / 0")
    server.flags = ["BUMPER"]
    await opened.says("#fact-flags", "bumper")
    await opened.says("#fact-place", "± 0.6°, tracking")
    await expect(opened.page.locator("#place")).to_be_visible()
    await opened.says("#fact-recording", "2 lost")
    await opened.says("#mode-name", "DRIVE")


async def test_the_log_can_be_searched_and_is_never_markup(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    for n, level in enumerate(("debug", "info", "warning", "error")):
        await server.send({"type": "log", "timestamp": 1.5 + n, "level": level, "event": f"event {level}",
                           "fields": {"name": "<img src=x onerror=alert(1)>"}})  # fmt: skip
    await opened.tab("Log")
    lines = opened.page.locator("#log li")
    await expect(lines).to_have_count(3)
    await expect(lines.nth(0)).to_contain_text("■ error")
    await expect(lines.nth(0)).to_contain_text("<img")
    assert await opened.page.locator("#log img").count() == 0
    await opened.page.locator("#log-level").select_option("debug")
    await expect(lines).to_have_count(4)
    await opened.page.locator("#log-filter").fill("warning")
    await expect(lines).to_have_count(1)
