"""What the page does not leave an operator to guess: what waits, what has started, what it may not do, and why."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.async_api import expect

from tests.browser.fake_server import TOKEN, FakeServer
from tests.browser.open_page import DESKTOP, PHONE, Opener
from tests.browser.synthetic_run import greeting

pytestmark = pytest.mark.asyncio(loop_scope="session")

LAPTOP = (1024, 768)
LONG = "a-robot-with-a-name-as-long-as-the-file-would-take-it"


async def test_edits_of_a_paused_run_say_that_they_wait(server: FakeServer, opener: Opener) -> None:
    server.paused = True
    server.holds = {"delete_segments", "lift_area"}
    opened = await opener.open(server.url)
    await opened.until("run.robot.paused", "the pause")
    await opened.world("void connection.request({ type: 'delete_segments', numbers: [1] })")
    await opened.says("#banners", "Paused: 1 edit of the map waits for the next cycle.")
    await opened.world("void connection.request({ type: 'lift_area', area: 1 })")
    await opened.says("#banners", "2 edits of the map wait")
    await opened.run_for(15_000)
    await expect(opened.page.locator("#toasts .toast")).to_have_count(0)
    await opened.save_screenshot("paused-edits")
    await opened.page.get_by_role("button", name="One cycle").first.click()
    await server.wait("single_step")
    await server.release()
    await expect(opened.page.locator("#banner-waiting")).to_have_count(0)


async def test_a_rejected_object_leaves_its_card(server: FakeServer, opener: Opener) -> None:
    server.cycle = 170
    opened = await opener.open(server.url)
    await opened.page.locator("#object-3").click()
    await expect(opened.page.locator("#object")).to_be_visible()
    await opened.page.locator("#object-reject").click()
    assert await server.wait("reject_object") == {"object": 3}
    await expect(opened.page.locator("#object")).to_be_hidden()


async def test_a_double_click_makes_one_bookmark(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await opened.tab("Time")
    await opened.page.locator("#bookmark-text").fill("the cupboard")
    await opened.page.get_by_role("button", name="Bookmark").dblclick()
    await opened.sync()
    assert [message["text"] for message in server.of("bookmark")] == ["the cupboard"]
    await opened.run_for(1000)
    await opened.page.get_by_role("button", name="Bookmark").click()
    await server.wait("bookmark", 2)


async def test_the_last_bookmark_is_taken_back_by_button_and_key(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await opened.tab("Time")
    server.data["undo_bookmark"] = "the cupboard"
    await opened.page.locator("#bookmark-undo").click()
    assert await server.wait("undo_bookmark") == {}
    await expect(opened.page.get_by_text("No longer bookmarked: the cupboard").first).to_be_visible()
    await opened.page.locator("#map-front").focus()
    await opened.page.keyboard.press("Control+z")
    await server.wait("undo_bookmark", 2)
    assert server.of("undo_edit") == []


async def test_lines_of_the_log_are_sentences(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await opened.tab("Log")
    for event, fields, said in (
        ("mode", {"mode": "DRIVE", "cycle": "5", "reason": "None"}, "Mode DRIVE (cycle 5)"),
        ("console refused", {"reason": "no such object", "client": "client 1 (::1)"},
         "Console refused: no such object (client 1 (::1))"),
        ("recording stopped", {"took_s": "1.5", "complete": "True"}, "Recording stopped (took 1.5 s, complete)"),
        ("the line is back", {}, "The line is back."),
    ):  # fmt: skip
        await server.send({"type": "log", "timestamp": "2026-01-02T10:11:12Z", "level": "info", "event": event,
                           "fields": fields})  # fmt: skip
        await opened.says("#log li:first-child", said)
    await opened.save_screenshot("log")


async def test_what_takes_long_shows_at_once_that_it_has_started(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    await opened.tab("Files")
    await opened.says("#files", "first.mcap")
    server.holds = {"list_recordings", "make_files"}
    await page.locator("#map-make").click()
    await opened.says("#job-text", "Map of this run: looking for its recording")
    await server.release("make_files")
    await opened.says("#job-text", "Map of now.mcap: asked for")
    await opened.save_screenshot("map-started")
    await server.release()

    server.holds = {"open_recording"}
    await page.locator("#file-row-1").click()
    await page.locator("#file-play").click()
    await opened.says("#banners", "Opening 2026-01-02-first.mcap")
    await expect(page.locator("#file-play")).to_be_disabled()
    await opened.run_for(12_000)
    await server.release()
    await expect(page.locator("#banner-opening")).to_have_count(0)


async def test_actions_of_a_recording_stay_near_a_long_list(server: FakeServer, opener: Opener) -> None:
    row = {"bytes": 1, "modified_s": 1.0, "duration_s": 1.0, "state": "complete", "pinned": False, "live": False}
    server.data["list_recordings"] = [row | {"file": f"run-{k}.mcap"} for k in range(500)]
    opened = await opener.open(server.url)
    page = opened.page
    await opened.tab("Files")
    await expect(page.locator("#files li")).to_have_count(500)
    await page.locator("#file-row-0").click()
    box = await page.locator("#file-play").bounding_box()
    assert box is not None
    assert box["y"] < DESKTOP[1], "in view without scrolling the panel"
    await opened.save_screenshot("files-500")


async def test_a_page_without_a_token_promises_no_halt_and_takes_one(server: FakeServer, opener: Opener) -> None:
    server.session = greeting() | {"has_token": False}
    server.controller = None
    opened = await opener.open(server.url)
    page = opened.page
    await opened.says("#banner-watching", "has no token, so it only watches; HALT does nothing here")
    await opened.tab("Layers")
    await page.locator("#tour-again").click()
    await opened.says("#tour-text", "Use the robot's own stop")
    await page.locator("#tour-skip").click()
    await page.locator("#banner-watching").get_by_role("button", name="Enter the token").click()
    await opened.save_screenshot("token")
    server.session = {}
    await page.locator("#token-given").fill(f"http://127.0.0.1:1/?token={TOKEN}")
    await page.locator("#token-given").press("Enter")
    await opened.until("run.session && run.session.has_token !== false", "the page with its token")
    assert await page.evaluate("sessionStorage.getItem('token')") == TOKEN


async def test_a_wrong_token_is_asked_for_and_not_tried_all_the_time(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url.replace(TOKEN, "wrong"), live=False, expected_errors="403")
    await opened.says("#banner-connection", "enter its token")
    await opened.save_screenshot("wrong-token")
    tried = server.connections
    await opened.run_for(50_000)
    assert server.connections == tried


async def test_a_table_of_plots_leaves_silence_empty(server: FakeServer, opener: Opener) -> None:
    frame = server.frame
    server.frame = lambda client: frame(client) | {"ranges": [-1.0] * 24}  # type: ignore[method-assign]
    opened = await opener.open(server.url)
    page = opened.page
    await opened.tab("Plot")
    await server.advance(5)
    await opened.sync()
    async with page.expect_download() as saved:
        await page.get_by_role("button", name="Save as CSV").click()
    lines = (await (await saved.value).path()).read_text("utf-8").splitlines()
    at = lines[0].split(",").index("ranges.0")
    assert {line.split(",")[at] for line in lines[1:]} == {""}


@pytest.mark.parametrize(
    "size",
    [
        pytest.param(DESKTOP, id="1440", marks=pytest.mark.soak),
        pytest.param(LAPTOP, id="1024"),
        pytest.param(PHONE, id="phone", marks=pytest.mark.soak),
    ],
)
async def test_the_bar_is_whole_whatever_stands_in_it(
    server: FakeServer, opener: Opener, size: tuple[int, int]
) -> None:
    session: dict[str, Any] = greeting(name=LONG)
    server.session = session
    server.mode = "SAFE_STOP"
    server.reason = (
        "bumper contact at the front left: free the robot by hand, look around it, and only then re-arm it"
    )
    frame = server.frame
    localized = {"pose": [12.345, -67.89, 1.0], "covariance": [1.0, 0.0, 1.0, 0.1], "status": "localizing",
                 "probability": 0.5, "frame": [0.0, 0.0, 0.0]}  # fmt: skip
    server.frame = lambda client: frame(client) | {"localized": localized}  # type: ignore[method-assign]
    opened = await opener.open(server.url, size)
    page = opened.page
    await opened.says("#mode-name", "SAFE STOP")
    await opened.drawn()
    await opened.save_screenshot(f"bar-{size[0]}")
    for selector in ("#halt", "#mode", "#reason"):
        box = await page.locator(selector).bounding_box()
        assert box is not None
        assert box["x"] >= 0, selector
        assert box["x"] + box["width"] <= size[0], selector
    wide = await page.evaluate(
        "document.querySelector('.bar').scrollWidth - document.querySelector('.bar').clientWidth"
    )
    assert wide <= 0
    if size != PHONE:
        cut = await page.evaluate("(({ scrollHeight, clientHeight }) => scrollHeight - clientHeight)"
                                  "(document.getElementById('reason'))")  # fmt: skip
        assert cut <= 1, "the reason is read whole"


async def test_after_a_reload_trail_and_plots_go_on_from_before(server: FakeServer, opener: Opener) -> None:
    past = [{"robot_s": 0.1 * k, "pose": [0.01 * k, 0.0, 0.0], "twist": [0.4, 0.0], "ranges": [1.0] * 24}
            for k in range(20)]  # fmt: skip
    trail = [[0.01 * k, 0.0, 0.1 * k] for k in range(20)]
    server.session = greeting() | {"history": {"samples": past, "trail": trail}}
    opened = await opener.open(server.url)
    page = opened.page
    assert await opened.world("run.trail.length") >= 20
    await opened.tab("Plot")
    async with page.expect_download() as saved:
        await page.get_by_role("button", name="Save as CSV").click()
    lines = (await (await saved.value).path()).read_text("utf-8").splitlines()
    assert len(lines) > 20
    assert lines[1].split(",")[1] == "0.4"
    assert await opened.world("run.session.history === undefined"), "it is not shown again with a recording"
