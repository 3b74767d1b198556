"""Places and no-go areas on the page of a real console: drawn, edited, undone, saved, loaded, kept over a reload."""

from __future__ import annotations

import asyncio
from pathlib import Path

import numpy as np
import pytest
from playwright.async_api import expect

from behaviors.move_to_goal import Goal
from config.load import load_world
from tests.browser.open_page import Opened, Opener, until
from tests.runtime.console.console_case import ConsoleCase, open_console

pytestmark = pytest.mark.asyncio(loop_scope="session")

SQUARE = ((1.0, 0.5), (2.0, 0.5), (2.0, 1.5), (1.0, 1.5))

REFUSE_ONCE = """async () => {
    const { connection } = await import('/page/main.js'), request = connection.request;
    connection.request = (message, ...more) => {
        if (message.type !== 'set_places') return request.call(connection, message, ...more);
        connection.request = request;
        return Promise.reject(new Error('not now'));
    };
}"""


async def beats(case: ConsoleCase) -> None:
    """Run cycles of a robot that stands, so that the page has states."""
    while True:
        case.cycle = 0
        case.cycles()
        await asyncio.sleep(0.05)


async def click(opened: Opened, *points: tuple[float, float]) -> None:
    for point in points:
        await opened.page.mouse.click(*await opened.screen(*point))


async def drag(opened: Opened, begin: tuple[float, float], end: tuple[float, float]) -> None:
    mouse = opened.page.mouse
    await mouse.move(*await opened.screen(*begin))
    await mouse.down()
    await mouse.move(*await opened.screen(*end), steps=4)
    await mouse.up()


async def ready(case: ConsoleCase, opener: Opener) -> Opened:
    """Open the page at the Drive tab, with a map that stays where it is."""
    opened = await opener.open(case.console.url, real_time=True, drawn_seldom=True)
    await opened.page.evaluate(
        "async () => { const { view } = await import('/page/main.js');"
        " view.fit({ left: -2, right: 4, bottom: -2, top: 3 }); view.touched = true; }"
    )
    await opened.tab("Drive")
    await until(opened.page.locator("#places-draw").is_enabled, "control")
    return opened


async def test_places_are_drawn_edited_undone_saved_and_survive_a_reload(opener: Opener, tmp_path: Path) -> None:
    async with open_console("console.command_age_max_s=60.0") as case:  # whatever else the machine does
        beating = asyncio.create_task(beats(case))
        try:
            await operate(case, opener, tmp_path)
        finally:
            await opener.leave()
            beating.cancel()
            await asyncio.gather(beating, return_exceptions=True)


async def operate(case: ConsoleCase, opener: Opener, folder: Path) -> None:
    settings = case.run.live_settings
    opened = await ready(case, opener)
    page, rows = opened.page, opened.page.locator("#places-list > li")
    await opened.says("#places-text", "There is no map")

    await page.locator("#places-kind").select_option("no_go_area")
    await click(opened, *SQUARE)
    await page.evaluate(REFUSE_ONCE)
    await page.locator("#places-finish").click()
    await opened.says("#toasts", "not now")
    await expect(page.locator("#places-finish")).to_be_enabled()  # what was drawn is not lost
    await page.locator("#places-finish").click()
    await expect(rows).to_have_count(1)
    assert np.allclose(settings.current.places.no_go_area[0].vertices_m, SQUARE, atol=0.02)
    await page.locator("#places-kind").select_option("no_go_line")
    await click(opened, (-1.0, 1.0), (-1.0, 2.0), (-0.5, 2.5), (-0.5, 2.5))
    await expect(rows).to_have_count(2)
    assert len(settings.current.places.no_go_line[0].points_m) == 3
    await page.locator("#places-kind").select_option("speed_area")
    await click(opened, (0.0, -1.5), (1.5, -1.5), (1.5, -0.7))
    await page.locator("#places-finish").click()
    await page.locator("#places-speed").fill("0.1")
    await page.locator("#places-name").fill("ward")
    await page.locator("#places-name").press("Enter")
    await until_row(opened, "ward at most 0.10 m/s")
    await page.locator("#places-kind").select_option("place")
    await drag(opened, (3.0, 0.0), (3.0, 0.8))
    await expect(page.locator("#places-name")).to_have_value("place-1")  # the run's answer fills the form
    await page.locator("#places-name").fill("charger")
    await page.locator("#places-name").press("Enter")
    await until_row(opened, "charger 3.00, 0.00 m, 90°")
    there = settings.current.places.place[0]
    assert (there.x_m, there.y_m, there.heading_deg) == pytest.approx((3.0, 0.0, 90.0), abs=1.0)

    await opened.save_screenshot("places")

    await page.locator("#places-name").fill("A name")
    for kind in ("no_go_line", "place"):  # each shows the form again
        await page.locator("#places-kind").select_option(kind)
    await expect(page.locator("#places-name")).to_have_value("A name")
    await page.locator("#places-name").press("Enter")
    await opened.says("#places-error", "small letters")
    await page.locator("#places-row-no_go_line-0").click()
    await expect(page.locator("#places-error")).to_have_text("")

    await drag(opened, (2.0, 1.5), (2.4, 1.9))
    await until(lambda: has_corner(case, (2.4, 1.9)), "a moved corner")
    await page.locator("#map-front").press("Control+z")
    await until(lambda: has_corner(case, (2.0, 1.5)), "the corner as it was")
    await page.locator("#places-remove-no_go_area-0").click()
    await expect(rows).to_have_count(3)
    await page.locator("#places-undo").click()
    await expect(rows).to_have_count(4)

    await page.locator("#places-go-0").click()
    await until(lambda: is_goal(case, there.x_m), "the goal")

    before = settings.current.places
    for button, name in (("save", "map.toml"), ("geojson", "map.geojson")):
        async with page.expect_download() as waiting:
            await page.locator(f"#places-{button}").click()
        await (await waiting.value).save_as(folder / name)
    assert load_world(folder / "map.toml").places() == before

    await page.reload()
    await opened.until("run.fresh", "a first state")
    await opened.tab("Drive")
    await expect(rows).to_have_count(4)
    for left in (3, 2, 1, 0):
        await page.locator("#places-list button[aria-label^='Remove']").first.click()
        await expect(rows).to_have_count(left)
    for name in ("map.geojson", "map.toml"):  # the second one adds nothing, as its places are there
        await page.locator("#places-file").set_input_files(folder / name)
        await expect(rows).to_have_count(4)
        await expect(page.locator("#places-file")).to_have_value("")
        assert settings.current.places == before


async def until_row(opened: Opened, text: str) -> None:
    await expect(opened.page.locator("#places-list")).to_contain_text(text)


async def has_corner(case: ConsoleCase, corner: tuple[float, float]) -> bool:
    corners = case.run.live_settings.current.places.no_go_area[0].vertices_m
    return any(one == pytest.approx(corner, abs=0.02) for one in corners)


async def is_goal(case: ConsoleCase, x: float) -> bool:
    return any(isinstance(one, Goal) and one.x == x for one in case.run.asked)
