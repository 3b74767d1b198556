"""What an operator arranges: buttons, panels side by side, plots with one time axis and derived values."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest
from playwright.async_api import expect

from tests.browser.fake_server import FakeServer
from tests.browser.open_page import DESKTOP, PHONE, Opened, Opener
from tests.browser.synthetic_run import greeting

pytestmark = pytest.mark.asyncio(loop_scope="session")

LAPTOP = (1024, 768)
MISSIONS = [{"name": "patrol", "about": ""}, {"name": "inspect-every-drum-of-the-hall-and-come-back", "about": ""}]


async def with_missions(server: FakeServer, opener: Opener, size: tuple[int, int] = DESKTOP) -> Opened:
    session: dict[str, Any] = greeting() | {"missions": MISSIONS}
    server.session = session
    return await opener.open(server.url, size)


async def make_button(opened: Opened, action: str, key: str) -> None:
    await opened.page.locator("#button-action").select_option(action)
    await opened.page.locator("#button-key").fill(key)
    await opened.page.get_by_role("button", name="Make a button").click()


async def test_a_named_place_is_a_button(server: FakeServer, opener: Opener) -> None:
    none: dict[str, Any] = {"frame": "odom", "place": [], "no_go_line": [], "no_go_area": [], "speed_area": []}
    charger = {"name": "charger", "x_m": 1.0, "y_m": 2.0, "heading_deg": None}
    server.session = greeting() | {"places": none | {"place": [charger]}}
    opened = await opener.open(server.url)
    await opened.tab("Drive")
    await opened.page.locator("#buttons-part summary").click()
    await make_button(opened, "place:charger", "g")
    await opened.page.locator("#own-buttons button").click()
    assert await server.wait("go_to_place") == {"name": "charger"}
    await server.send({"type": "places", **none})
    await opened.sync()
    await expect(opened.page.locator("#own-buttons button")).to_be_disabled()


async def test_a_mission_is_a_button_with_a_key_and_stays_after_a_reload(server: FakeServer, opener: Opener) -> None:
    opened = await with_missions(server, opener)
    page = opened.page
    await opened.tab("Drive")
    await page.locator("#buttons-part summary").click()
    await make_button(opened, "mission:patrol", "m")
    await make_button(opened, f"mission:{MISSIONS[1]['name']}", "f")
    await opened.says("#button-error", "the key F belongs to the page itself")
    for tool in await page.locator("#tools kbd").all_inner_texts():
        await make_button(opened, f"mission:{MISSIONS[1]['name']}", tool)
        await opened.says("#button-error", f"the key {tool} belongs to the page itself")
    await make_button(opened, f"mission:{MISSIONS[1]['name']}", "m")
    await opened.says("#button-error", "the key M belongs to mission patrol")
    await make_button(opened, f"mission:{MISSIONS[1]['name']}", "")
    await expect(page.locator("#own-buttons button")).to_have_count(2)
    await page.locator("#own-buttons button").first.click()
    assert await server.wait("start_mission") == {"name": "patrol"}
    await page.locator("#map-front").focus()
    await page.keyboard.press("m")
    await server.wait("start_mission", 2)
    await opened.says("#toasts", "Mission started: patrol")
    await page.locator("#route-name").fill("my m")
    await opened.sync()
    assert len(server.of("start_mission")) == 2, "a letter in a text field starts nothing"
    await opened.save_screenshot("own-buttons-1440")

    await page.reload()
    await opened.until("run.fresh", "the page after a reload")
    await expect(page.locator("#own-buttons button")).to_have_count(2)
    server.controller = None
    await opened.sync()
    await expect(page.locator("#own-buttons button").first).to_be_disabled()
    await opened.world("buttons.offer('place', () => [{ id: 'dock', name: 'dock', act: async () => {} }])")
    await opened.tab("Drive")
    assert "place dock" in await page.locator("#button-action option").all_text_contents()
    await page.locator("#buttons-part summary").click()
    await page.get_by_role("button", name="Remove the button mission patrol").click()
    await expect(page.locator("#own-buttons button")).to_have_count(1)


@pytest.mark.parametrize(
    "size", [pytest.param(LAPTOP, id="1024", marks=pytest.mark.soak), pytest.param(PHONE, id="phone")]
)
async def test_own_buttons_fit_on_the_map(server: FakeServer, opener: Opener, size: tuple[int, int]) -> None:
    opened = await with_missions(server, opener, size)
    for mission in MISSIONS:
        await opened.page.evaluate(
            """(name) => { const kept = JSON.parse(localStorage.getItem('echolocate'));
            localStorage.setItem('echolocate', JSON.stringify({ ...kept,
                buttons: [...(kept.buttons ?? []), { action: `mission:${name}`, key: '' }] })); }""",
            mission["name"],
        )
    await opened.page.reload()
    await opened.until("run.fresh", "the page after a reload")
    await opened.drawn()
    await opened.save_screenshot(f"own-buttons-{size[0]}")
    for button in await opened.page.locator("#own-buttons button").all():
        box = await button.bounding_box()
        assert box is not None
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= size[0]
        at = [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]
        assert await opened.page.evaluate(
            "([x, y]) => document.elementFromPoint(x, y)?.closest('#own-buttons') !== null", at
        ), "nothing lies over it"


async def test_two_panels_stand_side_by_side_with_the_sizes_one_gave(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    await opened.tab("Layers")
    await page.locator("#beside-panel").select_option("plot")
    await expect(page.locator("#panel-plot")).to_be_visible()
    await expect(page.locator("#panel-layers")).to_be_visible()
    await opened.tab("Objects")
    await expect(page.locator("#panel-plot")).to_be_visible()
    await page.locator("#split-beside").focus()
    before = await page.locator("#panel-plot").bounding_box()
    await page.keyboard.press("ArrowLeft")
    await page.keyboard.press("ArrowLeft")
    after = await page.locator("#panel-plot").bounding_box()
    assert before is not None
    assert after is not None
    assert after["width"] == pytest.approx(before["width"] + 48, abs=1)
    await opened.save_screenshot("beside-1440")

    await page.reload()
    await opened.until("run.fresh", "the page after a reload")
    kept = await page.locator("#panel-plot").bounding_box()
    assert kept is not None
    assert kept["width"] == pytest.approx(after["width"], abs=1)
    await expect(page.locator("#panel-objects")).to_be_visible()
    await page.set_viewport_size({"width": 1024, "height": 768})
    await expect(page.locator("#panel-plot")).to_be_hidden()
    await page.set_viewport_size({"width": 1440, "height": 900})
    await expect(page.locator("#panel-plot")).to_be_visible()
    await opened.tab("Plot")
    await expect(page.locator("#beside")).to_be_hidden()
    await expect(page.locator("#panel-objects")).to_be_hidden()


async def plots(server: FakeServer, opener: Opener) -> Opened:
    server.cycle = 60
    opened = await opener.open(server.url)
    await opened.tab("Plot")
    await server.advance(40)
    await opened.sync()
    await opened.drawn()
    return opened


async def spans(opened: Opened) -> set[str]:
    """Return the time spans that the plots say they show."""
    await opened.drawn()
    labels = [
        await lane.get_attribute("aria-label") or "" for lane in await opened.page.locator("#plot-lanes canvas").all()
    ]
    return {label.rsplit(" in ", 1)[1] for label in labels}


async def test_an_axis_of_values_is_marked_at_round_numbers(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    draw = "async ([low, high]) => (await import('/page/plot_draw.js')).valueMarks(low, high).map(([, text]) => text)"
    for low, high, marks in (
        (-0.0076, 0.2, ["0.0", "0.1", "0.2"]), (-0.5, 0.5, ["−0.5", "0.0", "0.5"]), (-180, 180, ["−100", "0", "100"]),
        (1234, 1300, ["1240", "1260", "1280", "1300"]), (2.5, 3.5, ["2.5", "3.0", "3.5"]),
    ):  # fmt: skip
        assert await opened.page.evaluate(draw, [low, high]) == marks


async def test_all_plots_share_a_time_axis_that_zooms_and_moves(server: FakeServer, opener: Opener) -> None:
    opened = await plots(server, opener)
    page = opened.page
    assert await spans(opened) == {"30 s"}
    await page.get_by_role("button", name="Zoom the time in").click()
    assert await spans(opened) == {"15 s"}
    await page.locator("#plot-lanes canvas").first.hover()
    await page.mouse.wheel(0, -500)
    (shown,) = await spans(opened)
    assert float(shown.split()[0]) < 15
    await expect(page.locator("#plot-follow")).to_have_attribute("aria-pressed", "false")
    box = await page.locator("#plot-lanes canvas").first.bounding_box()
    assert box is not None
    await page.mouse.move(box["x"] + 100, box["y"] + 40)
    await page.mouse.down()
    await page.mouse.move(box["x"] + 160, box["y"] + 40, steps=3)
    await page.mouse.up()
    assert await spans(opened) == {shown}, "a drag moves it and keeps its length"
    await opened.save_screenshot("plot-zoomed")
    await page.mouse.move(0, 0)
    await expect(page.locator("#plot-read")).to_have_text(re.compile(r"s before$"))  # of what is shown
    await page.locator("#plot-follow").click()
    assert await spans(opened) == {"30 s"}


async def test_a_plot_has_two_axes_a_rate_and_a_difference(
    server: FakeServer, opener: Opener, monkeypatch: pytest.MonkeyPatch
) -> None:
    pose = server.hall.pose
    monkeypatch.setattr(server.hall, "pose", lambda cycle: [*pose(cycle)[:2], pose(cycle)[2] + 4.0 * math.pi])
    opened = await plots(server, opener)
    page = opened.page
    await page.locator("#plot-filter").fill("heading")
    await page.get_by_label("heading", exact=True).first.check()
    label = await page.locator('.lane[data-path="pose.heading"] canvas').get_attribute("aria-label") or ""
    degrees = [float(one.replace("−", "-")) for one in re.findall(r"[−\d.]+", label.partition(" in ")[0])]
    assert len(degrees) == 2, label
    assert max(map(abs, degrees)) < 10.0, f"two turns count: {label}"
    options = await page.get_by_label("Combine heading", exact=True).locator("option").all_inner_texts()
    assert not [one for one in options if one.startswith("minus")], "degrees and metres have no difference"
    await page.get_by_label("heading", exact=True).first.uncheck()
    await page.locator("#plot-filter").fill("pose")
    await page.get_by_label("pose x", exact=True).first.check()
    await page.locator("#plot-filter").fill("range")
    await page.get_by_label("range 1", exact=True).check()
    await page.get_by_label("Combine pose x", exact=True).select_option(label="its rate")
    await page.get_by_label("Combine range 0", exact=True).select_option(label="minus range 1")
    await page.get_by_label("Combine speed", exact=True).select_option(label="pose x on the right")
    names = page.locator("#plot-lanes figcaption > span")
    both = "speed, pose x (right)"
    assert await names.all_inner_texts() == [both, "range 0", "range 1", "rate of pose x", "range 0 − range 1"]
    await opened.drawn()
    first = page.locator("#plot-lanes figcaption b")
    await expect(first.nth(0)).to_have_text(re.compile(r"ft/s, .* ft$"))
    speed = await first.nth(3).inner_text()
    assert speed.endswith(" ft/s")
    assert float(speed.split()[0]) == pytest.approx(0.98, abs=0.05), "the rate of x is the speed along x"
    derived = await page.get_by_label("Combine rate of pose x", exact=True).locator("option").all_inner_texts()
    assert "its rate" not in derived
    assert not [one for one in derived if one.startswith("minus")], "what is derived is not derived from again"
    await opened.save_screenshot("plot-combined")
    async with page.expect_download() as saved:
        await page.get_by_role("button", name="Save as CSV").click()
    lines = (await (await saved.value).path()).read_text("utf-8").splitlines()
    assert lines[0] == "robot_s,twist.v,pose.x,ranges.0,ranges.1,rate|pose.x,minus|ranges.0|ranges.1"
    row = lines[-1].split(",")
    if row[3] and row[4]:
        assert float(row[6]) == pytest.approx(float(row[3]) - float(row[4]))

    await page.reload()
    await opened.until("run.fresh", "the page after a reload")
    assert (await names.all_inner_texts())[0] == both
    await page.get_by_label("Combine speed", exact=True).select_option(label="pose x apart")
    assert (await names.all_inner_texts())[0] == "speed"
