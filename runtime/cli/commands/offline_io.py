"""Functions common to commands: reading a file with a progress bar, checking the files to be written."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from config.errors import FAILED, WRONG_CALL, UserError
from runtime.support.kernel_cache import prepare_kernels
from runtime.support.progress import progress

if TYPE_CHECKING:
    from runtime.analysis.timeline import Timeline
    from runtime.analysis.timeline_sources import TimelineSource


def plain_console(*, stderr: bool = False) -> Console:
    """Return a console that neither wraps lines nor colours numbers: paths can be copied, output can be parsed."""
    return Console(stderr=stderr, soft_wrap=True, highlight=False)


def read_timeline(source: TimelineSource, console: Console) -> Timeline:
    """Return the timeline of a recording or ring log, with a progress bar.

    Raises
    ------
    UserError
        The file cannot be read, or it holds nothing to show.
    """
    from runtime.analysis.timeline_sources import load_timeline

    with progress(console, "reading") as step:
        timeline = load_timeline(source, lambda settings: prepare_kernels(settings, console), step)
    if timeline.last is None:
        raise UserError(f"{source.file}: holds no echo and no odometry: nothing to show", FAILED)
    return timeline


def refuse_unwritable(files: dict[str, str | None]) -> None:
    """Check, before work or a drive begins, that the files of these options can be written.

    Raises
    ------
    UserError
        One cannot.
    """
    for option, path in files.items():
        if path is not None:
            with writing(option, path):
                is_new = not (Path(path).exists() or Path(path).is_symlink())
                Path(path).open("ab").close()
                if is_new:
                    Path(path).unlink()


@contextlib.contextmanager
def writing(option: str, path: str | Path) -> Iterator[None]:
    """Raise OSErrors of the block as a UserError that names the option.

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


def make_output_folder(path: str) -> Path:
    """Return the folder of `--out`, created if it does not exist.

    Raises
    ------
    UserError
        The path is a file, or the folder cannot be created.
    """
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise UserError(f"--out {path}: is a file; name a folder", WRONG_CALL)
    with writing("--out", path):
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def refuse_overwriting(source: str, target: Path) -> None:
    """Raise an error if the output would overwrite the input.

    Raises
    ------
    UserError
        Both are the same file.
    """
    if target.absolute() == Path(source).absolute():
        raise UserError(f"--out {target}: is the input itself; choose another name", WRONG_CALL)


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
