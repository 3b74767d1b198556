"""The recordings that pages may name, keep, delete, download and have something made of."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from runtime.console.commands.command_error import CommandError
from runtime.console.files.jobs import Jobs, Kind
from runtime.recording.folder_files import delete_recording, pin_recording, rename_recording
from runtime.recording.storage import find_recording

UNDO_MAX: Final = 50
"""New names and pins that can be taken back."""
NO_UNDO: Final = "there is no new name or pin of a recording to undo"


class RecordingFiles:
    """The recordings of a folder and the one in progress; the disk is waited for in threads.

    `current` returns the file of the recording in progress, None while nothing is recorded; `jobs` makes reports and
    maps.
    """

    def __init__(self, folder: Path, current: Callable[[], str | None], jobs: Jobs) -> None:
        self._folder = folder
        self._current = current
        self._undos: deque[tuple[str, Callable[[], object]]] = deque(maxlen=UNDO_MAX)
        """What each takes back, in words, and how."""
        self.jobs = jobs

    async def find(self, file: str) -> Path:
        """Return the path of a recording as listed.

        Raises
        ------
        CommandError
            There is no such recording.
        """
        path = Path(file) if file == self._current() else await asyncio.to_thread(find_recording, self._folder, file)
        if path is None:
            raise CommandError(f"there is no recording {file!r} in {self._folder}: list the recordings again")
        return path

    async def rename(self, file: str, to: str) -> str:
        """Give a recording another name, and return that. See `runtime.recording.folder_files`.

        Raises
        ------
        UserError
            It was not done.
        """
        self._refuse_live(file)
        name = await asyncio.to_thread(rename_recording, self._folder, file, to)
        if name != file:
            back = partial(rename_recording, self._folder, name, file)
            self._undos.append((f"{name} is {file} again", back))
        return name

    async def pin(self, file: str, *, pinned: bool) -> None:
        """Keep a recording when the folder is full, or no longer.

        Raises
        ------
        UserError
            It was not done.
        """
        was_pinned = await asyncio.to_thread(pin_recording, self._folder, file, pinned=pinned)
        if was_pinned is not pinned:
            back = partial(pin_recording, self._folder, file, pinned=was_pinned)
            self._undos.append((f"{file} is {'pinned' if was_pinned else 'unpinned'} again", back))

    async def undo(self) -> str:
        """Take back the last new name or pin that has not been taken back; return what is as before.

        Raises
        ------
        UserError
            There is none, or the recording is no longer as it left it.
        """
        if not self._undos:
            raise CommandError(NO_UNDO)
        done, back = self._undos.pop()
        await asyncio.to_thread(back)
        return done

    async def delete(self, file: str) -> None:
        """Delete a recording.

        Raises
        ------
        UserError
            It was not done.
        """
        self._refuse_live(file)
        await asyncio.to_thread(delete_recording, self._folder, file)

    async def make(self, kind: Kind, file: str) -> int:
        """Begin to make something of a recording, and return the job's number.

        Raises
        ------
        CommandError
            There is no such recording, or another job is under way.
        """
        return self.jobs.start(kind, file, await self.find(file))

    def _refuse_live(self, file: str) -> None:
        """Refuse the recording in progress also where the file system has no locks.

        Raises
        ------
        CommandError
            It is that one.
        """
        if str(self._folder / file) == self._current():
            raise CommandError(f"{file} is being written: stop recording first")
