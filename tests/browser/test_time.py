"""The time panel: pause, single step, speed, recording, playback."""

from __future__ import annotations

import pytest
from PIL import Image
from playwright.async_api import expect

from tests.browser.fake_server import FakeServer
from tests.browser.open_page import Opener
from tests.browser.synthetic_run import greeting

pytestmark = pytest.mark.asyncio(loop_scope="session")


@pytest.mark.promise("P31")
async def test_pause_single_step_speed_record_and_bookmark(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    await opened.tab("Time")
    await page.get_by_role("button", name="Pause").click()
    assert await server.wait("pause") == {}
    await opened.says("#time-text", "paused")
    await opened.says("#mode-name", "PAUSED")
    await opened.says("#mode-robot", "the robot: DRIVE")
    await page.get_by_role("button", name="One cycle", exact=True).click()
    assert await server.wait("single_step") == {}
    await page.locator("#map-front").focus()
    await page.keyboard.press("k")
    await server.wait("resume")
    await page.locator("#speed").select_option("4")
    assert await server.wait("set_speed") == {"factor": 4}
    await opened.says("#time-text", "× 4")
    await server.advance(140)  # of the synthetic run, whose clocks go alike
    await opened.says("#time-text", "(this machine reaches × 1.0)")

    record = page.get_by_role("button", name="Record", exact=True)
    await record.click()
    assert await server.wait("record") == {"on": True}
    await expect(record).to_have_attribute("aria-pressed", "true")
    await opened.says("#record-text", "now.mcap")
    await page.get_by_label("Bookmark", exact=True).first.fill("here it slipped")
    await page.keyboard.press("Enter")
    assert await server.wait("bookmark") == {"text": "here it slipped"}
    await expect(page.locator("#bookmark-text")).to_have_value("")
    await record.click()
    assert await server.wait("record", 2) == {"on": False}


async def test_a_robot_on_a_port_cannot_be_paused(server: FakeServer, opener: Opener) -> None:
    server.session = greeting(emulated=False, truth=None)
    opened = await opener.open(server.url)
    await opened.tab("Time")
    for name in ("Pause", "One cycle"):
        await expect(opened.page.get_by_role("button", name=name, exact=True)).to_be_disabled()


@pytest.mark.promise("P31")
async def test_a_recording_is_opened_scrubbed_played_and_left(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    await opened.tab("Time")
    await page.locator("#recordings").select_option("2026-01-02-first.mcap")
    await page.get_by_role("button", name="Open").click()
    assert await server.wait("open_recording") == {"file": "2026-01-02-first.mcap"}
    await opened.says("#banner-playback", "This is a recording, not the live run: 2026-01-02-first.mcap")
    await opened.says("#mode-name", "PLAYBACK")
    await opened.says("#mode-robot", "the robot: DRIVE")
    await opened.says("#time-text", "the robot then in DRIVE")
    await opened.says("#fact-link", "not recorded")
    await expect(page.locator("#fact-clients")).to_have_text("1")
    await expect(page.locator("#record")).to_be_disabled()
    await opened.says("#robot-name", "older")
    await page.locator("#scrub").focus()
    await page.keyboard.press("ArrowRight")
    assert (await server.wait("seek_recording"))["s"] == pytest.approx(0.05)
    await page.keyboard.press("End")
    await opened.says("#scrub-value", "21.5 s")
    await page.get_by_role("button", name="✎ the corner").click()
    await opened.says("#scrub-value", "4.5 s")
    assert server.of("seek_recording")[-1]["s"] == 4.5
    await page.get_by_role("button", name="SAFE STOP: bumper contact").click()
    await opened.says("#scrub-value", "9.0 s")
    await page.locator("#play-speed").select_option("4")
    await page.get_by_role("button", name="Play", exact=True).click()
    assert await server.wait("play_recording") == {"speed": 4}
    server.playback = {"s": 9.0, "is_playing": True, "speed": 4.0}
    await opened.says("#time-text", "2026-01-02-first.mcap, × 4:")
    server.playback = {"s": 13.0, "is_playing": True, "speed": 4.0}
    await opened.sync()
    await page.clock.fast_forward(4000)  # at once: the pace is measured at whatever time a message comes
    await opened.sync()
    await opened.says("#time-text", "× 4 (this machine reaches × 1.0)")
    await opened.says("#fact-age", "a recording")
    await opened.drawn()
    await expect(page.locator("#phases-legend")).to_have_text("not recorded")
    for tool in ("goal", "route", "move", "place"):
        await expect(page.locator(f"#tool-{tool}")).to_be_disabled()
    await page.get_by_role("button", name="Hold").click()
    assert await server.wait("play_recording", 2) == {"speed": 0}
    await page.get_by_role("button", name="On one cycle").click()
    assert await server.wait("step_recording") == {"cycles": 1}
    await page.get_by_role("button", name="Back one cycle").click()
    assert await server.wait("step_recording", 2) == {"cycles": -1}
    await opened.save_screenshot("recording")
    await page.keyboard.press("Space")
    await server.wait("halt")  # HALT means the robot, whatever is looked at
    await opened.says("#mode-name", "PLAYBACK")
    await opened.says("#mode-robot", "the robot: SAFE STOP")
    await opened.says("#announce", "playback, the robot: SAFE STOP: halted by the operator")
    await opened.says("#banner-stopped", "The robot itself: stopped: halted by the operator")
    await expect(page.locator("#banner-stopped button")).to_have_count(0)
    await page.locator("#banner-playback").get_by_role("button", name="Back to the live run").click()
    await server.wait("close_recording")
    await expect(page.locator("#banner-playback")).to_have_count(0)
    await expect(page.locator("#playback")).to_be_hidden()
    await opened.says("#robot-name", "denning")
    await expect(page.locator("#mode-name")).to_have_text("SAFE STOP")
    await opened.tab("Drive")
    await expect(page.locator("#arm")).to_be_enabled()


async def test_teleoperation_is_refused_while_a_recording_is_shown(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    server.playback = {"s": 1.0, "is_playing": False, "speed": 1.0}
    await opened.says("#banner-playback", "not the live run")
    await opened.tab("Drive")
    await opened.page.locator("#pad").focus()
    await opened.page.keyboard.press("ArrowUp")
    await opened.says("#toasts", "a recording is shown")
    await opened.sync()
    assert not server.of("teleoperate")
    await opened.steady()
    await opened.page.locator("#map-front").focus()
    for key in ("2", "a", "Delete", "Shift+A"):
        await opened.page.keyboard.press(key)
    await opened.says("#toasts", "go back to the live run first")
    await opened.sync()
    assert not server.of("delete_segments"), "the recording's numbers are not the live map's"
    assert not server.of("arm")


async def test_a_screenshot_and_the_report_are_saved(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await opened.steady()
    await opened.tab("Time")
    async with opened.page.expect_download() as saved:
        await opened.page.get_by_role("button", name="Screenshot").click()
    download = await saved.value
    assert download.suggested_filename.startswith("echolocate-")
    image = Image.open(await download.path()).convert("RGB")
    width, height = await opened.world("[view.width, view.height]")
    assert image.size == (2 * width, 2 * (height + 34))
    colours = image.getcolors(maxcolors=1 << 24)
    assert colours is not None
    assert len(colours) > 200, "the picture is empty"

    await opened.page.get_by_role("button", name="Report", exact=True).click()
    assert (await server.wait("make_files"))["kind"] == "report"
    await expect(opened.page.locator("#panel-files")).to_be_visible()
