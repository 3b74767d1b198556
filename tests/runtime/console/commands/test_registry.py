"""The registry of commands is complete, and every argument is bounded."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import pytest

import runtime.console
from runtime.console.commands.command import never
from runtime.console.commands.messages import MessageReader
from runtime.console.commands.registry import COMMANDS
from tests.runtime.console.sample_messages import ALL


def test_every_command_has_a_sample_message() -> None:
    """A new command is tested from the day it is added."""
    assert set(COMMANDS) == {message["type"] for message in ALL}


@dataclass(frozen=True)
class Unbounded:
    """Arguments of a command, one of them without bounds."""

    count: int


def test_the_page_drives_nothing_while_it_shows_a_recording() -> None:
    """What moves the robot, or says where something is, would be seen against the poses of the recording."""
    page = (Path(runtime.console.__file__).parent / "page" / "connection.js").read_text("utf-8")
    refused = set(re.findall(r'"(\w+)"', page.partition("const LIVE_ONLY = new Set([")[2].partition("]")[0]))
    drives = {
        name
        for name, command in COMMANDS.items()
        if command.can_begin_motion is not never and not command.survives_stop
    }
    assert drives - refused == {"restart_run", "resume", "single_step"}
    assert {"teleoperate", "set_places", "undo_places", "place_robot", "move_object"} <= refused


def test_an_argument_without_bounds_is_rejected() -> None:
    with pytest.raises(TypeError, match="argument count of dance has no bounds"):
        MessageReader({"dance": Unbounded, "halt": COMMANDS["halt"].type})
