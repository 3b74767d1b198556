"""`echolocate figures`: a run as the paper draws it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from runtime.commands.showing import folder, progress, read, writing
from runtime.complaint import DONE
from runtime.tables import Units

if TYPE_CHECKING:
    from runtime.trace.form import Trace
    from runtime.trace.sources import Asked


def draw_figures(asked: Asked, out: str, *, moving: bool, units: Units) -> int:
    """Carry out the command; see `runtime.cli.figures`."""
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
    from runtime.drawing.files import save, styled
    from runtime.drawing.moving import save_moving
    from runtime.drawing.pictures import pictures

    with progress(console, "drawing") as step, writing("--out", place), styled():
        paths = []
        for name, figure in pictures(trace, units).items():
            paths += save(figure, place, name)
            step()
        if moving:
            paths += save_moving(trace, units, place, "overview", step)
    return paths
