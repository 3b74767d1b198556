"""Missions on the page: the state machine, why it waits, waypoints by click and drag, hold, resume and skip."""

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


async def test_waypoints_by_click_and_drag_make_a_route(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    await page.get_by_role("tab", name="Drive").click()
    await page.locator("#route-add").click()
    await waypoint(opened, 2.0, 0.4)
    first = await server.wait("set_route")
    assert len(first["waypoints"]) == 1
    assert first["waypoints"][0][2] is None
    await waypoint(opened, 3.0, -0.4, towards=math.pi / 2)
    second = await server.wait("set_route", 2)
    assert second["waypoints"][0] == first["waypoints"][0]
    turn_deg = math.degrees(opened_frame(server)[2])
    assert second["waypoints"][1][2] + turn_deg == pytest.approx(90.0, abs=1.5)
    places = tuple((x, y, heading) for x, y, heading in second["waypoints"])
    server.drive_request = rows(route(places, second["frame"]))
    await opened.says("#mission-title", "route: running")
    await expect(page.locator("#mission-steps > li")).to_have_count(2)
    await opened.save_screenshot("route")
    await page.locator("#route-remove").click()
    assert (await server.wait("set_route", 3))["waypoints"] == first["waypoints"]


def opened_frame(server: FakeServer) -> tuple[float, float, float]:
    """Return the map frame of the last state."""
    state = server.clients[0].last
    assert state is not None
    x, y, turn = state["localized"]["frame"]
    return x, y, turn
