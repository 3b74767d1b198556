"""The console's token, kept across restarts in a file that only this user can read.

Pages that are open when a service restarts have the token of the run before; with the same token they come back by
themselves.
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

from config.errors import UserError
from runtime.support.user_folders import read_private

NAME: Final = "console-token"
_FORM: Final = re.compile(rb"[A-Za-z0-9_-]{22,128}\n?")
_BYTES_MAX: Final = 200


def kept_token(folder: Path, make: Callable[[], str]) -> str:
    """Return the token that is kept in a folder; make and keep one if there is none.

    Parameters
    ----------
    folder : Path
        The program's state folder; created if it does not exist.
    make : callable
        Returns a new token.

    Raises
    ------
    UserError
        The file holds no token, others may read or write it, or it cannot be read or created.
    """
    path = folder / NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _create(path, make)
        return _read(path)
    except OSError as error:
        raise UserError(
            f"the console's token cannot be kept in {path}: {error.strerror or error}; make its folder writable"
        ) from error


def _create(path: Path, make: Callable[[], str]) -> None:
    """Write a new token unless the file exists; whole or not at all, so that of two processes both read one token."""
    if path.exists():
        return
    fd, temporary = tempfile.mkstemp(prefix=f"{NAME}-", dir=path.parent)  # mode 0600
    try:
        with os.fdopen(fd, "wb") as file:
            file.write(f"{make()}\n".encode())
            file.flush()
            os.fsync(fd)
        os.link(temporary, path)
    except FileExistsError:
        pass  # another process was faster: its token counts
    finally:
        os.unlink(temporary)  # noqa: PTH108 - beside os.link


def _read(path: Path) -> str:
    """Return the file's token.

    Raises
    ------
    UserError
        It holds none, or is not this user's alone.
    """
    held = read_private(path, _BYTES_MAX)
    if held is None:
        raise UserError(f"others could know the console's token in {path}: delete this file, and a new one is made")
    if _FORM.fullmatch(held) is None:
        raise UserError(f"{path} holds no token of the console: delete this file, and a new one is made")
    return held.decode().strip()
