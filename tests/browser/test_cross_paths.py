"""Cross paths on the map: the arcs of their ellipses, and the object that reflected each."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from playwright.async_api import expect

from tests.browser.fake_server import FakeServer
from tests.browser.open_page import MODULE, Opened, Opener
from tests.browser.synthetic_run import DRUMS, RADIUS, Hall

pytestmark = pytest.mark.asyncio(loop_scope="session")

BEAM = math.radians(30.0)
RING_M = 0.381
FINE_M = 1e-6
"""The least of 20,001 points of an outline is this near to the shortest way over it."""


def sensor(index: int) -> dict[str, float]:
    """Return the frame of a sensor of a ring of 24 at the origin."""
    angle = math.radians(15.0 * index)
    return {"x": RING_M * math.cos(angle), "y": RING_M * math.sin(angle), "angle": angle}


def half_way(t: dict[str, float], l: dict[str, float], x: Any, y: Any) -> Any:  # noqa: E741
    """Return half the way from one sensor over points to another."""
    return 0.5 * (np.hypot(x - t["x"], y - t["y"]) + np.hypot(x - l["x"], y - l["y"]))


async def test_ways_and_arcs_are_those_of_plain_geometry(server: FakeServer, opener: Opener) -> None:
    rng = np.random.default_rng(1)
    opened = await opener.open(server.url)
    ways: list[list[Any]] = []
    expected: list[float] = []
    paths: list[dict[str, Any]] = []
    for k in range(20):
        t, l = sensor(0), sensor(1 + k % 4)  # noqa: E741
        away, bearing, radius = rng.uniform(0.6, 4.0), rng.uniform(-0.3, 0.8), rng.uniform(0.02, 0.7)
        x, y = (away + radius) * math.cos(bearing), (away + radius) * math.sin(bearing)
        turn = np.linspace(0.0, 2.0 * math.pi, 20_001)
        ways.append(["circle", t, l, {"x": x, "y": y}, radius])
        expected.append(half_way(t, l, x + radius * np.cos(turn), y + radius * np.sin(turn)).min())
        ends = [x + rng.uniform(-2, 2), y + rng.uniform(-2, 2), x + rng.uniform(-2, 2), y + rng.uniform(-2, 2)]
        along = np.linspace(0.0, 1.0, 20_001)
        ways.append(["side", t, l, ends, 0.0])
        normal = np.array([ends[1] - ends[3], ends[2] - ends[0]])
        sides = [normal @ (np.array([p["x"], p["y"]]) - ends[:2]) for p in (t, l)]
        parts = sides[0] * sides[1] <= 0.0
        points = [ends[i] + along * (ends[i + 2] - ends[i]) for i in (0, 1)]
        expected.append(math.inf if parts else half_way(t, l, *points).min())
        image = [2.0 * x - t["x"], 2.0 * y - t["y"]]  # two mirrors at a right angle turn about their corner
        ways.append(["corner", t, l, {"x": x, "y": y}])
        expected.append(0.5 * math.dist(image, (l["x"], l["y"])))
        paths.append({"transmitter": t, "listener": l, "half": rng.uniform(0.7, 5.0)})
    paths.append({"transmitter": sensor(0), "listener": sensor(12), "half": 0.3})
    found = await opened.probe("cross_paths", {"ways": ways, "paths": paths, "beam": BEAM})
    for one, half in zip(found["ways"], expected, strict=True):
        over = one[0] if isinstance(one, list) and one else one or {"half": math.inf}
        assert over["half"] == pytest.approx(half, abs=FINE_M)
    assert found["arcs"].pop() is None, "no way is shorter than the sensors are apart"
    seen = 0
    for path, arc in zip(paths, found["arcs"], strict=False):
        off = [
            [abs(math.remainder(math.atan2(y - s["y"], x - s["x"]) - s["angle"], 2.0 * math.pi)) for x, y in arc]
            for s in (path["transmitter"], path["listener"])
        ]
        for x, y in arc:
            assert half_way(path["transmitter"], path["listener"], x, y) == pytest.approx(path["half"], abs=1e-9)
        assert max(off[0]) < BEAM + 1e-9
        both = max(off[1]) < BEAM + 1e-9
        seen += both
        assert both or max(off[1]) < 2.0 * BEAM + 1e-9
        ends = [max(off[0][i], off[1][i]) for i in (0, -1)] if both else []
        assert ends == pytest.approx([BEAM] * len(ends)), "it ends where a beam does"
    assert seen >= 10


def heard(server: FakeServer, *paths: tuple[int, int, float]) -> None:
    """Let the ring have heard cross paths now, where it stands."""
    pose = server.hall.pose(server.cycle)
    server.cross_paths = [{"robot_s": server.cycle * 0.05, "pose": [*pose, 0.0], "paths": paths}]


async def reflectors(opened: Opened) -> list[list[Any] | None]:
    """Return kind, number and place of what reflected each path that is drawn."""
    await opened.drawn()
    found: list[list[Any] | None] = await opened.world(
        "run.crossPaths.map(({ reflector: r }) => r && [r.kind, r.object.number, r.x, r.y])"
    )
    return found


@pytest.mark.parametrize("hall", [Hall(moving=False, walls=((-1.0, 0.7, 1.0, 0.7),))], ids=["wall"])
async def test_a_path_is_ascribed_to_the_object_that_explains_it(server: FakeServer, opener: Opener) -> None:
    t, l = (RING_M * np.array([math.cos(a), math.sin(a)]) for a in (math.radians(90.0), math.radians(105.0)))  # noqa: E741
    over_wall = 0.5 * math.dist(t, (l[0], 1.4 - l[1]))
    server.hall.places[:] = [(0.0, -1.2), *DRUMS[1:]]
    drum_y = server.hall.seen(0)[0]["y"]
    below = RING_M * np.array([math.cos(math.radians(-90.0)), math.sin(math.radians(-90.0))])
    near = 0.5 * (math.dist(below, (0.01, drum_y + RADIUS)) + math.dist(-t, (0.01, drum_y + RADIUS)))
    heard(server, (6, 7, over_wall), (18, 17, near), (12, 13, 2.0), (6, 5, over_wall + 0.3))
    opened = await opener.open(server.url)
    await opened.steady()
    server.silent = True
    wall, drum, nothing, far = await reflectors(opened)
    assert wall is not None
    assert wall[:2] == ["wall", 101]
    assert wall[3] == pytest.approx(0.7)
    assert drum is not None
    assert drum[:2] == ["round", 1]
    assert nothing is far is None
    await opened.tab("Layers")
    box = opened.page.get_by_role("checkbox", name="cross paths, and what reflected them")
    await expect(box).to_be_checked()
    shown = await opened.picture()
    await opened.save_screenshot("cross-paths")
    await box.uncheck()
    assert await opened.picture() != shown
    await opened.page.reload()
    await expect(opened.page.locator("#layer-cross_paths")).not_to_be_checked()


async def test_paths_are_the_newest_and_a_jump_in_time_forgets_them(server: FakeServer, opener: Opener) -> None:
    opened = await opener.open(server.url)
    for _ in range(3):
        server.cycle += 1
        heard(server, *((0, 1, 1.0 + 0.001 * k) for k in range(100)))
        await server.send_states()
        await server.send_states()  # a firing that comes again is known
    await opened.sync()
    assert await opened.world("run.crossPaths.length") == 192
    server.cross_paths = []
    await server.advance(30)
    await opened.sync()
    assert await opened.world("run.crossPaths.length") == 0, "older than a second"
    heard(server, (0, 1, 1.0))
    await server.advance()
    await opened.sync()
    assert await opened.world("run.crossPaths.length") > 0
    server.cycle, server.cross_paths = 10, []
    await opened.sync()
    assert await opened.world("run.crossPaths.length") == 0, "of another moment"
    assert await opened.page.evaluate(f"async () => (await {MODULE}).run.fresh")
