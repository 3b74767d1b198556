"""The storage of recordings: a file named by the user, or a folder from which the oldest are deleted."""

from __future__ import annotations

import contextlib
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple, Protocol

import platformdirs

from config.settings import RecordingConfig

SUFFIX: Final = ".mcap"
MEGABYTE: Final = 1_000_000
PART_SHARE: Final = 0.25
"""Share of the folder's size limit that one file may take: the folder can then be kept within its limit."""


class RecordingTarget(Protocol):
    """Where the files of one recording are written."""

    def path(self, part: int) -> Path:
        """Return the path of a file, numbered from 1; its folder exists and has room afterwards."""
        ...

    def enforce_limits(self, current: Path) -> None:
        """Keep the storage within its limits; called regularly while the file `current` grows."""
        ...

    def is_part_full(self, part_bytes: int) -> bool:
        """Return whether a file of this size should be closed and followed by the next one."""
        ...


@dataclass(frozen=True, slots=True)
class SingleFile:
    """A file named by the user. After a disk error, recording continues in `NAME-2.mcap` and so on next to it."""

    first: Path

    def path(self, part: int) -> Path:
        """Return the path of a file, numbered from 1."""
        return self.first if part == 1 else self.first.with_stem(f"{self.first.stem}-{part}")

    def enforce_limits(self, current: Path) -> None:
        """Do nothing: files that the user named are never deleted."""

    def is_part_full(self, part_bytes: int) -> bool:  # noqa: ARG002 - a file named by the user is not split
        """Return False."""
        return False


@dataclass(frozen=True, slots=True)
class RotatingFolder:
    """A folder of recordings with limits on their number and on their total size.

    Parameters
    ----------
    folder : Path
        Created if it is missing.
    run : str
        Prefix of this run's file names; names sort by time.
    config : RecordingConfig
        The limits.
    """

    folder: Path
    run: str
    config: RecordingConfig

    def path(self, part: int) -> Path:
        """Return the path of a file, numbered from 1, after deleting old recordings to make room for it."""
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"{self.run}-{part:03d}{SUFFIX}"
        self._delete_oldest(self.config.keep - 1, path)
        return path

    def enforce_limits(self, current: Path) -> None:
        """Delete the oldest recordings, but never `current`, until the folder is within its limits."""
        self._delete_oldest(self.config.keep, current)

    def is_part_full(self, part_bytes: int) -> bool:
        """Return whether a file of this size has reached its share of the limit."""
        return part_bytes > PART_SHARE * self.config.cap_mb * MEGABYTE

    def _delete_oldest(self, number: int, current: Path) -> None:
        files = []
        for path in self.folder.glob(f"*{SUFFIX}"):
            with contextlib.suppress(OSError):  # another run has just deleted it
                files.append((path.stat().st_mtime_ns, path.stat().st_size, path))
        files.sort()
        total = sum(size for _, size, _ in files)
        count = len(files)
        for _, size, path in files:
            if count <= number and total <= self.config.cap_mb * MEGABYTE:
                return
            if path != current:
                with contextlib.suppress(OSError):
                    path.unlink()
                count -= 1
                total -= size


class RecordingFile(NamedTuple):
    """A recording in a folder."""

    file: str
    """Its name in the folder."""
    bytes: int
    modified_s: float
    """Unix time."""


def list_recordings(folder: Path) -> list[RecordingFile]:
    """Return the recordings in a folder, newest first; empty if the folder does not exist. Blocks on the disk."""
    found = []
    with contextlib.suppress(OSError):
        for path in folder.glob(f"*{SUFFIX}"):
            with contextlib.suppress(OSError):  # just deleted to make room
                info = path.stat()
                if stat.S_ISREG(info.st_mode):
                    found.append(RecordingFile(path.name, info.st_size, info.st_mtime))
    return sorted(found, key=lambda file: (-file.modified_s, file.file))


def find_recording(folder: Path, name: str) -> Path | None:
    """Return the path of a recording by its name in a folder; None if `list_recordings` has no such name.

    A name that leads out of the folder is therefore never found.
    """
    return next((folder / file.file for file in list_recordings(folder) if file.file == name), None)


def recordings_folder(config: RecordingConfig) -> Path:
    """Return the folder of the settings, or else `echolocate/runs` in the user's state folder."""
    default = platformdirs.user_state_path("echolocate") / "runs"
    return Path(config.folder).expanduser() if config.folder else default
