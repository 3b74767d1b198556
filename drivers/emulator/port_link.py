"""The symbolic link to an emulator's pty, which only one emulator at a time may have."""

from __future__ import annotations

import contextlib
import fcntl
import os
from pathlib import Path

from config.errors import UserError

_TRIES = 10


class EmulatorError(UserError):
    """The emulator cannot start or be controlled; the text is one line with the reason."""


class PortLink:
    """A symbolic link that is kept pointing at a pty.

    A pty may be anyone's, so the link does not show whether an emulator uses it. A locked file ``.NAME.lock`` beside
    it does; the system releases the lock with the process, and the file is removed with the link.

    Parameters
    ----------
    path
        The symbolic link.

    Raises
    ------
    EmulatorError
        Another emulator has the link, or no file can be created beside it.
    """

    def __init__(self, path: str) -> None:
        self.path = Path(path)
        self._lock_path = self.path.with_name(f".{self.path.name}.lock")
        try:
            self._lock = _lock(self._lock_path)
        except BlockingIOError:
            raise EmulatorError(f"another emulator has the link {path}: end it or choose another path") from None
        except (OSError, ValueError) as error:
            raise _not_made(self.path, error) from error

    def point_at(self, target: str) -> None:
        """Point the link at a pty.

        Raises
        ------
        EmulatorError
            The path exists and is not a link to a pty, or the link cannot be made.
        """
        link = self.path
        if link.is_symlink():
            before = link.readlink()
            if link.exists() and not str(before).startswith("/dev/pts/"):
                raise EmulatorError(
                    f"{link} is a link to {before}, which is not a pty: remove it or choose another path"
                )
        elif link.exists():
            raise EmulatorError(f"{link} exists and is not a link: remove it or choose another path")
        new_link = link.with_name(f".{link.name}.{os.getpid()}")
        try:
            new_link.symlink_to(target)
            new_link.replace(link)
        except OSError as error:
            raise _not_made(link, error) from error

    def remove(self, target: str) -> None:
        """Remove the link if it still points at this pty."""
        with contextlib.suppress(OSError):
            if self.path.readlink() == Path(target):
                self.path.unlink()

    def close(self) -> None:
        """Leave the path to other emulators."""
        with contextlib.suppress(OSError):
            self._lock_path.unlink()
        os.close(self._lock)


def _not_made(link: Path, error: OSError | ValueError) -> EmulatorError:
    reason = os.strerror(error.errno or 0) if isinstance(error, OSError) else str(error)
    return EmulatorError(f"cannot make the link {link}: {reason}; choose another path")


def _lock(path: Path) -> int:
    """Return a descriptor that holds the lock of a file, which is created.

    Raises
    ------
    BlockingIOError
        Another process holds the lock.
    OSError
        The file cannot be created or locked.
    """
    for _ in range(_TRIES):
        fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK, 0o600)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(fd), path.stat()):
                    return fd
        except BaseException:
            os.close(fd)
            raise
        os.close(fd)  # its owner has just removed it
    raise BlockingIOError
