"""What a person does with the recordings of a folder: look at the list, name, keep and delete them.

A name never leads out of the folder, no file is ever overwritten, and one that is being written is left alone.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final, Literal, NamedTuple, TypeAlias

from config.errors import UserError
from config.files import one_line
from runtime.recording.extent import recording_extent
from runtime.recording.folder_index import create_listed, listed_names
from runtime.recording.storage import SUFFIX, find_recording, is_pinned, list_recordings, pin_of
from runtime.support.file_lock import is_locked

NAME: Final = re.compile(r"[^\W_][\w .,()+=@-]*", re.ASCII)
NAME_MAX: Final = 100
"""Characters of a name without its suffix."""

Completeness: TypeAlias = Literal["live", "complete", "incomplete"]


class FolderFile(NamedTuple):
    """A recording of a folder, as a list of them shows it."""

    file: str
    """Its name in the folder."""
    bytes: int
    modified_s: float
    """Unix time."""
    duration_s: float | None
    """None where the file does not say."""
    state: Completeness
    """`live`: a run is writing it. `incomplete`: it ends where the run or the machine died."""
    pinned: bool
    """Whether it stays when the folder is full."""


def describe_recordings(folder: Path) -> list[FolderFile]:
    """Return the newest recordings of a folder, newest first. Blocks on the disk."""
    found = []
    for file, size, modified_s in list_recordings(folder):
        path = folder / file
        extent = recording_extent(path)
        state: Completeness = "complete" if extent.is_complete else "live" if is_locked(path) else "incomplete"
        found.append(FolderFile(file, size, modified_s, extent.duration_s, state, is_pinned(path)))
    return found


def rename_recording(folder: Path, name: str, to: str) -> str:
    """Give a recording another name, and return that; it counts towards the folder's limits as before.

    `to` is the new name, with or without its suffix.

    Raises
    ------
    UserError
        There is no such recording, a run is writing it, or the new name is taken or is none.
    """
    path = _finished(folder, name)
    stem = to.removesuffix(SUFFIX)
    if not stem.strip():
        raise UserError("the new name is empty: give the recording a name")
    if NAME.fullmatch(stem) is None or len(stem) > NAME_MAX:
        raise UserError(
            f"{one_line(to)!r} cannot be a recording's name: begin with a letter or digit, then letters, digits, "
            f"spaces and .,_()+=@-, {NAME_MAX} at most"
        )
    new = folder / f"{stem}{SUFFIX}"
    if new == path:
        return name
    try:
        # The new name is taken before the file moves there, so that nothing of another run is overwritten.
        if name in listed_names(folder):
            create_listed(new)
        else:
            new.touch(exist_ok=False)
    except FileExistsError:
        raise UserError(f"there is a recording {new.name} already: choose another name") from None
    except OSError as error:
        raise _refused(name, "renamed", error) from error
    try:
        if is_pinned(path):
            pin_of(new).touch()
        else:
            pin_of(new).unlink(missing_ok=True)
        path.replace(new)
    except OSError as error:
        new.unlink(missing_ok=True)
        pin_of(new).unlink(missing_ok=True)
        raise _refused(name, "renamed", error) from error
    pin_of(path).unlink(missing_ok=True)
    return new.name


def pin_recording(folder: Path, name: str, *, pinned: bool) -> bool:
    """Keep a recording when the folder is full, or no longer, also one being written; return whether it was kept.

    Raises
    ------
    UserError
        There is no such recording, or the disk refuses.
    """
    path = _found(folder, name)
    was_pinned = is_pinned(path)
    try:
        if pinned:
            pin_of(path).touch()
        else:
            pin_of(path).unlink(missing_ok=True)
    except OSError as error:
        raise _refused(name, "pinned" if pinned else "unpinned", error) from error
    return was_pinned


def delete_recording(folder: Path, name: str) -> None:
    """Delete a recording for good.

    Raises
    ------
    UserError
        There is no such recording, a run is writing it, it is pinned, or the disk refuses.
    """
    path = _finished(folder, name)
    if is_pinned(path):
        raise UserError(f"{name} is pinned: unpin it first")
    try:
        path.unlink()
    except OSError as error:
        raise _refused(name, "deleted", error) from error


def _found(folder: Path, name: str) -> Path:
    """Return the path of a recording in a folder.

    Raises
    ------
    UserError
        There is none of this name.
    """
    path = find_recording(folder, name)
    if path is None:
        raise UserError(f"there is no recording {one_line(name)!r} in {folder}: list the recordings again")
    return path


def _finished(folder: Path, name: str) -> Path:
    """Return the path of a recording that no run is writing.

    Raises
    ------
    UserError
        There is none of this name, or it is being written.
    """
    path = _found(folder, name)
    if is_locked(path):
        raise UserError(f"{name} is being written: stop recording first")
    return path


def _refused(name: str, done: str, error: OSError) -> UserError:
    return UserError(f"{name} cannot be {done}: {error.strerror or error}")
