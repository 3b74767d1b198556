"""The commands that read the recording of a finished run: replay, report, export, map, calibrate and others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final, Literal

from cyclopts import Parameter

from config.errors import WRONG_CALL, UserError
from runtime.cli.options import Flag, Force, JsonFile, ModelFiles, RobotFile, Sets, UnitsOption
from runtime.recording.conventions.options import AUTO, RingLogOptions

if TYPE_CHECKING:
    from runtime.analysis.timeline_sources import TimelineSource

LogOptions = Annotated[RingLogOptions, Parameter(name="*", negative="", show_default=False)]
File = Annotated[str, Parameter(help="Recording (MCAP) or ring log (CSV).")]


@Parameter(name="*")
@dataclass(frozen=True)
class SourceOptions:
    """What a file may not contain itself: its world, and for ring logs the robot and the models."""

    world: Annotated[
        str | None, Parameter(help="World file, or the name of a shipped one, if FILE does not contain its world.")
    ] = None
    robot: Annotated[str | None, Parameter(help="Ring logs: robot file, or the name of a shipped one.")] = None
    models: Annotated[
        tuple[str, ...],
        Parameter(
            name="--model",
            negative="",
            show_default=False,
            help="Ring logs: object model, file or name of a shipped one; may be repeated.",
        ),
    ] = ()
    log: LogOptions = AUTO

    def timeline_source(self, file: str, sets: tuple[str, ...]) -> TimelineSource:
        """Return the file together with these options, as the analysis takes them."""
        from runtime.analysis.timeline_sources import TimelineSource

        return TimelineSource(file, sets, self.robot, self.models, self.world, self.log)


NO_OPTIONS: Final = SourceOptions()


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
        Correct the drift of a ring log's odometry by what is recognised; objects are then in the map frame, which is
        the odometry's at the first row.
    map_file
        With --localize, the known room: a world file, or the name of a shipped one. The start is then unknown, and
        the map frame is the file's.
    trajectory
        With --localize, a file for the robot's poses in the map frame (CSV), one row a firing.
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
    from pathlib import Path

    from runtime.recording.reader import is_recording

    if trajectory is not None and not localize:
        raise UserError("--trajectory gives poses in the map frame: give --localize too", WRONG_CALL)
    if map_file is not None and not localize:
        raise UserError("--map names the room in which the robot is: give --localize too", WRONG_CALL)
    if localize and is_recording(Path(log)):
        raise UserError(f"{log}: is a recording; --localize applies to ring logs only", WRONG_CALL)
    if is_recording(Path(log)):
        options.refuse_for(log)
        from runtime.cli.commands.replay_recording import Span, replay_recording

        return replay_recording(
            log, sets, span=Span(since, until, speed), verify=verify, other=other, robot=robot, models=model,
            json_file=json, force=force, units=units,
        )  # fmt: skip
    if verify or other is not None or since or until is not None or speed is not None:
        raise UserError(
            f"{log}: is a ring log; --verify, --with, --from, --to and --speed apply to recordings (MCAP) only",
            WRONG_CALL,
        )
    from runtime.cli.commands.replay_ring_log import replay_log

    return replay_log(
        log, sets, robot=robot, models=model, json_file=json, force=force, units=units, localize=localize,
        trajectory=trajectory, map_file=map_file, options=options,
    )  # fmt: skip


def recover(recording: str, /, *, out: str | None = None, force: Force = False) -> int:
    """Restore what can be read of a damaged or incomplete recording.

    Parameters
    ----------
    recording
        Damaged file; it is not changed.
    out
        File to write; by default NAME-recovered.mcap in the same folder.
    force
        Overwrite it if it exists already.
    """
    from runtime.cli.commands.recover import recover_recording

    return recover_recording(recording, out, force=force)


def figures(
    file: File,
    /,
    *,
    out: str,
    still: Annotated[bool, Flag] = False,
    force: Force = False,
    options: SourceOptions = NO_OPTIONS,
    units: UnitsOption = "m",
    sets: Sets = (),
) -> int:
    """Draw a run as the paper does: raw data, segments, clusters, matched models, and an animation of it all.

    Parameters
    ----------
    out
        Folder for the figures: SVG, PDF and PNG; the animation as GIF, and as MP4 if ffmpeg is installed.
    still
        Leave out the animation.
    force
        Overwrite files that exist already.
    file
        Recording or ring log of the run.
    options
        Settings that a recording contains and a ring log does not.
    units
        Units of the axes.
    sets
        Single settings, each `path=value`, that override the others.
    """
    from runtime.cli.commands.figures import draw_figures

    return draw_figures(options.timeline_source(file, sets), out, moving=not still, force=force, units=units)


def report(
    file: File,
    /,
    *,
    out: str | None = None,
    force: Force = False,
    options: SourceOptions = NO_OPTIONS,
    units: UnitsOption = "m",
    sets: Sets = (),
) -> int:
    """Write one HTML page about a run: Table 2 with errors, figures, timing, link, stop reasons, settings.

    Parameters
    ----------
    out
        Page to write; by default NAME.html in the folder of FILE.
    force
        Overwrite it if it exists already.
    file
        Recording or ring log of the run.
    options
        Settings that a recording contains and a ring log does not.
    units
        Units of lengths on the page.
    sets
        Single settings, each `path=value`, that override the others.
    """
    from runtime.cli.commands.report import write_report

    return write_report(options.timeline_source(file, sets), out, force=force, units=units)


def export(
    file: File,
    /,
    *,
    to: Literal["csv", "parquet", "foxglove", "rosbag2", "ringlog"],
    out: str,
    force: Force = False,
    options: SourceOptions = NO_OPTIONS,
    sets: Sets = (),
) -> int:
    """Convert a run to the format of another program; some formats need `pip install 'echolocate[export]'`.

    Parameters
    ----------
    to
        Tables (csv, or parquet*), an MCAP for Foxglove (foxglove*), a ROS 2 bag (rosbag2*), or the firings of a
        recording as a ring log (ringlog). Formats with * need the extra `export`.
    out
        Folder for tables, new folder for a bag, otherwise the file to write.
    force
        Overwrite files that exist already; a bag always needs a new folder.
    file
        Recording or ring log of the run.
    options
        Settings that a recording contains and a ring log does not.
    sets
        Single settings, each `path=value`, that override the others.
    """
    from runtime.cli.commands.export import export_run

    return export_run(options.timeline_source(file, sets), to, out, force=force)


def map_command(
    file: File,
    /,
    *,
    out: str,
    grid: str | None = None,
    geojson: str | None = None,
    force: Force = False,
    options: SourceOptions = NO_OPTIONS,
    sets: Sets = (),
) -> int:
    """Write the map of a run as a world file, as an occupancy image with the YAML of ROS's map_server, as GeoJSON.

    Of a run in a known room (`run --map`) it is that map, corrected by what the run found, and what changed is said.

    Parameters
    ----------
    out
        World file to write (TOML).
    grid
        Image to write (PGM); its YAML is written beside it.
    geojson
        GeoJSON to write: drums, polygons and walls in metres of the map's own frame.
    force
        Overwrite files that exist already.
    file
        Recording or ring log of the run.
    options
        Settings that a recording contains and a ring log does not.
    sets
        Single settings, each `path=value`, that override the others.
    """
    from runtime.cli.commands.map_run import map_run

    return map_run(options.timeline_source(file, sets), out, grid, geojson, force=force)


def calibrate(
    file: File,
    /,
    *,
    out: str,
    way: float | None = None,
    drum: Annotated[tuple[float, ...], Parameter(negative="", show_default=False)] = (),
    force: Force = False,
    robot: RobotFile = None,
    options: LogOptions = AUTO,
) -> int:
    """Find a robot's mounts, beams and scales from a drive by a wall and a drum, and write them as a robot file.

    The drive: stand a metre from a bare wall, turn slowly twice on the spot; drive some metres, away from the wall
    and past something round; turn slowly twice again. Measure the way between both stands, and what is round.

    Parameters
    ----------
    out
        Robot file to write (TOML).
    way
        Measured distance between both stands, m; without it, a round object's radius alone shows lengths.
    drum
        Measured radius of a round object beside the way, m; may be repeated.
    force
        Overwrite files that exist already.
    file
        Recording or ring log of the drive.
    robot
        Ring logs: the nominal robot, file or name of a shipped one; None for the default.
    options
        The conventions of a ring log.
    """
    from runtime.cli.commands.calibrate import calibrate_robot

    return calibrate_robot(file, out, way_m=way, radii_m=drum, robot=robot, force=force, options=options)


def stand(
    file: File,
    /,
    *,
    at: float | None = None,
    map_file: Annotated[str | None, Parameter(name="--map")] = None,
    robot: RobotFile = None,
    json: JsonFile = None,
    force: Force = False,
    units: UnitsOption = "m",
    options: LogOptions = AUTO,
) -> int:
    """List what a robot heard where it stood, surface by surface, or with --map where in a known room it stood.

    To name kinds takes sensors that listen while others fire (robot file `ears`) and fine ranges. What the readings
    leave open is unknown, or convex if it may be an edge or a cylinder.

    With --map each pose that the readings of one round fit is given, the most probable first: a symmetric room gives
    several. This is Drumheller's method (1987); a drive says more: see `replay --localize --map`.

    Parameters
    ----------
    file
        Recording or ring log.
    at
        A moment of the stand by the robot's clock, s; by default the end.
    map_file
        The known room: a world file, or the name of a shipped one; its acoustics say how surfaces reflect.
    robot
        Ring logs: robot file, or the name of a shipped one; None for the default.
    json
        File for the surfaces or the poses (JSON).
    force
        Overwrite it if it exists already.
    units
        Units of the table.
    options
        The conventions of a ring log.
    """
    if map_file is not None:
        from runtime.cli.commands.stand_in_room import locate_stand

        return locate_stand(
            file, map_file, at, robot=robot, json_file=json, force=force, units=units, options=options
        )
    from runtime.cli.commands.stand import show_stand

    return show_stand(file, at, robot=robot, json_file=json, force=force, units=units, options=options)
