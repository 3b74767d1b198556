"""The worker process that replays a recording for one client: it reads commands as lines and writes frames.

The robot's process starts it at low priority. A seek is done cycle by cycle, and the next command is read between any
two cycles, so dragging a slider costs one seek, not one for each position.
"""

from __future__ import annotations

import math
import os
import select
import struct
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol

import orjson

from config.settings import Settings
from runtime.console.playback.replay_cursor import ReplayCursor, ReplayedCycle
from runtime.console.sent_messages import (
    GridMessage,
    OpeningMessage,
    RecordingDescription,
    ReplayProblemMessage,
    SessionInfo,
)
from runtime.cycle.step import CycleRecord
from runtime.recording.reader import RecordingError, open_recording, parse_settings
from runtime.recording.replayer import GAP_MAX_S
from runtime.recording.verification import refused_lines

FRAME_PERIOD_S: Final = 0.05
"""Shortest time between frames, at any speed."""
LAG_MAX_S: Final = 0.25
"""A replay that falls this far behind plays on slower than asked; it does not catch up."""
SPEED_MIN, SPEED_MAX = 0.05, 100.0
READ_BYTES: Final = 4096
HEADER: Final = struct.Struct("!cIIIII")
"""Before each message to the client: its kind, source and number of a frame, and the lengths of three parts."""
ANSWER, FRAME = b"a", b"f"
PROGRESS: Final = "opening"
"""Type of the answers that say how much of the recording has been read, before its description."""
PROGRESS_PERIOD_S: Final = 0.25


class PlaybackPosition(NamedTuple):
    """The position of a frame in the recording."""

    s: float
    """After the first cycle."""
    is_playing: bool
    speed: float


class FrameParts(NamedTuple):
    """A frame in JSON, in the parts that are sent separately: see `EncodedFrame`."""

    head: bytes
    changes: bytes
    whole: bytes


class FrameMaker(Protocol):
    """Makes the frames of replayed cycles."""

    def session(self) -> SessionInfo:
        """Return the session information of the recorded run."""

    def take(self, record: CycleRecord) -> None:
        """Take in a cycle, whether or not it is shown."""

    def frame(self, replayed: ReplayedCycle, position: PlaybackPosition) -> FrameParts:
        """Return the frame of a cycle."""

    def grid(self, replayed: ReplayedCycle) -> GridMessage:
        """Return the evidence grid after a cycle, as a message."""


class MakeFrameMaker(Protocol):
    """Constructs frame makers."""

    def __call__(self, settings: Settings, *, emulated: bool) -> FrameMaker:
        """Return a frame maker for settings of a recording, whose robot was `emulated` or not."""


class ReplayWorker:
    """Plays a recording under the control of commands: `execute` begins one, `advance` does the work, cycle by cycle.

    `make_frames` returns a frame maker for the settings in force, given as the recording has them. `show` gets each
    frame: the number of its source, its number there, and its parts; `answer` gets each message that is no frame. The
    clock is monotonic.
    """

    def __init__(
        self,
        cursor: ReplayCursor,
        make_frames: Callable[[dict[str, Any]], FrameMaker],
        show: Callable[[int, int, FrameParts], None],
        answer: Callable[[Mapping[str, Any]], None],
        clock: Callable[[], float],
    ) -> None:
        self._cursor = cursor
        self._make_frames = make_frames
        self._show = show
        self._answer = answer
        self._clock = clock
        self._source = 0
        """Number of the present source of frames …"""
        self._number = 0
        """… and how many frames it has made."""
        self._jumps = 0
        """The cursor's jumps, and …"""
        self._settings: dict[str, Any] | None = None
        """… its settings, for which that source was made."""
        self._frames: FrameMaker | None = None
        """That source; None before the first cycle."""
        self._newest: ReplayedCycle | None = None
        """The last cycle replayed; None before the first."""
        self._seek: Iterator[ReplayedCycle] | None = None
        """The cycles that the seek still has to replay; None while there is none."""
        self._target = 0
        """The position to which it goes."""
        self._last: ReplayedCycle | None = None
        """The cycle at that position; None until it is reached."""
        self._playing_from: tuple[float, float] | None = None
        """Host time and position, s, from which it plays; None while it does not."""
        self._speed = 1.0
        self._shown_s = -math.inf
        """Host time of the last frame while playing."""

    def execute(self, command: dict[str, Any]) -> None:
        """Begin to execute a command: seek to `s`, play at `speed` (0 pauses), step `cycles`, or show the `grid`.

        Raises
        ------
        ValueError, KeyError, TypeError
            The command is malformed.
        """
        cursor = self._cursor
        match command["do"]:
            case "seek":
                self._seek_to(cursor.position_at(float(command["s"])))
            case "step":
                self._playing_from = None
                current = cursor.position if self._seek is None else self._target
                self._seek_to(current + int(command["cycles"]))
            case "grid":
                if self._frames is not None and self._newest is not None:
                    self._answer(self._frames.grid(self._newest))
            case "play":
                self._play(float(command["speed"]))
            case _:
                raise ValueError("no such command")

    @property
    def wait_s(self) -> float:
        """Time until there is something to do, s; inf until the next command."""
        if self._seek is not None:
            return 0.0
        if self._playing_from is None:
            return math.inf
        since_s, from_s = self._playing_from
        next_s = min(self._cursor.time_of(self._cursor.position + 1), self._cursor.t_s + GAP_MAX_S)
        return max(0.0, since_s + (next_s - from_s) / self._speed - self._clock())

    def advance(self) -> None:
        """Replay one cycle at most, if one is due. Where the recording fails, pause and say so."""
        try:
            self._advance()
        except RecordingError as error:
            self._seek = self._playing_from = None
            self._report(str(error))
        self._report()

    def _advance(self) -> None:
        if self._seek is not None:
            self._advance_seek(self._seek)
        elif self._playing_from is not None and self.wait_s <= 0.0:
            self._advance_playing(*self._playing_from)

    def _report(self, *problems: str) -> None:
        """Answer what is wrong with keyframes, and other problems, the one that matters most last."""
        for text in (*refused_lines(self._cursor.take_refused()), *problems):
            self._answer(problem(text))

    def _play(self, speed: float) -> None:
        """Play at a speed, from the beginning if at the end; 0 pauses. A seek under way goes on.

        Raises
        ------
        ValueError
            The speed is out of range.
        """
        if speed and not SPEED_MIN <= speed <= SPEED_MAX:
            raise ValueError(f"the speed must be 0, or from {SPEED_MIN:g} to {SPEED_MAX:g}")
        if speed:
            self._speed = speed
            if self._cursor.position >= self._cursor.cycles and self._seek is None:
                self._seek_to(1)
        self._playing_from = (self._clock(), self._cursor.t_s) if speed else None
        self._shown_s = -math.inf

    def _seek_to(self, position: int) -> None:
        """Begin to go to a position, limited to those that there are."""
        self._target = min(max(1, position), self._cursor.cycles)
        self._seek, self._last = self._cursor.seek(self._target), None

    def _advance_seek(self, seek: Iterator[ReplayedCycle]) -> None:
        """Replay one cycle of a seek; at its end show the cycle at the position, or say that there is none."""
        replayed = next(seek, None)
        if replayed is not None:
            if self._cursor.position >= self._target:
                self._last = replayed
            self._take(replayed)
            return
        self._seek = None
        if self._playing_from is not None:
            self._playing_from = (self._clock(), self._cursor.t_s)
        if self._last is not None:
            self._show_frame(self._last)
        else:
            self._report("this moment cannot be replayed: cycles before it are missing; go to another one")

    def _advance_playing(self, since_s: float, from_s: float) -> None:
        """Replay the next cycle while playing, and show it if a frame is due; at the end show the last one and pause.

        `since_s`, `from_s`: host time and position from which it plays, s.
        """
        replayed = self._cursor.next_cycle()
        if replayed is None:
            self._playing_from = None
            self._seek_to(self._cursor.cycles)
            return
        self._take(replayed)
        host_s, t_s = self._clock(), self._cursor.t_s
        if abs(host_s - since_s - (t_s - from_s) / self._speed) > LAG_MAX_S:  # too slow, or after a gap
            self._playing_from = (host_s, t_s)
        if host_s - self._shown_s >= FRAME_PERIOD_S:
            self._shown_s = host_s
            self._show_frame(replayed)

    def _take(self, replayed: ReplayedCycle) -> None:
        """Take in a cycle, with a new source of frames after a jump or a change of settings."""
        settings = self._cursor.settings
        if self._frames is None or settings is not self._settings or self._jumps != self._cursor.jumps:
            self._jumps = self._cursor.jumps
            self._settings, self._frames = settings, self._make_frames(settings)
            self._source += 1
            self._number = 0
        self._frames.take(replayed.record)
        self._newest = replayed

    def _show_frame(self, replayed: ReplayedCycle) -> None:
        if self._frames is not None:
            self._number += 1
            position = PlaybackPosition(round(self._cursor.t_s, 3), self._playing_from is not None, self._speed)
            self._show(self._source, self._number, self._frames.frame(replayed, position))


def problem(text: object) -> ReplayProblemMessage:
    """Return the answer that says what is wrong."""
    return {"type": "replay_problem", "error": str(text)}


def description_of(cursor: ReplayCursor, about: SessionInfo, started: str) -> RecordingDescription:
    """Return the description of a recording: the worker's first answer that is no progress.

    Times are in s after the first cycle; `started` is in ISO 8601, UTC. It must have no key `type` or `error`: by
    these `ReplayProcess.begin` knows the other answers.
    """
    return {
        "duration_s": round(cursor.duration_s, 3),
        "cycles": cursor.cycles,
        "bookmarks": [(round(s, 3), text) for s, text in cursor.bookmarks],
        "modes": [(round(s, 3), mode.mode.value, mode.reason) for s, mode in cursor.modes],
        "about": about,
        "started": started,
    }


def run_worker(file: str, make: MakeFrameMaker) -> int:
    """Replay a recording until standard input or output is closed; return the process's exit code."""
    try:
        with open_recording(Path(file)) as recording:
            cursor = ReplayCursor(recording, _progress_writer(Path(file).stat().st_size, time.monotonic))
            emulated = recording.info.emulated

            def make_frames(settings: dict[str, Any]) -> FrameMaker:
                return make(parse_settings(settings), emulated=emulated)

            session = make_frames(recording.info.settings).session()
            _write_answer(description_of(cursor, session, recording.info.started))
            worker = ReplayWorker(cursor, make_frames, _write_frame, _write_answer, time.monotonic)
            worker.execute({"do": "seek", "s": 0.0})
            _serve(worker)
    except RecordingError as error:
        _write_answer(problem(error))
    except BrokenPipeError:  # the client has gone
        return 0
    return 0


def _progress_writer(size: int, clock: Callable[[], float]) -> Callable[[int], None]:
    """Return a function that gets how much of a file has been read, and writes that as an answer now and then."""
    next_s = clock() + PROGRESS_PERIOD_S

    def on_chunk(offset: int) -> None:
        nonlocal next_s
        if clock() >= next_s:
            next_s = clock() + PROGRESS_PERIOD_S
            opening: OpeningMessage = {"type": "opening", "share": round(min(1.0, offset / max(1, size)), 3)}
            _write_answer(opening)

    return on_chunk


def _serve(worker: ReplayWorker) -> None:
    """Read commands and replay cycles in turn until standard input is closed."""
    fd, rest = sys.stdin.fileno(), b""
    while True:
        wait_s = worker.wait_s
        ready, _, _ = select.select([fd], [], [], None if wait_s == math.inf else wait_s)
        if ready:
            data = os.read(fd, READ_BYTES)
            if not data:
                return
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                try:
                    worker.execute(orjson.loads(line))
                except (ValueError, KeyError, TypeError) as error:
                    _write_answer(problem(error))
        worker.advance()


def _write_answer(answer: Mapping[str, Any]) -> None:
    body = orjson.dumps(answer)
    _write(HEADER.pack(ANSWER, 0, 0, len(body), 0, 0) + body)


def _write_frame(source: int, number: int, parts: FrameParts) -> None:
    sizes = (len(part) for part in parts)
    _write(HEADER.pack(FRAME, source, number, *sizes) + b"".join(parts))


def _write(data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(1, rest) :]
