"""The page's list of other robots: name, mode and a link, from strangers whose words never become markup."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.browser.fake_server import FakeServer
from tests.browser.open_page import Opener

pytestmark = pytest.mark.asyncio(loop_scope="session")


async def test_other_robots_are_listed_with_a_link_to_the_page_of_each(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    page = opened.page
    part, rows = page.locator("#robots-part"), page.locator("#robots li")
    await expect(part).to_be_hidden()
    await server.send({"type": "robots", "robots": [
        {"name": "beta", "mode": "SAFE_STOP", "url": "http://10.0.0.7:8765/", "version": "1"},
        {"name": "<img src=x>", "mode": "<b>", "url": "http://10.0.0.8:80/", "version": "1"},
        {"name": "evil", "mode": "READY", "url": "javascript:alert(1)", "version": "1"},
    ]})  # fmt: skip
    await expect(rows).to_have_count(2)
    await expect(rows.nth(0)).to_have_text("beta SAFE STOP 10.0.0.7:8765")
    await expect(rows.nth(1)).to_contain_text("<img src=x> <b>")
    link = rows.nth(0).locator("a")
    assert await link.get_attribute("href") == "http://10.0.0.7:8765/", "without a token"
    assert await link.get_attribute("rel") == "noopener noreferrer"
    await server.send({"type": "robots", "robots": []})
    await expect(part).to_be_hidden()
