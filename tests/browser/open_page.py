"""Pages opened in a browser, and the actions of an operator on them."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

from playwright.async_api import Browser, BrowserContext, Page, expect

from tests.browser.fake_server import TIMEOUT_S

DESKTOP, PHONE, PROJECTOR = (1440, 900), (360, 740), (1920, 1080)
PROBES = Path(__file__).parent / "probes"
MODULE = "import('/page/main.js')"


@dataclass
class Opened:
    """A page, the errors it reported, and where its screenshots go."""

    page: Page
    screenshots: Callable[[str], Path]
    errors: list[str] = field(default_factory=list)

    async def screen(self, x: float, y: float) -> tuple[float, float]:
        """Return the screen position (px) of a point of the odometry frame (m)."""
        at: list[float] = await self.page.evaluate(
            f"""async ([x, y]) => {{
                const {{ view }} = await {MODULE};
                const box = document.getElementById('map-front').getBoundingClientRect();
                const [sx, sy] = view.toScreen(x, y);
                return [box.left + sx, box.top + sy];
            }}""",
            [x, y],
        )
        return at[0], at[1]

    async def world(self, expression: str) -> Any:
        """Return the value of an expression over the exports of the page's main module."""
        return await self.page.evaluate(
            f"async () => {{ const {{ connection, teleoperation, selection, tools, units, view, run }} ="
            f" await {MODULE}; return {expression}; }}"
        )

    async def until(self, expression: str, what: str) -> None:
        """Wait until such an expression becomes true."""
        await until(lambda: self.world(f"Boolean({expression})"), what)

    async def probe(self, name: str, *arguments: Any) -> Any:
        """Return the result of one of the functions in `probes/`."""
        return await self.page.evaluate((PROBES / f"{name}.js").read_text("utf-8"), *arguments)

    async def drawn(self) -> None:
        """Wait until all pending drawing is done."""
        await self.page.evaluate(
            "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done())))"
        )

    async def steady(self) -> None:
        """Turn off automatic fitting of the map, so that screen positions stay valid."""
        await self.until("run.fresh && run.state.objects.length > 0", "objects on the map")
        await self.page.evaluate(f"async () => {{ const {{ view }} = await {MODULE}; view.touched = true; }}")

    async def tab(self, name: str) -> None:
        """Show a panel."""
        await self.page.get_by_role("tab", name=name, exact=True).click()

    async def save_screenshot(self, name: str) -> None:
        """Save a screenshot."""
        await self.page.screenshot(path=self.screenshots(name))

    async def says(self, selector: str, words: str) -> None:
        """Wait until an element contains a text."""
        await expect(self.page.locator(selector)).to_contain_text(words, timeout=1000 * TIMEOUT_S)


class Opener:
    """Opens pages and closes them at the end."""

    def __init__(self, browser: Browser, screenshots: Callable[[str], Path]) -> None:
        self._browser = browser
        self._screenshots = screenshots
        self._contexts: list[BrowserContext] = []
        self._opened: list[Opened] = []

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.leave()

    async def leave(self) -> None:
        """Close all pages."""
        while self._contexts:
            await self._contexts.pop().close()

    async def open(
        self, url: str, size: tuple[int, int] = DESKTOP, *, scheme: Literal["dark", "light"] = "light",
        touch: bool = False, calm: bool = False, script: str | None = None, live: bool = True,
    ) -> Opened:  # fmt: skip
        """Open a page and wait for its first state."""
        context = await self._browser.new_context(
            viewport={"width": size[0], "height": size[1]}, color_scheme=scheme, has_touch=touch, is_mobile=touch,
            device_scale_factor=2 if touch else 1, reduced_motion="reduce" if calm else "no-preference",
            accept_downloads=True,
        )  # fmt: skip
        context.set_default_timeout(1000 * TIMEOUT_S)
        self._contexts.append(context)
        if script is not None:
            await context.add_init_script(script)
        page = await context.new_page()
        opened = Opened(page, self._screenshots)
        page.on("pageerror", lambda error: opened.errors.append(str(error)))
        page.on("console", lambda said: opened.errors.extend([said.text] * (said.type == "error")))
        self._opened.append(opened)
        await page.goto(url)
        if live:
            await opened.until("run.fresh", "a first state")
        return opened

    def check(self) -> None:
        """Fail if a page reported an error."""
        errors = [text for opened in self._opened for text in opened.errors]
        assert not errors, errors


async def until(done: Callable[[], Awaitable[object]], what: str) -> None:
    """Wait until a condition holds."""
    end_s = time.monotonic() + TIMEOUT_S
    while not await done():
        assert time.monotonic() < end_s, f"it never came: {what}"
        await asyncio.sleep(0.02)
