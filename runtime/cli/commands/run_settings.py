"""The settings of `echolocate run` as files and command line give them, at its start and when it reads them again."""

from __future__ import annotations

from collections.abc import Sequence

from config.errors import WRONG_CALL, UserError
from config.files import is_utf8, one_line, utf8
from config.load import ConfigError, list_shipped, load_settings, with_goal, with_known_room
from config.mission_step import Frame
from config.places import check_places, no_such_place
from config.settings import GoalConfig, Settings
from runtime.support.pattern_check import refuse_undrivable


def settings_of_files(
    config: str | None,
    sets: Sequence[str],
    world: str | None,
    robot: str | None,
    map_file: str | None,
    mission: str | None,
    *,
    goal: str | None = None,
    no_console: bool,
) -> Settings:
    """Return the settings as the files are now, on the port that they name.

    Without a run file and a mission, a shipped world is driven as the shipped run of its name says: with its goal.

    Parameters
    ----------
    config, sets, world, robot, map_file, mission, goal, no_console
        As of `runtime.cli.robot_commands.run`.

    Raises
    ------
    ConfigError
        The settings are wrong.
    UserError
        No robot can carry them out.
    """
    if config is None and mission is None and world in list_shipped("runs"):
        config = world
    settings = load_settings(config, sets, robot=robot, world=world, mission=mission)
    if map_file is not None:
        settings = with_known_room(settings, map_file)
    if goal is not None:
        if mission is not None:
            raise UserError("--goal and --mission exclude each other: leave one of them out", WRONG_CALL)
        settings = with_goal(settings, parse_goal(goal, "odom" if map_file is None else "map", settings))
    check_places(settings.mission, settings.places)
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
    goal: str | None = None,
    no_console: bool = False,
) -> Settings:
    """Return the settings as the files are now, for a run on the same port as before.

    Parameters
    ----------
    config, sets, world, port, robot, map_file, mission, goal, no_console
        As of `runtime.cli.robot_commands.run`.
    emulator_port : str, optional
        Port of the emulator, which is used if the settings name none.

    Raises
    ------
    ConfigError
        The settings are wrong, or no robot can carry them out.
    """
    try:
        settings = settings_of_files(config, sets, world, robot, map_file, mission, goal=goal, no_console=no_console)
    except ConfigError:
        raise
    except UserError as error:
        raise ConfigError(str(error)) from error
    port = port or settings.link.port or emulator_port
    return settings if port is None else with_port(settings, port)


def parse_goal(text: str, frame: Frame, settings: Settings) -> GoalConfig:
    """Return the goal of `--goal`: the name of a place, or X,Y in metres and, if given, the heading in degrees.

    Raises
    ------
    UserError
        The text is something else.
    """
    if text.strip()[:1].isalpha() and "," not in text:
        place = settings.places.named(text.strip())
        if place is None:
            raise UserError(f"--goal {one_line(text)}: {no_such_place(one_line(text), settings.places)}", WRONG_CALL)
        there = {"x_m": place.x_m, "y_m": place.y_m, "heading_deg": place.heading_deg}
        return GoalConfig.model_validate({**there, "frame": settings.places_frame})
    keys = ("x_m", "y_m", "heading_deg")
    try:
        values = [float(word) for word in text.split(",")]
        return GoalConfig.model_validate({"frame": frame, **dict(zip(keys[: len(values)], values, strict=True))})
    except ValueError:  # a word is no number, there are too many or too few, or one is out of its bounds
        raise UserError(
            f"--goal {one_line(text)}: expected X,Y in metres, or X,Y,HEADING with a final heading from -360 to 360 "
            "degrees, for example --goal 3,1.5,90, or the name of a place",
            WRONG_CALL,
        ) from None


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
