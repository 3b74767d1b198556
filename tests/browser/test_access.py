"""Accessibility: keys, contrast, names, text besides colour, any screen size, no external resources."""

from __future__ import annotations

from importlib.resources import files
from typing import Any, Literal

import pytest
from playwright.async_api import expect

from tests.browser.fake_server import PAGE, FakeServer
from tests.browser.open_page import DESKTOP, PHONE, PROJECTOR, Opened, Opener, until

pytestmark = pytest.mark.asyncio(loop_scope="session")

PANELS = ("Objects", "Drive", "Layers", "Tune", "Time", "Plot", "Files", "Log")
MODES = ("READY", "SAFE_STOP", "FAULT", "CONNECTING")
AXE = """async (rules) => (await axe.run(document, { resultTypes: ['violations'], rules })).violations
    .filter(({ impact }) => impact !== 'minor')
    .map(({ id, impact, nodes }) => [id, impact, nodes.map((node) => [node.target, node.failureSummary])])"""
AA = 4.5
AA_LARGE = 3.0


async def scene(server: FakeServer, opener: Opener, size: tuple[int, int], **more: Any) -> Opened:
    server.cycle = 170
    opened = await opener.open(server.url, size, **more)
    await opened.steady()
    await server.send({"type": "log", "timestamp": "2026-01-02T10:11:12Z", "level": "warning",
                       "event": "a sensor hears less", "fields": {"sensor": "17"}})  # fmt: skip
    await server.send({"type": "log", "timestamp": "2026-01-02T10:11:13Z", "level": "error",
                       "event": "the line was lost", "fields": {}})  # fmt: skip
    await opened.sync()
    return opened


async def faint_texts(opened: Opened) -> list[tuple[str, float]]:
    """Return the visible texts with too little contrast, and check that there are texts."""
    texts = await opened.probe("texts")
    assert len(texts) > 30
    return [(words, round(ratio, 2)) for words, ratio, large in texts if ratio < (AA_LARGE if large else AA)]


@pytest.mark.parametrize("scheme", ["dark", pytest.param("light", marks=pytest.mark.soak)])
async def test_all_text_has_contrast_in_every_panel_and_mode(
    server: FakeServer, opener: Opener, scheme: Literal["light", "dark"]
) -> None:
    opened = await scene(server, opener, DESKTOP, scheme=scheme, calm=True)
    for panel in PANELS:
        await opened.tab(panel)
        assert not await faint_texts(opened), panel
        await opened.save_screenshot(f"{scheme}-{panel.lower()}")
    for mode in MODES:
        server.mode, server.reason = mode, "bumper contact: free the robot, then re-arm"
        await opened.says("#mode-name", mode.replace("_", " "))
        assert await opened.page.locator("#mode-icon").get_attribute("href") == f"#m-{mode.lower()}"
        assert not await faint_texts(opened), mode
    shapes = {await opened.page.locator(f"#m-{m.lower()}").inner_html() for m in ("DRIVE", *MODES)}
    assert len(shapes) == 5, "two modes look alike but for their colour"


async def test_a_plot_has_a_name_before_it_is_drawn(server: FakeServer, opener: Opener) -> None:
    opened = await scene(server, opener, DESKTOP)
    await opened.page.evaluate("() => { window.requestAnimationFrame = () => 0; }")
    await opened.tab("Plot")
    assert await opened.page.locator("#plot-lanes canvas").count() > 0
    assert await opened.page.locator("#plot-lanes canvas:not([aria-label])").count() == 0


DESKTOPS = {"desktop": DESKTOP, "projector": PROJECTOR, "laptop": (1024, 768), "tablet": (820, 1180)}
HANDHELDS = {"phone": PHONE, "side": (740, 360)}


@pytest.mark.parametrize(
    "sizes",
    [
        pytest.param({"laptop": DESKTOPS["laptop"], "tablet": DESKTOPS["tablet"]}, id="desktop"),
        pytest.param({"phone": PHONE}, id="handheld"),
        pytest.param(DESKTOPS, id="desktops", marks=pytest.mark.soak),
        pytest.param(HANDHELDS, id="handhelds", marks=pytest.mark.soak),
    ],
)
async def test_it_fits_every_screen_and_every_control_has_a_name(
    server: FakeServer, opener: Opener, sizes: dict[str, tuple[int, int]]
) -> None:
    touch = "phone" in sizes
    opened = await scene(server, opener, next(iter(sizes.values())), touch=touch)
    for name, size in sizes.items():
        await opened.page.set_viewport_size({"width": size[0], "height": size[1]})
        await opened.until(f"innerWidth === {size[0]} && innerHeight === {size[1]}", f"the size of a {name}")
        tabs = [
            p for p in (*PANELS, "Cycle") if await opened.page.get_by_role("tab", name=p, exact=True).is_visible()
        ]
        assert tabs[: len(PANELS)] == list(PANELS)
        assert ("Cycle" in tabs) == (name not in {"desktop", "projector", "laptop"})
        for panel in tabs:
            await opened.tab(panel)
            wide = await opened.probe("too_wide")
            assert wide["page"] <= 0, (name, panel, wide)
            assert max(wide["panel"]) <= 0, (name, panel, wide)
            assert wide["tabs"] <= 0, (name, panel, wide)
            assert await opened.probe("unnamed") == [], (name, panel)
            if touch:
                assert not await opened.probe("too_small"), (name, panel)
            await opened.save_screenshot(f"{name}-{panel.lower()}")
        assert await opened.page.locator("#mode-name").is_visible()
        box = await opened.page.locator("#map-front").bounding_box()
        assert box is not None
        assert box["height"] >= 190


@pytest.mark.parametrize("schemes", [("light",), pytest.param(("light", "dark"), marks=pytest.mark.soak)], ids=str)
@pytest.mark.parametrize(
    "size", [pytest.param(DESKTOP, id="desktop"), pytest.param(PHONE, id="phone", marks=pytest.mark.soak)]
)
async def test_axe_finds_nothing_on_any_tab(
    server: FakeServer, opener: Opener, size: tuple[int, int], schemes: tuple[Literal["light", "dark"], ...]
) -> None:
    """Check every panel, drive mode, a dialog and the tour by the rules of axe-core.

    Its rule for contrast takes most of its time, and the quick form leaves that to the test above of all texts.
    """
    rules = {"color-contrast": {"enabled": len(schemes) > 1}}
    opened = await scene(server, opener, size, real_time=True, drawn_seldom=True, first_visit=True)
    page = opened.page
    await page.evaluate(files("axe_playwright_python").joinpath("axe.min.js").read_text("utf-8"))

    found = {}

    async def check(what: str) -> None:
        found[what] = await page.evaluate(AXE, rules)

    await check("tour")
    await page.get_by_role("button", name="Skip").click()
    for scheme in schemes:
        await page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
        for tab in await page.get_by_role("tab").all():
            if await tab.is_visible():
                await tab.click()
                await check(f"{scheme} {await tab.inner_text()}")
    await page.keyboard.press("?")
    await check("keys")
    await page.keyboard.press("Escape")
    await opened.tab("Drive")
    await page.get_by_role("button", name="Drive mode", exact=True).click()
    await check("drive mode")
    assert not {what: violations for what, violations in found.items() if violations}
    assert len(found) > 8 * len(schemes)


async def test_panels_tools_and_help_are_reached_with_keys_alone(server: FakeServer, opener: Opener) -> None:
    opened = await scene(server, opener, DESKTOP)
    page = opened.page
    await page.locator("#tab-objects").focus()
    for panel in ("drive", "layers", "tune", "time", "plot", "files", "log", "objects"):
        await page.keyboard.press("ArrowRight")
        await expect(page.locator(f"#panel-{panel}")).to_be_visible()
        await expect(page.locator(f"#tab-{panel}")).to_be_focused()
    await page.keyboard.press("End")
    await expect(page.locator("#panel-log")).to_be_visible()

    await page.locator("#tool-pan").focus()
    await page.keyboard.press("ArrowDown")
    await expect(page.locator("#tool-select")).to_have_attribute("aria-checked", "true")
    await expect(page.locator("#tool-select")).to_be_focused()
    await page.keyboard.press("ArrowUp")
    await page.keyboard.press("ArrowUp")
    await expect(page.locator("#tool-places")).to_have_attribute("aria-checked", "true")

    await page.keyboard.press("?")
    await opened.says("#dialog", "HALT, except while you type text")
    await opened.save_screenshot("keys")
    await page.keyboard.press("Escape")
    await expect(page.locator("#dialog")).to_be_hidden()


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


async def test_description_motion_colours_and_origin(server: FakeServer, opener: Opener) -> None:
    """Read the map's description, reduce motion, change the colours, and list what was loaded."""
    opened = await scene(server, opener, DESKTOP, calm=True)
    page = opened.page
    await opened.says("#map-text", "Objects: 6; drum at 7.0, 4.0 ft")

    moving = (
        "() => [...document.querySelectorAll('*')]"
        ".filter((e) => getComputedStyle(e).transitionDuration !== '0s').length"
    )
    assert await page.evaluate(moving) == 0

    light = await opened.picture()
    await page.emulate_media(color_scheme="dark")
    await expect(page.locator("body")).to_have_css("background-color", "rgb(25, 31, 38)")

    async def is_drawn_anew() -> bool:
        return await opened.picture() != light

    await until(is_drawn_anew, "a map in dark colours")

    origin = f"http://127.0.0.1:{server.port}/"
    assert opened.requests[0] == server.url
    assert len(opened.requests) > 20
    assert all(url.startswith((f"{origin}page/", "blob:")) for url in opened.requests[1:]), opened.requests


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
        assert text.count("\n") <= 400, file
