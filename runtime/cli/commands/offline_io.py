"""What the commands share that show a run which is over: reading it with a progress bar, and where to write."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import Progress

from config.errors import FAILED, WRONG_CALL, UserError
from runtime.support.kernel_cache import prepare_kernels

if TYPE_CHECKING:
    from runtime.analysis.timeline import Timeline
    from runtime.analysis.timeline_sources import TimelineSource


@contextlib.contextmanager
def progress(console: Console, what: str) -> Iterator[Callable[[], None]]:
    """Show that something goes on; gives what to call for each step."""
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=None)
        yield lambda: bar.update(task, advance=1)


def read(source: TimelineSource, console: Console) -> Timeline:
    """Return the timeline of a file.

    Raises
    ------
    UserError
        It cannot be read, or holds nothing to show.
    """
    from runtime.analysis.timeline_sources import load_timeline

    with progress(console, "reading") as step:
        timeline = load_timeline(source, lambda settings: prepare_kernels(settings, console), step)
    if timeline.last is None:
        raise UserError(f"{source.file}: holds no echo and no odometry: nothing to show", FAILED)
    return timeline


@contextlib.contextmanager
def writing(option: str, path: str | Path) -> Iterator[None]:
    """Turn what the disk refuses into a complaint that names the option.

    Raises
    ------
    UserError
        Something could not be written.
    """
    try:
        yield
    except OSError as error:
        raise UserError(
            f"{option} {path}: cannot be written: {error.strerror or error}; choose another place or make room",
            FAILED,
        ) from error


def folder(path: str) -> Path:
    """Return the folder of `--out`, made where it is missing.

    Raises
    ------
    UserError
        It is a file, or cannot be made.
    """
    made = Path(path)
    if made.exists() and not made.is_dir():
        raise UserError(f"--out {path}: is a file; name a folder", WRONG_CALL)
    with writing("--out", path):
        made.mkdir(parents=True, exist_ok=True)
    return made


def need(module: str, package: str, extra: str) -> None:
    """Complain where a package of an extra is missing.

    Raises
    ------
    UserError
        It is; the line names what to install.
    """
    from importlib.util import find_spec

    if find_spec(module) is None:
        raise UserError(
            f"this needs {package}, which is not installed: pip install 'echolocate[{extra}]' (or pip install "
            f"{package})",
            FAILED,
        )
