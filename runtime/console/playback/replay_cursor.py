"""A position in a recording that can be moved anywhere, and the state of the run there.

The state at a cycle is the result of all cycles up to it. So a seek runs the step again from the nearest earlier
cycle whose state is known: a keyframe of the file, or a state that was kept when the cursor passed it. Cycles are
yielded one by one, so that the caller can do something else in between.
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from perception.snapshot import Snapshot
from runtime.cycle.modes import ModeState
from runtime.cycle.step import CycleRecord, State
from runtime.recording.channels import BOOKMARK, CYCLE, KEYFRAME, MODE, RUN_INFO, SETTINGS, RawMessage, decode
from runtime.recording.mcap_scanner import BEGIN
from runtime.recording.reader import NS_PER_S, Recording, RecordingError
from runtime.recording.replayer import Replayer
from runtime.recording.schema import (
    Bookmark,
    Cycle,
    Keyframe,
    ModeChange,
    RunInfo,
    SettingsChange,
    StateFields,
    carried_state,
)
from runtime.recording.schema import perception_snapshot as memory_in

NUMBER: Final = re.compile(rb'\{"record":\{"cycle":(\d{1,15}),')
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
class _KnownState:
    """A cycle whose state is kept: what it takes to continue from there."""

    chunk_at: int
    told: dict[str, Any]
    left: StateFields
    memory: Snapshot


@dataclass(slots=True)
class _Index:
    """Where in the file each cycle and keyframe is."""

    numbers: list[int] = field(default_factory=list)
    """Of the cycles, in file order."""
    times_s: list[float] = field(default_factory=list)
    """Of the cycles, after the first one."""
    chunks_at: list[int] = field(default_factory=list)
    """File offset of each cycle's chunk."""
    keyframes: list[tuple[int, int, dict[str, Any]]] = field(default_factory=list)
    """Of each keyframe: the cycles before it, the offset of its chunk, and the settings in force."""


class ReplayCursor:
    """Replays a recording from anywhere to anywhere.

    Parameters
    ----------
    recording : Recording
        Open for as long as the cursor is used.

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

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._index = _Index()
        self.bookmarks: list[tuple[float, str]] = []
        self.modes: list[tuple[float, ModeState]] = []
        self._index_file()
        if not self._index.numbers:
            raise RecordingError(f"{recording.path}: holds no cycle: the run ended before its first one")
        self.cycles = len(self._index.numbers)
        self.duration_s = self._index.times_s[-1]
        self._kept: OrderedDict[int, _KnownState] = OrderedDict()
        self._kept_bytes = 0
        self._replayed: list[ReplayedCycle] = []
        self._replayer = Replayer(recording, self._take, begun=True)
        self._entries: Iterator[tuple[int, RawMessage]] = iter(())
        self._next = self.jumps = 0
        self._begin_at(0)

    @property
    def settings(self) -> dict[str, Any]:
        """The settings in force at this position, as the recording has them."""
        return self._replayer.told

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
        """Replay and return the next cycle whose state is known; None at the end."""
        self._replayed.clear()
        for chunk_at, entry in self._entries:
            self._replayer.take(entry)
            if entry.topic == CYCLE:
                self._next += 1
                if self._replayed:
                    self._keep(chunk_at)
                    return self._replayed[0]
        return None

    def seek(self, position: int) -> Iterator[ReplayedCycle]:
        """Go to a position; yield each cycle that is replayed on the way, the last of them at the position."""
        position = min(max(1, position), self.cycles)
        base = self._nearest(position)
        if not base <= self._next < position:
            self._begin_at(base)
        while self._next < position and (replayed := self.next_cycle()) is not None:
            yield replayed

    def _index_file(self) -> None:
        """Fill the index, the bookmarks and the modes."""
        index, recording = self._index, self._recording
        told, raw = recording.info.settings, b""
        first_ns: int | None = None
        for chunk_at, entries in recording.chunks():
            for entry in entries:
                if entry.topic == CYCLE:
                    first_ns = entry.log_ns if first_ns is None else first_ns
                    index.numbers.append(_number(entry))
                    index.times_s.append((entry.log_ns - first_ns) / NS_PER_S)
                    index.chunks_at.append(chunk_at)
                elif entry.topic == KEYFRAME:
                    index.keyframes.append((len(index.numbers), chunk_at, told))
                elif entry.topic == SETTINGS:
                    told = decode(SettingsChange, entry.data).settings
                elif entry.topic == RUN_INFO and entry.data != raw:
                    raw = entry.data
                    told = decode(RunInfo, raw).settings
                elif entry.topic == BOOKMARK:
                    s = 0.0 if first_ns is None else max(0.0, (entry.log_ns - first_ns) / NS_PER_S)
                    self.bookmarks.append((s, decode(Bookmark, entry.data).text))
                elif entry.topic == MODE and first_ns is not None:
                    at_s = (entry.log_ns - first_ns) / NS_PER_S
                    self.modes.append((at_s, decode(ModeChange, entry.data).mode))

    def _nearest(self, position: int) -> int:
        """Return the last position with a known state that is far enough before `position`."""
        latest = position - LOOK_BACK
        known = [at for at, _, _ in self._index.keyframes if at <= latest]
        known += [at for at in self._kept if at <= latest]
        return max(known, default=0)

    def _begin_at(self, position: int) -> None:
        """Go to a position with a known state, or to the beginning."""
        place = self._kept.get(position)
        frame = next((frame for frame in self._index.keyframes if frame[0] == position), None)
        self._replayer = Replayer(self._recording, self._take, begun=False)
        self._next = position
        self.jumps += 1
        if place is not None:
            self._kept.move_to_end(position)
            self._replayer.go_on(place.told, place.left, place.memory)
            self._entries = self._after(place.chunk_at, self._index.numbers[position - 1])
        elif frame is not None:
            _, chunk_at, told = frame
            self._entries = self._from_keyframe(chunk_at, told)
        else:
            self._replayer = Replayer(self._recording, self._take, begun=True)
            self._entries = self._since(BEGIN)

    def _since(self, begin_at: int) -> Iterator[tuple[int, RawMessage]]:
        for chunk_at, entries in self._recording.chunks(begin_at):
            for entry in entries:
                yield chunk_at, entry

    def _after(self, chunk_at: int, number: int) -> Iterator[tuple[int, RawMessage]]:
        """Yield the messages after a cycle."""
        rest = self._since(chunk_at)
        for _, entry in rest:
            if entry.topic == CYCLE and _number(entry) == number:
                break
        yield from rest

    def _from_keyframe(self, begin_at: int, told: dict[str, Any]) -> Iterator[tuple[int, RawMessage]]:
        """Restore the keyframe's state and yield the messages after it."""
        rest = self._since(begin_at)
        skipped = self._next - bisect_left(self._index.chunks_at, begin_at)
        for _, entry in rest:
            skipped -= entry.topic == CYCLE
            if entry.topic == KEYFRAME and skipped == 0:
                frame = decode(Keyframe, entry.data)
                left = {name: getattr(frame.left, name) for name in type(frame.left).model_fields}
                self._replayer.go_on(told, left, memory_in(frame))
                break
        yield from rest

    def _take(self, record: CycleRecord, state: State) -> None:
        self._replayed.append(ReplayedCycle(record, state))

    def _keep(self, chunk_at: int) -> None:
        """Keep the state of every so many cycles, for seeks backward."""
        if self._next % KEEP_PERIOD or self._next in self._kept or self._replayer.state is None:
            return
        state = self._replayer.state
        place = _KnownState(chunk_at, self._replayer.told, carried_state(state), state.perception.snapshot())
        self._kept[self._next] = place
        self._kept_bytes += _size(place)
        while self._kept_bytes > KEPT_BYTES and len(self._kept) > 1:
            self._kept_bytes -= _size(self._kept.popitem(last=False)[1])


def _size(place: _KnownState) -> int:
    return sum(array.nbytes for array in place.memory.values())


def _number(entry: RawMessage) -> int:
    """Return a cycle's number from the beginning of its record, because parsing all of it takes long."""
    found = NUMBER.match(entry.data)
    return decode(Cycle, entry.data).record.cycle if found is None else int(found[1])
