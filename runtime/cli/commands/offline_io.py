"""Functions common to the commands on finished runs: reading a file with a progress bar, optional packages."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from config.errors import FAILED, UserError
from runtime.cli.terminal.escaping_console import EscapingConsole
from runtime.support.kernel_warmup import prepare_kernels
from runtime.support.progress import progress

if TYPE_CHECKING:
    from config.settings import Settings
    from runtime.analysis.timeline import Timeline
    from runtime.analysis.timeline_sources import TimelineSource


def plain_console(*, stderr: bool = False) -> Console:
    """Return a console that neither wraps lines nor colours numbers: paths can be copied, output can be parsed."""
    return EscapingConsole(stderr=stderr, soft_wrap=True, highlight=False)


def read_timeline(
    source: TimelineSource,
    console: Console,
    check_outputs: Callable[[], None] = lambda: None,
    *,
    skim: bool = False,
) -> Timeline:
    """Return the timeline of a recording or ring log, with a progress bar.

    Parameters
    ----------
    source : TimelineSource
        The file, and the settings for a ring log.
    console : Console
        Where the progress bar is shown.
    check_outputs : callable
        Called once the settings have been read, before perception starts: raises a UserError if the command's files
        cannot be written.
    skim : bool
        As of `timeline_sources.load_timeline`.

    Raises
    ------
    UserError
        The file cannot be read, or it holds nothing to show.
    """
    from runtime.analysis.timeline_sources import load_timeline
    from runtime.recording.extent import recording_extent

    def prepare(settings: Settings) -> None:
        check_outputs()
        prepare_kernels(settings, console)

    with progress(console, "reading", recording_extent(Path(source.file)).messages) as step:
        timeline = load_timeline(source, prepare, step, skim=skim)
    if timeline.last is None:
        raise UserError(f"{source.file}: holds no echo and no odometry: nothing to show", FAILED)
    return timeline


def require_package(module: str, package: str, extra: str) -> None:
    """Raise an error if an optional package is not installed.

    Parameters
    ----------
    module : str
        Module to import.
    package : str
        Package that contains it.
    extra : str
        Extra of this program that installs it.

    Raises
    ------
    UserError
        The package is missing; the message says how to install it.
    """
    from importlib.util import find_spec

    if find_spec(module) is None:
        raise UserError(
            f"this needs {package}, which is not installed: pip install 'echolocate[{extra}]' (or pip install "
            f"{package})",
            FAILED,
        )
