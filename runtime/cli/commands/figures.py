"""`echolocate figures`: draw a run as the paper does."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from rich.console import Console

from config.errors import DONE
from runtime.cli.commands.offline_io import plain_console, read_timeline
from runtime.cli.commands.output_files import check_outputs, make_output_folder, writing
from runtime.cli.options import Flag, Force, Sets, UnitsOption
from runtime.cli.source_options import NO_OPTIONS, File, SourceOptions
from runtime.support.length_format import Units
from runtime.support.progress import progress

if TYPE_CHECKING:
    from runtime.analysis.timeline import Timeline

ANIMATION: Final = "overview"
"""Name of the animation without its suffix."""


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
    console, output, source = plain_console(stderr=True), plain_console(), options.timeline_source(file, sets)
    folder = make_output_folder(out)
    files = figure_files(folder, moving=not still)
    check = partial(check_outputs, {"--out": files}, source.inputs, force=force)
    timeline = read_timeline(source, console, check)
    for path in draw_all(timeline, folder, console, moving=not still, units=units):
        output.print(str(path))
    for note in timeline.notes:
        console.print(note)
    return DONE


def figure_files(folder: Path, *, moving: bool) -> list[Path]:
    """Return the files that `draw_all` may write.

    Parameters
    ----------
    folder : Path
        Where they go.
    moving : bool
        Whether the animation is drawn.
    """
    from runtime.analysis.plots.animation import MOVING
    from runtime.analysis.plots.figure_files import FORMATS
    from runtime.analysis.plots.paper_figures import NAMES

    files = [folder / f"{name}.{kind}" for name in NAMES for kind in FORMATS]
    return files + [folder / f"{ANIMATION}.{kind}" for kind in MOVING if moving]


def draw_all(timeline: Timeline, folder: Path, console: Console, *, moving: bool, units: Units) -> list[Path]:
    """Write every figure of a run into a folder and return the files.

    Parameters
    ----------
    timeline : Timeline
        The run.
    folder : Path
        An existing folder.
    console : Console
        Where the progress bar is shown.
    moving : bool
        Whether the animation is drawn.
    units : {"m", "ft"}
        Units of the axes.

    Raises
    ------
    UserError
        A file cannot be written.
    """
    from runtime.analysis.plots.animation import save_moving
    from runtime.analysis.plots.figure_files import save, styled
    from runtime.analysis.plots.paper_figures import pictures

    with progress(console, "drawing") as step, writing("--out", folder), styled():
        paths = []
        for name, figure in pictures(timeline, units).items():
            paths += save(figure, folder, name)
            step()
        if moving:
            paths += save_moving(timeline, units, folder, ANIMATION, step)
    return paths
