"""`echolocate figures`: a run as the paper draws it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from config.errors import DONE
from runtime.cli.commands.offline_io import folder, progress, read, writing
from runtime.support.length_format import Units

if TYPE_CHECKING:
    from runtime.analysis.timeline import Timeline
    from runtime.analysis.timeline_sources import TimelineSource


def draw_figures(source: TimelineSource, out: str, *, moving: bool, units: Units) -> int:
    """Carry out the command; see `runtime.cli.app.figures`."""
    console = Console(stderr=True, soft_wrap=True, highlight=False)
    place = folder(out)
    timeline = read(source, console)
    told = Console(soft_wrap=True, highlight=False)
    for path in draw_all(timeline, place, console, moving=moving, units=units):
        told.print(str(path))
    for note in timeline.notes:
        console.print(note)
    return DONE


def draw_all(timeline: Timeline, place: Path, console: Console, *, moving: bool, units: Units) -> list[Path]:
    """Write every picture of a run into a folder and return the files.

    Raises
    ------
    Complaint
        One cannot be written.
    """
    from runtime.analysis.plots.animation import save_moving
    from runtime.analysis.plots.figure_files import save, styled
    from runtime.analysis.plots.paper_figures import pictures

    with progress(console, "drawing") as step, writing("--out", place), styled():
        paths = []
        for name, figure in pictures(timeline, units).items():
            paths += save(figure, place, name)
            step()
        if moving:
            paths += save_moving(timeline, units, place, "overview", step)
    return paths
