"""The registry of commands is complete, and every argument is bounded."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

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


def test_an_argument_without_bounds_is_rejected() -> None:
    with pytest.raises(TypeError, match="argument count of dance has no bounds"):
        MessageReader({"dance": Unbounded, "halt": COMMANDS["halt"].type})
