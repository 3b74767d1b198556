"""`echolocate report`: one HTML page about a run."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from config.errors import DONE
from runtime.cli.commands.offline_io import plain_console, read_timeline
from runtime.cli.commands.output_files import check_outputs, writing
from runtime.cli.options import Force, Sets, UnitsOption
from runtime.cli.source_options import NO_OPTIONS, File, SourceOptions
from runtime.support.length_format import Units
from runtime.support.progress import progress

if TYPE_CHECKING:
    from runtime.analysis.timeline import Timeline


def report(
    file: File,
    /,
    *,
    out: str | None = None,
    force: Force = False,
    options: SourceOptions = NO_OPTIONS,
    units: UnitsOption = "m",
    sets: Sets = (),
) -> int:
    """Write one HTML page about a run: Table 2 with errors, figures, timing, link, stop reasons, settings.

    Parameters
    ----------
    out
        Page to write; by default NAME.html in the folder of FILE.
    force
        Overwrite it if it exists already.
    file
        Recording or ring log of the run.
    options
        Settings that a recording contains and a ring log does not.
    units
        Units of lengths on the page.
    sets
        Single settings, each `path=value`, that override the others.
    """
    console, source = plain_console(stderr=True), options.timeline_source(file, sets)
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
    from runtime.analysis.report.report_page import run_page

    with progress(console, "drawing"), writing("--out", target):
        target.write_text(run_page(timeline, units), encoding="utf-8")
