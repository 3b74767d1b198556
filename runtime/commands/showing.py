"""What the commands share that show a run which is over: reading it with a progress bar, and where to write."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import Progress

from runtime.complaint import FAILED, WRONG_CALL, Complaint
from runtime.kernels import ready_kernels

if TYPE_CHECKING:
    from runtime.trace.form import Trace
    from runtime.trace.sources import Asked


@contextlib.contextmanager
def progress(console: Console, what: str) -> Iterator[Callable[[], None]]:
    """Show that something goes on; gives what to call for each step."""
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=None)
        yield lambda: bar.update(task, advance=1)


def read(asked: Asked, console: Console) -> Trace:
    """Return the trace of a file.

    Raises
    ------
    Complaint
        It cannot be read, or holds nothing to show.
    """
    from runtime.trace.sources import trace_of

    with progress(console, "reading") as step:
        trace = trace_of(asked, lambda settings: ready_kernels(settings, console), step)
    if trace.last is None:
        raise Complaint(f"{asked.file}: holds no echo and no odometry: nothing to show", FAILED)
    return trace


@contextlib.contextmanager
def writing(option: str, path: str | Path) -> Iterator[None]:
    """Turn what the disk refuses into a complaint that names the option.

    Raises
    ------
    Complaint
        Something could not be written.
    """
    try:
        yield
    except OSError as error:
        raise Complaint(
            f"{option} {path}: cannot be written: {error.strerror or error}; choose another place or make room",
            FAILED,
        ) from error


def folder(path: str) -> Path:
    """Return the folder of `--out`, made where it is missing.

    Raises
    ------
    Complaint
        It is a file, or cannot be made.
    """
    made = Path(path)
    if made.exists() and not made.is_dir():
        raise Complaint(f"--out {path}: is a file; name a folder", WRONG_CALL)
    with writing("--out", path):
        made.mkdir(parents=True, exist_ok=True)
    return made


def need(module: str, package: str, extra: str) -> None:
    """Complain where a package of an extra is missing.

    Raises
    ------
    Complaint
        It is; the line names what to install.
    """
    from importlib.util import find_spec

    if find_spec(module) is None:
        raise Complaint(
            f"this needs {package}, which is not installed: pip install 'echolocate[{extra}]' (or pip install "
            f"{package})",
            FAILED,
        )
