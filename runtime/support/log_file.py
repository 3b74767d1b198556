"""The log file: it is appended to, and once it is full it becomes NAME.1, in place of the one before.

Several runs may write to one file. Only files that hold lines of a log are ever appended to or replaced.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import stat
from pathlib import Path
from typing import Final

import orjson

OLD_SUFFIX: Final = ".1"
HEAD_BYTES: Final = 1 << 20
HEAD_LINES: Final = 10
"""What is read to tell whether a file is a log: settings, its longest line, take some ten thousand bytes."""


class LogFile:
    """An open log file. Every method raises OSError if the disk fails.

    Parameters
    ----------
    path : Path
        Created if it does not exist, with its folder; only this user may read it. A device or a pipe is written to
        as it is.
    bytes_max : int
        Size at which a file is full.

    Raises
    ------
    OSError
        The file cannot be opened.
    ValueError
        It exists and is something else than a log.
    """

    def __init__(self, path: Path, bytes_max: int) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._path = Path(os.path.realpath(path))  # what a link leads to is renamed, not the link
        self._bytes_max = bytes_max
        self._is_cut = False
        self._fd = self._open()

    def write(self, line: bytes) -> None:
        """Append a line; a line that a full disk cut off is ended first."""
        self._make_room(len(line))
        rest = memoryview(b"\n" + line if self._is_cut else line)
        while rest:
            count = os.write(self._fd, rest)
            self._is_cut = count < len(rest)
            rest = rest[count:]

    def close(self) -> None:
        """Close the file."""
        os.close(self._fd)

    def _open(self) -> int:
        if not may_be_log(self._path):
            raise ValueError("it is not a log")
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOCTTY
        return os.open(self._path, flags, 0o600)

    def _make_room(self, more_bytes: int) -> None:
        """Begin another file if this one is full, or follow another run that has done so."""
        info = os.fstat(self._fd)
        if not stat.S_ISREG(info.st_mode) or info.st_size == 0 or info.st_size + more_bytes <= self._bytes_max:
            return
        with contextlib.suppress(BlockingIOError):  # another run is renaming it
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if self._is_current(info):
                old = self._path.with_name(f"{self._path.name}{OLD_SUFFIX}")
                if not may_be_log(old):
                    raise OSError(errno.EEXIST, f"the file is full, and {old} is not a log that could be replaced")
                self._path.replace(old)
            following = self._open()
            os.close(self._fd)
            self._fd, self._is_cut = following, False

    def _is_current(self, info: os.stat_result) -> bool:
        try:
            return os.path.samestat(info, self._path.stat())
        except FileNotFoundError:
            return False


def may_be_log(path: Path) -> bool:
    """Return whether there is no such file, nothing in it, or a log: one of its first lines is an event in JSON.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    try:
        if not path.is_file():
            return not path.is_dir()
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except FileNotFoundError:
        return True
    lines = head.splitlines()[:HEAD_LINES]
    is_cut = b"\n" not in head and head[:2] in {b"", b"{", b'{"'}  # the disk was full at once
    return is_cut or any(_is_event(line) for line in lines)


def _is_event(line: bytes) -> bool:
    try:
        event = orjson.loads(line)
    except orjson.JSONDecodeError:  # cut off by a full disk
        return False
    return isinstance(event, dict) and "event" in event
