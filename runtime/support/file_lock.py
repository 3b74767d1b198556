"""Lock a file for one writing process, with `flock` on the file itself.

A separate lock file would survive a crash. This lock ends with the process that holds it; what a killed recorder
leaves is an ordinary file that the next one may write.

(filelock and portalocker truncate the file or need a separate one.)
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from config.errors import FAILED, UserError

_TRIES: Final = 10


@contextlib.contextmanager
def file_lock(path: Path, named: str) -> Iterator[None]:
    """Lock the file at `path` during the block; create it if it does not exist, and leave its content untouched.

    Only regular files are locked: a pipe or /dev/null has no content that two writers could spoil.

    Parameters
    ----------
    path : Path
        The file.
    named : str
        How an error message names it, e.g. ``--record run.csv``.

    Raises
    ------
    UserError
        Another process holds the lock, or the file cannot be opened.
    """
    try:
        fd = _lock(path)
    except BlockingIOError:
        raise in_use(path, named) from None
    except OSError as error:
        raise UserError(f"{named}: cannot be written: {error.strerror}; choose another file", FAILED) from error
    try:
        yield
    finally:
        os.close(fd)


def in_use(path: Path, named: str) -> UserError:
    """Return the error for a file that another process has locked; `named` as for `file_lock`."""
    return UserError(
        f"{named}: another process writes to this file; end it (`fuser {path}` shows it) or choose another file",
        FAILED,
    )


def is_locked(path: Path) -> bool:
    """Return whether a process holds the lock of a file, this one included."""
    try:
        fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        fcntl.flock(fd, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # the file system has no locks
        return False
    else:
        return False
    finally:
        os.close(fd)


def _lock(path: Path) -> int:
    """Return a file descriptor that holds the lock.

    Raises
    ------
    BlockingIOError
        Another process holds the lock.
    OSError
        The file cannot be opened, or its file system has no locks.
    """
    for _ in range(_TRIES):
        fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOCTTY | os.O_NONBLOCK, 0o666)
        try:
            held = os.fstat(fd)
            if not stat.S_ISREG(held.st_mode):
                return fd
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(held, path.stat()):
                    return fd
        except BaseException:
            os.close(fd)
            raise
        # The file was replaced between opening and locking: the locked one no longer has this name.
        os.close(fd)
    raise BlockingIOError
