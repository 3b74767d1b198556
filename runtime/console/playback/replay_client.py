"""Recordings on the page: each client may look at one of its own while the robot drives on.

The robot's process only forwards what a child process (`replay_worker`) has put together. Nothing
here runs the step, reads a recording or waits for a disk in the loop.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

import orjson

from runtime.console.commands.command_error import CommandError
from runtime.console.frames.frame_encoder import EncodedFrame
from runtime.console.playback.replay_worker import ANSWER, HEADER, SPEED_MAX, SPEED_MIN
from runtime.console.protocols import Viewer
from runtime.recording.storage import find_recording, list_recordings
from runtime.support.child_process import ECHOLOCATE, kill_child, start_child
from runtime.support.length_format import Units

WORKERS_MAX: Final = 3
"""Recordings open at a time: each is a process with the whole of perception in its memory."""
OPEN_MAX_S: Final = 30.0
REPORT_MAX_S: Final = 300.0
STEP_MAX: Final = 100_000


class ReplayError(CommandError):
    """Something about recordings that cannot be done; its text is one line for the operator."""


class ReplayProcess:
    """A recording that is open, and the process that plays it.

    Parameters
    ----------
    process : asyncio.subprocess.Process
        Of `runtime.console.playback.replay_worker`.
    show : callable
        Gets each frame.
    tell : callable
        Gets each answer but the first.
    """

    def __init__(
        self,
        process: asyncio.subprocess.Process,
        show: Callable[[EncodedFrame], None],
        tell: Callable[[dict[str, Any]], None],
    ) -> None:
        self._process = process
        self._show = show
        self._tell = tell
        self._listener: asyncio.Task[None] | None = None

    async def begin(self) -> dict[str, Any]:
        """Wait until it is open and return what there is to know of it.

        Raises
        ------
        ReplayError
            It cannot be opened; the process is ended then.
        """
        try:
            async with asyncio.timeout(OPEN_MAX_S):
                _, _, (body, _, _) = await self._read()
        except TimeoutError:
            await self.close()
            raise ReplayError(f"the recording did not open within {OPEN_MAX_S:.0f} s: the machine is busy") from None
        except (asyncio.IncompleteReadError, OSError):
            words = b"" if self._process.stderr is None else await self._process.stderr.read()
            await self.close()
            last = words.decode(errors="replace").strip().rpartition("\n")[2]
            raise ReplayError(f"the recording cannot be played: {last or 'its player has ended'}") from None
        about: dict[str, Any] = orjson.loads(body)
        if "error" in about:
            await self.close()
            raise ReplayError(str(about["error"]))
        self._listener = asyncio.create_task(self._listen(), name="player")
        return about

    @property
    def is_over(self) -> bool:
        """Whether its process has ended."""
        return self._process.returncode is not None

    def do(self, command: dict[str, Any]) -> None:
        """Have something done; frames follow.

        Raises
        ------
        ReplayError
            The process has ended.
        """
        if self._process.stdin is None or self.is_over or self._process.stdin.is_closing():
            raise ReplayError("the recording's player has ended: open the recording again")
        self._process.stdin.write(orjson.dumps(command) + b"\n")

    async def close(self) -> None:
        """End its process."""
        if self._listener is not None:
            self._listener.cancel()
            await asyncio.gather(self._listener, return_exceptions=True)
        await kill_child(self._process)

    async def _listen(self) -> None:
        with contextlib.suppress(asyncio.IncompleteReadError, OSError):
            while True:
                kind, (source, number), parts = await self._read()
                if kind == ANSWER:
                    self._tell(orjson.loads(parts[0]))
                else:
                    head, changes, whole = parts
                    self._show(EncodedFrame((self, source), number, head, changes, partial(bytes, whole)))

    async def _read(self) -> tuple[bytes, tuple[int, int], tuple[bytes, bytes, bytes]]:
        out = self._process.stdout
        if out is None:
            raise OSError("it was started without pipes")
        kind, source, number, *sizes = HEADER.unpack(await out.readexactly(HEADER.size))
        head, changes, whole = [await out.readexactly(size) for size in sizes]
        return kind, (source, number), (head, changes, whole)


class ReplayClient:
    """The recordings that clients look at, and the page of the run so far.

    Parameters
    ----------
    folder : Path
        Where recordings are.
    program : str
        The module that plays one: `runtime.console.playback.replay_worker.play` with a maker of frames.
    current : callable
        Returns the file of the recording under way, None where there is none.
    units : {"m", "ft"}
        Of the report.
    """

    def __init__(self, folder: Path, program: str, current: Callable[[], str | None], units: Units = "m") -> None:
        self._folder = folder
        self._program = program
        self._current = current
        self._units: Units = units
        self._open: dict[int, ReplayProcess] = {}
        self._opening = 0
        self._ending: set[asyncio.Task[None]] = set()
        self._reporting = asyncio.Lock()

    async def recordings(self) -> list[dict[str, Any]]:
        """Return which recordings there are, newest first; `live` is the one under way."""
        found = await asyncio.to_thread(list_recordings, self._folder)
        current = self._current()
        here = [{**one._asdict(), "live": str(self._folder / one.file) == current} for one in found]
        if current is not None and not any(one["live"] for one in here):
            here.insert(0, {"file": current, "bytes": None, "modified_s": None, "live": True})
        return here

    async def open(self, viewer: Viewer, file: str) -> dict[str, Any]:
        """Show a recording of the folder, or the one under way, to a client from now on; return what is known of it.

        Raises
        ------
        ReplayError
            There is none of that name, it cannot be played, or too many are open.
        """
        current = self._current()
        path = Path(file) if file == current else await asyncio.to_thread(find_recording, self._folder, file)
        if path is None:
            raise ReplayError(f"there is no recording {file!r} in {self._folder}: ask for the list again")
        await self._close(viewer)
        if len(self._open) + self._opening >= WORKERS_MAX:
            raise ReplayError(f"{WORKERS_MAX} recordings are open already, by other pages: have one closed first")
        self._opening += 1
        try:
            process = await start_child(self._program, [str(path)], pipes=True, low_priority=True)
            playing = ReplayProcess(process, lambda frame: self._pass_on(viewer, frame), viewer.say)
            about = await playing.begin()
        finally:
            self._opening -= 1
        if viewer.is_gone:
            await playing.close()
            raise ReplayError("the page is gone")
        self._open[id(viewer)] = playing
        viewer.switch(live=False)
        return {"file": file, **about}

    async def scrub(self, viewer: Viewer, s: float) -> None:
        """Go to a time in the recording, s after its first cycle."""
        if not math.isfinite(s):
            raise ReplayError("the time must be a finite number")
        self._of(viewer).do({"do": "scrub", "s": s})

    async def play(self, viewer: Viewer, speed: float) -> None:
        """Let it go by, so many times as fast as it was; 0 stops it."""
        if speed != 0.0 and not SPEED_MIN <= speed <= SPEED_MAX:
            raise ReplayError(f"the speed must be 0, or from {SPEED_MIN:g} to {SPEED_MAX:g}")
        self._of(viewer).do({"do": "play", "speed": speed})

    async def step(self, viewer: Viewer, cycles: int) -> None:
        """Go so many cycles on, or back."""
        if abs(cycles) > STEP_MAX:
            raise ReplayError(f"a step has {STEP_MAX} cycles at most")
        self._of(viewer).do({"do": "step", "cycles": cycles})

    async def live(self, viewer: Viewer) -> None:
        """Go back to the run itself."""
        await self._close(viewer)
        viewer.switch(live=True)

    def leave(self, viewer: Viewer) -> None:
        """Take note that a client is gone."""
        task = asyncio.get_running_loop().create_task(self._close(viewer), name="player's end")
        self._ending.add(task)
        task.add_done_callback(self._ending.discard)

    async def close(self) -> None:
        """End every player."""
        open_now, self._open = list(self._open.values()), {}
        await asyncio.gather(*(playing.close() for playing in open_now), *self._ending, return_exceptions=True)

    async def report(self) -> bytes:
        """Return the run up to now as a page of its own: made of the recording under way, by a process beside.

        Raises
        ------
        ReplayError
            Nothing is being recorded, another report is under way, or it cannot be made.
        """
        current = self._current()
        if current is None:
            raise ReplayError("nothing is being recorded, and a report is made of a recording: switch it on first")
        if self._reporting.locked():
            raise ReplayError("a report is being made already: wait for it")
        async with self._reporting:
            return await report_of(Path(current), self._units)

    def _of(self, viewer: Viewer) -> ReplayProcess:
        playing = self._open.get(id(viewer))
        if playing is None:
            raise ReplayError("no recording is open: open one first")
        return playing

    async def _close(self, viewer: Viewer) -> None:
        playing = self._open.pop(id(viewer), None)
        if playing is not None:
            await playing.close()

    def _pass_on(self, viewer: Viewer, frame: EncodedFrame) -> None:
        if not viewer.is_gone:
            viewer.show(frame)


async def report_of(file: Path, units: Units, patience_s: float = REPORT_MAX_S) -> bytes:
    """Return the page of a recording, be it one under way, made by a process beside.

    Raises
    ------
    ReplayError
        It cannot be made, or not within `patience_s`.
    """
    with tempfile.TemporaryDirectory(prefix="echolocate-") as folder:
        target = Path(folder) / f"{file.stem}.html"
        process = await start_child(
            ECHOLOCATE, ["report", str(file), "--out", str(target), "--units", units], pipes=False, low_priority=True
        )
        try:
            async with asyncio.timeout(patience_s):
                _, words = await process.communicate()
        except TimeoutError:
            raise ReplayError(
                f"the report was not done within {patience_s:.0f} s: make it later, by `echolocate report {file}`"
            ) from None
        finally:
            await kill_child(process)
        if process.returncode:
            last = words.decode(errors="replace").strip().rpartition("\n")[2]
            raise ReplayError(f"no report: {last.removeprefix('echolocate: ') or 'its process has ended'}")
        return await asyncio.to_thread(target.read_bytes)
