"""A position in a recording that can be moved anywhere, and the state of the run there.

The state at a cycle is the result of all cycles up to it. So a seek runs the step again from the nearest earlier
cycle whose state is known: a keyframe of the file, or a state that was kept when the cursor passed it. Cycles are
yielded one by one, so that the caller can do something else in between.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from pydantic import ValidationError

from runtime.cycle.modes import ModeState
from runtime.cycle.step import CycleRecord, State
from runtime.recording.channels import BOOKMARK, BOOKMARK_WITHDRAWN, CYCLE, MODE, decode
from runtime.recording.reader import Recording, RecordingError, cycle_head, first_error
from runtime.recording.replayer import (
    Checkpoint,
    KeyframeError,
    KeyframeFinder,
    KeyframePosition,
    replay_from,
)
from runtime.recording.schema import Bookmark, ModeChange

LOOK_BACK: Final = 20
"""Cycles that a seek yields before its target, if there are so many: within them every sensor has fired."""
KEEP_PERIOD: Final = 100
"""Cycles between kept states, which make a seek backward short."""
KEPT_BYTES: Final = 64_000_000
"""Memory for kept states; the least recently used ones are dropped."""


class ReplayedCycle(NamedTuple):
    """A replayed cycle and the state after it; valid until the next one is replayed."""

    record: CycleRecord
    state: State


@dataclass(slots=True)
class _Index:
    """What is where in the file."""

    times_s: list[float] = field(default_factory=list)
    """Time of each cycle by the run's clock, s after the first one, in file order."""
    keyframes: dict[int, KeyframePosition] = field(default_factory=dict)
    """The keyframes by the number of cycles before them in the file."""


class ReplayCursor:
    """Replays a recording between any two positions.

    The recording is open for as long as the cursor is used. `on_chunk` gets the offset in the file of each chunk that
    is indexed.

    Attributes
    ----------
    duration_s
        Time from the first cycle to the last.
    cycles
        Number of cycles in the recording.
    bookmarks
        Time of each, s after the first cycle, and its text.
    modes
        Time at which each was entered, s after the first cycle, and the mode with its reason.
    jumps
        How often the cursor continued elsewhere than after the last cycle it yielded.

    Raises
    ------
    RecordingError
        The recording has no cycle.
    """

    def __init__(self, recording: Recording, on_chunk: Callable[[int], None] = lambda _: None) -> None:
        self._recording = recording
        self._on_chunk = on_chunk
        self._index = _Index()
        self.bookmarks: list[tuple[float, str]] = []
        self.modes: list[tuple[float, ModeState]] = []
        self._index_file()
        if not self._index.times_s:
            raise RecordingError(f"{recording.path}: holds no cycle: the run ended before its first one")
        self.cycles = len(self._index.times_s)
        self.duration_s = self._index.times_s[-1]
        self._refused: dict[str, bool] = {}
        """What is wrong with which keyframe, and whether that was taken."""
        self._kept: OrderedDict[int, Checkpoint] = OrderedDict()
        """States of positions that were passed, the one used last at the end."""
        self._kept_bytes = 0
        self._next = self.jumps = 0
        """_next: index of the cycle after the last one replayed."""
        self._begin_at(0)

    @property
    def settings(self) -> dict[str, Any]:
        """The settings in force at this position, as the recording has them."""
        return self._replayer.settings_data

    @property
    def position(self) -> int:
        """The number of cycles up to and including the last one that was replayed."""
        return self._next

    @property
    def t_s(self) -> float:
        """The time of the last replayed cycle, s after the first one."""
        return self._index.times_s[max(0, self._next - 1)]

    def time_of(self, position: int) -> float:
        """Return the time of the last cycle at a position, s after the first one."""
        return self._index.times_s[min(max(0, position - 1), self.cycles - 1)]

    def position_at(self, s: float) -> int:
        """Return the position at a time, s after the first cycle; at least 1."""
        return max(1, bisect_right(self._index.times_s, s))

    def next_cycle(self) -> ReplayedCycle | None:
        """Replay and return the next cycle whose state is known; None at the end.

        Raises
        ------
        RecordingError
            A message is invalid, or a cycle cannot be replayed. The next seek starts anew.
        """
        try:
            for step in self._replayer:
                if step.refused is not None:
                    self._refused.setdefault(step.refused, False)
                if step.message.topic == CYCLE:
                    self._next += 1
                    if step.replayed is not None and self._replayer.state is not None:
                        self._keep()
                        return ReplayedCycle(step.replayed, self._replayer.state)
        except (RecordingError, ValidationError) as error:
            self._next = self.cycles
            if isinstance(error, ValidationError):
                raise RecordingError(f"{self._recording.path}: an invalid message: {first_error(error)}") from error
            raise
        return None

    def seek(self, position: int) -> Iterator[ReplayedCycle]:
        """Go to a position; yield each cycle that is replayed on the way, the last of them at the position.

        Raises
        ------
        RecordingError
            As for `next_cycle`.
        """
        position = min(max(1, position), self.cycles)
        base = self._nearest(position)
        if not base <= self._next < position:
            self._begin_at(base)
        while self._next < position and (replayed := self.next_cycle()) is not None:
            yield replayed

    def take_refused(self) -> list[str]:
        """Return which keyframes were refused, and why, each once."""
        taken = [text for text, was_taken in self._refused.items() if not was_taken]
        self._refused = dict.fromkeys(self._refused, True)
        return taken

    def _index_file(self) -> None:
        """Fill the index, the bookmarks and the modes: the whole file is read, once, at the construction."""
        index, finder = self._index, KeyframeFinder(self._recording)
        first_run_s: float | None = None
        for chunk_offset, messages in self._recording.chunks():
            self._on_chunk(chunk_offset)
            for message in messages:
                keyframe = finder.find(chunk_offset, message)
                if keyframe is not None:
                    index.keyframes[len(index.times_s)] = keyframe
                elif message.topic == CYCLE:
                    _, run_s = cycle_head(message)
                    first_run_s = run_s if first_run_s is None else first_run_s
                    index.times_s.append(run_s - first_run_s)
                elif message.topic == BOOKMARK:
                    mark = decode(Bookmark, message.data)
                    s = 0.0 if first_run_s is None else max(0.0, mark.run_s - first_run_s)
                    self.bookmarks.append((s, mark.text))
                elif message.topic == BOOKMARK_WITHDRAWN:
                    del self.bookmarks[-1:]
                elif message.topic == MODE and first_run_s is not None:
                    change = decode(ModeChange, message.data)
                    last = self.modes[-1][1] if self.modes else None
                    if last is None or (last.mode, last.reason) != (change.mode.mode, change.mode.reason):
                        self.modes.append((change.run_s - first_run_s, change.mode))

    def _nearest(self, position: int) -> int:
        """Return the last position with a known state that is far enough before `position`."""
        latest = position - LOOK_BACK
        return max((at for at in (*self._index.keyframes, *self._kept) if at <= latest), default=0)

    def _begin_at(self, position: int) -> None:
        """Go to a position with a known state, or to the nearest one before whose state is not refused."""
        starts: dict[int, KeyframePosition | Checkpoint] = {**self._index.keyframes, **self._kept}
        before = {at: start for at, start in sorted(starts.items(), reverse=True) if at <= position}
        refused = list[int]()

        def on_refused(start: KeyframePosition | Checkpoint, error: KeyframeError) -> None:
            refused.append(next(at for at, other in before.items() if other is start))
            self._refused.setdefault(str(error), False)

        self._replayer = replay_from(self._recording, before.values(), on_refused)
        for at in refused:
            del self._index.keyframes[at]
        self._next = next((at for at in before if at not in refused), 0)
        if self._next in self._kept:
            self._kept.move_to_end(self._next)
        self.jumps += 1

    def _keep(self) -> None:
        """Keep the state of every so many cycles, for seeks backward."""
        if self._next % KEEP_PERIOD or self._next in self._kept:
            return
        checkpoint = self._replayer.checkpoint()
        if checkpoint is None:
            return
        self._kept[self._next] = checkpoint
        self._kept_bytes += checkpoint.nbytes
        while self._kept_bytes > KEPT_BYTES and len(self._kept) > 1:
            self._kept_bytes -= self._kept.popitem(last=False)[1].nbytes
