"""The commands that show a run which is over: `figures`, `report`, `export`; one half of `runtime.cli.app`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final, Literal

from cyclopts import Parameter

from runtime.cli.options import Flag, Sets, UnitsOption

if TYPE_CHECKING:
    from runtime.analysis.timeline_sources import TimelineSource

File = Annotated[str, Parameter(help="A recording (MCAP) or a ring log (CSV).")]


@Parameter(name="*")
@dataclass(frozen=True)
class Besides:
    """What FILE may not say of itself."""

    world: Annotated[
        str | None, Parameter(help="What stood there, a world file or a name, where FILE does not know.")
    ] = None
    robot: Annotated[str | None, Parameter(help="Ring logs: robot file, or the name of a shipped one.")] = None
    models: Annotated[
        tuple[str, ...],
        Parameter(name="--model", negative="", help="Ring logs: object model, a file or a name; may be repeated."),
    ] = ()

    def asked(self, file: str, sets: tuple[str, ...]) -> TimelineSource:
        """Return what is asked for, in the words of those who read it."""
        from runtime.analysis.timeline_sources import TimelineSource

        return TimelineSource(file, sets, self.robot, self.models, self.world)


NOTHING: Final = Besides()


def figures(
    file: File,
    /,
    *,
    out: str,
    still: Annotated[bool, Flag] = False,
    besides: Besides = NOTHING,
    units: UnitsOption = "m",
    sets: Sets = (),
) -> int:
    """Draw a run as the paper does: raw data, segments, clusters, matched models, and all of it moving.

    Parameters
    ----------
    out
        Folder for the pictures: SVG, PDF and PNG; GIF, and MP4 where ffmpeg is there.
    still
        Leave the moving overview out.
    """
    from runtime.cli.commands.figures import draw_figures

    return draw_figures(besides.asked(file, sets), out, moving=not still, units=units)


def report(
    file: File,
    /,
    *,
    out: str | None = None,
    besides: Besides = NOTHING,
    units: UnitsOption = "m",
    sets: Sets = (),
) -> int:
    """Put a run on one page of HTML: Table 2 with errors, pictures, timing, line, stop reasons, settings.

    Parameters
    ----------
    out
        The page; where it is not given, beside the file, as NAME.html.
    """
    from runtime.cli.commands.report import write_report

    return write_report(besides.asked(file, sets), out, units=units)


def export(
    file: File,
    /,
    *,
    to: Literal["csv", "parquet", "foxglove", "rosbag2", "ringlog"],
    out: str,
    besides: Besides = NOTHING,
    sets: Sets = (),
) -> int:
    """Write a run in the form of other programs; all but csv and ringlog need `pip install 'echolocate[export]'`.

    Parameters
    ----------
    to
        Tables (csv, parquet), an MCAP for Foxglove, a ROS 2 bag, or a recording's firings as a ring log.
    out
        A folder for tables, a new folder for a bag, else a file.
    """
    from runtime.cli.commands.export import export_run

    return export_run(besides.asked(file, sets), to, out)
