"""Folders of the user: for the program's state, those that a setting names with a tilde, and private files in them.

A user may have no home folder: in a container, a process can have a number without an entry in the list of users.
"""

from __future__ import annotations

import contextlib
import functools
import os
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

from platformdirs import user_state_path

from config.errors import WRONG_CALL, UserError
from config.files import one_line

NAME: Final = "echolocate"


def state_folder() -> Path:
    """Return the folder for logs and recordings; without a home folder, a new one that only this user can enter.

    Raises
    ------
    UserError
        There is no home folder, and no temporary folder can be created.
    """
    return users_own(user_state_path) or _temporary_folder()


def kept_places(map_name: str) -> Path:
    """Return the file in which the places of a shipped map are kept: the map itself comes with the program."""
    return state_folder() / "places" / f"{map_name}.toml"


def has_home() -> bool:
    """Return whether the user has a home folder, or the environment names another place for the state."""
    return users_own(user_state_path) is not None


def users_own(find: Callable[[str], Path]) -> Path | None:
    """Return the program's folder that a function of `platformdirs` finds; None if the user has no home folder."""
    with contextlib.suppress(RuntimeError):
        folder = find(NAME)
        return folder if folder.is_absolute() else None  # earlier versions return a folder of the name ~
    return None


def read_private(path: Path, bytes_max: int) -> bytes | None:
    """Return the first bytes of a file that is this user's alone; None if others can read or write it.

    Raises
    ------
    OSError
        It cannot be read, or is a link.
    """
    fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        about = os.fstat(fd)
        is_private = stat.S_ISREG(about.st_mode) and about.st_uid == os.geteuid() and not about.st_mode & 0o077
        return os.read(fd, bytes_max) if is_private else None
    finally:
        os.close(fd)


@functools.cache
def _temporary_folder() -> Path:
    """Return the folder of this process in place of one in the user's home."""
    try:
        return Path(tempfile.mkdtemp(prefix=f"{NAME}-state-"))
    except OSError as error:
        raise UserError(
            f"no home folder is known, and no temporary folder can be created: {error.strerror or error}; name a "
            "folder in XDG_STATE_HOME"
        ) from error


def expanded(path: str, setting: str) -> Path:
    """Return the path that a setting names, with ``~`` and ``~name`` replaced by the home folder of a user.

    Raises
    ------
    UserError
        There is no such user, or the user has no home folder.
    """
    try:
        return Path(path).expanduser()
    except RuntimeError:
        user = Path(path).parts[0]
        raise UserError(
            f"{setting} = {one_line(path)!r}: no home folder is known for {one_line(user)}; give a path without ~",
            WRONG_CALL,
        ) from None
