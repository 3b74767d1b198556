"""`echolocate stand`: what one stand of the ring hears: kind, place and bearing of each surface."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter
from rich.table import Table

from config.errors import DONE, FAILED, UserError
from runtime.cli.commands.offline_io import plain_console
from runtime.cli.commands.output_files import check_outputs
from runtime.cli.commands.robots.calibrate import read_firings
from runtime.cli.options import Force, JsonFile, RobotFile, UnitsOption
from runtime.cli.source_options import File, LogOptions
from runtime.recording.conventions.options import AUTO, RingLogOptions
from runtime.support.length_format import Units, format_length, format_point

if TYPE_CHECKING:
    from collections.abc import Sequence

    from config.settings import Settings
    from drivers.messages import Firing, Pose
    from perception.stand import StandSurface


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

    Raises
    ------
    UserError
        The file cannot be read or written, or no surface was heard often enough.
    """
    if map_file is not None:
        from runtime.cli.commands.stand_in_room import locate_stand

        return locate_stand(
            file, map_file, at, robot=robot, json_file=json, force=force, units=units, options=options
        )
    from drivers.messages import Pose
    from perception.stand import surfaces_of_stand
    from runtime.cycle.summary import write_json

    settings, heard = read_stand(file, at, robot, json, force=force, options=options)
    surfaces = surfaces_of_stand(settings.ring, heard)
    last = heard[-1]
    ring = Pose(last.pose.x, last.pose.y, last.ring_yaw)
    if json is not None:
        write_json(json, {"firings": len(heard), "surfaces": [surface_row(one, ring) for one in surfaces]})
    if not surfaces:
        raise UserError(
            f"{file}: no surface was heard over three different paths in the {len(heard)} firings of this stand; let "
            "the robot stand for a round of its firing pattern, or name another moment with --at",
            FAILED,
        )
    output = plain_console()
    output.print(stand_table(surfaces, ring, last.pose, units))
    output.print(f"{len(heard)} firings from {heard[0].robot_s:.2f} to {last.robot_s:.2f} s by the robot's clock")
    return DONE


def read_stand(
    file: str, at_s: float | None, robot: str | None, json_file: str | None, *, force: bool, options: RingLogOptions
) -> tuple[Settings, Sequence[Firing]]:
    """Return the settings, and the firings at the place where the robot was; arguments and errors of `stand`."""
    from perception.stand import stand_of

    settings, firings = read_firings(
        file, robot, lambda: check_outputs({"--json": json_file}, (file,), force=force), options
    )
    if at_s is not None and firings and round(at_s, 2) > round(firings[-1].robot_s, 2):  # as the error has them
        last = f"the last firing is at {firings[-1].robot_s:.2f} s"
        raise UserError(f"{file}: ends before --at {at_s:.2f} by the robot's clock; {last}", FAILED)
    stand = stand_of(firings, math.inf if at_s is None else at_s)
    if not stand:
        first = f" the first firing is at {firings[0].robot_s:.2f} s" if firings else " it holds no firing"
        raise UserError(f"{file}: nothing was fired up to --at {at_s} by the robot's clock;{first}", FAILED)
    return settings, stand


def stand_table(surfaces: tuple[StandSurface, ...], ring: Pose, robot: Pose, units: Units) -> Table:
    """Return a table of the surfaces, with the odds of plane, corner, edge and cylinder in per cent.

    Parameters
    ----------
    surfaces : tuple of StandSurface
        What was heard.
    ring : Pose
        The ring's centre and direction.
    robot : Pose
        The robot, from whose heading bearings count.
    units : {"m", "ft"}
        Of the lengths.
    """
    title = "Surfaces heard from this stand; places in odometry's frame, odds in %"
    table = Table(title=title, title_justify="left")
    table.add_column("kind")
    for name in (f"place ({units})", "range", "bearing", "plane : corner :\nedge : cylinder"):
        table.add_column(name, justify="right", no_wrap=True)
    for surface in surfaces:
        echo = surface.echo
        bearing = math.remainder(ring.theta + echo.bearing - robot.theta, 2.0 * math.pi)
        odds = " : ".join(f"{100.0 * share:.0f}" for share in echo.probabilities)
        table.add_row(
            surface.kind,
            format_point(*surface.place(ring), units),
            format_length(echo.range_m, units, 3),
            f"{math.degrees(bearing):.1f} ± {math.degrees(echo.sigma_bearing):.2f}°",
            odds if surface.is_one else "more than one",
        )
    return table


def surface_row(surface: StandSurface, ring: Pose) -> dict[str, Any]:
    """Return a surface as JSON, m and rad; its bearing is from the ring's sensor 0."""
    echo = surface.echo
    x, y = surface.place(ring)
    odds = dict(zip(("plane", "corner", "edge", "cylinder"), echo.probabilities, strict=True))
    return {
        "kind": surface.kind,
        "x": x,
        "y": y,
        "bearing": echo.bearing,
        "range": echo.range_m,
        "sigma_bearing": echo.sigma_bearing,
        "sigma_range": echo.sigma_range_m,
        "probabilities": odds,
        "radius": None if math.isnan(echo.radius_m) else echo.radius_m,
        "misfit": echo.misfit,
        "paths": surface.paths,
    }
