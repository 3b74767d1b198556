"""Accessibility: keys, contrast, names, text besides colour, any screen size, no external resources."""

from __future__ import annotations

from typing import Any, Literal

import pytest
from playwright.async_api import expect

from tests.browser.fake_server import PAGE, FakeServer
from tests.browser.open_page import DESKTOP, PHONE, PROJECTOR, Opened, Opener

pytestmark = pytest.mark.asyncio(loop_scope="session")

PANELS = ("Objects", "Drive", "Layers", "Tune", "Time", "Log")
MODES = ("drive", "ready", "connecting", "safe_stop", "fault")
AA = 4.5
AA_LARGE = 3.0


async def scene(server: FakeServer, opener: Opener, size: tuple[int, int], **more: Any) -> Opened:
    server.paused, server.cycle = True, 170
    opened = await opener.open(server.url, size, **more)
    await opened.steady()
    await server.send({"type": "log", "timestamp": "2026-01-02T10:11:12Z", "level": "warning",
                       "event": "a sensor hears less", "fields": {"sensor": "17"}})  # fmt: skip
    await server.send({"type": "log", "timestamp": "2026-01-02T10:11:13Z", "level": "error",
                       "event": "the line was lost", "fields": {}})  # fmt: skip
    return opened


@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_all_text_has_contrast(server: FakeServer, opener: Opener, scheme: Literal["light", "dark"]) -> None:
    opened = await scene(server, opener, DESKTOP, scheme=scheme, calm=True)
    for panel in PANELS:
        await opened.tab(panel)
        texts = await opened.probe("texts")
        assert len(texts) > 30
        faint = [(words, round(ratio, 2)) for words, ratio, large in texts if ratio < (AA_LARGE if large else AA)]
        assert not faint, (panel, faint)
        await opened.save_screenshot(f"{scheme}-{panel.lower()}")


@pytest.mark.parametrize("mode", ["READY", "SAFE_STOP", "FAULT", "CONNECTING"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_each_mode_has_contrast_text_and_a_shape(
    server: FakeServer, opener: Opener, mode: str, scheme: Literal["light", "dark"]
) -> None:
    server.mode, server.reason = mode, "bumper contact: free the robot, then re-arm"
    opened = await scene(server, opener, DESKTOP, scheme=scheme, calm=True)
    await opened.says("#mode-name", mode.replace("_", " "))
    assert await opened.page.locator("#mode-icon").get_attribute("href") == f"#m-{mode.lower()}"
    texts = await opened.probe("texts")
    assert not [(words, ratio) for words, ratio, large in texts if ratio < (AA_LARGE if large else AA)]
    shapes = {
        await opened.page.locator(f"#m-{m}").inner_html()
        for m in ("drive", "ready", "connecting", "safe_stop", "fault")
    }
    assert len(shapes) == 5, "two modes look alike but for their colour"


async def test_every_control_has_an_accessible_name(server: FakeServer, opener: Opener) -> None:
    opened = await scene(server, opener, DESKTOP)
    for panel in PANELS:
        await opened.tab(panel)
        assert await opened.probe("unnamed") == []


@pytest.mark.parametrize(
    ("name", "size"),
    [("phone", PHONE), ("desktop", DESKTOP), ("projector", PROJECTOR), ("tablet", (820, 1180)), ("side", (740, 360))],
)
async def test_it_fits_every_screen(server: FakeServer, opener: Opener, name: str, size: tuple[int, int]) -> None:
    touch = name in {"phone", "side"}
    opened = await scene(server, opener, size, touch=touch)
    seen = [p for p in (*PANELS, "Cycle") if await opened.page.get_by_role("tab", name=p, exact=True).is_visible()]
    assert ("Cycle" in seen) == (name not in {"desktop", "projector"})
    for panel in seen:
        await opened.tab(panel)
        wide = await opened.probe("too_wide")
        assert wide["page"] <= 0, (panel, wide)
        assert max(wide["panel"]) <= 0, (panel, wide)
        assert wide["tabs"] <= 0, (panel, wide)
        await opened.save_screenshot(f"{name}-{panel.lower()}")
    assert await opened.page.locator("#mode-name").is_visible()
    box = await opened.page.locator("#map-front").bounding_box()
    assert box is not None
    assert box["height"] >= 190


async def test_touch_targets_are_large_enough(server: FakeServer, opener: Opener) -> None:
    opened = await scene(server, opener, PHONE, touch=True)
    for panel in (*PANELS, "Cycle"):
        await opened.tab(panel)
        small = await opened.probe("too_small")
        assert not small, (panel, small)


async def test_panels_are_reached_with_keys_alone(server: FakeServer, opener: Opener) -> None:
    opened = await scene(server, opener, DESKTOP)
    page = opened.page
    await page.locator("#tab-objects").focus()
    for panel in ("drive", "layers", "tune", "time", "log", "objects"):
        await page.keyboard.press("ArrowRight")
        await expect(page.locator(f"#panel-{panel}")).to_be_visible()
        await expect(page.locator(f"#tab-{panel}")).to_be_focused()
    await page.keyboard.press("End")
    await expect(page.locator("#panel-log")).to_be_visible()


async def test_focus_cycles_and_is_always_visible(server: FakeServer, opener: Opener) -> None:
    opened = await scene(server, opener, DESKTOP)
    page = opened.page
    await opened.tab("Drive")
    met = []
    for _ in range(60):
        await page.keyboard.press("Tab")
        where = await opened.probe("focus")
        met.append(where[0])
        assert where[1], f"{where[0]} has the focus and does not show it"
    assert {"halt", "map-front", "tool-pan", "fit", "tab-drive", "disarm", "pad", "teleop-limit", "goal-x"} <= set(
        met
    )


async def test_tools_are_radio_buttons(server: FakeServer, opener: Opener) -> None:
    opened = await scene(server, opener, DESKTOP)
    page = opened.page
    await page.locator("#tool-pan").focus()
    await page.keyboard.press("ArrowDown")
    await expect(page.locator("#tool-select")).to_have_attribute("aria-checked", "true")
    await expect(page.locator("#tool-select")).to_be_focused()
    await page.keyboard.press("ArrowUp")
    await page.keyboard.press("ArrowUp")
    await expect(page.locator("#tool-tape")).to_have_attribute("aria-checked", "true")


async def test_keys_are_listed(server: FakeServer, opener: Opener) -> None:
    opened = await scene(server, opener, DESKTOP)
    await opened.page.keyboard.press("?")
    await opened.says("#dialog", "HALT, except while you type text")
    await opened.save_screenshot("keys")
    await opened.page.keyboard.press("Escape")
    await expect(opened.page.locator("#dialog")).to_be_hidden()


async def test_the_map_has_a_text_description(server: FakeServer, opener: Opener) -> None:
    opened = await scene(server, opener, DESKTOP)
    await opened.says("#map-text", "6 objects: drum at 7.0, 4.0 ft")


async def test_reduced_motion_is_respected(server: FakeServer, opener: Opener) -> None:
    opened = await scene(server, opener, DESKTOP, calm=True)
    moving = (
        "() => [...document.querySelectorAll('*')]"
        ".filter((e) => getComputedStyle(e).transitionDuration !== '0s').length"
    )
    assert await opened.page.evaluate(moving) == 0


async def test_a_change_of_colour_scheme_applies_at_once(server: FakeServer, opener: Opener) -> None:
    opened = await scene(server, opener, DESKTOP)
    corner = "() => document.getElementById('map-back').toDataURL()"
    light = await opened.page.evaluate(corner)
    await opened.page.emulate_media(color_scheme="dark")
    await opened.drawn()
    assert await opened.page.evaluate(corner) != light
    assert await opened.page.evaluate("() => getComputedStyle(document.body).backgroundColor") == "rgb(25, 31, 38)"


async def test_nothing_is_loaded_from_elsewhere(server: FakeServer, opener: Opener) -> None:
    opened = await scene(server, opener, DESKTOP)
    asked = await opened.page.evaluate("() => performance.getEntriesByType('resource').map((e) => e.name)")
    assert len(asked) > 20
    assert all(name.startswith((f"http://127.0.0.1:{server.port}/page/", "blob:")) for name in asked), asked


async def test_no_script_or_style_is_inline() -> None:
    index = (PAGE / "index.html").read_text("utf-8")
    assert "<style" not in index
    assert "style=" not in index
    assert " on" + "click" not in index
    assert index.count("<script") == index.count('<script type="module" src="/page/')
    for file in PAGE.glob("*.js"):
        text = file.read_text("utf-8")
        assert "innerHTML" not in text, file
        assert "eval(" not in text, file
        assert text.startswith("//"), f"{file} does not say why it exists"
        assert text.count("\n") < 260, file
