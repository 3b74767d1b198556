"""`echolocate figures`: draw a run as the paper does."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from config.errors import DONE
from runtime.cli.commands.offline_io import make_output_folder, plain_console, read_timeline, writing
from runtime.support.length_format import Units
from runtime.support.progress import progress

if TYPE_CHECKING:
    from runtime.analysis.timeline import Timeline
    from runtime.analysis.timeline_sources import TimelineSource


def draw_figures(source: TimelineSource, out: str, *, moving: bool, units: Units) -> int:
    """Draw all figures of a run and return the exit code.

    Parameters
    ----------
    source, out, units
        As of `runtime.cli.recording_commands.figures`.
    moving : bool
        Whether the animation is drawn.
    """
    console, output = plain_console(stderr=True), plain_console()
    folder = make_output_folder(out)
    timeline = read_timeline(source, console)
    for path in draw_all(timeline, folder, console, moving=moving, units=units):
        output.print(str(path))
    for note in timeline.notes:
        console.print(note)
    return DONE


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
            paths += save_moving(timeline, units, folder, "overview", step)
    return paths
