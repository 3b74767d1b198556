"""Live settings changed from the page: validated, shown to all clients, undone, saved."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from config.load import load_settings
from config.settings import Settings
from runtime.cycle.modes import Mode, ModeState
from tests.runtime.console.console_case import open_console

GAIN = "behaviors.avoid_static_obstacle.avoid_obstacle_gain"


async def test_a_change_is_shown_to_all_clients_and_undone() -> None:
    async with open_console() as case:
        page, other = await case.page(), await case.page()
        answer = await page.ask(type="set_parameter", path=GAIN, value=2)
        assert answer["data"] == [{"path": GAIN, "value": 2.0}]
        for one in (page, other):
            shown = next((m for m in one.received if m["type"] == "parameters"), None) or await one.next("parameters")
            assert {p["path"]: p["value"] for p in shown["parameters"]}[GAIN] == 2.0
        (settings,) = case.run.asked
        assert isinstance(settings, Settings)
        assert settings.behaviors.avoid_static_obstacle.avoid_obstacle_gain == 2.0
        answer = await page.ask(type="undo_parameter")
        assert answer["data"] == {"path": GAIN, "value": 1.0}
        assert case.run.asked[1] == case.run.settings
        assert (await page.ask(type="undo_parameter"))["error"] == "there is no change to undo"


@pytest.mark.parametrize(
    ("path", "value", "error"),
    [
        (GAIN, 1e9, "must be at most 100 (and at least 0)"),
        (GAIN, "much", "must be a number, not a string"),
        ("behaviors.avoid_static_obstacle.avoid_obstacle_safety_margin_m", 50.0,
         "avoid_obstacle_safety_margin_m is not below avoid_obstacle_sphere_m"),
        ("cycle.rate_hz", 50.0, "cycle.rate_hz: 20.0 → 50.0: needs a restart"),
        ("console.host", "0.0.0.0", 'console.host: "127.0.0.1" → "0.0.0.0": needs a restart'),
        ("behaviors.avoid_static_obstacle.gain", 1.0, "unknown key"),
        ("link.port.x.y", 1.0, "link.port is a single value"),
        ("ring.firing.step_period_s", 0.001, "step_period_s 0.001 is shorter than sound takes"),
        ("ring.firing.step_period_s", 0.6, "a look ahead can be 1.90 s old, and counts for behaviors."),
        ("behaviors.avoid_static_obstacle.echo_age_max_s", 0.2, "a look ahead can be 0.25 s old"),
    ],
)  # fmt: skip
async def test_an_invalid_change_is_refused(path: str, value: Any, error: str) -> None:
    async with open_console() as case:
        page = await case.page()
        answer = await page.ask(type="set_parameter", path=path, value=value)
        assert not answer["ok"]
        assert answer["field"] == path
        assert error in answer["error"] or answer["error"].startswith(error)
        assert case.run.asked == []


async def test_a_preset_replaces_sets_and_null_clears_a_value() -> None:
    async with open_console("ring.firing={sets=[[0,8],[1,9]]}") as case:
        page = await case.page()
        assert (await page.ask(type="set_parameter", path="ring.firing.preset", value="quadrants"))["ok"]
        assert (await page.ask(type="set_parameter", path="behaviors.move_ahead.distance_m", value=None))["ok"]
        settings = case.console.tuning.current
        assert (settings.ring.firing.preset, settings.ring.firing.sets) == ("quadrants", None)
        assert settings.behaviors.move_ahead.distance_m is None


async def test_a_saved_file_loads_the_same_settings(tmp_path: Path) -> None:
    async with open_console("link.port=/dev/pts/7") as case:
        page = await case.page()
        await page.ask(type="set_parameter", path=GAIN, value=3.5)
        text = (await page.ask(type="save_toml"))["data"]
    assert f"{GAIN}: 1.0 → 3.5" in text
    assert "/dev/pts/7" not in text, "the emulator's port"
    path = tmp_path / "saved.toml"
    path.write_text(text, encoding="utf-8")
    assert load_settings(path, ["link.port=/dev/pts/7"]) == case.console.tuning.current


async def test_settings_from_a_file_are_shown_and_end_undo() -> None:
    async with open_console() as case:
        page = await case.page()
        await page.ask(type="set_parameter", path=GAIN, value=3.5)
        case.run.live_settings.apply(case.run.settings, can_undo=False)
        while (await page.next("parameters"))["parameters"] != page.received[0]["parameters"]:
            pass
        assert not (await page.ask(type="undo_parameter"))["ok"]


@pytest.mark.parametrize(
    ("toml", "error"),
    [
        ("vertices_m = [", "line 1"),
        ('name = "box"\nclosed = true\nvertices_m = [[0.0, 0.0], [1.0, 0.0]]', "a closed outline needs"),
        ("", "name: missing"),
        ('name = "drum"\nclosed = false\nvertices_m = [[0.0, 0.0], [1.0, 0.0]]', "two models are named"),
    ],
)
async def test_an_invalid_model_is_refused(toml: str, error: str) -> None:
    async with open_console() as case:
        answer = await (await case.page()).ask(type="load_model", toml=toml)
        assert not answer["ok"]
        assert answer["field"] == "toml"
        assert error in answer["error"]
        assert case.run.asked == []


BOX = 'name = "crate"\nclosed = true\nvertices_m = [[0.4, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.4, -0.3]]\n'


async def test_a_further_model_begins_a_session_and_is_not_undone() -> None:
    async with open_console() as case:
        case.cycles()
        page, other = await case.page(), await case.page()
        case.cycles()
        await other.next("state")
        await page.ask(type="set_parameter", path=GAIN, value=2.0)
        assert (await page.ask(type="load_model", toml=BOX))["data"] == {"name": "crate"}
        for one in (page, other):
            sessions = [message for message in one.received if message["type"] == "session"]
            session = sessions[1] if len(sessions) > 1 else await one.next("session")
            assert [model["name"] for model in session["models"]] == ["drum", "crate"]
            assert session["role"] == ("control" if one is page else "watch")
        assert (await page.ask(type="undo_parameter"))["data"] == {"path": GAIN, "value": 1.0}
        assert [model.name for model in case.console.tuning.current.models] == ["drum", "crate"]
        assert not (await page.ask(type="undo_parameter"))["ok"]
        case.cycles()
        assert (await other.next("state"))["segments"]["whole"], "a new session sends all segments"


ROOM = "drum = [{x_m = 1.0, y_m = 2.0, radius_m = 0.3}]\n[[wall]]\nx1_m = -3.0\ny1_m = 3.0\nx2_m = 4.0\ny2_m = 3.0\n"


async def test_a_map_is_loaded_while_the_robot_stands_shown_to_all_and_forgotten() -> None:
    async with open_console() as case:
        page, other = await case.page(), await case.page()
        assert (await page.ask(type="load_map", toml=ROOM))["ok"]
        session = await other.next("session")
        assert session["known_room"]["drums"] == [[1.0, 2.0, 0.3]]
        (settings,) = case.run.asked
        assert isinstance(settings, Settings)
        room = settings.perception.localization.known_room
        assert room is not None
        assert len(room.wall) == 1
        perception = case.run.state.perception
        assert perception.known_room is None
        perception.apply_settings(settings.perception)
        found = perception.known_room
        assert (found is not None, perception.localized().status) == (True, "localizing")  # type: ignore[union-attr]
        perception.apply_settings(settings.perception)
        assert perception.known_room is found, "the same map again loses no place"
        assert (await page.ask(type="load_map", toml=None))["ok"]
        assert (await other.next("session"))["known_room"] is None
        perception.apply_settings(case.console.tuning.current.perception)
        assert perception.localized() is None


async def test_a_map_that_cannot_be_is_refused_and_so_is_any_while_the_robot_drives() -> None:
    async with open_console() as case:
        page = await case.page()
        for toml, error in (
            ("wall = 1", "map: wall"),
            ("", "surface"),
            ("a = [", "map"),
            ("start = {x_m = 1.0}", ""),
        ):
            answer = await page.ask(type="load_map", toml=toml)
            assert (answer["ok"], answer["field"]) == (False, "toml"), answer
            assert error in answer["error"]
        case.run.state.mode = ModeState(Mode.DRIVE)
        assert "the robot drives" in (await page.ask(type="load_map", toml=ROOM))["error"]
        assert case.run.asked == []
    async with open_console("perception.localization.correct_drift=true") as case:
        page = await case.page()
        assert "exclude each other" in (await page.ask(type="load_map", toml=ROOM))["error"]
