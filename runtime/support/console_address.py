"""The addresses of the runs on this machine, for other commands: each run has a file that only its owner can read.

The file holds the start URL. It is locked while the run lasts, so what a killed run leaves counts for nothing; the
next run removes it. The address of the newest run is also in a file of a fixed name, for scripts.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from config.errors import UserError
from runtime.support.file_lock import file_lock, is_locked
from runtime.support.user_folders import read_private

FOLDER: Final = "consoles"
NEWEST: Final = "console-address"
YOUNG_S: Final = 60.0
"""A younger file is not removed: its run may be about to lock it."""
_BYTES_MAX: Final = 500
_NO_RUN: Final = (
    "no run of this user is known on this machine: start `echolocate run`, or name another machine's with --connect"
)


@contextmanager
def announced(url: str, folder: Path) -> Iterator[None]:
    """Keep a run's start URL, with its token, during the block; a folder that cannot be written stops no run."""
    path = folder / FOLDER / str(os.getpid())
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError, UserError):
            path.parent.mkdir(parents=True, exist_ok=True)
            for left in path.parent.iterdir():
                with contextlib.suppress(OSError):  # another run has just removed it, or it is no file
                    is_young = left != path and time.time() - left.stat().st_mtime < YOUNG_S
                    if not (is_young or is_locked(left)):
                        left.unlink()
            os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_CLOEXEC, 0o600))
            stack.enter_context(file_lock(path, str(path)))
            path.write_text(f"{url}\n", "utf-8")
            stack.callback(_leave, path, folder)
            _name_newest(folder)
        yield


def find_consoles(folder: Path) -> list[str]:
    """Return the start URLs of this user's runs on this machine, the newest first.

    Raises
    ------
    UserError
        There is no run, or a file is not this user's alone.
    """
    found = []
    with contextlib.suppress(OSError):
        for path in (folder / FOLDER).iterdir():
            with contextlib.suppress(FileNotFoundError):  # that run has ended meanwhile
                if is_locked(path) and (url := _read(path)):  # empty: that run is just starting, or its disk is full
                    found.append((path.stat().st_mtime_ns, url))
    if not found:
        raise UserError(_NO_RUN)
    return [url for _, url in sorted(found, reverse=True)]


def find_console(folder: Path, address: str | None = None) -> str:
    """Return the start URL of the newest run, or of the run at an address that is given without its token.

    Parameters
    ----------
    folder : Path
        As of `find_consoles`, and it raises the same.
    address : str, optional
        URL of a run's page. One with a token, or of no run on this machine, is returned as it is.
    """
    if address is None:
        return find_consoles(folder)[0]
    wanted = urlsplit(address)
    with contextlib.suppress(UserError):
        same = (url for url in find_consoles(folder) if urlsplit(url).netloc == wanted.netloc)
        return address if wanted.query else next(same, address)
    return address


def list_consoles(folder: Path) -> str | None:
    """Return a line that names the runs on this machine, without their tokens; None if there is only one, or none."""
    try:
        pages = [urlsplit(url)._replace(query="").geturl() for url in find_consoles(folder)]
    except UserError:
        return None
    if len(pages) < 2:
        return None
    return f"{len(pages)} runs on this machine: {', '.join(pages)}; the newest is taken, --connect names another"


def _read(path: Path) -> str:
    """Return the URL in a file.

    Raises
    ------
    OSError
        It cannot be read.
    UserError
        It is not this user's alone.
    """
    held = read_private(path, _BYTES_MAX)
    if held is None:
        raise UserError(f"others can read or write the address in {path}: delete this file and start the run again")
    return held.decode("utf-8", "replace").strip()


def _leave(path: Path, folder: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)
    _name_newest(folder)


def _name_newest(folder: Path) -> None:
    """Write the address of the newest run into the file for scripts, or remove that file without a run."""
    with contextlib.suppress(OSError):
        try:
            url = find_console(folder)
        except UserError:
            (folder / NEWEST).unlink(missing_ok=True)
            return
        fd, temporary = tempfile.mkstemp(prefix=f"{NEWEST}-", dir=folder)  # mode 0600
        with os.fdopen(fd, "w", encoding="utf-8") as file:
            file.write(f"{url}\n")
        Path(temporary).replace(folder / NEWEST)
