"""The settings of `echolocate run` as files and command line give them, at its start and when it reads them again."""

from __future__ import annotations

from collections.abc import Sequence

from config.errors import WRONG_CALL, UserError
from config.files import is_utf8, utf8
from config.load import ConfigError, load_settings, with_known_room
from config.settings import Settings
from runtime.support.pattern_check import refuse_undrivable


def settings_of_files(
    config: str | None,
    sets: Sequence[str],
    world: str | None,
    robot: str | None,
    map_file: str | None,
    mission: str | None,
    *,
    no_console: bool,
) -> Settings:
    """Return the settings as the files are now, on the port that they name.

    Parameters
    ----------
    config, sets, world, robot, map_file, mission, no_console
        As of `runtime.cli.robot_commands.run`.

    Raises
    ------
    ConfigError
        The settings are wrong.
    UserError
        No robot can carry them out.
    """
    settings = load_settings(config, sets, robot=robot, world=world, mission=mission)
    if map_file is not None:
        settings = with_known_room(settings, map_file)
    refuse_undrivable(settings)
    return without_console(settings) if no_console else settings


def reload_settings(
    config: str | None,
    sets: Sequence[str],
    world: str | None,
    port: str | None,
    emulator_port: str | None,
    *,
    robot: str | None = None,
    map_file: str | None = None,
    mission: str | None = None,
    no_console: bool = False,
) -> Settings:
    """Return the settings as the files are now, for a run on the same port as before.

    Parameters
    ----------
    config, sets, world, port, robot, map_file, mission, no_console
        As of `runtime.cli.robot_commands.run`.
    emulator_port : str, optional
        Port of the emulator, which is used if the settings name none.

    Raises
    ------
    ConfigError
        The settings are wrong, or no robot can carry them out.
    """
    try:
        settings = settings_of_files(config, sets, world, robot, map_file, mission, no_console=no_console)
    except ConfigError:
        raise
    except UserError as error:
        raise ConfigError(str(error)) from error
    port = port or settings.link.port or emulator_port
    return settings if port is None else with_port(settings, port)


def without_console(settings: Settings) -> Settings:
    """Return the settings with the operator console switched off."""
    return settings.model_copy(update={"console": settings.console.model_copy(update={"enabled": False})})


def with_port(settings: Settings, port: str) -> Settings:
    """Return the settings with the serial port replaced.

    Raises
    ------
    UserError
        No settings can hold the port's path.
    """
    if not is_utf8(port):
        raise UserError(f"the port {utf8(port)}: its path is not UTF-8 text; use a link at another path", WRONG_CALL)
    return settings.model_copy(update={"link": settings.link.model_copy(update={"port": port})})
