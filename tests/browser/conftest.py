"""A browser for the tests of the page: Debian's chromium, without a screen and drawing in software.

Everything runs in one loop a session, because a browser belongs to the loop that started it. A browser that is
missing fails the tests: a page that was never opened is untested.
"""

from __future__ import annotations

import shutil
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser, async_playwright

from tests.browser.fake_server import FakeServer, serving
from tests.browser.open_page import Opener
from tests.browser.synthetic_run import Hall

ARGUMENTS = ("--disable-gpu", "--disable-dev-shm-usage", "--force-color-profile=srgb")


@pytest_asyncio.fixture(scope="session", loop_scope="session")
async def browser() -> AsyncIterator[Browser]:
    program = shutil.which("chromium")
    assert program is not None, "chromium is missing: `make test` installs it, or apt-get install chromium"
    async with async_playwright() as playwright:
        launched = await playwright.chromium.launch(executable_path=program, args=list(ARGUMENTS))
        yield launched
        await launched.close()


@pytest.fixture
def hall() -> Hall:
    return Hall()


@pytest_asyncio.fixture(loop_scope="session")
async def server(hall: Hall) -> AsyncIterator[FakeServer]:
    async with serving(hall) as running:
        yield running


@pytest_asyncio.fixture(loop_scope="session")
async def opener(browser: Browser, screenshots: Callable[[str], Path]) -> AsyncIterator[Opener]:
    """Open pages, and check at the end that none reported an error."""
    async with Opener(browser, screenshots) as pages:
        yield pages
    pages.check()


@pytest.fixture
def screenshots(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[[str], Path]:
    """Where a screenshot goes: the folder given by --screenshots, or the test's own."""
    folder = request.config.getoption("screenshots")
    where = tmp_path if folder is None else Path(folder)
    where.mkdir(parents=True, exist_ok=True)
    return lambda name: where / f"{name}.png"
