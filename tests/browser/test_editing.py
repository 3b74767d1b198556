"""Editing the map: actions of the operator on the page, and the messages that arrive at the process."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from playwright.async_api import Locator, expect

from drivers.messages import Pose
from tests.browser.fake_server import FakeServer
from tests.browser.open_page import PHONE, Opened, Opener
from tests.browser.synthetic_run import DRUMS, RADIUS

pytestmark = pytest.mark.asyncio(loop_scope="session")

GAIN = "behaviors.avoid_static_obstacle.avoid_obstacle_gain"


async def still(server: FakeServer, opener: Opener, size: tuple[int, int] | None = None) -> Opened:
    server.cycle = 170
    opened = await (opener.open(server.url) if size is None else opener.open(server.url, size, touch=True))
    await opened.steady()
    return opened


async def middle(opened: Opened, number: int) -> tuple[float, float]:
    """Return the screen position of the middle of a segment."""
    s = await opened.world(f"run.segments.get({number})")
    x, y = (s["x1"] + s["x2"]) / 2, (s["y1"] + s["y2"]) / 2
    return await opened.screen(x, y)


async def lasso(opened: Opened, x: float, y: float, r: float) -> None:
    """Draw a lasso round a point of the map."""
    page = opened.page
    spots = [await opened.screen(x + r * math.cos(a), y + r * math.sin(a)) for a in [0.4 * i for i in range(16)]]
    await page.mouse.move(*spots[0])
    await page.mouse.down()
    for spot in spots[1:]:
        await page.mouse.move(*spot)
    await page.mouse.up()


async def test_segments_are_selected_with_the_pointer_to_delete_and_pin(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    page = opened.page
    await page.locator("#tool-select").click()
    await page.mouse.click(*await middle(opened, 8))
    chosen = await opened.world("[...selection.segments]")
    assert len(chosen) == 1
    await page.mouse.move(*await middle(opened, 8))
    await opened.says("#tip", f"segment {chosen[0]}, ")
    await opened.says("#tip", " s old")
    await expect(page.locator("#selection-count")).to_have_text("1 segment")
    await page.keyboard.press("Delete")
    assert await server.wait("delete_segments") == {"numbers": chosen}
    await opened.until(f"!run.segments.has({chosen[0]})", "the segment gone")
    await expect(page.locator("#selection-bar")).to_be_hidden()

    await page.keyboard.press("2")
    await lasso(opened, *DRUMS[1], 1.35 * RADIUS)
    inside = sorted(await opened.world(
        f"[...run.segments.values()].filter((s) => Math.hypot((s.x1 + s.x2) / 2 - {DRUMS[1][0]},"
        f" (s.y1 + s.y2) / 2 - {DRUMS[1][1]}) < {1.3 * RADIUS}).map((s) => s.number)"
    ))  # fmt: skip
    assert len(inside) > 10
    await expect(page.locator("#selection-count")).to_have_text(f"{len(inside)} segments")
    await opened.save_screenshot("lasso")
    await page.locator("#selection-pin").click()
    pinned = await server.wait("pin_segments")
    assert sorted(pinned["numbers"]) == inside
    assert pinned["pinned"] is True
    await opened.until(f"run.segments.get({inside[0]}).pinned", "a pin")
    await page.locator("#selection-unpin").click()
    assert (await server.wait("pin_segments", 2))["pinned"] is False
    await page.keyboard.press("Escape")

    await lasso(opened, *DRUMS[0], 1.35 * RADIUS)
    first = await opened.world("selection.segments.size")
    await page.keyboard.down("Shift")
    await lasso(opened, *DRUMS[2], 1.35 * RADIUS)
    await page.keyboard.up("Shift")
    assert await opened.world("selection.segments.size") > first


async def test_segments_are_selected_with_the_keyboard_alone(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    page = opened.page
    await page.locator("#map-front").focus()
    await page.keyboard.press("2")
    await page.keyboard.press("a")
    assert await opened.world("selection.segments.size === run.segments.size")
    await page.keyboard.press("Escape")
    await page.keyboard.press("ArrowUp")
    for _ in range(40):  # up along the middle of the map until something is within reach
        await page.keyboard.press("Enter")
        if await opened.world("selection.segments.size + (selection.object === null ? 0 : 1)") > 0:
            break
        await page.keyboard.press("ArrowUp")
    assert await opened.world("selection.segments.size + (selection.object === null ? 0 : 1)") > 0


async def test_objects_are_placed_dragged_and_rotated_with_the_pointer(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    page = opened.page
    await page.get_by_role("radio", name="Place a model").click()
    await page.get_by_label("Model", exact=True).select_option("box")
    await page.mouse.move(*await opened.screen(3.0, 0.0))
    await page.mouse.down()
    await page.mouse.move(*await opened.screen(3.0, 0.5), steps=6)
    await opened.save_screenshot("place")
    await page.mouse.up()
    placed = await server.wait("place_model")
    assert placed["model"] == "box"
    assert (placed["x"], placed["y"], placed["theta"]) == pytest.approx((3.0, 0.0, math.pi / 2), abs=0.02)

    await page.keyboard.press("3")
    x, y = DRUMS[4]
    await page.mouse.move(*await opened.screen(x, y))
    await page.mouse.down()
    await page.mouse.move(*await opened.screen(x + 0.2, y + 0.1), steps=6)
    await page.mouse.up()
    moved = await server.wait("move_object")
    assert moved["object"] == 5
    assert (moved["x"], moved["y"], moved["theta"]) == pytest.approx((x + 0.21, y + 0.09, 0.0), abs=0.02)
    reach = RADIUS + 30 / await opened.world("view.scale")  # the handle stands out along the object's own x axis
    cx, cy = x + 0.01, y - 0.01
    await page.mouse.move(*await opened.screen(cx + reach, cy))
    await page.mouse.down()
    await page.mouse.move(*await opened.screen(cx, cy + reach), steps=6)
    await opened.save_screenshot("turn")
    await page.mouse.up()
    turned = await server.wait("move_object", 2)
    assert (turned["x"], turned["y"], turned["theta"]) == pytest.approx((cx, cy, math.pi / 2), abs=0.03)
    await page.locator("#map-front").focus()
    await page.keyboard.press("Shift+ArrowUp")
    await server.wait("move_object", 3)
    await opened.sync()
    await opened.run_for(1600)
    await opened.says("#toasts", "The readings put object 5 ")


async def test_a_drag_says_where_the_robot_is_in_the_known_room(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    page = opened.page
    await page.locator("#tool-here").click()
    await page.mouse.move(*await opened.screen(1.0, 0.0))
    await page.mouse.down()
    await page.mouse.move(*await opened.screen(1.0, 0.5), steps=6)
    await opened.save_screenshot("here")
    await page.mouse.up()
    sent = await server.wait("place_robot")
    frame = Pose(0.05, -0.02, 0.03)  # of `synthetic_run`
    here = frame.compose(Pose(sent["x"], sent["y"], sent["theta"]))
    assert (here.x, here.y, here.theta) == pytest.approx((1.0, 0.0, math.pi / 2), abs=0.02)
    await expect(page.locator("#tool-pan")).to_have_attribute("aria-checked", "true")


async def test_an_object_is_nudged_and_rotated_by_keys(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    page = opened.page
    await page.locator("#objects").focus()
    await page.keyboard.press("End")
    await page.get_by_role("button", name="Move and turn").click()
    await expect(page.locator("#map-front")).to_be_focused()
    await page.keyboard.press("ArrowRight")
    moved = await server.wait("move_object")
    x, y = DRUMS[5]
    assert moved["object"] == 6
    assert (moved["x"], moved["y"]) == pytest.approx((x + 0.02, y - 0.01), abs=1e-6)
    await page.keyboard.press("Shift+ArrowUp")
    assert (await server.wait("move_object", 2))["y"] == pytest.approx(y + 0.09, abs=1e-6)
    await page.keyboard.press("[")
    assert (await server.wait("move_object", 3))["theta"] == pytest.approx(math.radians(5.0))


async def test_objects_are_confirmed_and_rejected_and_the_map_cleared(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    page = opened.page
    await page.locator("#objects li").nth(2).click()
    await page.get_by_role("button", name="Confirm").click()
    assert await server.wait("confirm_object") == {"object": 3}
    await page.get_by_role("button", name="Reject").click()
    assert await server.wait("reject_object") == {"object": 3}

    await expect(page.locator("#areas-part")).to_be_hidden()
    server.areas = [[4, 1.5, -0.5, 0.3]]
    await opened.sync()
    await opened.says("#areas", "4  ")
    await page.get_by_role("button", name="Lift area 4").click()
    assert await server.wait("lift_area") == {"area": 4}
    await page.locator("#map-front").focus()
    await page.keyboard.press("Control+z")
    assert await server.wait("undo_edit") == {}
    await opened.says("#toasts", "The object is reported again")

    server.refusals["reject_object"] = ("object 3 left the map before", None)
    await page.locator("#objects li").nth(2).click()
    await page.get_by_role("button", name="Reject").click()
    await opened.says("#toasts", "object 3 left the map before")

    await page.get_by_role("button", name="Clear the map…").click()
    await page.get_by_role("button", name="Keep it").click()
    await page.get_by_role("button", name="Clear the map…").click()
    await opened.sync()
    assert not server.of("clear_map")
    await page.get_by_role("button", name="Clear the map", exact=True).click()
    assert await server.wait("clear_map") == {}


async def test_a_model_file_is_loaded_and_its_error_shown_beside_it(
    server: FakeServer, opener: Opener, tmp_path: Path
) -> None:
    opened = await still(server, opener)
    text = 'name = "post"\nclosed = true\nvertices_m = [[0.1, 0.0], [0.0, 0.1], [0.0, 0.0]]\n'
    file = tmp_path / "post.toml"
    file.write_text(text)
    await opened.tab("Tune")
    await opened.page.get_by_label("Load another model").set_input_files(file)
    assert await server.wait("load_model") == {"toml": text}
    await opened.says("#toasts", "post.toml is loaded")
    server.refusals["load_model"] = ("vertices_m: at least 3 are wanted", "vertices_m")
    await opened.page.get_by_label("Load another model").set_input_files(file)
    await opened.says("#model-error", "at least 3 are wanted")
    file.write_bytes(b"#" * 70_000)
    await opened.page.get_by_label("Load another model").set_input_files(file)
    await opened.says("#model-error", "70 kB long")
    await opened.sync()
    assert len(server.of("load_model")) == 2


def field(opened: Opened, path: str) -> Locator:
    return opened.page.locator(f'#tune-fields [data-path="{path}"]')


async def test_a_parameter_is_set_and_its_error_shown_beside_it(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    page = opened.page
    await opened.tab("Tune")
    gain = page.locator("#tune-fields").get_by_label("avoid obstacle gain")
    await gain.fill("2.5")
    await gain.press("Enter")
    assert await server.wait("set_parameter") == {"path": GAIN, "value": 2.5}
    await expect(field(opened, GAIN)).to_have_class("field changed")
    assert await page.locator("#drive-gains input").first.input_value() == "2.5", "both places show it"

    server.refusals["set_parameter"] = ("must be at most 100", GAIN)
    await gain.fill("1000")
    await gain.press("Tab")
    await expect(gain).to_have_attribute("aria-invalid", "true")
    await expect(field(opened, GAIN).locator(".error")).to_have_text("must be at most 100")
    await expect(gain).to_have_value("1000")
    await opened.save_screenshot("refused")

    await gain.fill("much")
    await gain.press("Enter")
    await expect(field(opened, GAIN).locator(".error")).to_have_text("a number is wanted")
    await opened.sync()
    assert len(server.of("set_parameter")) == 2
    await gain.press("Escape")
    await expect(gain).to_have_value("2.5")


async def test_parameters_are_filtered_chosen_undone_and_saved(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener)
    page = opened.page
    await opened.tab("Tune")
    await page.locator("#tune-filter").fill("founds a new")
    await expect(page.locator("#tune-fields .field:visible")).to_have_count(1)
    await expect(field(opened, "perception.clusters.threshold_m")).to_be_visible()
    await page.locator("#tune-filter").fill("")

    await page.get_by_label("preset").select_option("quadrants")
    assert await server.wait("set_parameter") == {"path": "ring.firing.preset", "value": "quadrants"}
    gain = page.locator("#tune-fields").get_by_label("avoid obstacle gain")
    await gain.fill("2.5")
    await gain.press("Enter")
    await server.wait("set_parameter", 2)
    await page.get_by_role("button", name="Undo").click()
    assert await server.wait("undo_parameter") == {}
    await page.locator("#tune-filter").focus()
    await expect(gain).to_have_value("1")

    await page.get_by_role("button", name="Save as TOML").click()
    await expect(page.locator("#toml")).to_have_value("[cycle]\nperception_budget_s = 0.005\n")
    async with page.expect_download() as saved:
        await page.get_by_role("button", name="Save as a file").click()
    path = await (await saved.value).path()
    assert path.read_text() == "[cycle]\nperception_budget_s = 0.005\n"


async def test_a_finger_selects_on_a_phone(server: FakeServer, opener: Opener) -> None:
    opened = await still(server, opener, PHONE)
    await opened.page.locator("#tool-select").tap()
    await opened.page.touchscreen.tap(*await middle(opened, 8))
    await expect(opened.page.locator("#selection-count")).to_have_text("1 segment")
    await opened.save_screenshot("phone-chosen")
    await opened.page.get_by_role("button", name="Delete").tap()
    assert len((await server.wait("delete_segments"))["numbers"]) == 1
