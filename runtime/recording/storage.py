"""The storage of recordings: a file named by the user, or a folder from which the oldest are deleted.

What one run can displace is bounded, so no sequence of commands or restarts empties the folder. Files that no run has
written into the folder are left alone.
"""

from __future__ import annotations

import contextlib
import glob
import heapq
import os
import stat
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple, Protocol

from config.files import is_utf8
from config.settings import RecordingConfig
from runtime.recording.channels import BOOKMARK, BOOKMARK_WITHDRAWN
from runtime.recording.folder_index import create_listed, is_finished_recording, listed_names
from runtime.support.file_lock import is_locked
from runtime.support.user_folders import expanded, state_folder

SUFFIX: Final = ".mcap"
MEGABYTE: Final = 1_000_000
PIN_SUFFIX: Final = ".keep"
"""An empty file with this after a recording's name pins it."""
PART_DIGITS: Final = 3
LISTED_MAX: Final = 500
"""Recordings that are listed: more than a person looks through."""
WARN_SHARE: Final = 0.9
"""Share of a limit at which a person is warned of what goes next."""
PART_SHARE: Final = 0.25
"""Share of the folder's size limit that one file may take: the folder can then be kept within its limit."""


class RecordingTarget(Protocol):
    """Where the files of one recording are written."""

    @property
    def place(self) -> Path:
        """The file or the folder, for messages."""
        ...

    def begin_part(self, part: int) -> Path:
        """Return the path of the next file, numbered from 1, and see to it that it can be written there."""
        ...

    def enforce_limits(self, current: Path) -> str | None:
        """Keep the storage within its limits; return what a person should know about it.

        Called when the file `current` is opened, regularly while it grows, and once it is closed.
        """
        ...

    def pin(self, current: Path) -> bool:
        """Keep a file: it has a bookmark. Return whether it was not kept before."""
        ...

    def unpin(self, current: Path) -> None:
        """Keep a file no longer: its bookmarks are withdrawn."""
        ...

    def remove_empty(self, current: Path) -> bool:
        """Remove a closed file in which nothing happened; return whether it was removed."""
        ...

    def is_part_full(self, part_bytes: int) -> bool:
        """Return whether a file of this size should be closed and followed by the next one."""
        ...


@dataclass(frozen=True, slots=True)
class SingleFile:
    """A file named by the user. After a disk error, recording continues in `NAME-2.mcap` and so on next to it."""

    first: Path

    @property
    def place(self) -> Path:
        """The file."""
        return self.first

    def begin_part(self, part: int) -> Path:
        """Return the path of a file, numbered from 1: the first as the user named it, a later one is created.

        Raises
        ------
        OSError
            A later file cannot be created.
        """
        if part == 1:
            return self.first
        while True:
            path = self.first.with_stem(f"{self.first.stem}-{part}")
            try:
                path.touch(exist_ok=False)
            except FileExistsError:
                part += 1
            else:
                return path

    def enforce_limits(self, current: Path) -> None:
        """Do nothing: files that the user named are never deleted."""

    def pin(self, current: Path) -> bool:  # noqa: ARG002 - the user named it
        """Return False: files that the user named are never deleted."""
        return False

    def unpin(self, current: Path) -> None:
        """Do nothing, for the same reason."""

    def remove_empty(self, current: Path) -> bool:  # noqa: ARG002 - the user named it
        """Return False."""
        return False

    def is_part_full(self, part_bytes: int) -> bool:  # noqa: ARG002 - a file named by the user is not split
        """Return False."""
        return False


class StoredFile(NamedTuple):
    """A file of the folder that counts towards its limits."""

    bytes: int
    path: Path


@dataclass(slots=True)
class RotatingFolder:
    """A folder of recordings with limits on the number of runs in it and on its total size.

    The oldest files go first, one at each check, and only after an earlier check of this run has named them. A run
    removes at most as many bytes of older runs as it has written itself; a file too large for that stays, and the
    oldest that fits goes. Pinned files, beside which an empty `NAME.mcap.keep` lies, stay and do not count. A file
    with a bookmark is pinned. Files that the folder's index does not list stay and do not count either. Nor do the
    files of another run go while it is writing one of them.

    Parameters
    ----------
    folder : Path
        Created if it is missing.
    run : str
        Prefix of this run's file names; names sort by time. Another is taken where files have it already.
    config : RecordingConfig
        The limits.
    """

    folder: Path
    run: str
    config: RecordingConfig
    _own: set[Path] = field(default_factory=set)
    """The files of this run."""
    _removed_bytes: int = 0
    """Of older runs."""
    _own_removed_bytes: int = 0
    _announced: Path | None = None
    """The file that the last check has named."""

    @property
    def place(self) -> Path:
        """The folder."""
        return self.folder

    def begin_part(self, part: int) -> Path:
        """Create a file, numbered from 1, and return its path; it counts as one of this run.

        Where another run has files of this name, `run` changes.

        Raises
        ------
        OSError
            It cannot be created.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        run, number = self.run, 1
        while True:
            path = self.folder / f"{run}-{part:0{PART_DIGITS}d}{SUFFIX}"
            try:
                create_listed(path)
                break
            except FileExistsError:  # of another machine, container or time
                number += 1
                run = f"{self.run}.{number}"
        self.run = run
        self._own.add(path)
        return path

    def enforce_limits(self, current: Path) -> str | None:
        """Remove the file that the last check named if the folder exceeds a limit, but never `current`.

        Returns
        -------
        str or None
            What goes next and how to keep it, once the folder comes within a tenth of a limit.
        """
        files = self._counted_files()
        if self._fill(files) > 1.0 and self._announced is not None:
            due = self._next(files, current)
            if due is not None and due.path == self._announced and self._remove(due):
                files.remove(due)
        fill = self._fill(files)
        due = self._next(files, current) if fill > WARN_SHARE else None
        self._announced = None if due is None else due.path
        if due is None:
            return None
        return (
            f"the folder of recordings is nearly full; {due.path.name} goes next: to keep it, move it, create "
            f"{due.path.name}{PIN_SUFFIX} beside it, or raise recording.cap_mb and recording.keep"
        )

    def pin(self, current: Path) -> bool:
        """Create the file that pins a recording; return whether it was not there."""
        was_pinned = is_pinned(current)
        pin_of(current).touch()
        return not was_pinned

    def unpin(self, current: Path) -> None:
        """Remove the file that pins a recording."""
        pin_of(current).unlink(missing_ok=True)

    def remove_empty(self, current: Path) -> bool:
        """Remove a closed file in which nothing happened, unless it is pinned; return whether it was removed."""
        if is_pinned(current):
            return False
        current.unlink()
        return True

    def is_part_full(self, part_bytes: int) -> bool:
        """Return whether a file of this size has reached its share of the limit."""
        return part_bytes > PART_SHARE * self.config.cap_mb * MEGABYTE

    def _counted_files(self) -> list[StoredFile]:
        """Return the files that are listed and not pinned, oldest first."""
        files = []
        present = {path.name for path in self.folder.iterdir()}
        for name in listed_names(self.folder):
            if name in present and f"{name}{PIN_SUFFIX}" not in present:
                path = self.folder / name
                with contextlib.suppress(OSError):  # just removed by another run
                    info = path.lstat()
                    if stat.S_ISREG(info.st_mode):
                        files.append(StoredFile(info.st_size, path))
        return files

    def _fill(self, files: Sequence[StoredFile]) -> float:
        """Return the share of a limit that the folder has reached, by size or by number of runs."""
        runs = len({_run_of(file.path) for file in files})
        return max(sum(file.bytes for file in files) / (self.config.cap_mb * MEGABYTE), runs / self.config.keep)

    def _next(self, files: Sequence[StoredFile], current: Path) -> StoredFile | None:
        """Return the file that goes next, None if this run may remove none."""
        own = [file for file in files if file.path in self._own]
        written = self._own_removed_bytes + sum(file.bytes for file in own)
        for file in files:
            if file.path in self._own or self._removed_bytes + file.bytes > written:
                continue
            if is_finished_recording(file.path) and not self._is_live(file) and not has_bookmark(file.path):
                return file
        too_large = sum(file.bytes for file in files) > self.config.cap_mb * MEGABYTE
        finished = [file for file in own if file.path != current]
        return finished[0] if too_large and finished else None

    def _is_live(self, file: StoredFile) -> bool:
        """Return whether another run is still writing a later part of the same recording."""
        parts = self.folder.glob(f"{glob.escape(_run_of(file.path))}-*{SUFFIX}")
        return any(is_locked(path) for path in parts)

    def _remove(self, file: StoredFile) -> bool:
        """Remove a file and return whether that was possible."""
        try:
            file.path.unlink()
        except OSError:
            return False
        if file.path in self._own:
            self._own_removed_bytes += file.bytes
        else:
            self._removed_bytes += file.bytes
        return True


def pin_of(path: Path) -> Path:
    """Return the path of the empty file that pins a recording."""
    return path.with_name(f"{path.name}{PIN_SUFFIX}")


def is_pinned(path: Path) -> bool:
    """Return whether a recording is pinned."""
    try:
        return pin_of(path).exists()
    except OSError:  # the name leaves no room for a suffix
        return False


def has_bookmark(path: Path) -> bool:
    """Return whether a recording has bookmarks by its index: those of older versions have no pin. Pins it if so."""
    from mcap.exceptions import McapError
    from mcap.reader import SeekingReader

    try:
        with path.open("rb") as file:
            summary = SeekingReader(file).get_summary()
    except (OSError, McapError, ValueError, struct.error):  # not closed properly, or no recording
        return False
    if summary is None or summary.statistics is None:
        return False
    counts = summary.statistics.channel_message_counts
    of = {channel.topic: counts.get(number, 0) for number, channel in summary.channels.items()}
    found = of.get(BOOKMARK, 0) > of.get(BOOKMARK_WITHDRAWN, 0)
    if found:
        with contextlib.suppress(OSError):
            pin_of(path).touch()
    return found


def _run_of(path: Path) -> str:
    """Return the run that a file belongs to: its name without the number of the part."""
    run, _, part = path.stem.rpartition("-")
    return run if run and part.isdigit() and len(part) >= PART_DIGITS else path.stem


class RecordingFile(NamedTuple):
    """A recording in a folder."""

    file: str
    """Its name in the folder."""
    bytes: int
    modified_s: float
    """Unix time."""


def list_recordings(folder: Path) -> list[RecordingFile]:
    """Return the newest recordings in a folder, newest first; empty if the folder does not exist. Blocks on the disk.

    In a thread it leaves the interpreter to the loop, however many files there are: no single call takes long.
    """
    return heapq.nsmallest(LISTED_MAX, _recordings(folder), key=lambda file: (-file.modified_s, file.file))


def _recordings(folder: Path) -> Iterator[RecordingFile]:
    """Yield the recordings in a folder; a folder or file that cannot be read yields nothing."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith(SUFFIX) and is_utf8(entry.name):  # the console has no other text
                with contextlib.suppress(OSError):  # just deleted to make room
                    info = entry.stat()
                    if stat.S_ISREG(info.st_mode):
                        yield RecordingFile(entry.name, info.st_size, info.st_mtime)


def find_recording(folder: Path, name: str) -> Path | None:
    """Return the path of a recording by its name in a folder; None if there is none of this name.

    A name that leads out of the folder is therefore never found.
    """
    path = folder / name
    try:
        is_file = path.is_file()
    except (OSError, ValueError):  # a name that no file can have: too long, or with a NUL
        return None
    return path if is_file and path.name == name and name.endswith(SUFFIX) and is_utf8(name) else None


def recordings_folder(config: RecordingConfig) -> Path:
    """Return the folder of the settings, or else `echolocate/runs` in the user's state folder.

    Raises
    ------
    UserError
        The settings name the home folder of a user that has none, or see `runtime.support.user_folders`.
    """
    return expanded(config.folder, "recording.folder") if config.folder else state_folder() / "runs"
