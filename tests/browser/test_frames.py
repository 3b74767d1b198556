"""Drawing speed: 500 segments and 40 objects, all layers on, software rendering.

A browser draws as often as the machine lets it, and here others share it. So the page draws as fast as it can, every
frame anew, and in turns with it a page that draws a hundred lines: what the machine takes away it takes from both.
"""

from __future__ import annotations

from collections.abc import Callable
from statistics import median

import pytest

from tests.browser.fake_server import FakeServer
from tests.browser.open_page import DESKTOP, Opener
from tests.browser.synthetic_run import Hall

pytestmark = [pytest.mark.realtime, pytest.mark.asyncio(loop_scope="session")]

FRAMES_PER_S = 30.0
ROUNDS = 5
ENOUGH = 25
CONTROL_FRAMES_PER_S = 45.0
"""Below this frame rate of the control the machine is too busy for the measurement to mean anything."""


@pytest.mark.parametrize("hall", [Hall(segments=500, objects=40, moving=False)], ids=["full"])
async def test_thirty_frames_a_second(server: FakeServer, opener: Opener, measured: Callable[[str], None]) -> None:
    opened = await opener.open(server.url, DESKTOP)
    await opened.steady()
    await opened.until("run.segments.size === 500 && run.state.objects.length === 40", "the whole scene")
    renderer = await opened.probe("renderer")
    assert renderer == "none" or "SwiftShader" in renderer or "llvmpipe" in renderer, (
        f"not drawn in software: {renderer}"
    )
    page, control = [], []
    for _ in range(ENOUGH):
        control.append(await opened.probe("frames_per_s", "control"))
        page.append(await opened.probe("frames_per_s", "page"))
        if len(page) >= ROUNDS and max(page) >= FRAMES_PER_S:
            break
    await opened.save_screenshot("full")
    best, free = max(page), max(control)
    measured(f"{median(page):.0f} frames/s, at best {best:.0f}; a page that draws a hundred lines: {free:.0f}")
    assert best >= FRAMES_PER_S or best >= free * FRAMES_PER_S / CONTROL_FRAMES_PER_S, (page, control)


@pytest.mark.parametrize("hall", [Hall(segments=500, objects=40, moving=False)], ids=["full"])
async def test_only_changes_are_drawn(server: FakeServer, opener: Opener) -> None:
    server.paused = True
    opened = await opener.open(server.url)
    await opened.steady()
    await opened.until("run.segments.size === 500", "the whole scene")
    server.silent = True
    counts = await opened.probe("repaints")
    assert counts[0] == {"back": 0, "front": 0}, "it draws although nothing changed"
    assert counts[1] == {"back": 0, "front": 10}, "once a frame, and the front alone"
