"""The connection of the page: the token, stale data, reconnecting, HALT without a connection."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.browser.fake_server import FakeServer
from tests.browser.open_page import MODULE, Opened, Opener

pytestmark = pytest.mark.asyncio(loop_scope="session")

RETRY_MS = (250, 500, 1000, 2000, 4000, 4000)
HALT_CONFIRM_MS = 500
HALT_ANSWER_MS = 3000
REFUSED = r"WebSocket connection to .* failed|Failed to load resource"
COUNT_LOSSES = f"""async () => {{
    const {{ connection }} = await {MODULE};
    window.losses = 0;
    connection.on('closed', () => window.losses++);
}}"""


async def open_counting(server: FakeServer, opener: Opener) -> Opened:
    """Open a page that counts the connections which it lost or failed to make."""
    opened = await opener.open(server.url, expected_errors=REFUSED)
    await opened.page.evaluate(COUNT_LOSSES)
    return opened


async def test_a_wrong_token_is_reported_and_the_right_one_is_hidden(server: FakeServer, opener: Opener) -> None:
    wrong = await opener.open(server.url.replace("right", "wrong"), live=False, expected_errors=REFUSED)
    await wrong.says("#banner-connection", "token is missing or wrong")
    await wrong.page.keyboard.press("Space")
    await wrong.run_for(1)
    await wrong.says("#banner-halt", "HALT not sent, as the run refuses this page's token: use the robot's own stop")
    await wrong.save_screenshot("wrong-token")

    opened = await opener.open(server.url)
    assert "token" not in opened.page.url
    await opened.page.reload()
    await opened.until("run.fresh", "the page after a reload")
    assert "token" not in opened.page.url


async def test_a_message_is_too_long_by_its_bytes(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    refusal = "connection.request({ type: 'read_mission', toml: 'ä'.repeat(40000) }).catch((error) => error.message)"
    assert await opened.world(f"await {refusal}") == "the message is too long"
    assert server.connections == 1, "it is not sent, which would end the connection"


async def test_a_command_carries_the_newest_challenge(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    newest = 2**52 - 1
    for number in (7, newest):
        await server.send({"type": "challenge", "number": number})
    await opened.sync()
    await opened.world("connection.send({ type: 'arm' })")
    await server.wait("arm")
    assert server.of("arm")[0]["challenge"] == newest, "to the last bit"


@pytest.mark.promise("P31")
async def test_old_data_are_reported_as_old(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    await opened.run_for(1000)
    await opened.sync()
    server.silent = True
    await opened.sync()
    stale, old = opened.page.locator("#banner-stale"), opened.page.locator("#facts .bad dt")
    await opened.run_for(2400)
    await expect(old).to_have_count(0)
    await opened.run_for(400)
    await expect(old).to_have_text("data age")
    await opened.says("#mode-name", "NO DATA")
    await opened.says("#mode-robot", "the robot was in DRIVE")
    await expect(opened.page.locator("#fact-twist")).to_have_text("unknown")
    await expect(stale).to_have_count(0)
    await opened.run_for(600)
    await opened.says("#banner-stale", "what you see is old")
    await opened.says("#announce", "what you see is old")
    server.silent = False
    await opened.sync()
    await opened.run_for(200)
    await opened.says("#mode-name", "DRIVE")
    await expect(stale).to_have_count(0)
    await expect(old).to_have_count(0)


async def test_it_reconnects_and_receives_the_whole_map(server: FakeServer, opener: Opener) -> None:
    opened = await open_counting(server, opener)
    await opened.steady()
    server.deleted |= {1}
    server.controller, server.refusing = 2, True
    await server.drop()
    for losses, pause_ms in enumerate(RETRY_MS, start=1):
        await opened.until(f"window.losses === {losses}", f"loss {losses} of the connection")
        await opened.says("#banner-connection", "No connection")
        await opened.says("#mode-name", "NO DATA")
        await opened.run_for(pause_ms - 1)
        assert server.connections == losses, "it tries again too early"
        if losses == len(RETRY_MS):
            server.refusing = False
        await opened.run_for(1)
    await expect(opened.page.locator("#banner-connection")).to_have_count(0)
    await opened.until("run.fresh", "a state")
    assert server.connections == len(RETRY_MS) + 1
    assert await opened.world("run.segments.size") == server.hall.known(server.cycle) - 1
    assert not await opened.world("run.segments.has(1)"), "of the old map nothing stays"


async def test_a_connection_that_died_unnoticed_is_made_anew(server: FakeServer, opener: Opener) -> None:
    opened = await open_counting(server, opener)
    server.silent = server.deaf = True
    await opened.run_for(12_000)
    await server.wait("save_toml")
    await opened.run_for(7_000)
    assert await opened.world("connection.open"), "the answer may still come"
    server.deaf = False
    await opened.run_for(4_000)
    await opened.until("window.losses === 1", "the end of the dead connection")
    server.silent = False
    await opened.run_for(RETRY_MS[0])
    await opened.until("run.fresh && connection.open", "a new connection")
    assert server.connections == 2


async def test_a_halt_without_a_connection_is_reported_and_sent_on_reconnecting(
    server: FakeServer, opener: Opener
) -> None:
    opened = await open_counting(server, opener)
    await server.drop()
    await opened.until("window.losses === 1", "the loss of the connection")
    await opened.page.keyboard.press("Space")
    await opened.run_for(1)
    await opened.says("#banner-halt", "HALT not confirmed")
    assert not server.received
    await opened.run_for(RETRY_MS[0])
    await server.wait("halt")
    assert server.received[0]["type"] == "halt", "before anything else"
    await opened.says("#mode-name", "SAFE STOP")
    await opened.until("document.getElementById('banner-halt') === null", "the confirmation")


async def test_a_halt_over_a_connection_that_hangs_is_unconfirmed_and_sent_over_a_new_one(
    server: FakeServer, opener: Opener
) -> None:
    opened = await open_counting(server, opener)
    server.silent = server.deaf = True
    await opened.page.keyboard.press("Space")
    await opened.run_for(HALT_CONFIRM_MS)
    await opened.says("#banner-halt", "HALT not confirmed: use the robot's own stop")
    server.silent = server.deaf = False
    await opened.run_for(HALT_ANSWER_MS)
    await opened.until("window.losses === 1", "the end of the dead connection")
    await opened.run_for(RETRY_MS[0])
    await opened.says("#mode-name", "SAFE STOP")
    await opened.until("document.getElementById('banner-halt') === null", "the confirmation")
    assert server.connections == 2


async def test_a_halt_that_is_answered_shows_nothing(server: FakeServer, opener: Opener) -> None:
    opened = await open_counting(server, opener)
    await opened.page.keyboard.press("Space")
    await opened.says("#mode-name", "SAFE STOP")
    await opened.run_for(2 * HALT_CONFIRM_MS)
    assert await opened.page.locator("#banner-halt").count() == 0
