"""A browser for the tests of the page: Debian's chromium, without a screen and drawing in software.

Its headless shell has no window to keep either, and takes half of the processor time.

Everything runs in one loop a session, because a browser belongs to the loop that started it. A browser that is
missing fails the tests: a page that was never opened is untested.
"""

from __future__ import annotations

import shutil
import socket
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import async_playwright, expect

from tests.browser.fake_server import FakeServer, serving
from tests.browser.open_page import Opener, PagePool
from tests.browser.synthetic_run import Hall
from tests.hil.machine import TIMEOUT_S

ARGUMENTS = ("--disable-gpu", "--disable-dev-shm-usage", "--force-color-profile=srgb")


@pytest_asyncio.fixture(scope="package", loop_scope="session")
async def pool() -> AsyncIterator[PagePool]:
    """Pages of one browser for all tests; it ends with the last of these, as it computes a little all the time."""
    program = shutil.which("chromium-headless-shell") or shutil.which("chromium")
    assert program is not None, "chromium is missing: `make test` installs it, or apt-get install chromium"
    expect.set_options(timeout=1000 * TIMEOUT_S)
    async with async_playwright() as playwright:
        launched = await playwright.chromium.launch(
            executable_path=program, args=list(ARGUMENTS), timeout=1000 * TIMEOUT_S
        )
        yield PagePool(launched)
        await launched.close()


@pytest.fixture
def hall() -> Hall:
    return Hall()


@pytest.fixture(scope="session")
def port() -> int:
    """Return a port for one server after another: the browser keeps by it what it has loaded and compiled."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        number: int = free.getsockname()[1]
    return number


@pytest_asyncio.fixture(loop_scope="session")
async def server(hall: Hall, port: int) -> AsyncIterator[FakeServer]:
    async with serving(hall, port) as running:
        yield running


@pytest_asyncio.fixture(loop_scope="session")
async def opener(pool: PagePool, screenshots: Callable[[str], Path | None]) -> AsyncIterator[Opener]:
    """Open pages, and check at the end that none reported an error."""
    async with Opener(pool, screenshots) as pages:
        yield pages
    pages.check()


@pytest.fixture
def screenshots(request: pytest.FixtureRequest) -> Callable[[str], Path | None]:
    """Where a screenshot goes; None without the option --screenshots."""
    folder = request.config.getoption("screenshots", None)
    if folder is None:
        return lambda _name: None
    where = Path(folder)
    where.mkdir(parents=True, exist_ok=True)
    return lambda name: where / f"{name}.png"
