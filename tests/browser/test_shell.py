"""What surrounds the panels: a layout that is kept, plots, warnings that reach a person, drive mode, the tour."""

from __future__ import annotations

import re
from typing import Any, Literal

import pytest
from playwright.async_api import expect

from tests.browser.fake_server import FakeServer
from tests.browser.open_page import Opened, Opener

pytestmark = pytest.mark.asyncio(loop_scope="session")

HANDHELD = (390, 844)
COUNT_TONES = """() => {
    window.tones = 0;
    class Gain { gain = { setValueAtTime() {}, exponentialRampToValueAtTime() {} }; connect(to) { return to; } }
    class Tone extends Gain { frequency = {}; start() { window.tones++; } stop() {} }
    window.AudioContext = class {
        currentTime = 0;
        async resume() {}
        createOscillator() { return new Tone(); }
        createGain() { return new Gain(); }
    };
}"""


async def size(opened: Opened, selector: str, side: Literal["width", "height"]) -> float:
    box = await opened.page.locator(selector).bounding_box()
    assert box is not None
    return box[side]


async def again(server: FakeServer, opened: Opened) -> None:
    """Load the page anew; it gets the control that it had."""
    server.controller = 2
    await opened.page.reload()
    await opened.until("run.fresh", "a state")


async def warn(server: FakeServer, level: str = "warning") -> None:
    await server.send({"type": "log", "timestamp": "", "level": level, "event": "a sensor hears less", "fields": {}})


async def test_layout_tool_tab_and_units_survive_a_reload(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    width, height = await size(opened, "#tabs", "width"), await size(opened, "#panel-cycle", "height")
    await page.locator("#split-panel").focus()
    await page.keyboard.press("ArrowLeft")
    await page.keyboard.press("ArrowLeft")
    assert await size(opened, "#tabs", "width") == pytest.approx(width + 48, abs=1)
    border = await page.locator("#split-cycle").bounding_box()
    assert border is not None
    await page.mouse.move(border["x"] + 300, border["y"] + 6)
    await page.mouse.down()
    await page.mouse.move(border["x"] + 300, border["y"] + 6 - 60)
    await page.mouse.up()
    assert await size(opened, "#panel-cycle", "height") == pytest.approx(height + 60, abs=1)
    await page.locator("#tool-goal").click()
    await opened.tab("Plot")
    await page.get_by_role("button", name="Units: feet").click()

    await again(server, opened)
    assert await size(opened, "#tabs", "width") == pytest.approx(width + 48, abs=1)
    assert await size(opened, "#panel-cycle", "height") == pytest.approx(height + 60, abs=1)
    await expect(page.locator("#tool-goal")).to_have_attribute("aria-checked", "true")
    await expect(page.locator("#panel-plot")).to_be_visible()
    await expect(page.locator("#units")).to_have_text("m")
    await expect(page.locator("#split-panel")).to_have_attribute("aria-valuenow", f"{round(width + 48)}")
    await page.locator("#split-panel").press("Enter")
    assert await size(opened, "#tabs", "width") == pytest.approx(width, abs=1)


async def test_any_number_is_plotted_live_and_in_a_recording(server: FakeServer, opener: Opener) -> None:
    server.cycle = 60
    opened = await opener.open(server.url)
    page = opened.page
    await opened.tab("Plot")
    await server.advance(20)
    await opened.run_for(1100)
    await server.advance(1)
    await page.locator("#plot-filter").fill("object 3")
    await page.get_by_label("object 3 probability").check()
    await page.locator("#plot-filter").fill("phase")
    await page.get_by_label("phase refine").check()
    await opened.sync()
    await opened.drawn()
    names = page.locator("#plot-lanes figcaption span")
    assert await names.all_inner_texts() == ["speed", "range 0", "object 3 probability", "phase refine"]
    values = page.locator("#plot-lanes figcaption b")
    await expect(values.nth(0)).to_have_text("0.98 ft/s")
    await expect(values.nth(3)).to_contain_text(" ms")
    await expect(values.nth(2)).to_have_text("0.98")
    await expect(page.locator("#plot-lanes canvas").nth(3)).to_have_attribute(
        "aria-label", re.compile(r"^phase refine: 2.* to 4.* ms in 30 s$")
    )
    await page.locator("#plot-at").focus()
    await page.keyboard.press("ArrowLeft")
    await opened.says("#plot-read", " s before")
    async with page.expect_download() as saved:
        await page.get_by_role("button", name="Save as CSV").click()
    lines = (await (await saved.value).path()).read_text("utf-8").splitlines()
    assert lines[0] == "robot_s,twist.v,ranges.0,objects.3.probability,phases.refine"
    assert len(lines) > 20
    assert all(len(line.split(",")[0].partition(".")[2]) <= 6 for line in lines), "microseconds"
    await page.get_by_role("button", name="Remove range 0").click()
    await opened.save_screenshot("plot")

    await again(server, opened)
    assert await names.all_inner_texts() == ["speed", "object 3 probability", "phase refine"]
    server.playback = {"s": 1.0, "is_playing": False, "speed": 1.0}
    for cycle in (30, 20, 25):  # as one scrubs
        server.cycle = cycle
        await opened.sync()
    await opened.drawn()
    await opened.save_screenshot("plot-recording")

    seen: dict[str, Any] = await opened.probe("history")
    assert seen["fields"] == [
        "pose.x", "pose.y", "pose.heading", "ranges.0", "paused", "cycle", "objects.7.probability",
        "objects.7.covariance.xx", "objects.7.covariance.xy", "objects.7.covariance.yy", "vectors.sum.x",
        "vectors.sum.y",
    ]  # fmt: skip
    assert seen["values"] == [3, 5, 9, 1, None, None, None]
    assert seen["count"] < 3500
    assert 150.0 <= seen["first"] <= 220.0, "half an hour of the past"
    assert seen["newest"][-1] - seen["newest"][0] == pytest.approx(99 / 20)
    assert [value for _, value in seen["around"]] == [-2, 30020], "one a second, and by time"


async def test_warnings_are_counted_until_the_log_is_looked_at(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    await page.evaluate(COUNT_TONES)
    for level in ("info", "warning", "error"):
        await warn(server, level)
    await expect(page.locator("#log-badge")).to_have_text("2")
    await expect(page).to_have_title("(2) DRIVE · denning · echolocate")
    await expect(page.locator("#tab-log")).to_have_attribute("title", "2 new warnings")
    assert await page.evaluate("tones") == 0, "silent unless one wants sounds"
    await opened.tab("Log")
    await expect(page.locator("#log-badge")).to_be_hidden()
    await expect(page).to_have_title("DRIVE · denning · echolocate")
    await page.get_by_label("sound at warnings and stops").check()
    assert await page.evaluate("tones") == 1
    await opened.tab("Objects")
    await opened.run_for(4000)
    await warn(server)
    await warn(server)
    await expect(page.locator("#log-badge")).to_have_text("2")
    assert await page.evaluate("tones") == 2, "one sound for many warnings"
    await opened.run_for(4000)
    server.mode, server.reason = "SAFE_STOP", "bumper contact"
    await opened.says("#mode-name", "SAFE STOP")
    assert await page.evaluate("tones") == 5


async def test_drive_mode_has_the_pad_beside_halt(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url, HANDHELD, touch=True)
    page = opened.page
    await page.get_by_role("tab", name="Drive").tap()
    await expect(page.locator("#pad")).to_be_in_viewport(ratio=1.0)  # without scrolling
    await page.get_by_role("button", name="Drive mode", exact=True).tap()
    for turned in (False, True):
        await page.set_viewport_size({"width": HANDHELD[turned], "height": HANDHELD[not turned]})
        await opened.until(f"innerWidth === {HANDHELD[turned]}", "the size")
        for part in ("#pad", "#halt", "#arm", "#disarm", "#mode", "#map", "#teleop-limit"):
            await expect(page.locator(part)).to_be_in_viewport(ratio=1.0)
        pad, halt = await page.locator("#pad").bounding_box(), await page.locator("#halt").bounding_box()
        assert pad is not None
        assert halt is not None
        assert pad["x"] + pad["width"] < halt["x"], "side by side"
        assert abs(pad["y"] + pad["height"] / 2 - halt["y"] - halt["height"] / 2) < 30
        assert await opened.probe("too_small") == []
        await opened.save_screenshot(f"drive-mode-{'side' if turned else 'upright'}")
    assert pad is not None
    touch = await page.context.new_cdp_session(page)
    spot = {"x": pad["x"] + pad["width"] / 2, "y": pad["y"] + 20}
    await touch.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [spot]})
    assert (await server.wait("teleoperate"))["v"] > 0.1
    await touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    await page.locator("#halt").tap()
    await server.wait("halt")

    await again(server, opened)
    await expect(page.locator("#dock #pad")).to_be_visible()
    await page.get_by_role("button", name="Leave drive mode").tap()
    await expect(page.locator("header #halt")).to_be_visible()
    await expect(page.locator("#panel-drive #pad")).to_be_visible()


async def test_the_tour_is_shown_once_and_leaves_halt_alone(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url, first_visit=True)
    page = opened.page
    card = page.get_by_role("dialog", name="HALT")
    await expect(card).to_be_visible()
    await page.locator("#halt").click()
    await server.wait("halt")
    await page.locator("#tour-next").focus()
    for _ in range(4):
        await page.keyboard.press("Enter")
    await opened.says("#tour-title", "To drive")
    await opened.says("#tour-count", "5 of 5")
    await page.get_by_role("button", name="Back").click()
    await opened.says("#tour-title", "Panels")
    await page.keyboard.press("Space")
    await server.wait("halt", 2)
    await page.keyboard.press("Escape")
    await expect(page.locator("#tour")).to_be_hidden()
    await again(server, opened)
    await expect(page.locator("#tour")).to_be_hidden()
    await opened.tab("Layers")
    await page.get_by_role("button", name="Tour").click()
    await expect(page.get_by_role("dialog", name="HALT")).to_be_visible()
    await page.get_by_role("button", name="Skip").click()
    await expect(page.locator("#tour")).to_be_hidden()
