"""The display: map and layers, pan, zoom, follow, tape; ring, charts, object list, log; stale data."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.browser.fake_server import FakeServer
from tests.browser.open_page import PHONE, Opened, Opener, until
from tests.browser.synthetic_run import DRUMS, Hall, greeting

pytestmark = pytest.mark.asyncio(loop_scope="session")


async def picture(opened: Opened) -> str:
    """Return a checksum of the map's pixels, after all pending drawing."""
    await opened.drawn()
    return str(await opened.probe("inked"))


async def still(server: FakeServer, opener: Opener, cycle: int = 170) -> Opened:
    """Open a page of a robot that stands still, so that the map does not change by itself."""
    server.paused, server.cycle = True, cycle
    opened = await opener.open(server.url)
    await opened.steady()
    return opened


async def test_every_layer_draws_something_and_can_be_switched(server: FakeServer, opener: Opener) -> None:
    server.drive_request = {"kind": "goal", "x": 3.0, "y": 0.3}
    server.cycle = 170
    opened = await opener.open(server.url)
    await opened.until("run.trail.length > 5", "a trail")
    server.paused = True
    await opened.steady()
    await opened.page.get_by_role("option").nth(1).click()  # the picked object's readings are a layer too
    await opened.says("#evidence", "12 readings")
    await opened.tab("Layers")
    server.silent = True
    boxes = opened.page.locator("#layers input")
    names = await opened.page.locator("#layers label").all_inner_texts()
    assert len(names) == 15
    assert [name for name in names if "arc" in name or "beam" in name] == [
        "arcs of recent echoes",
        "beams firing now",
    ]
    whole = await picture(opened)
    for index, name in enumerate(names):
        await boxes.nth(index).uncheck()
        without = await picture(opened)
        assert without != whole, f"{name} draws nothing"
        await boxes.nth(index).check()
        assert await picture(opened) == whole, f"{name} is not what it was"
    await opened.save_screenshot("layers")


async def test_true_outlines_are_drawn_only_if_reported(server: FakeServer, opener: Opener) -> None:
    server.session = greeting(truth=None)
    opened = await still(server, opener)
    await opened.tab("Layers")
    server.silent = True
    whole = await picture(opened)
    await opened.page.locator("#layer-truth").uncheck()
    assert await picture(opened) == whole


async def test_only_the_beams_firing_now_are_drawn(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    server.silent = True
    for layer in ("arcs", "segments", "clusters", "models", "grid", "truth", "vectors", "labels"):
        await opened.page.evaluate(f"() => document.getElementById('layer-{layer}').click()")
    first = await picture(opened)
    await opened.page.evaluate("async () => { const { run, scene } = await import('/page/main.js');"
                               " run.state.firing = [0]; scene.invalidate('front'); }")  # fmt: skip
    assert await picture(opened) != first


async def test_age_makes_segments_thinner(server: FakeServer, opener: Opener) -> None:
    server.hall.moving = False
    opened = await still(server, opener)
    server.silent = True
    young = await picture(opened)
    await opened.page.evaluate("async () => { const { run, scene } = await import('/page/main.js');"
                               " for (const s of run.segments.values()) s.t -= 90; run.segmentsVersion++;"
                               " scene.invalidate('back'); }")  # fmt: skip
    assert await picture(opened) != young


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
    assert await opened.world("view.scale") > 1.3 * scale
    assert await opened.screen(*DRUMS[0]) == pytest.approx(after, abs=1.0), "it zooms about the pointer"

    await page.locator("#map-front").focus()
    x = await opened.world("view.x")
    await page.keyboard.press("ArrowRight")
    assert await opened.world("view.x") > x
    await page.keyboard.press("-")
    await page.keyboard.press("f")
    for place in DRUMS:
        sx, sy = await opened.screen(*place)
        box = await page.locator("#map-front").bounding_box()
        assert box is not None
        assert box["x"] < sx < box["x"] + box["width"]
        assert box["y"] < sy < box["y"] + box["height"]


async def test_follow_keeps_the_robot_centred_until_the_map_is_panned(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await opened.steady()
    follow = opened.page.get_by_role("button", name="Follow the robot")
    await follow.click()
    await expect(follow).to_have_attribute("aria-pressed", "true")
    x = await opened.world("run.state.pose[0]")
    await opened.until(f"run.state.pose[0] > {x} + 0.1", "a robot that drives")
    assert await opened.world("view.x === run.state.pose[0] && view.y === run.state.pose[1]")
    await opened.page.locator("#map-front").focus()
    await opened.page.keyboard.press("ArrowUp")
    await expect(follow).to_have_attribute("aria-pressed", "false")


async def test_two_fingers_pinch_and_pan_whatever_the_tool(server: FakeServer, opener: Opener) -> None:
    server.paused, server.cycle = True, 170
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
    assert await opened.world("view.scale") == pytest.approx(2.0 * scale, rel=0.02)
    assert await opened.world("view.toWorld(180, 120)") == pytest.approx(place, abs=0.02)
    assert await opened.world("selection.segments.size") == 0, "a pinch is no lasso"


async def test_feet_or_metres_everywhere(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    x = DRUMS[0][0] + 0.01
    await opened.says("#objects", f"{x / 0.3048:.2f}, ")
    await opened.page.get_by_role("button", name="Units: feet").click()
    await opened.says("#objects", f"{x:.2f}, ")
    await opened.page.keyboard.press("u")
    await expect(opened.page.locator("#units")).to_have_text("ft")


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
    await page.mouse.click(*start)
    await page.mouse.click(*end)
    await opened.says("#announce", "Tape: 3.0")


async def test_objects_are_listed_as_text(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    rows = opened.page.locator("#objects li")
    await expect(rows).to_have_count(6)
    await expect(rows.nth(0)).to_contain_text("drum")
    await expect(rows.nth(0)).to_contain_text("97 %")
    await expect(rows.nth(0)).to_contain_text("± 0.013 ft")
    await opened.page.locator("#objects").focus()
    await opened.page.keyboard.press("ArrowDown")
    await opened.page.keyboard.press("ArrowDown")
    assert await server.wait("evidence", 2) == {"object": 2}
    await expect(opened.page.locator("#object-name")).to_have_text("2 drum")
    await opened.says("#object-facts", "95 % ellipse")
    await opened.says("#evidence", "21.4 nats")
    await opened.says("#evidence", "2.4 nats")
    await opened.says("#evidence", "3 of them against")
    await opened.save_screenshot("picked")


async def test_ring_charts_and_facts(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    server.recording = {"file": "runs/now.mcap", "bytes": 1_200_000, "dropped": 2}
    await opened.says("#ring-text", "nearest")
    await opened.says("#ring-text", "not trusted: 17 (weak)")
    for phase in ("gather", "perceive", "decide", "command", "refine", "observers"):
        await opened.says("#phases-legend", phase)
    server.cycle = 171
    await opened.says("#late-legend", "1 missed")
    await opened.says("#late-legend", "ended by budget")
    assert await opened.world("run.chart.some((one) => one.missed === 1)")
    await opened.says("#fact-link", "1 / 0")
    server.flags = ["BUMPER"]
    await opened.says("#fact-flags", "bumper")
    await opened.says("#fact-recording", "2 lost")
    await opened.says("#mode-name", "DRIVE")
    marks = await opened.page.evaluate("""() => {
        const canvas = document.getElementById('phases');
        const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, 12).data;
        let inked = 0;
        for (let i = 3; i < data.length; i += 4) inked += data[i] > 200 ? 1 : 0;
        return inked;
    }""")
    assert marks > 10, "a miss has no mark above its column"


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


async def test_old_data_are_reported_as_old(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    server.silent = True
    await opened.says("#banner-stale", "what you see is old")
    await expect(opened.page.locator("#facts .bad dt").first).to_have_text("data age")
    server.silent = False
    await expect(opened.page.locator("#banner-stale")).to_have_count(0)


async def test_it_reconnects_and_receives_the_whole_map(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await opened.steady()
    await server.drop()
    await opened.says("#banners", "No connection")
    server.controller = 2
    await expect(opened.page.locator("#banner-connection")).to_have_count(0, timeout=30_000)
    await opened.until(f"run.segments.size >= {server.hall.known(server.cycle) - 5}", "the whole map")


async def test_a_wrong_token_is_reported(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url.replace("right", "wrong"), live=False)
    await opened.says("#banner-connection", "token is missing or wrong")
    await opened.save_screenshot("wrong-token")
    opened.errors.clear()  # the browser's own words on the refusal


async def test_the_token_does_not_stay_in_the_address(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    assert "token" not in opened.page.url
    await opened.page.reload()
    await opened.until("run.fresh", "the page after a reload")
    assert "token" not in opened.page.url


@pytest.mark.parametrize("hall", [Hall(segments=60, objects=12)], ids=["walls"])
async def test_objects_without_a_model_are_shown(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    await expect(opened.page.locator("#objects li")).to_have_count(12)
    await opened.says("#objects", "wall")
    await opened.save_screenshot("walls")


async def test_removed_segments_disappear(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    size = await opened.world("run.segments.size")
    server.deleted |= {1, 2, 3}
    await until(lambda: opened.world(f"run.segments.size === {size - 3}"), "three segments fewer")


async def test_a_whole_map_after_a_gap_replaces_the_old_one(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    assert await opened.world("run.segments.has(5) && run.segments.has(6)")
    server.deleted |= {5, 6}
    for client in server.clients:  # one that missed the frame in which they went
        client.gone |= {5, 6}
        client.whole = True
    await opened.until("!run.segments.has(5) && !run.segments.has(6)", "a map without them")
    assert await opened.world("run.segments.has(7)")
