"""Every message there is: what the robot is asked for, what is answered, and why not."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any, get_args

import pytest

from behaviors.move_to_goal import Goal
from behaviors.teleoperation import Teleoperate
from config.load import load_settings
from config.settings import Settings
from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    MoveObject,
    PinSegments,
    PlaceModel,
    RejectObject,
)
from runtime.console import forms
from runtime.console.frames import RecordingNow
from runtime.console.overtime import Overtime
from runtime.console.refusal import Refusal
from runtime.console.seams import Viewer
from runtime.modes import Request
from runtime.wishes import Legs
from tests.runtime.console.operated import operated

GAIN = "behaviors.avoid_static_obstacle.avoid_obstacle_gain"

ASKED: list[tuple[dict[str, Any], object]] = [
    ({"type": "halt"}, Request.HALT),
    ({"type": "arm"}, Request.ARM),
    ({"type": "disarm"}, Request.DISARM),
    ({"type": "wish", "kind": "legs"}, Legs()),
    ({"type": "wish", "kind": "goal", "x": 1, "y": -2.5}, Goal(1.0, -2.5)),
    ({"type": "teleoperate", "v": 0.2, "w": -1}, Teleoperate(0.2, -1.0, 0.25)),
]
EDITS: list[tuple[dict[str, Any], object]] = [
    ({"type": "clear_map"}, ClearMap()),
    ({"type": "delete_segments", "numbers": [3, 1]}, DeleteSegments((3, 1))),
    ({"type": "pin_segments", "numbers": [2], "pinned": True}, PinSegments((2,), pinned=True)),
    (
        {"type": "place_model", "model": "semicircle", "x": 1.0, "y": 2.0, "theta": 0.5},
        PlaceModel("semicircle", 1.0, 2.0, 0.5),
    ),
    ({"type": "move_object", "object": 4, "x": 1.0, "y": 2.0, "theta": 0}, MoveObject(4, 1.0, 2.0, 0.0)),
    ({"type": "reject_object", "object": 4}, RejectObject(4)),
    ({"type": "confirm_object", "object": 4}, ConfirmObject(4)),
]
OTHERS = {"take_control", "give_control", "grant", "evidence", "load_model", "set", "undo", "save_toml"}
OF_TIME: list[tuple[dict[str, Any], str]] = [
    ({"type": "pause"}, "pause"),
    ({"type": "resume"}, "resume"),
    ({"type": "single_step"}, "single_step"),
    ({"type": "speed", "factor": 2}, "speed 2.0"),
    ({"type": "record", "on": True}, "record True"),
    ({"type": "bookmark", "text": "here"}, "bookmark here"),
    ({"type": "recordings"}, "recordings"),
    ({"type": "open", "file": "run.mcap"}, "open run.mcap"),
    ({"type": "scrub", "s": 1.5}, "scrub 1.5"),
    ({"type": "play", "speed": 1}, "play 1.0"),
    ({"type": "step", "cycles": -3}, "step -3"),
    ({"type": "live"}, "live"),
]


def test_no_message_is_left_out() -> None:
    """So a new message is tested the day it is added."""
    known = {get_args(form.model_fields["type"].annotation)[0] for form in forms.Form.__subclasses__()}
    tested: set[str] = OTHERS.union(*({row[0]["type"] for row in table} for table in (ASKED, EDITS, OF_TIME)))
    assert known == tested


@pytest.mark.parametrize(("message", "asked"), ASKED, ids=lambda value: str(value)[:40])
async def test_what_goes_to_the_robot(message: dict[str, Any], asked: object) -> None:
    async with operated() as case:
        page = await case.page()
        assert (await page.ask(**message)) == {
            "type": "answer", "id": 1, "ok": True, "error": None, "field": None, "data": None
        }  # fmt: skip
        assert case.run.asked == [asked]


@pytest.mark.parametrize(("message", "edit"), EDITS, ids=lambda value: str(value)[:40])
async def test_what_goes_to_the_map(message: dict[str, Any], edit: object) -> None:
    async with operated() as case:
        page = await case.page()
        number = await page.say(**message)
        await case.settled(lambda: case.run.asked == [edit], "the edit")
        case.cycles(edits=(edit,), outcomes=(None,))
        assert (await page.answer(number))["ok"]


@pytest.mark.parametrize("message", [row[0] for row in (*ASKED[1:], *EDITS)], ids=lambda m: str(m["type"]))
async def test_who_has_not_the_control_is_refused(message: dict[str, Any]) -> None:
    async with operated() as case:
        _first, second = await case.page(), await case.page()
        assert not (await second.ask(**message))["ok"]
        assert case.run.asked == []
        assert case.refusals() == ["another client has the control: ask for it first"]


BAD: list[tuple[str, str | None]] = [
    ('{"id":1,"type":"teleoperate","v":NaN,"w":0}', "v"),
    ('{"id":1,"type":"teleoperate","v":1e999,"w":0}', "v"),
    ('{"id":1,"type":"teleoperate","v":"1","w":0}', "v"),
    ('{"id":1,"type":"teleoperate","v":true,"w":0}', "v"),
    ('{"id":1,"type":"teleoperate","v":0}', "w"),
    ('{"id":1,"type":"teleoperate","v":99,"w":0}', "v"),
    ('{"id":1,"type":"wish","kind":"goal","x":1e9,"y":0}', "x"),
    ('{"id":1,"type":"wish","kind":"flight"}', "kind"),
    ('{"id":1,"type":"arm","now":true}', "now"),
    ('{"id":1,"type":"ARM"}', "type"),
    ('{"id":1}', "type"),
    ('{"id":1,"type":"delete_segments","numbers":[]}', "numbers"),
    ('{"id":1,"type":"delete_segments","numbers":[1.5]}', "numbers.0"),
    ('{"id":1,"type":"set","path":"a","value":[1]}', "value"),
]


@pytest.mark.parametrize(("text", "field"), BAD)
async def test_what_has_no_form_is_answered_and_does_nothing(text: str, field: str | None) -> None:
    async with operated() as case:
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
    async with operated() as case:
        page = await case.page()
        await page.socket.send_str(text)
        answer = await page.next("answer")
        assert (answer["id"], answer["ok"]) == (None, False)
        assert case.run.asked == []


async def test_a_parameter_is_changed_for_all_to_see_and_taken_back() -> None:
    async with operated() as case:
        page, other = await case.page(), await case.page()
        answer = await page.ask(type="set", path=GAIN, value=2)
        assert answer["data"] == [{"path": GAIN, "value": 2.0}]
        for one in (page, other):
            told = next((m for m in one.heard if m["type"] == "parameters"), None) or await one.next("parameters")
            assert {p["path"]: p["value"] for p in told["parameters"]}[GAIN] == 2.0
        (settings,) = case.run.asked
        assert isinstance(settings, Settings)
        assert settings.behaviors.avoid_static_obstacle.avoid_obstacle_gain == 2.0
        answer = await page.ask(type="undo")
        assert answer["data"] == {"path": GAIN, "value": 1.0}
        assert case.run.asked[1] == case.run.settings
        assert (await page.ask(type="undo"))["error"] == "there is no change to take back"


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
    async with operated() as case:
        page = await case.page()
        answer = await page.ask(type="set", path=path, value=value)
        assert not answer["ok"]
        assert answer["field"] == path
        assert error in answer["error"] or answer["error"].startswith(error)
        assert case.run.asked == []


async def test_a_firing_pattern_by_name_and_what_is_not_given() -> None:
    async with operated("ring.firing={sets=[[0,8],[1,9]]}") as case:
        page = await case.page()
        assert (await page.ask(type="set", path="ring.firing.preset", value="quadrants"))["ok"]
        assert (await page.ask(type="set", path="behaviors.move_ahead.distance_m", value=None))["ok"]
        settings = case.console.tuning.current
        assert (settings.ring.firing.preset, settings.ring.firing.sets) == ("quadrants", None)
        assert settings.behaviors.move_ahead.distance_m is None


async def test_all_settings_as_a_file_that_gives_them_again(tmp_path: Path) -> None:
    async with operated("link.port=/dev/pts/7") as case:
        page = await case.page()
        await page.ask(type="set", path=GAIN, value=3.5)
        text = (await page.ask(type="save_toml"))["data"]
    assert f"{GAIN}: 1.0 → 3.5" in text
    assert "/dev/pts/7" not in text, "the emulator's port"
    path = tmp_path / "saved.toml"
    path.write_text(text, encoding="utf-8")
    assert load_settings(path, ["link.port=/dev/pts/7"]) == case.console.tuning.current


async def test_settings_from_elsewhere_are_shown_and_end_what_can_be_taken_back() -> None:
    async with operated() as case:
        page = await case.page()
        await page.ask(type="set", path=GAIN, value=3.5)
        case.console.adopt(case.run.settings)
        while (await page.next("parameters"))["parameters"] != page.heard[0]["parameters"]:
            pass
        assert not (await page.ask(type="undo"))["ok"]


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
    async with operated() as case:
        answer = await (await case.page()).ask(type="load_model", toml=toml)
        assert not answer["ok"]
        assert answer["field"] == "toml"
        assert error in answer["error"]
        assert case.run.asked == []


BOX = 'name = "crate"\nclosed = true\nvertices_m = [[0.4, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.4, -0.3]]\n'


async def test_a_further_model_is_greeted_and_not_taken_back() -> None:
    async with operated() as case:
        case.cycles()
        page, other = await case.page(), await case.page()
        case.cycles()
        await other.next("state")
        await page.ask(type="set", path=GAIN, value=2.0)
        assert (await page.ask(type="load_model", toml=BOX))["data"] == {"name": "crate"}
        for one in (page, other):
            hellos = [message for message in one.heard if message["type"] == "hello"]
            hello = hellos[1] if len(hellos) > 1 else await one.next("hello")
            assert [model["name"] for model in hello["models"]] == ["semicircle", "crate"]
            assert hello["role"] == ("control" if one is page else "watch")
        assert (await page.ask(type="undo"))["data"] == {"path": GAIN, "value": 1.0}
        assert [model.name for model in case.console.tuning.current.models] == ["semicircle", "crate"]
        assert not (await page.ask(type="undo"))["ok"]
        case.cycles()
        assert (await other.next("state"))["segments"]["whole"], "it was greeted anew"


async def test_why_an_object_is_believed() -> None:
    async with operated() as case:
        _first, page = await case.page(), await case.page()
        data = (await page.ask(type="evidence", object=1))["data"]
        assert (data["object"], data["model"], data["for"], data["against"]) == (1, "semicircle", 3.5, 1.0)
        assert (await page.ask(type="evidence", object=2))["error"] == "object 2 is not there any more"


class Held:
    """Time, recording and recordings, held by somebody who keeps what is asked for."""

    def __init__(self) -> None:
        self.did: list[str] = []
        self.why_not: str | None = None
        self.go = asyncio.Event()
        self.go.set()
        self.left: list[Viewer] = []
        self.is_paused = True
        self.speed = 2.0
        self.now = RecordingNow("run.mcap", 10, 0)

    async def _do(self, what: str) -> str | None:
        await self.go.wait()
        self.did.append(what)
        return self.why_not

    async def _show(self, what: str) -> None:
        why_not = await self._do(what)
        if why_not is not None:
            raise Refusal(why_not)

    async def pause(self) -> str | None:
        return await self._do("pause")

    async def resume(self) -> str | None:
        return await self._do("resume")

    async def single_step(self) -> str | None:
        return await self._do("single_step")

    async def set_speed(self, factor: float) -> str | None:
        return await self._do(f"speed {factor}")

    async def record(self, *, on: bool) -> str | None:
        return await self._do(f"record {on}")

    async def bookmark(self, text: str) -> str | None:
        return await self._do(f"bookmark {text}")

    async def recordings(self) -> list[dict[str, Any]]:
        await self._show("recordings")
        return [{"file": "run.mcap"}]

    async def open(self, viewer: Viewer, file: str) -> dict[str, Any]:
        await self._show(f"open {file}")
        viewer.switch(live=False)
        return {"seconds": 3.0}

    async def scrub(self, _viewer: Viewer, s: float) -> None:
        await self._show(f"scrub {s}")

    async def play(self, _viewer: Viewer, speed: float) -> None:
        await self._show(f"play {speed}")

    async def step(self, _viewer: Viewer, cycles: int) -> None:
        await self._show(f"step {cycles}")

    async def live(self, viewer: Viewer) -> None:
        await self._show("live")
        viewer.switch(live=True)

    def leave(self, viewer: Viewer) -> None:
        self.left.append(viewer)

    async def report(self) -> bytes:
        if self.why_not is not None:
            raise Refusal(self.why_not)
        return b"<h1>report</h1>"

    async def close(self) -> None:
        self.did.append("close")


@pytest.mark.parametrize(("message", "done"), OF_TIME, ids=lambda value: str(value)[:30])
async def test_what_takes_its_time(message: dict[str, Any], done: str) -> None:
    held = Held()
    async with operated(overtime=Overtime(held, held, held)) as case:
        page = await case.page()
        assert (await page.ask(**message))["ok"]
        assert held.did == [done]
        held.why_not = "not just now"
        assert (await page.ask(**message))["error"] == "not just now"
        held.why_not = None
        held.go.clear()
        slow = await page.say(**message)
        assert "still under way" in (await page.ask(**message))["error"]
        assert (await page.ask(type="halt"))["ok"], "a HALT does not wait behind it"
        held.go.set()
        assert (await page.answer(slow))["ok"]
    async with operated() as case:
        page = await case.page()
        assert (await page.ask(**message))["error"] == f"{message['type']}: not available here"


async def test_a_page_that_leaves_in_the_middle_of_it() -> None:
    held = Held()
    async with operated(overtime=Overtime(held, held, held)) as case:
        page = await case.page()
        held.go.clear()
        await page.say(type="open", file="run.mcap")
        await case.settled(lambda: bool(case.console._tasks), "the work")
        await page.socket.close()
        await case.settled(lambda: not case.console._tasks, "that it is given up")
        assert len(held.left) == 1


async def test_work_that_fails_is_a_fault_of_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    held = Held()
    monkeypatch.setattr(held, "_do", lambda _what: 1 / 0)
    async with operated(overtime=Overtime(held, held, held)) as case:
        page = await case.page()
        await page.say(type="pause")
        await case.settled(lambda: any(line["event"] == "a part failed" for line in case.log), "a line in the log")
        assert "console work 1" in str(case.run.health.unwell())


async def test_a_recording_is_shown_to_who_opened_it_only() -> None:
    held = Held()
    async with operated(overtime=Overtime(held, held, held)) as case:
        page, other = await case.page(), await case.page()
        assert (await page.ask(type="open", file="run.mcap"))["data"] == {"seconds": 3.0}
        case.cycles()
        frame = await other.next("state")
        assert (frame["paused"], frame["speed"]) == (True, 2.0)
        assert frame["recording"] == {"file": "run.mcap", "bytes": 10, "dropped": 0}
        assert not [message for message in page.heard if message["type"] == "state"]
        await page.ask(type="live")
        case.cycles()
        assert (await page.next("state"))["segments"]["whole"]
        async with case.session.get(case.url.with_path("/report", keep_query=True)) as answer:
            assert await answer.text() == "<h1>report</h1>"
        held.why_not = "nothing is being recorded"
        async with case.session.get(case.url.with_path("/report", keep_query=True)) as answer:
            assert (answer.status, await answer.text()) == (409, held.why_not)
    assert held.did[-1] == "close"
