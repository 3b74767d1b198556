"""A temporary folder for a run. It is removed at the end of the run, or after a SIGKILL at the start of the next one.

A folder in use is recognised by its lock, which the system releases with the process that holds it; a process number
in the name could by now belong to another process.
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
"""A younger folder is not removed: its owner may be about to lock it."""


@contextlib.contextmanager
def temp_folder() -> Iterator[Path]:
    """Yield a new folder for temporary files that only this user can enter, and remove it at the end.

    Raises
    ------
    OSError
        It cannot be created.
    """
    remove_stale_folders()
    with tempfile.TemporaryDirectory(prefix=PREFIX, ignore_cleanup_errors=True) as name:
        folder = Path(name)
        lock = _lock(folder)
        try:
            yield folder
        finally:
            if lock is not None:
                os.close(lock)


def remove_stale_folders() -> None:
    """Remove the folders of this user's runs whose process no longer exists."""
    with contextlib.suppress(OSError):  # if it cannot be listed, creating a folder in it reports that
        for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
            if _may_be_stale(folder) and (lock := _lock(folder)) is not None:
                shutil.rmtree(folder, ignore_errors=True)
                os.close(lock)


def _may_be_stale(folder: Path) -> bool:
    """Return whether this is a folder of this user, and not so young that its run may be about to lock it."""
    try:
        found = folder.lstat()
    except OSError:
        return False
    age_s = time.time() - found.st_mtime
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid() and age_s > YOUNG_S


def _lock(folder: Path) -> int | None:
    """Return a descriptor that holds the lock of a folder; None if another process does or there are no locks."""
    fd = None
    try:
        fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        if fd is not None:
            os.close(fd)
        return None
    return fd
