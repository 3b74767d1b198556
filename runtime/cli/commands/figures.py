"""`echolocate figures`: a run as the paper draws it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from config.errors import DONE
from runtime.analysis.text_tables import Units
from runtime.cli.commands.offline_io import folder, progress, read, writing

if TYPE_CHECKING:
    from runtime.analysis.trace import Trace
    from runtime.analysis.trace_sources import Asked


def draw_figures(asked: Asked, out: str, *, moving: bool, units: Units) -> int:
    """Carry out the command; see `runtime.cli.app.figures`."""
    console = Console(stderr=True, soft_wrap=True, highlight=False)
    place = folder(out)
    trace = read(asked, console)
    told = Console(soft_wrap=True, highlight=False)
    for path in draw_all(trace, place, console, moving=moving, units=units):
        told.print(str(path))
    for note in trace.notes:
        console.print(note)
    return DONE


def draw_all(trace: Trace, place: Path, console: Console, *, moving: bool, units: Units) -> list[Path]:
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
        for name, figure in pictures(trace, units).items():
            paths += save(figure, place, name)
            step()
        if moving:
            paths += save_moving(trace, units, place, "overview", step)
    return paths
