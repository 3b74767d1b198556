"""The dispatcher checks permission before a command is carried out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import orjson
import pytest

from runtime.console.clients.challenges import STOPPED
from runtime.console.commands.command import Permission
from runtime.console.commands.registry import COMMANDS, reader
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode, ModeState
from tests.runtime.console.console_case import open_console
from tests.runtime.console.sample_messages import ALL, EDITS, ROBOT_REQUESTS

NEEDS_CONTROL = [message for message in ALL if COMMANDS[message["type"]].permission is Permission.CONTROL]


@pytest.mark.parametrize("message", NEEDS_CONTROL, ids=lambda message: str(message["type"]))
async def test_a_client_without_control_is_refused(message: dict[str, Any]) -> None:
    async with open_console() as case:
        _first, second = await case.page(), await case.page()
        assert not (await second.ask(**message))["ok"]
        assert case.run.asked == []
        assert case.refusals() == ["another client has control: ask for it first"]


def test_commands_that_need_no_control() -> None:
    """They neither move the robot, other than to stop it, nor change anything of the run."""
    assert {name for name, command in COMMANDS.items() if command.permission is Permission.TOKEN} == {
        "halt", "take_control", "evidence", "show_grid", "save_toml", "list_recordings", "open_recording",
        "seek_recording", "play_recording", "step_recording", "close_recording",
        "list_settings", "read_settings", "check_settings", "change_settings",
        "read_mission", "save_route", "make_files", "list_jobs", "cancel_job", "robot_file",
            "read_places", "save_map",
    }  # fmt: skip


MOTIONS: list[dict[str, Any]] = [
    {"type": "arm"},
    {"type": "legs"},
    {"type": "goal", "x": 1.0, "y": -2.5},
    {"type": "teleoperate", "v": 0.2, "w": -1.0},
]
"""Messages that begin a motion."""


@pytest.mark.promise("P18")
async def test_a_late_command_moves_nothing(measured: Callable[[str], None]) -> None:
    """Late, from before a HALT of any client, or without a challenge: refused, with what happened and what to do."""
    async with open_console() as case:
        page, other = await case.page(), await case.page()
        for message in (*MOTIONS, *(edit for edit, _ in EDITS)):
            challenge = case.console.hub.challenges.issue()
            case.clock[0] += 1.4
            late = await page.ask(**message, challenge=challenge)
            assert late["error"] == f"{message['type']}: it arrived 1.4 s late and was not carried out: press again"
            assert "reload the page" in (await page.ask(**message, challenge=None))["error"]
            assert "far too late" in (await page.ask(**message, challenge=1))["error"]
        assert case.run.asked == []
        for message in MOTIONS:
            challenge = case.console.hub.challenges.issue()
            assert (await other.ask(type="halt", challenge=None))["ok"], "HALT needs no challenge"
            assert (await page.ask(**message, challenge=challenge))["error"] == f"{message['type']}: {STOPPED}"
            assert (await page.ask(**message))["ok"], "pressed again"
        assert case.run.asked.count(Request.HALT) == len(MOTIONS)
        assert len(case.run.asked) == 2 * len(MOTIONS)
        assert (await page.ask(type="disarm", challenge=None))["ok"]
        assert (await page.ask(type="teleoperate", v=0.0, w=0.0, challenge=None))["ok"], "it stops the robot"
    measured(
        f"{len(MOTIONS)} motions and {len(EDITS)} edits, 1.4 s late or from before a HALT: none reaches the robot"
    )


@pytest.mark.promise("P18")
@pytest.mark.parametrize("mode", [Mode.SAFE_STOP, Mode.FAULT])
async def test_a_command_from_before_a_stop_is_refused(mode: Mode) -> None:
    async with open_console() as case:
        page = await case.page()
        challenge = case.console.hub.challenges.issue()
        case.run.state.mode = ModeState(mode, 1.0, "bumper contact")
        case.cycles()
        assert STOPPED in (await page.ask(type="arm", challenge=challenge))["error"]
        challenge = case.console.hub.challenges.issue()
        case.cycles()
        assert (await page.ask(type="arm", challenge=challenge))["ok"], "it stopped once"


@pytest.mark.promise("P18")
@pytest.mark.parametrize("message", MOTIONS, ids=lambda message: str(message["type"]))
async def test_a_command_that_waits_for_its_cycle_is_void_without_its_sender_or_after_a_halt(
    message: dict[str, Any],
) -> None:
    async with open_console() as case:
        page = await case.page()
        assert (await page.ask(**message))["ok"]
        (is_valid,) = case.run.validity
        assert is_valid()
        await page.socket.close()
        await case.settled(lambda: not case.console.hub.clients, "its departure")
        assert not is_valid()
        page, other = await case.page(), await case.page()
        assert (await page.ask(**message))["ok"]
        is_valid = case.run.validity[-1]
        await other.ask(type="halt")
        assert not is_valid()


@pytest.mark.promise("P18")
async def test_arming_ends_with_its_client() -> None:
    async with open_console() as case:
        page = await case.page()
        await page.ask(type="arm")
        case.run.state.mode = ModeState(Mode.READY, 0.0, None, arming_run_s=1.0)
        await page.socket.close()
        await case.settled(lambda: case.run.asked == [Request.ARM, Request.DISARM], "the end of arming")


@pytest.mark.promise("P18")
@pytest.mark.parametrize("message", MOTIONS, ids=lambda message: str(message["type"]))
async def test_a_command_that_waits_for_its_cycle_is_void_once_control_has_changed_hands(
    message: dict[str, Any],
) -> None:
    async with open_console() as case:
        page, other = await case.page(), await case.page()
        await other.ask(type="take_control")
        assert (await page.ask(**message))["ok"]
        is_valid = case.run.validity[0]
        assert is_valid()
        assert (await page.ask(type="grant_control", client=2))["ok"]
        assert not is_valid()


@pytest.mark.promise("P18")
@pytest.mark.parametrize("way", ["grant_control", "release_control"])
async def test_arming_ends_with_control(way: str) -> None:
    """Else the robot would begin to drive for an operator who did not arm it, or for none."""
    async with open_console() as case:
        page, other = await case.page(), await case.page()
        await other.ask(type="take_control")
        await page.ask(type="arm")
        case.run.state.mode = ModeState(Mode.READY, 0.0, None, arming_run_s=1.0)
        assert (await page.ask(type=way, client=2) if way == "grant_control" else await page.ask(type=way))["ok"]
        assert case.run.asked == [Request.ARM, Request.DISARM]
        await other.ask(type="arm")
        case.run.state.mode = ModeState(Mode.DRIVE, 2.0)
        await other.ask(type="release_control")
        assert case.run.asked[2:] == [Request.ARM], "what drives already goes on"


def test_whatever_requests_a_motion_needs_a_challenge() -> None:
    """Those that stop the robot need none, so that nothing can hold them up."""
    needs = {
        message["type"]
        for message in ALL
        if COMMANDS[message["type"]].can_begin_motion(reader().read(_text(message)).arguments)
    }
    assert {message["type"] for message, _ in ROBOT_REQUESTS} - needs == {"halt", "disarm"}
    assert {message["type"] for message, _ in EDITS} <= needs
    assert {"resume", "single_step", "set_parameter", "undo_parameter", "load_model"} <= needs


def _text(message: dict[str, Any]) -> bytes:
    return orjson.dumps({"id": 1, **message})
