"""The address of the run on this machine, for other commands: a file with the start URL that only its owner can read.

The newest run is found by it; a run removes its own at the end.
"""

from __future__ import annotations

import contextlib
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from config.errors import UserError

NAME: Final = "console-address"
_BYTES_MAX: Final = 500


@contextmanager
def announced(url: str, folder: Path) -> Iterator[None]:
    """Keep a run's start URL in a folder while the context lasts; a folder that cannot be written stops no run.

    Parameters
    ----------
    url : str
        The start URL, with the token.
    folder : Path
        The program's state folder.
    """
    path, line = folder / NAME, f"{url}\n".encode()
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        fd, temporary = tempfile.mkstemp(prefix=f"{NAME}-", dir=folder)  # mode 0600
        with os.fdopen(fd, "wb") as file:
            file.write(line)
        Path(temporary).replace(path)
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            if path.read_bytes() == line:
                path.unlink()


def find_console(folder: Path) -> str:
    """Return the start URL of the newest run of this user on this machine.

    Parameters
    ----------
    folder : Path
        The program's state folder.

    Raises
    ------
    UserError
        There is none, or the file is not this user's alone.
    """
    path = folder / NAME
    try:
        fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError as error:
        raise UserError(
            "no run of this user is known on this machine: start `echolocate run`, or name another machine's with "
            "--connect"
        ) from error
    try:
        about = os.fstat(fd)
        is_private = stat.S_ISREG(about.st_mode) and about.st_uid == os.geteuid() and not about.st_mode & 0o077
        held = os.read(fd, _BYTES_MAX) if is_private else b""
    finally:
        os.close(fd)
    if not is_private:
        raise UserError(f"others can read or write the address in {path}: delete this file and start the run again")
    return held.decode("utf-8", "replace").strip()
