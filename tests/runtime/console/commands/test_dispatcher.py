"""The dispatcher checks permission before a command is carried out."""

from __future__ import annotations

from typing import Any

import pytest

from runtime.console.commands.command import Permission
from runtime.console.commands.registry import COMMANDS
from tests.runtime.console.console_case import open_console
from tests.runtime.console.sample_messages import ALL

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
        "halt", "take_control", "evidence", "save_toml", "list_recordings", "open_recording", "seek_recording",
        "play_recording", "step_recording", "close_recording",
    }  # fmt: skip
