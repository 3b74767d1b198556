"""The settings of `echolocate run` as files and command line give them, at its start and when it reads them again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

from config.errors import WRONG_CALL, UserError, naming_file
from config.files import is_utf8, one_line, utf8
from config.load import ConfigError, list_shipped, load_settings, load_world, with_goal, with_known_room
from config.mission_step import Frame
from config.places import check_places, no_such_place
from config.robot import NO_BODY
from config.settings import GoalConfig, Settings
from runtime.cli.options import Flag, RobotFile, Sets
from runtime.support.user_folders import kept_places


@Parameter(name="*")
@dataclass(frozen=True)
class SettingsFiles:
    """What the command line says of a run's settings."""

    config: Annotated[str | None, Parameter(parse=False)] = None
    """Run file, or the name of a shipped one; the argument of the command."""
    no_console: Annotated[bool, Flag, Parameter(help="Do not serve the operator console.")] = False
    map_file: Annotated[
        str | None,
        Parameter(
            name="--map",
            help="The known room in which the robot finds itself: a world file, or the name of a shipped one.",
        ),
    ] = None
    robot: RobotFile = None
    world: Annotated[
        str | None,
        Parameter(
            help="Emulated robot: world file, or the name of a shipped one; without CONFIG its shipped run is driven."
        ),
    ] = None
    mission: Annotated[
        str | None,
        Parameter(
            help="What to do once armed: a mission file, or the name of a shipped one; None for that of the run file."
        ),
    ] = None
    goal: Annotated[
        str | None,
        Parameter(
            allow_leading_hyphen=True,
            help="Where to drive once armed: X,Y in metres, or X,Y,HEADING with the final heading in degrees, or the "
            "name of a place; in the map with --map, otherwise in odometry's frame, from where the run begins.",
        ),
    ] = None
    sets: Sets = ()

    @property
    def name_a_robot(self) -> bool:
        """Whether a run file or an option says which robot it is."""
        return self.config is not None or self.robot is not None

    @property
    def file(self) -> str | None:
        """What says what the robot is, a file or --set over it; None if it is the default, or with a goal over it."""
        file = self.robot or self.config
        if file is None or self.goal is not None:
            return None
        return f"--set over {file}" if self.sets else file

    def read(self) -> Settings:
        """Return the settings as the files are now, on the port that they name.

        Without a run file and a mission, a shipped world is driven as the shipped run of its name: with its goal. A
        shipped map has the places that an earlier run kept for it.

        Raises
        ------
        ConfigError
            The settings are wrong.
        UserError
            No robot can carry them out.
        """
        settings = self.read_unchecked()
        refuse_impossible(settings, self.file)
        return settings

    def read_unchecked(self) -> Settings:
        """Return the settings as `read` does, without asking whether a robot can carry them out.

        Raises
        ------
        ConfigError
            The settings are wrong.
        UserError
            An option is wrong, or a place has no name.
        """
        is_shipped = self.config is None and self.mission is None and self.world in list_shipped("runs")
        config = self.world if is_shipped else self.config
        settings = load_settings(config, self.sets, robot=self.robot, world=self.world, mission=self.mission)
        if self.map_file is not None:
            settings = with_known_room(settings, self.map_file)
            if self.map_file in list_shipped("worlds") and (kept := kept_places(self.map_file)).exists():
                settings = settings.model_copy(update={"places": load_world(kept).places()})
        if self.goal is not None:
            if self.mission is not None:
                raise UserError("--goal and --mission exclude each other: leave one of them out", WRONG_CALL)
            frame: Frame = "odom" if self.map_file is None else "map"
            settings = with_goal(settings, parse_goal(self.goal, frame, settings))
        check_places(settings.mission, settings.places)
        return without_console(settings) if self.no_console else settings

    def read_again(self, port: str | None, emulator_port: str | None) -> Settings:
        """Return the settings as the files are now, for a run on the same port as before.

        Parameters
        ----------
        port : str, optional
            The port that the command line names.
        emulator_port : str, optional
            Port of the emulator, which is used if the settings name none.

        Raises
        ------
        ConfigError
            The settings are wrong, or no robot can carry them out.
        """
        try:
            settings = self.read()
        except ConfigError:
            raise
        except UserError as error:
            raise ConfigError(str(error)) from error
        port = port or settings.link.port or emulator_port
        return settings if port is None else with_port(settings, port)


def refuse_impossible(settings: Settings, file: str | None = None) -> None:
    """Refuse settings that no robot can carry out, and name their file; this imports the most of perception.

    Raises
    ------
    UserError
        What is impossible, and why.
    """
    from runtime.support.blind_sides import refuse_blind_ways
    from runtime.support.pattern_check import refuse_undrivable

    with naming_file(file):
        if settings.body == NO_BODY:
            raise UserError(
                "body: the robot file describes none, so it is good for replays, stands and maps only; to drive, add "
                "a [body] with radius_m, speed_max_m_s and turn_max_rad_s",
                WRONG_CALL,
            )
        refuse_undrivable(settings)
        refuse_blind_ways(settings)


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
