"""Handlers of the commands on the settings files of the run, and of its restart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

from pydantic import Field

from runtime.console.commands.command import Call
from runtime.console.commands.command_error import CommandError
from runtime.console.commands.messages import NoArguments, Number, Scalar
from runtime.console.protocols import SettingsFileControl
from runtime.console.sent_messages import SettingsCheck, SettingsRow, SettingsText
from runtime.cycle.modes import Mode

STOP_FIRST: Final = "the robot drives: halt or disarm it before the run is started again"
SETTINGS_MAX: Final = 48 * 1024
"""Characters of a settings file that is edited; the longest shipped one has a fifth of that."""


@dataclass(frozen=True, slots=True)
class ReadSettings:
    """Ask for the text of a settings file, by its number in the list."""

    file: Number


@dataclass(frozen=True, slots=True)
class CheckSettings:
    """Ask what another text in place of a settings file would mean."""

    file: Number
    toml: Annotated[str, Field(max_length=SETTINGS_MAX)]


@dataclass(frozen=True, slots=True)
class ChangeSettings:
    """Ask for a text in place of a settings file with another value of a field of its form; null removes its key."""

    file: Number
    toml: Annotated[str, Field(max_length=SETTINGS_MAX)]
    path: Annotated[str, Field(min_length=1, max_length=200)]
    value: Scalar


@dataclass(frozen=True, slots=True)
class SaveSettings:
    """Write another text in place of a settings file; `digest` is of the text that was changed."""

    file: Number
    toml: Annotated[str, Field(max_length=SETTINGS_MAX)]
    digest: Annotated[str, Field(min_length=64, max_length=64)]


def list_settings(call: Call, _: NoArguments) -> list[SettingsRow]:
    """Return the settings files of the run."""
    return _settings_files(call).listed()


async def read_settings(call: Call, given: ReadSettings) -> SettingsText:
    """Return the text of a file."""
    return await _settings_files(call).read(given.file)


async def check_settings(call: Call, given: CheckSettings) -> SettingsCheck:
    """Return what a changed text would mean."""
    return await _settings_files(call).check(given.file, given.toml)


async def change_settings(call: Call, given: ChangeSettings) -> str:
    """Return the text with the change."""
    return await _settings_files(call).changed(given.file, given.toml, given.path, given.value)


async def save_settings(call: Call, given: SaveSettings) -> SettingsText:
    """Write a changed text in place of a file."""
    return await _settings_files(call).save(given.file, given.toml, given.digest)


async def restart_run(call: Call, _: NoArguments) -> None:
    """End the run and start it again.

    Raises
    ------
    CommandError
        The robot drives, the settings are wrong, or this run cannot be started again.
    """
    if call.context.robot.state.mode.mode is Mode.DRIVE:
        raise CommandError(STOP_FIRST)
    await _settings_files(call).restart()


def _settings_files(call: Call) -> SettingsFileControl:
    return call.available(call.context.settings_files)
