"""Options of `echolocate replay`: of recordings and ring logs alike, of recordings alone, of ring logs alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Final

from cyclopts import Parameter

from config.errors import WRONG_CALL, UserError
from runtime.cli.options import Flag, JsonFile, ModelFiles, RobotFile, Sets, UnitsOption

SPEED_MIN: Final = 0.001
"""Slowest replay: a cycle is shown for a minute."""


@Parameter(name="*")
@dataclass(frozen=True)
class ReplayOptions:
    """What a recording and a ring log are given alike."""

    robot: RobotFile = None
    model: ModelFiles = ()
    json: JsonFile = None
    units: UnitsOption = "m"
    sets: Sets = ()


@Parameter(name="*")
@dataclass(frozen=True)
class RecordingOptions:
    """The part of a recording that is replayed, in seconds after its first cycle, and how."""

    verify: Annotated[
        bool, Flag, Parameter(help="Fail unless every cycle that can be replayed is reproduced bit by bit.")
    ] = False
    other: Annotated[
        str | None,
        Parameter(name="--with", help="Compare with the run under the settings of this run file. So does --set."),
    ] = None
    since_s: Annotated[
        float,
        Parameter(name="--from", show_default=False, help="Start this many seconds after the first recorded cycle."),
    ] = 0.0
    until_s: Annotated[
        float | None, Parameter(name="--to", help="End this many seconds after the first recorded cycle.")
    ] = None
    speed: Annotated[
        float | None,
        Parameter(
            help="Show the run this many times as fast as it was; by default it is replayed as fast as possible."
        ),
    ] = None

    @property
    def is_part(self) -> bool:
        """Whether not the whole recording is replayed."""
        return self.since_s != 0.0 or self.until_s is not None

    def validate(self) -> None:
        """Check the options.

        Raises
        ------
        UserError
            A number is negative or infinite, or the end is not after the start.
        """
        for option, value in (("--from", self.since_s), ("--to", self.until_s), ("--speed", self.speed)):
            if value is not None and not (value >= 0.0 and math.isfinite(value)):
                raise UserError(f"{option} {value}: must be a number, 0 or above", WRONG_CALL)
        if self.speed is not None and self.speed < SPEED_MIN:
            raise UserError(f"--speed {self.speed:g}: must be {SPEED_MIN} or above", WRONG_CALL)
        if self.until_s is not None and self.until_s <= self.since_s:
            raise UserError(f"--to {self.until_s}: must be after --from {self.since_s}", WRONG_CALL)


@Parameter(name="*")
@dataclass(frozen=True)
class LocalizeOptions:
    """Whether a ring log's drift is corrected, in what room, and where the poses are written."""

    localize: Annotated[
        bool,
        Flag,
        Parameter(
            help="Correct the drift of a ring log's odometry by round objects and by maps of its way; objects are "
            "then in the map frame, which is the odometry's at the first row."
        ),
    ] = False
    trajectory: Annotated[
        str | None,
        Parameter(
            help="With --localize, a file for the robot's poses in the map frame (CSV), one row a firing, as known "
            "at its time."
        ),
    ] = None
    path: Annotated[
        str | None,
        Parameter(
            help="The same as known at the end: later matches of the map correct earlier poses, too. Not with --map."
        ),
    ] = None
    map_file: Annotated[
        str | None,
        Parameter(
            name="--map",
            help="With --localize, the known room: a world file, or the name of a shipped one. The start is then "
            "unknown, and the map frame is the file's.",
        ),
    ] = None

    def validate(self) -> None:
        """Check the options.

        Raises
        ------
        UserError
            One has a meaning with --localize only, or without --map only.
        """
        if self.localize and self.path is not None and self.map_file is not None:
            raise UserError(
                "--path gives the poses that later matches correct; in a known room (--map) none is corrected later: "
                "give --trajectory",
                WRONG_CALL,
            )
        if self.localize:
            return
        for option, file in (("--trajectory", self.trajectory), ("--path", self.path)):
            if file is not None:
                raise UserError(f"{option} gives poses in the map frame: give --localize too", WRONG_CALL)
        if self.map_file is not None:
            raise UserError("--map names the room in which the robot is: give --localize too", WRONG_CALL)


BOTH: Final = ReplayOptions()
WHOLE: Final = RecordingOptions()
AS_ODOMETRY_SAYS: Final = LocalizeOptions()
