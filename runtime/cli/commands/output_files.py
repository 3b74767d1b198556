"""The guard of every file that a command writes: no input, no other output and, without --force, no existing file.

Files are compared by inode, so a symbolic or a hard link is the file that it leads to. Devices and pipes may be
written to as they like: they hold nothing that could be lost.
"""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final, TypeAlias

from config.errors import FAILED, WRONG_CALL, UserError
from config.files import files_read, one_line
from runtime.support.file_lock import in_use, is_locked

PathLike: TypeAlias = str | Path
FileId: TypeAlias = tuple[int, int, str]
"""Device and inode of a file, or those of the folder of a file that does not exist yet, and its name there."""

HARMLESS: Final = frozenset({os.devnull})


def check_outputs(
    outputs: Mapping[str, PathLike | Iterable[PathLike] | None],
    inputs: Iterable[PathLike | None] = (),
    *,
    force: bool,
    appended: Mapping[str, PathLike] | None = None,
) -> None:
    """Check, before work or a drive begins, that all files of a command can be written and that none is lost by it.

    Parameters
    ----------
    outputs : mapping
        Files by the option that asks for them; None for an option not given.
    inputs : iterable
        Files that are read, besides the settings files that have been read already; names of shipped ones and None
        are skipped.
    force : bool
        Whether existing files may be overwritten. An empty one always may: nothing is lost.
    appended : mapping, optional
        Files that are only appended to, by the setting that names them; they may exist.

    Raises
    ------
    UserError
        An output is an input or another output, exists, is being written by another process, or cannot be written.
    """
    read = {found: path for path in (*inputs, *files_read()) if path is not None and (found := _existing(path))}
    written: dict[FileId, str] = {}
    for option, path in [*(appended or {}).items(), *_each(outputs)]:
        shown = f"{option} {one_line(str(path))}"
        found = _identity(path)
        if found in read:
            raise UserError(
                f"{shown}: is an input itself: {one_line(str(read[found]))}; choose another name", WRONG_CALL
            )
        is_device = _exists(path) and not Path(path).is_file()
        if found in written:
            raise UserError(f"{shown}: is the same file as {written[found]}; choose another name", WRONG_CALL)
        if found is not None and not is_device:
            written[found] = shown
    for option, path in _each(outputs):
        if is_locked(Path(path)):
            raise in_use(Path(path), f"{option} {one_line(str(path))}")
    refuse_existing(outputs, force=force)
    for option, path in _each(outputs):
        _refuse_unwritable(option, Path(path))


def refuse_existing(outputs: Mapping[str, PathLike | Iterable[PathLike] | None], *, force: bool) -> None:
    """Refuse files that hold something; `check_outputs` includes it.

    Parameters
    ----------
    outputs, force
        As of `check_outputs`.

    Raises
    ------
    UserError
        There is such a file.
    """
    for option, path in _each(outputs):
        if not force and _has_content(Path(path)):
            problem = "exists; choose another name, or overwrite it with --force"
            raise UserError(f"{option} {one_line(str(path))}: {problem}", WRONG_CALL)


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
    if _exists(folder) and not folder.is_dir():
        raise UserError(f"--out {path}: is a file; name a folder", WRONG_CALL)
    with writing("--out", path):
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def _each(outputs: Mapping[str, PathLike | Iterable[PathLike] | None]) -> Iterator[tuple[str, PathLike]]:
    for option, paths in outputs.items():
        if isinstance(paths, (str, Path)):
            yield option, paths
        elif paths is not None:
            yield from ((option, path) for path in paths)


def _existing(path: PathLike) -> FileId | None:
    """Return the identity of an existing file or device, through links; None for anything else."""
    try:
        info = Path(path).stat()
    except (OSError, ValueError):
        return None
    # A serial port must not be written to either.
    is_file = stat.S_ISREG(info.st_mode) or (stat.S_ISCHR(info.st_mode) and os.path.realpath(path) not in HARMLESS)
    return (info.st_dev, info.st_ino, "") if is_file else None


def _exists(path: PathLike) -> bool:
    """Return whether there is something at a path; a name that is too long or hidden is refused when it is opened."""
    try:
        return Path(path).exists()
    except OSError:
        return False


def _identity(path: PathLike) -> FileId | None:
    """Return the identity of a file that may not exist yet; None for a pipe, a folder, or one that cannot be made."""
    found = _existing(path)
    if found is not None or _exists(path):
        return found
    target = Path(os.path.realpath(path))  # where a link leads that names no file yet
    try:
        folder = target.parent.stat()
    except OSError:
        return None
    return folder.st_dev, folder.st_ino, target.name


def _has_content(path: Path) -> bool:
    try:
        info = path.stat()
    except OSError:
        return False
    return stat.S_ISREG(info.st_mode) and info.st_size > 0


def _refuse_unwritable(option: str, path: Path) -> None:
    """Check that a file can be written, without leaving one behind.

    Raises
    ------
    UserError
        It cannot.
    """
    with writing(option, path):
        if path.exists() and not path.is_file() and not path.is_dir():
            return  # to open a pipe would wait for its reader
        is_new = not (path.exists() or path.is_symlink())
        with path.open("ab") as file:
            if is_new and os.fstat(file.fileno()).st_size == 0:
                path.unlink()
