"""Places over a real socket: set, undone, driven to by name, read from files and saved."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable
from typing import Any

import orjson
import pytest

from behaviors.move_to_goal import Goal
from config.load import parse_text
from config.settings import Settings
from config.world import WorldConfig
from tests.runtime.console.console_case import ConsoleCase, Page, open_console

CHARGER = {"name": "charger", "x_m": 1.0, "y_m": 2.0, "heading_deg": 180.0}
RUG = {"name": "rug", "vertices_m": [[5.0, 5.0], [6.0, 5.0], [6.0, 6.0]]}
STAIRS = {"name": "stairs", "points_m": [[0.0, 3.0], [1.0, 3.0]]}
WARD = {"name": "ward", "vertices_m": [[7.0, 5.0], [8.0, 5.0], [8.0, 6.0]], "speed_max_m_s": 0.1}
ALL = {"place": [CHARGER], "no_go_line": [STAIRS], "no_go_area": [RUG], "speed_area": [WARD]}


def over_a_socket(test: Callable[[ConsoleCase, Page], Awaitable[None]]) -> None:
    async def body() -> None:
        async with open_console() as case:
            await test(case, await case.page())

    asyncio.run(body())


async def ask(page: Page, **message: Any) -> Any:
    answer = await page.ask(**message)
    assert answer["ok"], answer
    return answer["data"]


def test_places_are_set_shown_and_undone() -> None:
    async def body(case: ConsoleCase, page: Page) -> None:
        await page.send(type="set_places", places={"place": [CHARGER]})
        shown = await page.next("places")
        assert (shown["frame"], shown["place"], shown["no_go_area"]) == ("odom", [CHARGER], [])
        await ask(page, type="set_places", places=ALL)
        await ask(page, type="undo_places")
        assert [place.name for place in case.run.live_settings.current.places.place] == ["charger"]
        assert not case.run.live_settings.current.places.no_go_area
        await ask(page, type="undo_places")
        assert not case.run.live_settings.current.places.has_any
        assert "no change of the places" in (await page.ask(type="undo_places"))["error"]

    over_a_socket(body)


def test_the_undo_of_settings_leaves_places_alone() -> None:
    async def body(case: ConsoleCase, page: Page) -> None:
        await ask(page, type="set_parameter", path="behaviors.arbiter.base_velocity_m_s", value=0.2)
        await ask(page, type="set_places", places=ALL)
        await ask(page, type="undo_parameter")
        settings = case.run.live_settings.current
        assert settings.places.has_any
        assert settings.behaviors.arbiter.base_velocity_m_s != 0.2

    over_a_socket(body)


def test_a_goal_by_name_and_an_unknown_one() -> None:
    async def body(case: ConsoleCase, page: Page) -> None:
        await ask(page, type="set_places", places=ALL)
        await ask(page, type="go_to_place", name="charger")
        goal = case.run.asked[-1]
        assert isinstance(goal, Goal)
        assert (goal.x, goal.y, goal.heading) == (1.0, 2.0, math.pi)
        refused = await page.ask(type="go_to_place", name="charge")
        assert refused["error"] == "no place is named charge; did you mean charger?; the places are charger"

    over_a_socket(body)


@pytest.mark.parametrize("format_name", ["toml", "geojson"])
def test_a_saved_map_is_read_back(format_name: str) -> None:
    async def body(_: ConsoleCase, page: Page) -> None:
        await ask(page, type="set_places", places=ALL)
        text = await ask(page, type="save_map", format=format_name)
        assert await ask(page, type="read_places", text=text) == ALL
        if format_name == "toml":
            assert parse_text(WorldConfig, text, "map").places().has_any

    over_a_socket(body)


@pytest.mark.parametrize("text", ["{", "[[place]]", "{}", orjson.dumps({"units": "m", "features": [1]}).decode()])
def test_what_is_no_map_is_refused(text: str) -> None:
    async def body(_: ConsoleCase, page: Page) -> None:
        refused = await page.ask(type="read_places", text=text)
        assert not refused["ok"]
        assert refused["field"] == "text"

    over_a_socket(body)


async def test_each_change_of_the_places_is_kept() -> None:
    kept: list[list[str]] = []

    class Files:
        async def keep_places(self, settings: Settings) -> None:
            kept.append([place.name for place in settings.places.place])

    async with open_console(settings_files=Files()) as case:  # type: ignore[arg-type]
        page = await case.page()
        await ask(page, type="set_places", places={"place": [CHARGER]})
        await ask(page, type="set_places", places={"place": [CHARGER]})
        await ask(page, type="undo_places")
    assert kept == [["charger"], []]
