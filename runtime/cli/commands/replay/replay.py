"""`echolocate replay`: a recording cycle by cycle, or perception over a ring log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from config.errors import WRONG_CALL, UserError
from runtime.cli.options import Flag, Force, JsonFile, ModelFiles, ReplayOptions, RobotFile, Sets, UnitsOption
from runtime.cli.source_options import LogOptions
from runtime.recording.conventions.options import AUTO


def replay(
    log: str,
    /,
    *,
    verify: Annotated[bool, Flag] = False,
    other: Annotated[str | None, Parameter(name="--with")] = None,
    since: Annotated[float, Parameter(name="--from", show_default=False)] = 0.0,
    until: Annotated[float | None, Parameter(name="--to")] = None,
    speed: float | None = None,
    localize: Annotated[bool, Flag] = False,
    trajectory: str | None = None,
    path: str | None = None,
    map_file: Annotated[str | None, Parameter(name="--map")] = None,
    robot: RobotFile = None,
    model: ModelFiles = (),
    json: JsonFile = None,
    force: Force = False,
    units: UnitsOption = "m",
    options: LogOptions = AUTO,
    sets: Sets = (),
) -> int:
    """Replay a recording cycle by cycle, or run perception over a ring log.

    Parameters
    ----------
    log
        Recording (MCAP), or ring log (CSV with the header t,x,y,theta[,ring_yaw],r00,r01,…).
    verify
        Fail unless every cycle is reproduced bit by bit.
    other
        Compare with the run under the settings of this run file. So does --set.
    since
        Start this many seconds after the first recorded cycle.
    until
        End this many seconds after the first recorded cycle.
    speed
        Show the run this many times as fast as it was; by default it is replayed as fast as possible.
    localize
        Correct the drift of a ring log's odometry by round objects and by maps of its way; objects are then in the
        map frame, which is the odometry's at the first row.
    map_file
        With --localize, the known room: a world file, or the name of a shipped one. The start is then unknown, and
        the map frame is the file's.
    trajectory
        With --localize, a file for the robot's poses in the map frame (CSV), one row a firing, as known at its time.
    path
        The same as known at the end: later matches of the map correct earlier poses, too.
    robot
        Robot file for a ring log; a recording contains its robot.
    model
        Object models to recognise in a ring log; a recording contains its models.
    json
        File for a summary (JSON); None for no file.
    force
        Overwrite files that exist already.
    units
        Units of the printed tables.
    options
        The conventions of a ring log.
    sets
        Single settings, each `path=value`, that differ from the recorded or default ones.

    Raises
    ------
    UserError
        An option that applies to recordings only is given with a ring log.
    """
    from runtime.recording.reader import is_recording

    common = ReplayOptions(sets, robot, model, json, force, units)
    if not (trajectory is None and path is None) and not localize:
        raise UserError(
            f"{'--path' if trajectory is None else '--trajectory'} gives poses in the map frame: give --localize too",
            WRONG_CALL,
        )
    if map_file is not None and not localize:
        raise UserError("--map names the room in which the robot is: give --localize too", WRONG_CALL)
    if localize and is_recording(Path(log)):
        raise UserError(f"{log}: is a recording; --localize applies to ring logs only", WRONG_CALL)
    if is_recording(Path(log)):
        options.refuse_for(log)
        from runtime.cli.commands.replay.replay_recording import Span, replay_recording

        return replay_recording(log, common, span=Span(since, until, speed), verify=verify, other=other)
    if verify or other is not None or since or until is not None or speed is not None:
        raise UserError(
            f"{log}: is a ring log; --verify, --with, --from, --to and --speed apply to recordings (MCAP) only",
            WRONG_CALL,
        )
    from runtime.cli.commands.replay.replay_ring_log import replay_log

    return replay_log(
        log, common, localize=localize, trajectory=trajectory, path=path, map_file=map_file, options=options
    )
