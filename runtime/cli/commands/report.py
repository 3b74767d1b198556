"""`echolocate report`: one HTML page about a run."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from config.errors import DONE
from runtime.cli.commands.offline_io import plain_console, read_timeline
from runtime.cli.commands.output_files import check_outputs, writing
from runtime.support.length_format import Units
from runtime.support.progress import progress

if TYPE_CHECKING:
    from runtime.analysis.timeline import Timeline
    from runtime.analysis.timeline_sources import TimelineSource


def write_report(source: TimelineSource, out: str | None, *, force: bool, units: Units) -> int:
    """Write the page of a run and return the exit code.

    Parameters
    ----------
    source, out, force, units
        As of `runtime.cli.recording_commands.report`.
    """
    console = plain_console(stderr=True)
    target = Path(source.file).with_suffix(".html") if out is None else Path(out)
    check = partial(check_outputs, {"--out": target}, source.inputs, force=force)
    timeline = read_timeline(source, console, check, skim=True)
    write_page(timeline, target, console, units=units)
    plain_console().print(str(target))
    return DONE


def write_page(timeline: Timeline, target: Path, console: Console, *, units: Units) -> None:
    """Write the page of a run.

    Parameters
    ----------
    timeline : Timeline
        The run.
    target : Path
        The file.
    console : Console
        Where the progress bar is shown.
    units : {"m", "ft"}
        Units of lengths on the page.

    Raises
    ------
    UserError
        The file cannot be written.
    """
    from runtime.analysis.report.report_page import page

    with progress(console, "drawing"), writing("--out", target):
        target.write_text(page(timeline, units), encoding="utf-8")
