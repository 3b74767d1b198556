"""The clients of replay workers: each page may watch one recording while the robot drives on.

The robot's process only forwards what a child process (`replay_worker`) has encoded. Nothing here runs the step,
reads a recording or waits for a disk in the loop.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final, cast

import orjson

from runtime.console.commands.command_error import CommandError
from runtime.console.frames.frame_encoder import EncodedFrame
from runtime.console.playback.replay_worker import ANSWER, HEADER, PROGRESS, SPEED_MAX, SPEED_MIN, problem
from runtime.console.protocols import Viewer
from runtime.console.sent_messages import ListedRecording, OpenedRecording, RecordingDescription
from runtime.recording.folder_files import describe_recordings
from runtime.recording.storage import find_recording
from runtime.support.child_process import kill_child, start_child

WORKERS_MAX: Final = 3
"""Recordings open at a time: each worker holds the whole of perception in memory."""
OPEN_MAX_S: Final = 30.0
"""Longest time without progress while a recording is indexed."""
ERRORS_KEPT_BYTES: Final = 4096
"""Most of a worker's standard error that is kept: it ends with the reason why the worker ended."""
STEP_MAX: Final = 100_000
"""Cycles of one step: more than an hour of a run."""


class ReplayError(CommandError):
    """A recording cannot be listed, opened or played."""


class ReplayProcess:
    """A worker process and the recording it has open.

    The process runs `runtime.console.playback.replay_worker`. `on_frame` gets each frame, `on_answer` each answer:
    progress of opening, and what follows it; `begin` returns the description.
    """

    def __init__(
        self,
        process: asyncio.subprocess.Process,
        on_frame: Callable[[EncodedFrame], None],
        on_answer: Callable[[Mapping[str, Any]], None],
    ) -> None:
        self._process = process
        self._on_frame = on_frame
        self._on_answer = on_answer
        self._reader: asyncio.Task[None] | None = None
        """Passes on frames and answers; None before the recording is open."""
        self._errors: asyncio.Task[bytes] | None = None
        """Reads the process's standard error; None before `begin`."""

    async def begin(self) -> RecordingDescription:
        """Wait until the recording is open and return its description; call it once.

        Progress of opening goes to `on_answer`, and so do all later answers.

        Raises
        ------
        ReplayError
            It cannot be opened; the process has ended then.
        """
        self._errors = asyncio.create_task(self._read_errors(), name="replay errors")
        try:
            async with asyncio.timeout(OPEN_MAX_S) as limit:
                answer = await self._next_answer()
                while answer.get("type") == PROGRESS:
                    limit.reschedule(asyncio.get_running_loop().time() + OPEN_MAX_S)
                    self._on_answer(answer)
                    answer = await self._next_answer()
        except TimeoutError:
            await self.close()
            raise ReplayError(
                f"opening made no progress for {OPEN_MAX_S:.0f} s, likely because the machine is busy: try again"
            ) from None
        except (asyncio.IncompleteReadError, OSError):
            output = await self._errors
            await self.close()
            raise ReplayError(f"cannot replay the recording: {_last_line(output) or 'its process ended'}") from None
        if "error" in answer:
            await self.close()
            raise ReplayError(str(answer["error"]))
        self._reader = asyncio.create_task(self._read_all(), name="replay reader")
        return cast("RecordingDescription", answer)

    async def _next_answer(self) -> dict[str, Any]:
        """Return the next message, which must be an answer: before the description there are no frames."""
        _, _, (body, _, _) = await self._read()
        found: dict[str, Any] = orjson.loads(body)
        return found

    @property
    def is_over(self) -> bool:
        """Whether the process has ended."""
        return self._process.returncode is not None

    def command(self, command: dict[str, Any]) -> None:
        """Send the worker a command; frames follow.

        Raises
        ------
        ReplayError
            The process has ended.
        """
        if self._process.stdin is None or self.is_over or self._process.stdin.is_closing():
            raise ReplayError("the process that replays the recording has ended: open the recording again")
        self._process.stdin.write(orjson.dumps(command) + b"\n")

    async def close(self) -> None:
        """End the process. It is killed at once, also where the caller is cancelled meanwhile."""
        tasks = [task for task in (self._reader, self._errors) if task is not None]
        for task in tasks:
            task.cancel()
        await kill_child(self._process)
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _read_errors(self) -> bytes:
        """Read the process's standard error until it ends, as a full pipe would hold it up; return the last of it."""
        last = b""
        while self._process.stderr is not None and (output := await self._process.stderr.read(ERRORS_KEPT_BYTES)):
            last = (last + output)[-ERRORS_KEPT_BYTES:]
        return last

    async def _read_all(self) -> None:
        """Pass on frames and answers until the process ends, then say so; after `close` nothing is said."""
        with contextlib.suppress(asyncio.IncompleteReadError, OSError):
            while True:
                kind, (source, number), (head, changes, whole) = await self._read()
                if kind == ANSWER:
                    self._on_answer(orjson.loads(head))
                else:
                    self._on_frame(EncodedFrame((self, source), number, head, changes, partial(bytes, whole)))
        self._on_answer(problem("the process that replays the recording has ended: open the recording again"))

    async def _read(self) -> tuple[bytes, tuple[int, int], tuple[bytes, bytes, bytes]]:
        """Return the next message: its kind, a frame's source and number, and its parts.

        Raises
        ------
        asyncio.IncompleteReadError, OSError
            The process has ended, or has no pipes.
        """
        out = self._process.stdout
        if out is None:
            raise OSError("the process was started without pipes")
        kind, source, number, *sizes = HEADER.unpack(await out.readexactly(HEADER.size))
        head, changes, whole = [await out.readexactly(size) for size in sizes]
        return kind, (source, number), (head, changes, whole)


class ReplayClient:
    """The recordings that clients watch.

    `program` is the module of the worker process, which calls `replay_worker.run_worker`. `current` returns the file
    of the recording in progress, None while nothing is recorded.
    """

    def __init__(self, folder: Path, program: str, current: Callable[[], str | None]) -> None:
        self._folder = folder
        self._program = program
        self._current = current
        self._open: dict[int, ReplayProcess] = {}
        """By the `id` of the client that watches it."""
        self._workers = 0
        """Processes that run, from before their start until after their end."""
        self._closing: set[asyncio.Task[None]] = set()
        """Tasks that end the workers of clients which are gone."""

    async def recordings(self) -> list[ListedRecording]:
        """Return the recordings that can be opened, newest first; `live` marks the one in progress."""
        found = await asyncio.to_thread(describe_recordings, self._folder)
        current = self._current()
        rows: list[ListedRecording] = [
            {
                "file": one.file,
                "bytes": one.bytes,
                "modified_s": one.modified_s,
                "duration_s": one.duration_s,
                "state": one.state,
                "pinned": one.pinned,
                "live": str(self._folder / one.file) == current,
            }
            for one in found
        ]
        if current is not None and not any(row["live"] for row in rows):
            rows.insert(
                0,
                {
                    "file": current,
                    "bytes": None,
                    "modified_s": None,
                    "duration_s": None,
                    "state": "live",
                    "pinned": False,
                    "live": True,
                },
            )
        return rows

    async def open(self, viewer: Viewer, file: str) -> OpenedRecording:
        """Show a client a recording of the folder, or the one in progress; return its description.

        The file is as listed by `recordings`.

        Raises
        ------
        ReplayError
            There is no such recording, it cannot be replayed, or too many are open.
        """
        current = self._current()
        path = Path(file) if file == current else await asyncio.to_thread(find_recording, self._folder, file)
        if path is None:
            raise ReplayError(f"there is no recording {file!r} in {self._folder}: list the recordings again")
        await self._close(viewer)
        if self._workers >= WORKERS_MAX:
            raise ReplayError(f"{WORKERS_MAX} recordings are open already, in other pages: close one of them first")
        self._workers += 1
        try:
            process = await start_child(self._program, [str(path)], pipes=True, low_priority=True)
        except BaseException as error:
            self._workers -= 1
            if isinstance(error, OSError):
                raise ReplayError(f"no process can be started to replay it: {error.strerror}; try again") from error
            raise
        replay = ReplayProcess(process, partial(_forward, viewer), viewer.send)
        try:
            description = await replay.begin()
            await self._close(viewer)  # the page may have opened another one meanwhile
        except BaseException:  # a cancellation too: the page may be closed while the recording opens
            await self._end(replay)
            raise
        if viewer.is_gone:
            await self._end(replay)
            raise ReplayError("the page is gone")
        self._open[id(viewer)] = replay
        viewer.switch(live=False)
        return {"file": file, **description}

    async def seek(self, viewer: Viewer, s: float) -> None:
        """Go to a time in the recording, s after its first cycle.

        Raises
        ------
        ReplayError
            No recording is open, or the time is not finite.
        """
        if not math.isfinite(s):
            raise ReplayError("the time must be a finite number")
        self._replay_of(viewer).command({"do": "seek", "s": s})

    async def play(self, viewer: Viewer, speed: float) -> None:
        """Play the recording `speed` times as fast as it was made; 0 pauses it.

        Raises
        ------
        ReplayError
            No recording is open, or the speed is out of range.
        """
        if speed != 0.0 and not SPEED_MIN <= speed <= SPEED_MAX:
            raise ReplayError(f"the speed must be 0, or from {SPEED_MIN:g} to {SPEED_MAX:g}")
        self._replay_of(viewer).command({"do": "play", "speed": speed})

    async def step(self, viewer: Viewer, cycles: int) -> None:
        """Go forward by this many cycles; backward where negative.

        Raises
        ------
        ReplayError
            No recording is open, or the step is too long.
        """
        if abs(cycles) > STEP_MAX:
            raise ReplayError(f"a step may have at most {STEP_MAX} cycles")
        self._replay_of(viewer).command({"do": "step", "cycles": cycles})

    def show_grid(self, viewer: Viewer) -> None:
        """Have the worker send the evidence grid at the moment of the recording.

        Raises
        ------
        ReplayError
            No recording is open.
        """
        self._replay_of(viewer).command({"do": "grid"})

    async def close_recording(self, viewer: Viewer) -> None:
        """Show the client the run itself again."""
        await self._close(viewer)
        viewer.switch(live=True)

    def leave(self, viewer: Viewer) -> None:
        """End the worker of a disconnected client."""
        task = asyncio.get_running_loop().create_task(self._close(viewer), name="replay close")
        self._closing.add(task)
        task.add_done_callback(self._closing.discard)

    async def close(self) -> None:
        """End every worker."""
        replays, self._open = list(self._open.values()), {}
        await asyncio.gather(*(self._end(replay) for replay in replays), *self._closing, return_exceptions=True)

    def _replay_of(self, viewer: Viewer) -> ReplayProcess:
        """Return the worker of a client.

        Raises
        ------
        ReplayError
            It has none open.
        """
        replay = self._open.get(id(viewer))
        if replay is None:
            raise ReplayError("no recording is open: open one first")
        return replay

    async def _close(self, viewer: Viewer) -> None:
        while (replay := self._open.pop(id(viewer), None)) is not None:
            await self._end(replay)

    async def _end(self, replay: ReplayProcess) -> None:
        """End a worker and count it as ended, also where the caller is cancelled meanwhile."""
        try:
            await replay.close()
        finally:
            self._workers -= 1


def _forward(viewer: Viewer, frame: EncodedFrame) -> None:
    if not viewer.is_gone:
        viewer.show(frame)


def _last_line(output: bytes) -> str:
    return output.decode(errors="replace").strip().rpartition("\n")[2]
