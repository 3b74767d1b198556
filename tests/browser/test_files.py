"""Recordings and maps as files: the list, what can be done with one, with keys too, and how far long work is."""

from __future__ import annotations

import re
from typing import Any

import pytest
from playwright.async_api import expect

from drivers.registry import driver_names
from tests.browser.fake_server import TOKEN, FakeServer
from tests.browser.open_page import Opened, Opener

pytestmark = pytest.mark.asyncio(loop_scope="session")

FIRST = "2026-01-02-first.mcap"
DESKTOP, SMALL, PHONE = (1440, 900), (1024, 768), (390, 844)


def job(**changes: Any) -> dict[str, Any]:
    about = {"type": "job", "job": 1, "kind": "map", "file": FIRST, "share": 0.0, "what": "starting", "made": [],
             "error": None, "over": False}  # fmt: skip
    return about | changes


async def files_of(opened: Opened) -> None:
    await opened.tab("Files")
    await opened.says("#files", FIRST)


async def test_a_recording_is_described_renamed_pinned_and_deleted(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    await files_of(opened)
    server.controller = 2  # the page gets the control that it had
    await page.reload()  # the panel is shown before there is a connection to ask
    await opened.says("#files", FIRST)
    await opened.says("#file-row-0", "this run, up to now")
    await opened.says("#file-row-1", "1 h 02 min, 1.5 MB, complete")
    await page.locator("#file-row-0").press("Enter")
    await expect(page.locator("#file-delete")).to_be_disabled()
    await page.locator("#file-row-1").press("Enter")
    await expect(page.locator("#file-row-1")).to_be_focused()
    link = await page.locator("#file-download").get_attribute("href")
    assert link == f"/recording?file={FIRST}&token={TOKEN}"

    await page.locator("#file-new-name").fill(" ")
    await page.locator("#file-new-name").press("Enter")
    await opened.says("#file-error", "a name is wanted")
    server.data["rename_recording"] = "dock.mcap"
    await page.locator("#file-new-name").fill("dock")
    await page.locator("#file-new-name").press("Enter")
    assert await server.wait("rename_recording") == {"file": FIRST, "to": "dock"}
    await opened.says("#toasts", "dock.mcap")
    server.refusals["rename_recording"] = ("there is a recording dock.mcap already: choose another name", None)
    await page.locator("#file-row-1").press("Enter")
    await page.locator("#file-rename-do").press("Enter")
    await opened.says("#file-error", "choose another name")
    await page.locator("#file-pin").press("Enter")
    assert await server.wait("pin_recording") == {"file": FIRST, "pinned": True}

    await page.locator("#file-delete").press("Enter")
    await opened.says("#dialog-title", f"Delete {FIRST}?")
    await page.get_by_role("button", name="Keep it").press("Enter")
    await page.locator("#file-delete").press("Enter")
    await opened.save_screenshot("files-delete")
    await page.get_by_role("button", name="Delete it").press("Enter")
    assert await server.wait("delete_recording") == {"file": FIRST}
    assert len(server.of("delete_recording")) == 1, "nothing is deleted unasked"


async def test_long_work_says_how_far_it_is_and_what_it_made(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    await files_of(opened)
    await page.locator("#file-row-1").click()
    await page.locator("#file-map").click()
    assert await server.wait("make_files") == {"kind": "map", "file": FIRST}
    await server.send(job(share=0.42, what="reading"))
    await opened.says("#job-text", f"Map of {FIRST}: reading, 42 %")
    for name, size in {"1440": DESKTOP, "1024": SMALL, "390": PHONE}.items():
        await page.set_viewport_size({"width": size[0], "height": size[1]})
        await opened.save_screenshot(f"files-{name}")
    await page.locator("#job-cancel").press("Enter")
    assert await server.wait("cancel_job") == {"job": 1}
    await server.send(job(over=True, error="cancelled"))
    await expect(page.locator("#job")).to_be_hidden()
    await opened.says("#toasts", "cancelled")
    await server.send(job(job=2, over=True, share=1.0, what="done", made=["first.toml", "first.geojson"]))
    await opened.says("#made", f"Map of {FIRST}")
    await page.set_viewport_size({"width": DESKTOP[0], "height": DESKTOP[1]})
    await expect(page.locator("#made a").first).to_be_in_viewport()
    links = [await a.get_attribute("href") for a in await page.locator("#made a").all()]
    assert links == [f"/made?job=2&file=first.{suffix}&token={TOKEN}" for suffix in ("toml", "geojson")]

    await server.send({"type": "opening", "share": 0.25})
    await opened.says("#file-opening", "Opening: 25 %")
    await page.locator("#file-play").click()
    assert await server.wait("open_recording") == {"file": FIRST}
    await opened.says("#banner-playback", FIRST)
    await expect(page.locator("#panel-time")).to_be_visible()


async def test_the_jobs_of_another_run_are_others(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await files_of(opened)
    await server.send(job(over=True, share=1.0, what="done", made=["first.toml"]))
    await opened.says("#made", f"Map of {FIRST}")
    await server.drop()
    await opened.run_for(300)
    await server.wait_for_clients(1)
    await expect(opened.page.locator("#made-part")).to_be_hidden()
    await server.send(job(over=True, error="holds no cycle"))
    await opened.says("#toasts", "holds no cycle")


async def test_who_only_watches_can_look_but_change_nothing(server: FakeServer, opener: Opener) -> None:
    server.controller = 99
    opened = await opener.open(server.url)
    await files_of(opened)
    await opened.page.locator("#file-row-1").click()
    for name in ("file-pin", "file-delete", "file-rename-do"):
        await expect(opened.page.locator(f"#{name}")).to_be_disabled()
    await expect(opened.page.locator("#file-play")).to_be_enabled()


async def test_a_map_is_loaded_forgotten_and_the_robot_placed_in_it(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    await files_of(opened)
    await opened.says("#map-known", "Disarm the robot to load or forget a map")
    await expect(page.locator("#map-load")).to_be_disabled()
    server.mode = "READY"
    await expect(page.locator("#map-load")).to_be_enabled()
    chosen = {"name": "hall.toml", "mimeType": "text/plain", "buffer": b"[[wall]]"}
    server.refusals["load_map"] = ("map: wall 0: x1_m is missing", "toml")
    await page.locator("#map-load").set_input_files(chosen)  # type: ignore[arg-type]
    await opened.says("#map-error", "x1_m is missing")
    server.refusals.clear()
    await page.locator("#map-load").set_input_files(chosen)  # type: ignore[arg-type]
    assert await server.wait("load_map", 2) == {"toml": "[[wall]]"}
    await opened.says("#toasts", "hall.toml is the map now")
    await page.locator("#here-x").fill("10")
    await page.locator("#here-y").fill("-1")
    await page.locator("#here-heading").fill("90")
    await page.locator("#here-heading").press("Enter")
    placed = await server.wait("place_robot")
    assert placed == pytest.approx({"x": 3.048, "y": -0.3048, "theta": 1.5708}, abs=1e-4)
    await page.locator("#map-here").press("Enter")
    await expect(page.locator("#tool-here")).to_have_attribute("aria-checked", "true")
    await opened.save_screenshot("files-map")
    await page.locator("#map-forget").press("Enter")
    assert await server.wait("load_map", 3) == {"toml": None}


async def test_a_robot_is_described_with_a_picture_of_its_ring_and_saved(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    await opened.tab("Files")
    await page.locator("#robot-part summary").press("Enter")
    beams = page.locator("#robot-picture .beam")
    await expect(beams).to_have_count(16)
    await page.locator("#new-count").fill("8")
    await expect(beams).to_have_count(8)
    await expect(page.locator("#robot-picture")).to_have_attribute("aria-label", re.compile("8 sensors"))
    await page.locator("#robot-each").press("Enter")  # the space bar is HALT
    await expect(page.locator("#robot-sensors li")).to_have_count(8)
    drivers = await page.locator("#new-driver option").all_text_contents()
    assert drivers[:4] == [*driver_names()][:4]
    before = await beams.nth(0).get_attribute("d")
    await page.get_by_label("direction (degrees) of sensor 0").fill("20")
    assert await beams.nth(0).get_attribute("d") != before, "it is drawn as it is edited"
    await page.get_by_role("button", name="Remove sensor 7").press("Enter")
    await page.locator("#new-name").fill("Ring 7!")
    await page.get_by_label("x (m) of sensor 3").fill("0.1x")
    await page.locator("#robot-save").press("Enter")
    await opened.says("#robot-error", "sensor 3: three numbers are wanted")
    await page.get_by_label("x (m) of sensor 3").fill("0.1")
    server.data["robot_file"] = "# A robot\n"
    for name, size in {"1440": DESKTOP, "1024": SMALL, "390": PHONE}.items():
        await page.set_viewport_size({"width": size[0], "height": size[1]})
        await page.locator("#robot-picture").scroll_into_view_if_needed()
        await opened.save_screenshot(f"robot-{name}")
    async with page.expect_download() as downloading:
        await page.locator("#new-name").press("Enter")
    assert (await downloading.value).suggested_filename == "ring-7-.toml"
    asked = await server.wait("robot_file")
    assert (asked["count"], len(asked["sensors"]), asked["sensors"][0]) == (None, 7, [0.2, 0, 20])
    assert (asked["name"], asked["preset"], asked["synchro"]) == ("Ring 7!", "quadrants", False)
    server.refusals["robot_file"] = ("ring.firing: the pattern does not look ahead", None)
    await page.locator("#robot-save").press("Enter")
    await opened.says("#robot-error", "does not look ahead")
    await page.locator("#robot-this").press("Enter")
    await expect(page.locator("#robot-sensors li")).to_have_count(24)


async def test_what_is_wrong_with_a_played_recording_stays_on_the_page(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    text = "the keyframe of cycle 800 is refused: count is 7, expected 0 to 4"
    await server.send({"type": "replay_problem", "error": text})
    await opened.says("#banner-recording", text)
    await opened.save_screenshot("files-problem")
    await opened.page.locator("#banner-recording").get_by_role("button", name="Close").press("Enter")
    await expect(opened.page.locator("#banner-recording")).to_have_count(0)
