"""Missions on the page: the state machine, why it waits, hold, resume and skip; routes by click, drag and keys."""

from __future__ import annotations

import math
from typing import Any

import orjson
import pytest
from playwright.async_api import expect

from behaviors.missions.mission import Mission, MissionEdit, edited, goes_to, route
from config.load import load_mission
from runtime.console.frames.mission_rows import MissionRows
from tests.browser.fake_server import FakeServer
from tests.browser.open_page import Opened, Opener
from tests.browser.synthetic_run import NO_PLACES, greeting

pytestmark = pytest.mark.asyncio(loop_scope="session")


def rows(mission: Mission) -> dict[str, Any]:
    """Return a mission as frames have it."""
    row: dict[str, Any] = orjson.loads(orjson.dumps(MissionRows().row(mission)))
    return row


async def test_the_state_machine_the_step_and_why_it_waits(server: FakeServer, opener: Opener) -> None:
    mission = Mission(load_mission("there-and-back"))
    server.drive_request = rows(goes_to(mission, "wait", "reached"))
    opened = await opener.open(server.url)
    page = opened.page
    await page.get_by_role("tab", name="Drive").click()
    await opened.says("#mission-title", "there-and-back: running")
    await opened.says("#drive-request-text", "Mission there-and-back: running.")
    await opened.says('#mission-steps [aria-current="step"]', "wait stand")
    await opened.says('#mission-steps [aria-current="step"]', "time 3 s → next step")
    await expect(page.locator("#mission-resume")).to_be_disabled()
    await page.locator("#mission-hold").click()
    assert await server.wait("hold_mission") == {}
    server.drive_request = rows(edited(mission, MissionEdit("hold")))
    await opened.says("#mission-reason", "held by the operator")
    await expect(page.locator("#mission-hold")).to_be_disabled()
    for button, message in (("resume", "resume_mission"), ("skip", "skip_step")):
        await page.locator(f"#mission-{button}").click()
        assert await server.wait(message) == {}
    await opened.save_screenshot("mission")
    server.drive_request = rows(goes_to(mission, "failed", "stuck in its step there"))
    await opened.says("#mission-reason", "has failed: stuck in its step there")
    await expect(page.locator("#mission-skip")).to_be_disabled()
    server.drive_request = {"kind": "legs"}
    await expect(page.locator("#mission")).to_be_hidden()


async def test_a_mission_of_the_list_is_started(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await opened.page.get_by_role("tab", name="Drive").click()
    await opened.page.locator("#mission-name").select_option("patrol")
    await opened.page.locator("#mission-start").click()
    assert await server.wait("start_mission") == {"name": "patrol"}


async def waypoint(opened: Opened, x: float, y: float, towards: float | None = None) -> None:
    """Click at a place, or drag from it in a direction."""
    mouse, (sx, sy) = opened.page.mouse, await opened.screen(x, y)
    await mouse.move(sx, sy)
    await mouse.down()
    if towards is not None:
        await mouse.move(sx + 40.0 * math.cos(towards), sy - 40.0 * math.sin(towards), steps=3)
    await mouse.up()


async def test_a_route_is_set_changed_driven_and_queued(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    await opened.steady()
    await page.get_by_role("tab", name="Drive").click()
    await page.locator("#route-add").click()
    rows_of = page.locator("#route-list > li")
    await waypoint(opened, 2.0, 0.4)
    await waypoint(opened, 3.0, -0.4, towards=math.pi / 2)
    await waypoint(opened, 1.0, -0.4)
    await expect(rows_of).to_have_count(3)
    assert server.of("set_route") == [], "nothing is driven before the operator says so"
    await opened.save_screenshot("route")

    await drag(opened, (1.0, -0.4), (1.4, 0.8))
    await page.get_by_role("button", name="Earlier waypoint 3").press("Enter")
    await page.get_by_role("button", name="Later waypoint 1").press("Enter")
    await page.get_by_role("button", name="Remove waypoint 3").press("Enter")
    await expect(rows_of).to_have_count(2)
    await page.locator("#map-front").press("Control+z")
    await expect(rows_of).to_have_count(3)
    await page.locator("#route-row-2").click()
    await page.locator("#route-heading").fill("-45")
    await page.locator("#route-heading").press("Enter")
    await expect(page.locator("#route-row-2")).to_contain_text("-45°")

    await page.locator("#route-drive").press("Enter")
    sent = await server.wait("set_route")
    frame = opened_frame(server)
    places = [in_plane(frame, x, y) for x, y, _ in sent["waypoints"]]
    for place, expected in zip(places, ((1.4, 0.8), (2.0, 0.4), (3.0, -0.4)), strict=True):
        assert place == pytest.approx(expected, abs=0.03)
    assert [heading for _, _, heading in sent["waypoints"]] == [None, None, -45]
    under_way = goes_to(route(tuple(map(tuple, sent["waypoints"])), sent["frame"]), "next", "reached")
    server.drive_request = rows(under_way)
    await opened.says("#mission-title", "route: running")
    await opened.says("#route-text", "3 waypoints, in the map, 1 behind the robot")
    await expect(page.locator("#route-remove-0")).to_be_disabled()
    await waypoint(opened, 0.4, 0.0)
    queued = await server.wait("set_route", 2)
    assert queued["waypoints"][:3] == sent["waypoints"], "it goes on, and one more follows"
    await opened.save_screenshot("route-under-way")


async def test_a_route_is_saved_and_loaded_as_a_mission_file(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    await page.get_by_role("tab", name="Drive").click()
    server.data["read_mission"] = {"name": "corridor", "about": "", "waypoints": [[1, 2, None], [3, 4, 90]],
                                   "frame": "odom"}  # fmt: skip
    chosen = {"name": "corridor.toml", "mimeType": "text/plain", "buffer": b"name = 1"}
    await page.locator("#route-file").set_input_files(chosen)  # type: ignore[arg-type]
    assert await server.wait("read_mission") == {"toml": "name = 1"}
    await expect(page.locator("#route-list > li")).to_have_count(2)
    server.data["save_route"] = "# A route\n"
    async with page.expect_download() as downloading:
        await page.locator("#route-keep").click()
    saved = await server.wait("save_route")
    assert saved == {"name": "corridor", "waypoints": [[1, 2, None], [3, 4, 90]], "frame": "odom"}
    assert (await downloading.value).suggested_filename == "corridor.toml"
    server.data["read_mission"] |= {"name": "dock", "waypoints": None, "frame": None}
    await page.locator("#route-file").set_input_files(chosen)  # type: ignore[arg-type]
    await page.get_by_role("button", name="Start it").click()
    assert await server.wait("run_mission") == {"toml": "name = 1"}


async def test_what_is_not_changed_in_the_form_of_a_place_is_not_rounded(server: FakeServer, opener: Opener) -> None:
    place = {"name": "dock", "x_m": 1.2345, "y_m": -0.5678, "heading_deg": None}
    server.session = greeting() | {"places": NO_PLACES | {"place": [place]}}
    server.data["read_mission"] = {"name": "r", "about": "", "waypoints": [[1.2345, -0.5678, None]], "frame": "odom"}
    opened = await opener.open(server.url)
    page = opened.page
    await opened.tab("Drive")
    await page.locator("#places-row-place-0").click()
    await page.locator("#places-name").fill("charger")
    await page.locator("#places-name").press("Enter")
    assert (await server.wait("set_places"))["places"]["place"] == [place | {"name": "charger"}]

    chosen = {"name": "r.toml", "mimeType": "text/plain", "buffer": b"name = 1"}
    await page.locator("#route-file").set_input_files(chosen)  # type: ignore[arg-type]
    await page.locator("#route-row-0").click()
    await page.locator("#route-x").fill("7")
    await page.locator("#route-x").press("Enter")
    await page.locator("#route-drive").press("Enter")
    ((x, y, _),) = (await server.wait("set_route"))["waypoints"]
    assert (x, y) == (pytest.approx(7 * 0.3048), -0.5678)


async def drag(opened: Opened, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Drag from one place to another."""
    mouse = opened.page.mouse
    await mouse.move(*await opened.screen(*start))
    await mouse.down()
    await mouse.move(*await opened.screen(*end), steps=3)
    await mouse.up()


def in_plane(frame: tuple[float, float, float], x: float, y: float) -> tuple[float, float]:
    """Return where a place of the map lies in the plane."""
    x0, y0, turn = frame
    return x0 + math.cos(turn) * x - math.sin(turn) * y, y0 + math.sin(turn) * x + math.cos(turn) * y


def opened_frame(server: FakeServer) -> tuple[float, float, float]:
    """Return the map frame of the last state."""
    state = server.clients[0].last
    assert state is not None
    x, y, turn = state["localized"]["frame"]
    return x, y, turn
