"""The program that plays a recording: commands come in as lines, frames go out, and in between the step is run again.

It is a process of its own (see `runtime.support.child_process`). Seeking is cut into cycles, and the next command is
read between any two of them: dragging a slider costs one seek, not one per position.
"""

from __future__ import annotations

import math
import os
import select
import struct
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol

import orjson

from config.settings import Settings
from runtime.console.playback.replay_cursor import ReplayCursor, Shown
from runtime.cycle.step import CycleRecord
from runtime.recording.reader import RecordingError, open_recording, parse_settings

FRAME_S: Final = 0.05
"""Frames are no closer than this, however fast it goes."""
BEHIND_S: Final = 0.25
"""Where this much cannot be kept up with it is slower than it was asked to be, and does not hurry after."""
SPEED_MIN, SPEED_MAX = 0.05, 100.0
LINE_MAX: Final = 4096
HEADER: Final = struct.Struct("!cIIIII")
"""Kind, whose frame (a jump begins another source), its number, and the lengths of head, changes and whole."""
ANSWER, FRAME = b"a", b"f"


class At(NamedTuple):
    """Where in the recording a frame is from."""

    s: float
    """After its first cycle."""
    is_playing: bool
    speed: float


class Picture(NamedTuple):
    """A frame in JSON: all but the segments, without its closing brace; these as changes; these whole."""

    head: bytes
    changes: bytes
    whole: bytes


class Builder(Protocol):
    """Makes frames of cycles, as for a live run."""

    def about(self) -> dict[str, Any]:
        """Return what a page is told first."""

    def take(self, record: CycleRecord) -> None:
        """Take note of a cycle, whether or not it is shown."""

    def frame(self, shown: Shown, at: At) -> Picture:
        """Return the frame of a cycle."""


class Make(Protocol):
    """Makes builders."""

    def __call__(self, settings: Settings, *, emulated: bool) -> Builder:
        """Return a builder for these settings of a recording; `emulated` where their world is what stood there."""


class ReplayWorker:
    """Plays a recording.

    Parameters
    ----------
    playback : ReplayCursor
        The recording.
    build : callable
        Makes a builder for the settings in force.
    show : callable
        Gets each frame: its source, its number, the frame.
    clock : callable
        Monotonic, s.
    """

    def __init__(
        self,
        playback: ReplayCursor,
        build: Callable[[dict[str, Any]], Builder],
        show: Callable[[int, int, Picture], None],
        clock: Callable[[], float],
    ) -> None:
        self._playback = playback
        self._build = build
        self._show = show
        self._clock = clock
        self._source = self._number = self._jumps = self._target = 0
        self._last: Shown | None = None
        self._told: dict[str, Any] | None = None
        self._builder: Builder | None = None
        self._going: Iterator[Shown] | None = None
        self._goes_on: tuple[float, float] | None = None
        """Playing: since when by the clock, and from where, s."""
        self._speed = 1.0
        self._shown_s = -math.inf

    def do(self, command: dict[str, Any]) -> None:
        """Take a command: scrub to `s`, play at `speed` (0 stops), step so many `cycles`.

        Raises
        ------
        ValueError, KeyError, TypeError
            It is none.
        """
        playback = self._playback
        match command["do"]:
            case "scrub":
                self._go(playback.position_at(float(command["s"])))
            case "step":
                self._goes_on = None
                here = playback.position if self._going is None else self._target
                self._go(here + int(command["cycles"]))
            case "play":
                speed = float(command["speed"])
                if speed and not SPEED_MIN <= speed <= SPEED_MAX:
                    raise ValueError(f"the speed must be 0, or from {SPEED_MIN:g} to {SPEED_MAX:g}")
                if speed:
                    self._speed = speed
                    if playback.position >= playback.cycles and self._going is None:
                        self._go(1)
                self._goes_on = (self._clock(), playback.t_s) if speed else None
                self._shown_s = -math.inf
            case _:
                raise ValueError("no such command")

    @property
    def wait_s(self) -> float:
        """How long there is nothing to do, s; inf until the next command."""
        if self._going is not None:
            return 0.0
        if self._goes_on is None:
            return math.inf
        since_s, from_s = self._goes_on
        next_s = self._playback.time_of(self._playback.position + 1)
        return max(0.0, since_s + (next_s - from_s) / self._speed - self._clock())

    def work(self) -> None:
        """Do a little of what is to be done: one cycle at most."""
        if self._going is not None:
            self._get_there()
        elif self._goes_on is not None and self.wait_s <= 0.0:
            self._play_on(*self._goes_on)

    def _go(self, position: int) -> None:
        self._target = min(max(1, position), self._playback.cycles)
        self._going, self._last = self._playback.to(self._target), None

    def _get_there(self) -> None:
        shown = None if self._going is None else next(self._going, None)
        if shown is None:
            self._going = None
            if self._goes_on is not None:
                self._goes_on = (self._clock(), self._playback.t_s)
            if self._last is not None:
                self._frame(self._last)
            return
        self._last = shown
        self._take(shown)

    def _play_on(self, since_s: float, from_s: float) -> None:
        shown = self._playback.on()
        if shown is None:
            self._goes_on = None
            self._go(self._playback.cycles)
            return
        self._take(shown)
        now_s, t_s = self._clock(), self._playback.t_s
        if now_s - since_s - (t_s - from_s) / self._speed > BEHIND_S:
            self._goes_on = (now_s, t_s)
        if now_s - self._shown_s >= FRAME_S:
            self._shown_s = now_s
            self._frame(shown)

    def _take(self, shown: Shown) -> None:
        told = self._playback.settings
        if self._builder is None or told is not self._told or self._jumps != self._playback.jumps:
            self._jumps = self._playback.jumps
            self._told, self._builder = told, self._build(told)
            self._source += 1
            self._number = 0
        self._builder.take(shown.record)

    def _frame(self, shown: Shown) -> None:
        if self._builder is not None:
            self._number += 1
            at = At(round(self._playback.t_s, 3), self._goes_on is not None, self._speed)
            self._show(self._source, self._number, self._builder.frame(shown, at))


def about_recording(playback: ReplayCursor, more: dict[str, Any]) -> dict[str, Any]:
    """Return what there is to know of a recording before it is played."""
    return {
        "duration_s": round(playback.duration_s, 3),
        "cycles": playback.cycles,
        "bookmarks": [[round(s, 3), text] for s, text in playback.bookmarks],
        "modes": [[round(s, 3), mode.mode.value, mode.reason] for s, mode in playback.modes],
        **more,
    }


def play(file: str, make: Make) -> int:
    """Play a recording for whoever holds the other ends of standard input and output, until they are closed.

    Parameters
    ----------
    file : str
        The recording.
    make : Make
        Makes builders.
    """
    try:
        with open_recording(Path(file)) as recording:
            playback = ReplayCursor(recording)
            emulated = recording.info.emulated

            def build(told: dict[str, Any]) -> Builder:
                return make(parse_settings(told), emulated=emulated)

            about = build(recording.info.settings).about()
            _answer(about_recording(playback, {"about": about, "started": recording.info.started}))
            player = ReplayWorker(playback, build, _show, time.monotonic)
            player.do({"do": "scrub", "s": 0.0})
            _serve(player)
    except RecordingError as error:
        _answer({"error": str(error)})
    except BrokenPipeError:  # nobody looks on any more
        return 0
    return 0


def _serve(player: ReplayWorker) -> None:
    """Hear commands and work in turn."""
    fd, rest = sys.stdin.fileno(), b""
    while True:
        wait_s = player.wait_s
        ready, _, _ = select.select([fd], [], [], None if wait_s == math.inf else wait_s)
        if ready:
            data = os.read(fd, LINE_MAX)
            if not data:
                return
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                try:
                    player.do(orjson.loads(line))
                except (ValueError, KeyError, TypeError) as error:
                    _answer({"error": f"{error}"})
        player.work()


def _answer(told: dict[str, Any]) -> None:
    body = orjson.dumps(told)
    _write(HEADER.pack(ANSWER, 0, 0, len(body), 0, 0) + body)


def _show(source: int, number: int, picture: Picture) -> None:
    sizes = (len(part) for part in picture)
    _write(HEADER.pack(FRAME, source, number, *sizes) + b"".join(picture))


def _write(data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(1, rest) :]
