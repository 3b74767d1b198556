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
    await opened.says("#evidence", "odds × more than a million")
    await opened.says("#evidence", "odds × 11")
    await opened.says("#evidence", "3 of them against")
    await opened.save_screenshot("picked")

    x = DRUMS[0][0] + 0.01
    await opened.says("#objects", f"{x / 0.3048:.2f}, ")
    await page.get_by_role("button", name="Units: feet").click()
    await opened.sync()
    await opened.says("#objects", f"{x:.2f}, ")
    await page.keyboard.press("u")
    await expect(page.locator("#units")).to_have_text("ft")


@pytest.mark.parametrize("hall", [Hall(segments=60, walls=((1.5, 0.8, 2.7, 0.8),))], ids=["wall"])
async def test_a_wall_is_an_object_and_what_it_hides_is_not_certain(server: FakeServer, opener: Opener) -> None:
    server.cycle = 170
    server.deleted = set(range(1, 61))
    opened = await opener.open(server.url)
    page = opened.page
    await opened.steady()
    await expect(page.locator("#objects-count")).to_have_text("6, and 1 wall")
    wall = page.locator("#object-101")
    await expect(wall).to_contain_text("98 %")
    await expect(wall).to_contain_text("3.94 ft long")
    await expect(page.locator("#object-1")).to_contain_text("hidden")
    await expect(page.locator("#object-2")).to_contain_text("97 %")
    await page.locator("#object-1").click()
    await expect(page.locator("#objects")).not_to_contain_text("°")  # a disc has no heading
    await expect(page.locator("#object-facts")).not_to_contain_text("turned by")
    await opened.says("#object-facts", "behind wall 101, where no reading checks it; before: probability 97 %")
    before = await opened.picture()

    await page.locator("#tool-select").click()
    await page.mouse.click(*await opened.screen(1.7, 0.82))
    await expect(page.locator("#object-name")).to_have_text("101 wall")
    assert await opened.picture() != before, "the picked wall looks like any other"
    await opened.says("#object-facts", "4.92, 2.62 to 8.86, 2.62 ft")
    await opened.says("#object-facts", "± 0.2°")
    for name in ("Confirm", "Move and turn"):
        await expect(page.get_by_role("button", name=name, exact=True)).to_be_hidden()
    await opened.save_screenshot("wall")
    await page.get_by_role("button", name="Reject").click()
    assert await server.wait("reject_object") == {"object": 101}
    assert [m["object"] for m in server.of("evidence")] == [1], "a wall has no readings to list"

    server.refusals["evidence"] = ("object 2 no longer exists", None)
    await page.locator("#object-2").click()
    await opened.says("#evidence", "no longer exists")
    for _ in range(3):
        await opened.run_for(1500)
        await server.advance()
        await opened.sync()
    assert [m["object"] for m in server.of("evidence")] == [1, 2], "what was refused is not asked again each second"


async def test_ring_charts_and_facts(server: FakeServer, opener: Opener, monkeypatch: pytest.MonkeyPatch) -> None:
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
    await opened.says("#ring-text", "not trusted: 17 (failing)")
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
    frame = server.hall.frame
    unsure = frame(0)["localized"] | {"status": "localizing", "probability": 0.03}
    monkeypatch.setattr(server.hall, "frame", lambda cycle: frame(cycle) | {"localized": unsure})
    await opened.says("#fact-place", "unknown, localizing 3 %")


async def test_the_log_can_be_searched_and_is_never_markup(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    for level in ("debug", "info", "warning", "error"):
        await server.send({"type": "log", "timestamp": "", "level": level, "event": f"event {level}",
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
