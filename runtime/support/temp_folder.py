"""A folder for what a run needs while it lasts, gone with it; also after a run that could not clear up behind itself.

Nobody hears SIGKILL. So each start takes away what runs before it have left, and tells a folder that is in use by its
lock, which the system itself gives up with the process that holds it: a number could by now be another process's.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

PREFIX: Final = "echolocate-run-"

YOUNG_S: Final = 60.0
"""A younger folder is left alone: its owner may be about to lock it."""


@contextlib.contextmanager
def temp_folder() -> Iterator[Path]:
    """Give a fresh folder in the system's temporary place that only this user can enter.

    Raises
    ------
    OSError
        It cannot be made.
    """
    sweep()
    folder = Path(tempfile.mkdtemp(prefix=PREFIX))
    lock = _lock(folder)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def sweep() -> None:
    """Take away what this user's runs have left behind whose process is gone."""
    with contextlib.suppress(OSError):  # a place that cannot be listed is told where a folder is made in it
        for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
            if _is_ours(folder) and (lock := _lock(folder)) is not None:
                shutil.rmtree(folder, ignore_errors=True)
                os.close(lock)


def _is_ours(folder: Path) -> bool:
    try:
        found = folder.lstat()
    except OSError:
        return False
    age_s = time.time() - found.st_mtime
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid() and age_s > YOUNG_S


def _lock(folder: Path) -> int | None:
    """Return what holds the lock of a folder; None where another process does, or the file system knows no locks."""
    fd = None
    try:
        fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        if fd is not None:
            os.close(fd)
        return None
    return fd
