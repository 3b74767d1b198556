"""`echolocate report`: a run on one page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from config.errors import DONE, WRONG_CALL, UserError
from runtime.cli.commands.offline_io import progress, read, writing
from runtime.support.length_format import Units

if TYPE_CHECKING:
    from runtime.analysis.timeline import Timeline
    from runtime.analysis.timeline_sources import TimelineSource


def write_report(source: TimelineSource, out: str | None, *, units: Units) -> int:
    """Carry out the command; see `runtime.cli.app.report`."""
    console = Console(stderr=True, soft_wrap=True, highlight=False)
    target = Path(source.file).with_suffix(".html") if out is None else Path(out)
    if target.absolute() == Path(source.file).absolute():
        raise UserError(f"--out {target}: is the file itself; choose another name", WRONG_CALL)
    timeline = read(source, console)
    report(timeline, target, console, units=units)
    Console(soft_wrap=True, highlight=False).print(str(target))
    return DONE


def report(timeline: Timeline, target: Path, console: Console, *, units: Units) -> None:
    """Write the page of a run.

    Raises
    ------
    UserError
        It cannot be written.
    """
    from runtime.analysis.report.report_page import page

    with progress(console, "drawing"), writing("--out", target):
        target.write_text(page(timeline, units), encoding="utf-8")
