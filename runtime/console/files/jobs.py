"""Long work on recordings for the pages: reports and maps, each made by a child process that says how far it is.

One job at a time, at low priority, so that the robot's own work is not delayed. Every page gets its progress and its
end, and any may cancel it: so one that is reloaded meanwhile finds it again.
"""

from __future__ import annotations

import asyncio
import contextlib
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal, TypeAlias

from runtime.console.commands.command_error import CommandError
from runtime.console.sent_messages import JobMessage
from runtime.support.child_process import ECHOLOCATE, kill_child, start_child
from runtime.support.length_format import Units
from runtime.support.progress import MARK, PROGRESS_LINES
from runtime.support.temp_folder import temp_folder

Kind: TypeAlias = Literal["report", "map"]

KEPT: Final = 8
"""Jobs whose files are kept; those of older ones are deleted."""
JOB_MAX_S: Final = 1800.0
"""A job that takes longer is ended: the command line has no limit."""
SUFFIXES: Final[Mapping[Kind, tuple[str, ...]]] = MappingProxyType(
    {"report": (".html",), "map": (".toml", ".pgm", ".yaml", ".geojson")}
)
"""Of the files that each kind makes."""


@dataclass
class Job:
    """Work under way or done."""

    number: int
    kind: Kind
    file: str
    """The recording, as a page names it."""
    share: float = 0.0
    """How much is done, of 1."""
    what: str = "starting"
    made: list[str] = field(default_factory=list)
    """Names of the files that were made."""
    error: str | None = None
    is_over: bool = False
    task: asyncio.Task[None] | None = None

    def message(self) -> JobMessage:
        """Return what pages get of it."""
        return {
            "type": "job",
            "job": self.number,
            "kind": self.kind,
            "file": self.file,
            "share": round(self.share, 3),
            "what": self.what,
            "made": self.made,
            "error": self.error,
            "over": self.is_over,
        }


class Jobs:
    """The jobs of a run's console, and the files that they made.

    Reports are in `units`; the module `program` does the work.
    """

    def __init__(self, units: Units = "m", program: str = ECHOLOCATE) -> None:
        self._units: Units = units
        self._program = program
        self._jobs: dict[int, Job] = {}
        """By number, the oldest first; those that are over as long as their files are kept."""
        self._number = 0
        """Of the last job."""
        self._folder: Path | None = None
        """Has a folder for the files of each job; None before the first one."""
        self._resources = contextlib.ExitStack()
        """Deletes that folder."""
        self.broadcast: Callable[[JobMessage], None] = lambda _: None
        """Sends a message to every page."""

    def listed(self) -> list[JobMessage]:
        """Return the jobs of which files or progress can be had, the newest first."""
        return [job.message() for job in reversed(self._jobs.values())]

    def start(self, kind: Kind, file: str, path: Path) -> int:
        """Begin a job on a recording, and return its number.

        `file` is the recording as a page names it.

        Raises
        ------
        CommandError
            Another job is under way, or there is no room for files.
        """
        busy = next((job for job in self._jobs.values() if not job.is_over), None)
        if busy is not None:
            raise CommandError(f"a {busy.kind} of {busy.file} is being made: wait for it, or cancel it")
        self._number += 1
        try:
            if self._folder is None:
                self._folder = self._resources.enter_context(temp_folder())
            folder = self._folder / str(self._number)
            folder.mkdir()
        except OSError as error:
            raise CommandError(f"no folder for its files can be made: {error.strerror}; make room") from error
        job = self._jobs[self._number] = Job(self._number, kind, file)
        for old in [number for number in self._jobs if number <= self._number - KEPT]:
            del self._jobs[old]
            shutil.rmtree(self._folder / str(old), ignore_errors=True)
        job.task = asyncio.create_task(self._run(job, path, folder), name=f"console job {job.number}")
        job.task.add_done_callback(partial(self._end, job))
        return job.number

    def cancel(self, number: int) -> None:
        """End a job.

        Raises
        ------
        CommandError
            There is none of this number under way.
        """
        job = self._jobs.get(number)
        if job is None or job.is_over or job.task is None:
            raise CommandError("there is nothing to cancel: it is over")
        job.task.cancel()

    def path_of(self, number: int, name: str) -> Path | None:
        """Return the path of a file that a job made, None if it made none of this name."""
        job = self._jobs.get(number)
        if job is None or self._folder is None or name not in job.made:
            return None
        return self._folder / str(number) / name

    async def close(self) -> None:
        """End what is under way and delete all files."""
        tasks = [job.task for job in self._jobs.values() if job.task is not None]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        self._resources.close()

    async def _run(self, job: Job, path: Path, folder: Path) -> None:
        """Do a job's work in a child process."""
        targets = [folder / f"{path.stem}{suffix}" for suffix in SUFFIXES[job.kind]]
        options = ("--out",) if job.kind == "report" else ("--out", "--grid", "", "--geojson")
        words = [
            word for option, target in zip(options, targets, strict=True) if option for word in (option, str(target))
        ]
        more = ["--units", self._units] if job.kind == "report" else []
        process: asyncio.subprocess.Process | None = None
        try:
            process = await start_child(
                self._program,
                [job.kind, str(path), *words, *more],
                pipes=False,
                low_priority=True,
                environment={PROGRESS_LINES: "1"},
            )
            async with asyncio.timeout(JOB_MAX_S):
                last = await self._follow(job, process)
                await process.wait()
            if process.returncode:
                job.error = last.removeprefix("echolocate: ") or "its process ended"
            else:
                job.share = 1.0
                job.made = [target.name for target in targets if target.exists()]
        except TimeoutError:
            job.error = f"it was not done within {JOB_MAX_S / 60.0:.0f} min: use `echolocate {job.kind}`"
        except OSError as error:
            job.error = f"its process cannot be started: {error.strerror}"
        except ValueError as error:  # a line that is too long
            job.error = f"its process said what cannot be read: {error}"
        finally:
            if process is not None:
                await kill_child(process)

    def _end(self, job: Job, task: asyncio.Task[None]) -> None:
        """Write the end of a job, however it came, to it and send it to pages; also if its work never began."""
        if task.cancelled():
            if not job.made:  # else it was done in that moment
                job.error = job.error or "cancelled"
        elif (error := task.exception()) is not None:
            job.error = f"{type(error).__name__}: {error}, which is a bug in this program: report it"
        job.is_over, job.what = True, "done" if job.error is None else "failed"
        self.broadcast(job.message())

    async def _follow(self, job: Job, process: asyncio.subprocess.Process) -> str:
        """Pass on how far the process is; return its last other line."""
        last = ""
        if process.stderr is not None:
            async for line in process.stderr:
                text = line.decode(errors="replace").strip()
                if text.startswith(MARK):
                    share, _, job.what = text.removeprefix(MARK).partition(" ")
                    with contextlib.suppress(ValueError):
                        job.share = float(share)
                    self.broadcast(job.message())
                elif text:
                    last = text
        return last
