"""One writer to a file: the lock lies on the file itself, so that none can be left over.

A lock file beside it would outlive a crash and lie about who is there. `flock` ends with the process that holds it,
however that ends; what is left of a recorder that died is an ordinary file, and the next one simply takes it.
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
    """Hold the file at `path` for this process alone; it is made if it is not there, and its content left untouched.

    What is no ordinary file (a pipe, /dev/null) has no content that two could spoil, and is not locked.

    Parameters
    ----------
    path : Path
        The file.
    named : str
        What a complaint calls it, as ``--record run.csv``.

    Raises
    ------
    UserError
        Another process holds it, or it cannot be opened.
    """
    try:
        fd = _lock(path)
    except BlockingIOError:
        raise UserError(
            f"{named}: another process writes to this file; end that one (`fuser {path}` names it) "
            "or choose another file",
            FAILED,
        ) from None
    except OSError as error:
        raise UserError(f"{named}: cannot be written: {error.strerror}; choose another file", FAILED) from error
    try:
        yield
    finally:
        os.close(fd)


def _lock(path: Path) -> int:
    """Return a descriptor that holds the lock.

    Raises
    ------
    BlockingIOError
        Another process holds it.
    OSError
        The file cannot be opened, or its file system knows no locks.
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
        # Between being opened and being locked it was replaced: what is locked is no longer the file of that name.
        os.close(fd)
    raise BlockingIOError
