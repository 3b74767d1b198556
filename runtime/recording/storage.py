"""Where recordings go: the file that was asked for, or a folder in which the oldest make room for the newest."""

from __future__ import annotations

import contextlib
import os
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple, Protocol

from config.settings import RecordingConfig

SUFFIX: Final = ".mcap"
MEGABYTE: Final = 1_000_000


class RecordingTarget(Protocol):
    """Where the parts of one recording go."""

    def path(self, part: int) -> Path:
        """Return where a part goes, numbered from 1, and make it possible that it goes there."""
        ...

    def enforce_limits(self, current: Path) -> None:
        """Keep what lies there within its bounds; called now and then while `current` grows."""
        ...

    def is_part_full(self, part_bytes: int) -> bool:
        """Say whether a part of that size should be followed by the next one."""
        ...


@dataclass(frozen=True, slots=True)
class SingleFile:
    """A file by name, and beside it the next ones after trouble with the disk: `hall-2.mcap` and so on."""

    first: Path

    def path(self, part: int) -> Path:
        """Return the part's file."""
        return self.first if part == 1 else self.first.with_stem(f"{self.first.stem}-{part}")

    def enforce_limits(self, current: Path) -> None:
        """Leave everything: a file that was asked for is not for us to delete."""

    def is_part_full(self, part_bytes: int) -> bool:  # noqa: ARG002 - what is asked for by name stays one file
        """Say no."""
        return False


@dataclass(frozen=True, slots=True)
class RotatingFolder:
    """A folder of recordings with a cap on their number and on their size together.

    Parameters
    ----------
    folder : Path
        Made where it is missing.
    run : str
        Begins the names of this run's files; names sort by time.
    config : RecordingConfig
        The bounds.
    """

    folder: Path
    run: str
    config: RecordingConfig

    def path(self, part: int) -> Path:
        """Return the part's file, after room was made for it."""
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"{self.run}-{part:03d}{SUFFIX}"
        self._keep(self.config.keep - 1, path)
        return path

    def enforce_limits(self, current: Path) -> None:
        """Delete the oldest recordings until the rest is within bounds; never the one under way."""
        self._keep(self.config.keep, current)

    def is_part_full(self, part_bytes: int) -> bool:
        """Say whether the part has its share of the cap: a quarter, so that the cap can be kept to."""
        return part_bytes > 0.25 * self.config.cap_mb * MEGABYTE

    def _keep(self, number: int, current: Path) -> None:
        known = []
        for path in self.folder.glob(f"*{SUFFIX}"):
            with contextlib.suppress(OSError):  # another run's tidying was faster
                known.append((path.stat().st_mtime_ns, path.stat().st_size, path))
        known.sort()
        total = sum(size for _, size, _ in known)
        left = len(known)
        for _, size, path in known:
            if left <= number and total <= self.config.cap_mb * MEGABYTE:
                return
            if path != current:
                with contextlib.suppress(OSError):
                    path.unlink()
                left -= 1
                total -= size


class RecordingFile(NamedTuple):
    """A recording in the folder."""

    file: str
    """Its name there."""
    bytes: int
    modified_s: float
    """Unix time."""


def list_recordings(folder: Path) -> list[RecordingFile]:
    """Return the recordings in a folder, newest first; none where there is no such folder. Waits for the disk."""
    found = []
    with contextlib.suppress(OSError):
        for path in folder.glob(f"*{SUFFIX}"):
            with contextlib.suppress(OSError):  # it made room for another just now
                known = path.stat()
                if stat.S_ISREG(known.st_mode):
                    found.append(RecordingFile(path.name, known.st_size, known.st_mtime))
    return sorted(found, key=lambda one: (-one.modified_s, one.file))


def find_recording(folder: Path, name: str) -> Path | None:
    """Return the recording of that name in a folder; None where `list_recordings` has none, wherever else the name leads."""
    return next((folder / one.file for one in list_recordings(folder) if one.file == name), None)


def recordings_folder(config: RecordingConfig) -> Path:
    """Return the folder of the settings, else the user's own for what programs leave behind."""
    state = os.environ.get("XDG_STATE_HOME") or "~/.local/state"
    return Path(config.folder or f"{state}/echolocate/runs").expanduser()
