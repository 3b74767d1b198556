"""Messages that are done at once: what the robot is asked for, what is answered, and why not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from config.load import load_settings
from config.settings import Settings
from runtime.console.commands.registry import COMMANDS
from tests.runtime.console.console_case import open_console
from tests.runtime.console.sample_messages import ALL, EDITS, ROBOT_REQUESTS

GAIN = "behaviors.avoid_static_obstacle.avoid_obstacle_gain"


def test_no_message_is_left_out() -> None:
    """So a new message is tested the day it is added."""
    assert set(COMMANDS) == {message["type"] for message in ALL}


@pytest.mark.parametrize(("message", "asked"), ROBOT_REQUESTS, ids=lambda value: str(value)[:40])
async def test_what_goes_to_the_robot(message: dict[str, Any], asked: object) -> None:
    async with open_console() as case:
        page = await case.page()
        assert (await page.ask(**message)) == {
            "type": "answer", "id": 1, "ok": True, "error": None, "field": None, "data": None
        }  # fmt: skip
        assert case.run.asked == [asked]


@pytest.mark.parametrize(("message", "edit"), EDITS, ids=lambda value: str(value)[:40])
async def test_what_goes_to_the_map(message: dict[str, Any], edit: object) -> None:
    async with open_console() as case:
        page = await case.page()
        number = await page.send(**message)
        await case.settled(lambda: case.run.asked == [edit], "the edit")
        case.cycles(edits=(edit,), outcomes=(None,))
        assert (await page.answer(number))["ok"]


@pytest.mark.parametrize("message", [row[0] for row in (*ROBOT_REQUESTS[1:], *EDITS)], ids=lambda m: str(m["type"]))
async def test_who_has_not_the_control_is_refused(message: dict[str, Any]) -> None:
    async with open_console() as case:
        _first, second = await case.page(), await case.page()
        assert not (await second.ask(**message))["ok"]
        assert case.run.asked == []
        assert case.refusals() == ["another client has control: ask for it first"]


BAD: list[tuple[str, str | None]] = [
    ('{"id":1,"type":"teleoperate","v":NaN,"w":0}', "v"),
    ('{"id":1,"type":"teleoperate","v":1e999,"w":0}', "v"),
    ('{"id":1,"type":"teleoperate","v":"1","w":0}', "v"),
    ('{"id":1,"type":"teleoperate","v":true,"w":0}', "v"),
    ('{"id":1,"type":"teleoperate","v":0}', "w"),
    ('{"id":1,"type":"teleoperate","v":99,"w":0}', "v"),
    ('{"id":1,"type":"goal","x":1e9,"y":0}', "x"),
    ('{"id":1,"type":"drive_request"}', "type"),
    ('{"id":1,"type":"arm","now":true}', "now"),
    ('{"id":1,"type":"ARM"}', "type"),
    ('{"id":1}', "type"),
    ('{"id":1,"type":"delete_segments","numbers":[]}', "numbers"),
    ('{"id":1,"type":"delete_segments","numbers":[1.5]}', "numbers.0"),
    ('{"id":1,"type":"set_parameter","path":"a","value":[1]}', "value"),
]


@pytest.mark.parametrize(("text", "field"), BAD)
async def test_what_has_no_form_is_answered_and_does_nothing(text: str, field: str | None) -> None:
    async with open_console() as case:
        page = await case.page()
        await page.socket.send_str(text)
        answer = await page.next("answer")
        assert (answer["id"], answer["ok"], answer["field"]) == (1, False, field)
        assert len(answer["error"]) < 200
        assert case.run.asked == []


NUMBERLESS = [
    "", "arm", "[]", "null", '{"id":true,"type":"arm"}', '{"id":-1,"type":"arm"}', '{"type":"arm"}', "[" * 10_000,
    '{"id":1e400,"type":"arm"}', "\x00", "🤖",
]  # fmt: skip


@pytest.mark.parametrize("text", NUMBERLESS)
async def test_what_has_no_number_is_answered_without(text: str) -> None:
    async with open_console() as case:
        page = await case.page()
        await page.socket.send_str(text)
        answer = await page.next("answer")
        assert (answer["id"], answer["ok"]) == (None, False)
        assert case.run.asked == []


async def test_a_parameter_is_changed_for_all_to_see_and_taken_back() -> None:
    async with open_console() as case:
        page, other = await case.page(), await case.page()
        answer = await page.ask(type="set_parameter", path=GAIN, value=2)
        assert answer["data"] == [{"path": GAIN, "value": 2.0}]
        for one in (page, other):
            told = next((m for m in one.received if m["type"] == "parameters"), None) or await one.next("parameters")
            assert {p["path"]: p["value"] for p in told["parameters"]}[GAIN] == 2.0
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
    ],
)  # fmt: skip
async def test_a_parameter_that_is_refused(path: str, value: Any, error: str) -> None:
    async with open_console() as case:
        page = await case.page()
        answer = await page.ask(type="set_parameter", path=path, value=value)
        assert not answer["ok"]
        assert answer["field"] == path
        assert error in answer["error"] or answer["error"].startswith(error)
        assert case.run.asked == []


async def test_a_firing_pattern_by_name_and_what_is_not_given() -> None:
    async with open_console("ring.firing={sets=[[0,8],[1,9]]}") as case:
        page = await case.page()
        assert (await page.ask(type="set_parameter", path="ring.firing.preset", value="quadrants"))["ok"]
        assert (await page.ask(type="set_parameter", path="behaviors.move_ahead.distance_m", value=None))["ok"]
        settings = case.console.tuning.current
        assert (settings.ring.firing.preset, settings.ring.firing.sets) == ("quadrants", None)
        assert settings.behaviors.move_ahead.distance_m is None


async def test_all_settings_as_a_file_that_gives_them_again(tmp_path: Path) -> None:
    async with open_console("link.port=/dev/pts/7") as case:
        page = await case.page()
        await page.ask(type="set_parameter", path=GAIN, value=3.5)
        text = (await page.ask(type="save_toml"))["data"]
    assert f"{GAIN}: 1.0 → 3.5" in text
    assert "/dev/pts/7" not in text, "the emulator's port"
    path = tmp_path / "saved.toml"
    path.write_text(text, encoding="utf-8")
    assert load_settings(path, ["link.port=/dev/pts/7"]) == case.console.tuning.current


async def test_settings_from_elsewhere_are_shown_and_end_what_can_be_taken_back() -> None:
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
        ('name = "semicircle"\nclosed = false\nvertices_m = [[0.0, 0.0], [1.0, 0.0]]', "two models are named"),
    ],
)
async def test_a_model_that_is_none(toml: str, error: str) -> None:
    async with open_console() as case:
        answer = await (await case.page()).ask(type="load_model", toml=toml)
        assert not answer["ok"]
        assert answer["field"] == "toml"
        assert error in answer["error"]
        assert case.run.asked == []


BOX = 'name = "crate"\nclosed = true\nvertices_m = [[0.4, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.4, -0.3]]\n'


async def test_a_further_model_is_greeted_and_not_taken_back() -> None:
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
            assert [model["name"] for model in session["models"]] == ["semicircle", "crate"]
            assert session["role"] == ("control" if one is page else "watch")
        assert (await page.ask(type="undo_parameter"))["data"] == {"path": GAIN, "value": 1.0}
        assert [model.name for model in case.console.tuning.current.models] == ["semicircle", "crate"]
        assert not (await page.ask(type="undo_parameter"))["ok"]
        case.cycles()
        assert (await other.next("state"))["segments"]["whole"], "it was greeted anew"


async def test_why_an_object_is_believed() -> None:
    async with open_console() as case:
        _first, page = await case.page(), await case.page()
        data = (await page.ask(type="evidence", object=1))["data"]
        assert (data["object"], data["model"], data["for"], data["against"]) == (1, "semicircle", 3.5, 1.0)
        assert "object 2 no longer exists" in (await page.ask(type="evidence", object=2))["error"]
