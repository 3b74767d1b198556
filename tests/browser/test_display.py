"""The map: layers, pan, zoom, follow, tape, segments, and how often it is drawn."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.browser.fake_server import FakeServer
from tests.browser.open_page import FRAME_MS, MODULE, PHONE, Opened, Opener
from tests.browser.synthetic_run import DRUMS, Hall, greeting

pytestmark = pytest.mark.asyncio(loop_scope="session")

SMALL = (1200, 640)
"""Fewer pixels to compare; the layout is that of a desktop."""


async def still(server: FakeServer, opener: Opener, size: tuple[int, int] = SMALL) -> Opened:
    """Open a page of a robot that has driven for a while and stands still."""
    server.cycle = 170
    opened = await opener.open(server.url, size)
    await opened.steady()
    return opened


async def fall_silent(server: FakeServer, opened: Opened) -> None:
    """Send one more state, the last: of data 2.5 s old the header says so, and the map gets another height."""
    await server.advance()
    server.silent = True
    await opened.sync()


async def change(opened: Opened, script: str) -> None:
    """Run a script over the page's state."""
    await opened.page.evaluate(f"async () => {{ const {{ run, scene }} = await {MODULE}; {script} }}")


async def test_every_layer_draws_something_and_can_be_switched(server: FakeServer, opener: Opener) -> None:
    server.drive_request = {"kind": "goal", "x": 3.0, "y": 0.3}
    server.areas = [[1, 2.0, 0.0, 0.5]]
    server.canyons = [{"number": 1, "mouth": [2.0, 1.0, 2.0, -1.0], "axis": 0.0, "depth": 3.0, "probability": 0.95}]
    server.polylines = [{"number": 1, "points": [[1.0, 0.2], [1.5, 0.5], [1.4, 0.9]], "probability": 0.9}]
    server.known_way = {
        "path": [[-1.0, 0.0], [0.0, 0.4], [1.0, 0.3]],
        "maps": [[-1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.4, 0.02, 0.005, 0.01]],
        "loops": [[-1.0, 0.0, 0.0, 0.4]],
    }
    server.cross_paths = [{"robot_s": 8.5, "pose": [2.5, 0.0, 0.0, 0.0], "paths": [[6, 7, 0.6], [6, 5, 0.6]]}]
    server.cycle = 150
    opened = await opener.open(server.url, SMALL)
    await server.advance(20)
    await opened.sync()
    assert await opened.world("run.trail.length") > 5
    await opened.steady()
    await opened.page.get_by_role("option").nth(1).click()  # the picked object's readings are a layer too
    await opened.says("#evidence", "12 readings")
    bars = await opened.page.locator("#evidence .track").evaluate_all(
        "all => all.map((bar) => Math.round(bar.getBoundingClientRect().width))"
    )
    assert len(set(bars)) == 1, "for and against have one scale"
    await opened.tab("Layers")
    await fall_silent(server, opened)
    boxes = opened.page.locator("#layers input")
    names = await opened.page.locator("#layers label").all_inner_texts()
    assert len(names) == 25
    assert [name for name in names if "arc" in name or "beam" in name] == [
        "arcs of recent echoes",
        "beams firing now",
    ]
    await change(opened, "run.state.valley = { blocked: '11000000', way: [[0.0, 0.0], [1.0, 0.5]] };")
    whole = await opened.picture()
    for index, name in enumerate(names):
        if "mission" in name or "evidence grid" in name or "places" in name:
            continue  # see test_mission, and below
        await boxes.nth(index).uncheck()
        without = await opened.picture()
        assert without != whole, f"{name} draws nothing"
        await boxes.nth(index).check()
        assert await opened.picture() == whole, f"{name} is not what it was"
    await opened.save_screenshot("layers")


GRID = {"type": "grid", "on": True, "x": -1.0, "y": -0.5, "cell": 0.5, "columns": 2, "rows": 2, "cells": "Wgr/ZA=="}
"""Four cells: 90, 10, −1 and 100 %."""


async def test_the_evidence_grid_is_asked_for_only_while_its_layer_is_on(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    server.silent = True
    await opened.run_for(3000)
    assert server.of("show_grid") == []
    await opened.tab("Layers")
    box = opened.page.locator("#layer-evidence_grid")
    await box.check()
    await opened.run_for(1000)
    await server.wait("show_grid")
    await server.send(GRID)
    await opened.page.wait_for_function(f"async () => (await {MODULE}).run.grid?.picture !== undefined")
    shown = await opened.picture()
    await opened.save_screenshot("evidence-grid")
    await box.uncheck()
    assert await opened.picture() != shown
    await box.check()
    assert await opened.picture() == shown


async def test_what_a_layer_draws_depends_on_the_state(server: FakeServer, opener: Opener) -> None:
    server.session = greeting(truth=None)
    server.hall.moving = False
    opened = await still(server, opener)
    await fall_silent(server, opened)
    whole = await opened.picture()
    await opened.tab("Layers")
    await opened.page.locator("#layer-truth").uncheck()
    assert await opened.picture() == whole, "true outlines that the robot did not report"

    await change(opened, "for (const s of run.segments.values()) s.t -= 90; run.segmentsVersion++;"
                         " scene.invalidate('back');")  # fmt: skip
    assert await opened.picture() != whole, "old segments look like new ones"

    for layer in ("arcs", "segments", "clusters", "models", "grid", "vectors", "labels"):
        await opened.page.evaluate(f"() => document.getElementById('layer-{layer}').click()")
    first = await opened.picture()
    await change(opened, "run.state.firing = [0]; scene.invalidate('front');")
    assert await opened.picture() != first, "the beams of other sensors look alike"


@pytest.mark.parametrize("hall", [Hall(segments=500, objects=40, moving=False)], ids=["full"])
async def test_only_changes_are_drawn(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    assert await opened.world("run.segments.size") == 500
    await fall_silent(server, opened)
    await opened.run_for(20 * FRAME_MS)
    await opened.probe("count_repaints")
    await opened.run_for(10 * FRAME_MS)
    assert await opened.page.evaluate("painted") == {"back": 0, "front": 0}, "it draws although nothing changed"
    for _ in range(10):
        await change(opened, "scene.invalidate('front'); scene.invalidate('front');")
        await opened.drawn()
    assert await opened.page.evaluate("painted") == {"back": 0, "front": 10}, "once a frame, and the front alone"
    for _ in range(3):
        server.silent = False
        await server.advance()
        server.silent = True  # a heartbeat while the page draws would be one more state
        await opened.sync()
        await opened.drawn()
    painted = await opened.page.evaluate("painted")
    assert painted["front"] == 13, "once for each state"
    assert painted["back"] <= 1, "the second changed at most once"


async def test_pan_zoom_and_fit_by_mouse_and_keys(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    page = opened.page
    before = await opened.screen(*DRUMS[0])
    await page.mouse.move(500, 300)
    await page.mouse.down()
    await page.mouse.move(560, 340, steps=4)
    await page.mouse.up()
    after = await opened.screen(*DRUMS[0])
    assert after == pytest.approx((before[0] + 60, before[1] + 40), abs=1.0)

    scale = await opened.world("view.scale")
    await page.mouse.move(*after)
    await page.mouse.wheel(0, -300)
    await opened.until(f"view.scale > 1.3 * {scale}", "a larger scale")
    assert await opened.screen(*DRUMS[0]) == pytest.approx(after, abs=1.0), "it zooms about the pointer"

    await page.locator("#map-front").focus()
    x = await opened.world("view.x")
    await page.keyboard.press("ArrowRight")
    assert await opened.world("view.x") > x
    await page.keyboard.press("-")
    await page.keyboard.press("f")
    box = await page.locator("#map-front").bounding_box()
    assert box is not None
    for place in DRUMS:
        sx, sy = await opened.screen(*place)
        assert box["x"] < sx < box["x"] + box["width"]
        assert box["y"] < sy < box["y"] + box["height"]


async def test_follow_keeps_the_robot_centred_until_the_map_is_panned(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url, SMALL)
    await opened.steady()
    follow = opened.page.get_by_role("button", name="Follow the robot")
    await follow.click()
    await expect(follow).to_have_attribute("aria-pressed", "true")
    x = await opened.world("run.state.pose[0]")
    await server.advance(10)
    await opened.sync()
    assert await opened.world("run.state.pose[0]") > x + 0.1
    assert await opened.world("view.x === run.state.pose[0] && view.y === run.state.pose[1]")
    await opened.page.locator("#map-front").focus()
    await opened.page.keyboard.press("ArrowUp")
    await expect(follow).to_have_attribute("aria-pressed", "false")


async def test_two_fingers_pinch_and_pan_whatever_the_tool(server: FakeServer, opener: Opener) -> None:
    server.cycle = 170
    opened = await opener.open(server.url, PHONE, touch=True)
    await opened.steady()
    await opened.page.locator("#tool-select").click()
    touch = await opened.page.context.new_cdp_session(opened.page)

    async def fingers(kind: str, *spots: tuple[float, float]) -> None:
        points = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(spots)]
        await touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    scale = await opened.world("view.scale")
    place = await opened.world("view.toWorld(180, 120)")
    box = await opened.page.locator("#map-front").bounding_box()
    assert box is not None
    y = box["y"] + 120
    await fingers("touchStart", (150, y), (210, y))
    for spread in (40, 50, 60):
        await fingers("touchMove", (180 - spread, y), (180 + spread, y))
    await fingers("touchEnd")
    await opened.until(f"Math.abs(view.scale / (2 * {scale}) - 1) < 0.02", "twice the scale")
    assert await opened.world("view.toWorld(180, 120)") == pytest.approx(place, abs=0.02)
    assert await opened.world("selection.segments.size") == 0, "a pinch is no lasso"


async def test_tape_measures_from_drum_to_drum(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    page = opened.page
    await page.keyboard.press("6")
    start, end = await opened.screen(*DRUMS[0]), await opened.screen(*DRUMS[1])
    await page.mouse.move(*start)
    await page.mouse.down()
    await page.mouse.move(*end, steps=5)
    await page.mouse.up()
    await opened.says("#announce", "Tape: 3.0")
    assert "ft at 0°" in (await page.locator("#announce").inner_text())
    await opened.save_screenshot("tape")

    await page.locator("#map-front").press("Escape")
    await page.evaluate("() => { document.getElementById('announce').textContent = ''; }")
    await page.mouse.click(*start)
    await page.mouse.click(*end)
    await opened.says("#announce", "Tape: 3.0")


async def test_segments_go_when_the_robot_drops_them(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    size = await opened.world("run.segments.size")
    server.deleted |= {1, 2, 3}
    await opened.sync()
    assert await opened.world("run.segments.size") == size - 3

    assert await opened.world("run.segments.has(5) && run.segments.has(6)")
    server.deleted |= {5, 6}
    for client in server.clients:  # one that missed the frame in which they went
        client.gone |= {5, 6}
        client.whole = True
    await opened.sync()
    assert not await opened.world("run.segments.has(5) || run.segments.has(6)"), "a whole map replaces the old one"
    assert await opened.world("run.segments.has(7)")


async def test_objects_left_behind_stay_until_the_robot_lists_them_anew(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    near = await opened.world("run.state.objects.length")
    behind = server.frame(next(iter(server.clients)))["objects"][0] | {"number": 901, "x": 9.0, "y": 9.0}
    await server.send(server.frame(next(iter(server.clients))) | {"archived": [behind]})
    await opened.sync()
    assert await opened.world("run.state.objects.length") == near + 1, "kept by frames that do not list them"
    assert await opened.world("run.object(901).x") == 9.0
    await opened.says("#objects", "901")
    await server.send(server.frame(next(iter(server.clients))) | {"archived": []})
    await opened.sync()
    assert await opened.world("run.state.objects.length") == near
