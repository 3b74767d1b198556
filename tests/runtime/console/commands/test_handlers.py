"""Commands that are carried out at once or by the next cycle."""

from __future__ import annotations

from typing import Any

import pytest

from behaviors.missions.mission import Mission, MissionEdit
from config.load import load_mission
from perception.edits import ConfirmObject, RejectObject
from runtime.console.clients.control import REQUEST_TIMEOUT_S
from runtime.console.commands import handlers
from runtime.console.frames.grid_message import grid_message
from runtime.console.sent_messages import GridMessage
from runtime.cycle.inputs import Request
from runtime.cycle.step import State
from tests.runtime.console.console_case import open_console
from tests.runtime.console.sample_messages import EDITS, ROBOT_REQUESTS


@pytest.mark.parametrize(("message", "asked"), ROBOT_REQUESTS, ids=lambda value: str(value)[:40])
async def test_requests_reach_the_robot(message: dict[str, Any], asked: object) -> None:
    async with open_console() as case:
        page = await case.page()
        assert (await page.ask(**message)) == {
            "type": "answer", "id": 1, "ok": True, "error": None, "field": None, "data": None
        }  # fmt: skip
        assert case.run.asked == [asked]


@pytest.mark.parametrize(("message", "edit"), EDITS, ids=lambda value: str(value)[:40])
async def test_edits_reach_the_next_cycle(message: dict[str, Any], edit: object) -> None:
    async with open_console() as case:
        page = await case.page()
        number = await page.send(**message)
        await case.settled(lambda: case.run.asked == [edit], "the edit")
        case.cycles(edits=(edit,), outcomes=(None,))
        assert (await page.answer(number))["ok"]


async def test_a_mission_is_held_resumed_and_skipped_where_that_is_possible() -> None:
    async with open_console() as case:
        page = await case.page()
        answer = await page.ask(type="skip_step")
        assert answer["error"] == "there is no mission to skip: start one, or set waypoints"
        case.run.state.drive_request = Mission(load_mission("patrol"))
        assert (await page.ask(type="hold_mission"))["ok"]
        assert (await page.ask(type="skip_step"))["ok"]
        assert case.run.asked == [MissionEdit("hold"), MissionEdit("skip")]
        assert (await page.ask(type="resume_mission"))["error"] == "the mission patrol is not held"
        case.run.edits_max = 0
        assert "too many changes" in (await page.ask(type="skip_step"))["error"]


async def test_a_mission_that_this_run_cannot_drive_is_refused() -> None:
    async with open_console('models=["box"]') as case:
        page = await case.page()
        for name, why in (
            ("patrl", "no mission is named patrl"), ("../missions/patrol", "no mission is named"),
            ("dock", "mission dock looks for drum"),
        ):  # fmt: skip
            answer = await page.ask(type="start_mission", name=name)
            assert why in answer["error"]
            assert answer["field"] == "name"
        answer = await page.ask(type="set_route", waypoints=[[1, 0, None]], frame="map")
        assert "no map frame" in answer["error"]
        assert not (await page.ask(type="set_route", waypoints=[], frame="odom"))["ok"]
        assert not (await page.ask(type="set_route", waypoints=[[1e9, 0, None]], frame="odom"))["ok"]
        assert case.run.asked == []


async def test_edits_are_answered_after_their_cycle() -> None:
    async with open_console() as case:
        page = await case.page()
        first = await page.send(type="confirm_object", object=3)
        second = await page.send(type="reject_object", object=4)
        await case.settled(lambda: len(case.run.asked) == 2, "both")
        case.cycles()
        edits = (ConfirmObject(3), RejectObject(4))
        assert tuple(case.run.asked) == edits
        case.cycles(edits=edits, outcomes=(None, "there is no object 4"))
        assert (await page.answer(first))["ok"]
        assert (await page.answer(second))["error"] == "there is no object 4"
        case.run.edits_max = 0
        assert "too many edits" in (await page.ask(type="clear_map"))["error"]


async def test_control_is_requested_and_granted() -> None:
    async with open_console() as case:
        first, second = await case.page(), await case.page()
        answer = await second.ask(type="arm")
        assert not answer["ok"]
        assert answer["error"] == "another client has control: ask for it first"
        assert case.refusals()[-1] == answer["error"], "refused and logged"
        assert not (await second.ask(type="take_control"))["ok"]
        asked = await first.next("role")
        assert asked["role"] == "control"
        assert asked["asked_by"] == "client 2 (127.0.0.1)"
        assert (await first.ask(type="grant_control", client=asked["client"]))["ok"]
        assert (await second.next("role"))["role"] == "control"
        assert not (await first.ask(type="arm"))["ok"]
        assert (await second.ask(type="arm"))["ok"]
        assert case.run.asked == [Request.ARM]
        case.cycles()
        assert (await second.next("state"))["controller"] is True
        assert (await first.next("state"))["controller"] is False
        assert (await first.ask(type="halt"))["ok"], "HALT needs no control"


async def test_an_idle_holder_loses_control_after_a_request() -> None:
    async with open_console() as case:
        _first, second = await case.page(), await case.page()
        await second.ask(type="take_control")
        case.cycles(step_s=REQUEST_TIMEOUT_S + 1.0)
        assert (await second.next("role"))["role"] == "control"


async def test_a_lost_connection_ends_teleoperation() -> None:
    async with open_console() as case:
        page, other = await case.page(), await case.page()
        assert (await page.ask(type="teleoperate", v=0.2, w=0.0))["ok"]
        transport = page.socket._conn.transport  # type: ignore[union-attr]
        assert transport is not None
        transport.abort()
        await case.settled(lambda: len(case.run.asked) == 2, "the end of teleoperation")
        assert [(w.v, w.w) for w in case.run.asked] == [(0.2, 0.0), (0.0, 0.0)]  # type: ignore[attr-defined]
        assert (await other.ask(type="take_control"))["ok"], "control is free"


async def test_a_closed_page_leaves_a_goal_in_force() -> None:
    async with open_console() as case:
        page = await case.page()
        await page.ask(type="teleoperate", v=0.2, w=0.0)
        await page.ask(type="goal", x=1.0, y=2.0)
        await page.socket.close()
        await case.settled(lambda: not case.console.hub.clients, "its departure")
        assert len(case.run.asked) == 2


async def test_the_evidence_grid_is_sent_to_the_client_that_asks(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[State] = []

    def counted(state: State) -> GridMessage:
        made.append(state)
        return grid_message(state)

    monkeypatch.setattr(handlers, "grid_message", counted)
    async with open_console() as case:
        page, other = await case.page(), await case.page()
        assert (await page.ask(type="show_grid"))["ok"]
        message = next(message for message in page.received if message["type"] == "grid")
        assert message == {"type": "grid", "on": False, "columns": 0, "rows": 0, "cells": ""}
        assert (await other.ask(type="save_toml"))["ok"]
        assert all(message["type"] != "grid" for message in other.received)
        for _ in range(5):
            assert (await other.ask(type="show_grid"))["ok"]
        assert len(made) == 1, "it is not made more often than twice a second"
        case.clock[0] += 0.6
        assert (await other.ask(type="show_grid"))["ok"]
        assert len(made) == 2


async def test_the_evidence_for_an_object() -> None:
    async with open_console() as case:
        _first, page = await case.page(), await case.page()
        data = (await page.ask(type="evidence", object=1))["data"]
        assert (data["object"], data["model"], data["for"], data["against"]) == (1, "semicircle", 3.5, 1.0)
        assert "object 2 no longer exists" in (await page.ask(type="evidence", object=2))["error"]
