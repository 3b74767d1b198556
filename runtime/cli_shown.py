"""The commands that show a run which is over: `figures`, `report`, `export`; one half of `runtime.cli`."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter

from runtime.options import Flag, Sets, UnitsOption

Robot = Annotated[str | None, Parameter(help="Ring logs: robot file, or the name of a shipped one.")]
Models = Annotated[
    tuple[str, ...],
    Parameter(name="--model", negative="", help="Ring logs: object model, a file or a name; may be repeated."),
]
World = Annotated[str | None, Parameter(help="What stood there, a world file or a name, where FILE does not know.")]


def figures(
    file: str,
    /,
    *,
    out: str,
    still: Annotated[bool, Flag] = False,
    world: World = None,
    robot: Robot = None,
    models: Models = (),
    units: UnitsOption = "m",
    sets: Sets = (),
) -> int:
    """Draw a run as the paper does: raw data, segments, clusters, matched models, and all of it moving.

    Parameters
    ----------
    file
        A recording (MCAP) or a ring log (CSV).
    out
        Folder for the pictures: SVG, PDF and PNG; GIF, and MP4 where ffmpeg is there.
    still
        Leave the moving overview out.
    """
    from runtime.commands.figures import draw_figures
    from runtime.trace.sources import Asked

    return draw_figures(Asked(file, sets, robot, models, world), out, moving=not still, units=units)


def report(
    file: str,
    /,
    *,
    out: str | None = None,
    world: World = None,
    robot: Robot = None,
    models: Models = (),
    units: UnitsOption = "m",
    sets: Sets = (),
) -> int:
    """Put a run on one page of HTML: Table 2 with errors, pictures, timing, line, stop reasons, settings.

    Parameters
    ----------
    file
        A recording (MCAP) or a ring log (CSV).
    out
        The page; where it is not given, beside the file, as NAME.html.
    """
    from runtime.commands.report import write_report
    from runtime.trace.sources import Asked

    return write_report(Asked(file, sets, robot, models, world), out, units=units)


def export(
    file: str,
    /,
    *,
    to: Literal["csv", "parquet", "foxglove", "rosbag2", "ringlog"],
    out: str,
    world: World = None,
    robot: Robot = None,
    models: Models = (),
    sets: Sets = (),
) -> int:
    """Write a run in the form of other programs; all but csv and ringlog need `pip install 'echolocate[export]'`.

    Parameters
    ----------
    file
        A recording (MCAP) or a ring log (CSV).
    to
        Tables (csv, parquet), an MCAP for Foxglove, a ROS 2 bag, or a recording's firings as a ring log.
    out
        A folder for tables, a new folder for a bag, else a file.
    """
    from runtime.commands.export import export_run
    from runtime.trace.sources import Asked

    return export_run(Asked(file, sets, robot, models, world), to, out)
