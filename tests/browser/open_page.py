"""Pages opened in a browser, and the actions of an operator on them."""

from __future__ import annotations

import asyncio
import contextlib
import re
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

from playwright.async_api import Browser, BrowserContext, ConsoleMessage, Error, Page, Request, expect

from tests.browser.fake_server import SYNC
from tests.hil.machine import TIMEOUT_S

DESKTOP, PHONE, PROJECTOR = (1440, 900), (360, 740), (1920, 1080)
PROBES = Path(__file__).parent / "probes"
MODULE = "import('/page/main.js')"
BEGIN = datetime(2026, 1, 2, 12, 0, 0, tzinfo=UTC)
FRAME_MS = 16
DRAWN_SELDOM = "window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 250);"
"""On the browser's own clock: each state that comes would be drawn, which takes most of the time of such tests."""
TOUR_SEEN = """if (location.protocol === 'http:' && localStorage.getItem('echolocate') === null)
    localStorage.setItem('echolocate', '{"tour seen": true}');"""


@dataclass
class Opened:
    """A page, the errors it reported, and where its screenshots go.

    Timers, frames and the clock of a page on the fake server stand still but for `run_for`: what happens at which
    time does not depend on the machine, and nothing is drawn unless a test looks at it.
    """

    page: Page
    screenshots: Callable[[str], Path | None]
    is_real_time: bool = False
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    _listeners: list[tuple[str, Callable[..., None]]] = field(default_factory=list)

    def watch_errors(self, expected: str | None) -> None:
        """Keep the page's errors but those that match a pattern, and what it requests."""

        def note(text: str) -> None:
            if expected is None or re.search(expected, text) is None:
                self.errors.append(text)

        def on_error(error: Error) -> None:
            note(str(error))

        def on_console(said: ConsoleMessage) -> None:
            if said.type == "error":
                note(said.text)

        def on_request(request: Request) -> None:
            self.requests.append(request.url)

        self.page.on("pageerror", on_error)
        self.page.on("console", on_console)
        self.page.on("request", on_request)
        self._listeners = [("pageerror", on_error), ("console", on_console), ("request", on_request)]

    def ignore_errors(self) -> None:
        """Keep no more errors."""
        while self._listeners:
            self.page.remove_listener(*self._listeners.pop())

    async def run_for(self, ms: int) -> None:
        """Let time pass in the page."""
        await self.page.clock.run_for(ms)

    async def sync(self) -> None:
        """Wait until the server has received all messages of the page, and the page has the present state."""
        await self.world(f"await connection.request({{ type: '{SYNC}' }})")

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
            f"async () => {{ const {{ buttons, connection, teleoperation, selection, tools, units, view, run }} ="
            f" await {MODULE}; return {expression}; }}"
        )

    async def until(self, expression: str, what: str) -> None:
        """Wait until such an expression becomes true."""
        await until(lambda: self.world(f"Boolean({expression})"), what)

    async def probe(self, name: str, *arguments: Any) -> Any:
        """Return the result of one of the functions in `probes/`."""
        return await self.page.evaluate((PROBES / f"{name}.js").read_text("utf-8"), *arguments)

    async def drawn(self) -> None:
        """Let the page do all pending drawing."""
        await self.run_for(2 * FRAME_MS)

    async def picture(self) -> str:
        """Return a checksum of the map's pixels, after all pending drawing."""
        await self.drawn()
        return str(await self.probe("inked"))

    async def steady(self) -> None:
        """Turn off automatic fitting of the map, so that screen positions stay valid."""
        await self.until("run.fresh && run.state.objects.length > 0 && view.width > 1", "objects on the map")
        if not self.is_real_time:
            await self.drawn()  # the first values make the header, and with it the map, another height
        await self.page.evaluate(f"async () => {{ const {{ view }} = await {MODULE}; view.touched = true; }}")

    async def crash(self) -> None:
        """Let the page's process crash."""
        chrome = await self.page.context.new_cdp_session(self.page)
        async with self.page.expect_event("crash"):
            with contextlib.suppress(Error, TimeoutError):  # nothing is left to answer
                await asyncio.wait_for(chrome.send("Page.crash"), 0.5)

    async def tab(self, name: str) -> None:
        """Show a panel."""
        await self.page.get_by_role("tab", name=name, exact=True).click()

    async def save_screenshot(self, name: str) -> None:
        """Save a screenshot, if the run has a folder for them."""
        path = self.screenshots(name)
        if path is not None:
            if not self.is_real_time:
                await self.drawn()
            await self.page.screenshot(path=path)

    async def says(self, selector: str, words: str) -> None:
        """Wait until an element contains a text."""
        await expect(self.page.locator(selector)).to_contain_text(words)


class PagePool:
    """Pages that are used again by the next test: to make a page anew costs the browser two seconds of computing.

    Their clocks stand still. What a page stores lies with its origin, which the next server may have again, so the
    storage is cleared.
    """

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        self._free: dict[bool, list[Page]] = {False: [], True: []}

    async def context(self, *, touch: bool, first_visit: bool = False) -> BrowserContext:
        """Return a new context, in which the tour of the page has been seen unless it is a first visit."""
        context = await self._browser.new_context(
            has_touch=touch, is_mobile=touch, device_scale_factor=2 if touch else 1, accept_downloads=True
        )
        context.set_default_timeout(1000 * TIMEOUT_S)
        if not first_visit:
            await context.add_init_script(TOUR_SEEN)
        return context

    async def take(self, origin: str, *, touch: bool) -> Page:
        """Return a page whose clock stands still and which has nothing stored of an origin."""
        if self._free[touch]:
            page = self._free[touch].pop()
        else:
            context = await self.context(touch=touch)
            await stop_clock(context)
            page = await context.new_page()
        chrome = await page.context.new_cdp_session(page)
        await chrome.send("Storage.clearDataForOrigin", {"origin": origin, "storageTypes": "all"})
        await chrome.detach()
        return page

    async def give_back(self, page: Page, *, touch: bool) -> None:
        """Take a page back, with no key or button held and without the pages that it opened."""
        for other in page.context.pages:
            if other != page:
                await other.close()
        await page.mouse.up()
        self._free[touch].append(page)


async def stop_clock(context: BrowserContext) -> None:
    """Let the clocks of a context's pages stand still."""
    await context.clock.install(time=BEGIN)
    await context.clock.pause_at(BEGIN + timedelta(minutes=1))


class Opener:
    """Opens pages, and closes them or gives them back at the end."""

    def __init__(self, pool: PagePool, screenshots: Callable[[str], Path | None]) -> None:
        self._pool = pool
        self._screenshots = screenshots
        self._contexts: list[BrowserContext] = []
        self._taken: list[tuple[Page, bool]] = []
        self._opened: list[Opened] = []

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.leave()

    async def leave(self) -> None:
        """Close the pages of its own, and give back the others."""
        for opened in self._opened:
            opened.ignore_errors()
        while self._contexts:
            await self._contexts.pop().close()
        while self._taken:
            page, touch = self._taken.pop()
            await self._pool.give_back(page, touch=touch)

    async def open(
        self, url: str, size: tuple[int, int] = DESKTOP, *, scheme: Literal["dark", "light"] = "light",
        touch: bool = False, calm: bool = False, script: str | None = None, live: bool = True,
        first_visit: bool = False, real_time: bool = False, drawn_seldom: bool = False,
        expected_errors: str | None = None,
    ) -> Opened:  # fmt: skip
        """Open a page and wait for its first state.

        Parameters
        ----------
        live
            Whether a first state comes.
        first_visit
            Whether the tour of the page has not been seen.
        real_time
            Whether the page has the browser's own clock.
        drawn_seldom
            Whether it then draws four times a second.
        expected_errors
            A pattern of the errors that belong to the test; any other fails it.
        """
        if real_time or first_visit or script is not None:
            context = await self._pool.context(touch=touch, first_visit=first_visit)
            self._contexts.append(context)
            if script is not None:
                await context.add_init_script(script)
            if drawn_seldom:
                await context.add_init_script(DRAWN_SELDOM)
            if not real_time:
                await stop_clock(context)
            page = await context.new_page()
        else:
            page = await self._pool.take(url.partition("/?")[0], touch=touch)
            self._taken.append((page, touch))
        await page.set_viewport_size({"width": size[0], "height": size[1]})
        await page.emulate_media(color_scheme=scheme, reduced_motion="reduce" if calm else "no-preference")
        opened = Opened(page, self._screenshots, real_time)
        opened.watch_errors(expected_errors)
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
