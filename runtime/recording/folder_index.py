"""The index of a folder of recordings: which files runs have written into it, in the order of their writing.

Only what it lists is ever removed to make room. Neither names nor times of files tell that: the user may keep other
MCAP files in the folder, and a clock may have been set back. The index is only appended to, in one write for each
line, so any number of runs share it without a lock.
"""

from __future__ import annotations

import errno
import fcntl
import os
import stat
import struct
from pathlib import Path
from typing import Final

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from runtime.recording.mcap_file import PROFILE

INDEX: Final = ".echolocate-recordings"
"""Name of the index in the folder: a file name a line."""
INDEX_MAX: Final = 1 << 22
"""Bytes read from its end: about a hundred thousand names. Earlier files are never removed."""

_HEAD: Final = struct.Struct("<8sBQI")
"""Beginning of an MCAP file: magic, opcode and length of its header, length of the profile."""


def create_listed(path: Path) -> None:
    """Create an empty file in an existing folder, and list it in the folder's index.

    Raises
    ------
    FileExistsError
        There is a file of this name, which stays as it is.
    OSError
        File or index cannot be written; the file does not exist then.
    """
    path.touch(exist_ok=False)
    try:
        _append(path.with_name(INDEX), path.name)
    except BaseException:
        path.unlink(missing_ok=True)
        raise


def listed_names(folder: Path) -> list[str]:
    """Return the names that the index of a folder lists, the oldest first; no such file need exist.

    Raises
    ------
    OSError
        There is an index, but it cannot be read.
    """
    try:
        fd = os.open(folder / INDEX, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    except FileNotFoundError:
        return []
    with os.fdopen(fd, "rb") as file:
        file.seek(max(0, os.fstat(fd).st_size - INDEX_MAX))
        lines = (os.fsdecode(line.rstrip(b"\n")) for line in file)
        return list(dict.fromkeys(name for name in lines if name))


def is_finished_recording(path: Path) -> bool:
    """Return whether a file begins as our recordings do, or is still empty, and no run is writing it."""
    try:
        fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        fcntl.flock(fd, fcntl.LOCK_SH | fcntl.LOCK_NB)
        info = os.fstat(fd)
        return stat.S_ISREG(info.st_mode) and (info.st_size == 0 or _is_ours(os.pread(fd, 64, 0)))
    except OSError:  # locked by the run that writes it, or the file system has no locks
        return False
    finally:
        os.close(fd)


def _is_ours(head: bytes) -> bool:
    """Return whether a file that begins with these bytes is a recording of this program."""
    if len(head) < _HEAD.size:
        return False
    magic, opcode, _, _ = _HEAD.unpack_from(head)
    return magic == MCAP0_MAGIC and opcode == Opcode.HEADER and head[_HEAD.size :].startswith(f"{PROFILE}/".encode())


def _append(index: Path, name: str) -> None:
    """Append a name to the index; a newline before it ends a line that a full disk cut off.

    Raises
    ------
    OSError
        It cannot be written.
    """
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    fd = os.open(index, flags, 0o666)
    try:
        line = b"\n" + os.fsencode(name) + b"\n"
        if os.write(fd, line) != len(line):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(index))
    finally:
        os.close(fd)
