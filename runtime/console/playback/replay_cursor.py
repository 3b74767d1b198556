"""A recording as something to move about in: to a time, on cycle by cycle, and back.

The state of a run at a moment is what its cycles up to then have left. So going to a time is running the step again
from the nearest moment before it whose state is known: a keyframe of the file, or one that was passed earlier and is
kept. Cycles are given out one by one, so that whoever shows them can do something else in between.
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
"""So many cycles are given out before the one that is gone to, where there are: by then the whole ring has fired."""
KEPT_EVERY: Final = 100
"""Of so many cycles one's state is kept, so that the way back is short."""
KEPT_BYTES: Final = 64_000_000
"""Kept at most; what was not used for longest goes first."""


class Shown(NamedTuple):
    """A cycle, and what it left; good until the next one is asked for."""

    record: CycleRecord
    state: State


@dataclass(slots=True)
class _Place:
    """A moment whose state is known: what it takes to go on from there."""

    chunk_at: int
    told: dict[str, Any]
    left: StateFields
    memory: Snapshot


@dataclass(slots=True)
class _Index:
    """What is where in the file."""

    numbers: list[int] = field(default_factory=list)
    """Of the cycles, in the order of the file."""
    times_s: list[float] = field(default_factory=list)
    """Of the cycles, from the first one on."""
    chunks_at: list[int] = field(default_factory=list)
    """Where each cycle's chunk begins."""
    keyframes: list[tuple[int, int, dict[str, Any]]] = field(default_factory=list)
    """How many cycles stand before it, where its chunk begins, and the settings in force."""


class ReplayCursor:
    """Runs the step again over a recording, from anywhere to anywhere.

    Parameters
    ----------
    recording : Recording
        Stays open meanwhile.

    Attributes
    ----------
    duration_s
        From the first cycle to the last.
    cycles
        In the recording.
    bookmarks
        When, after the first cycle, and what it says.
    modes
        When each was entered, and why.
    jumps
        How often it went on elsewhere than after the last cycle given out.

    Raises
    ------
    RecordingError
        It holds no cycle.
    """

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._index = _Index()
        self.bookmarks: list[tuple[float, str]] = []
        self.modes: list[tuple[float, ModeState]] = []
        self._survey()
        if not self._index.numbers:
            raise RecordingError(f"{recording.path}: holds no cycle: the run ended before its first one")
        self.cycles = len(self._index.numbers)
        self.duration_s = self._index.times_s[-1]
        self._kept: OrderedDict[int, _Place] = OrderedDict()
        self._kept_bytes = 0
        self._replayed: list[Shown] = []
        self._rerun = Replayer(recording, self._take, begun=True)
        self._entries: Iterator[tuple[int, RawMessage]] = iter(())
        self._next = self.jumps = 0
        self._begin_at(0)

    @property
    def settings(self) -> dict[str, Any]:
        """The settings in force at this place, as the recording tells them."""
        return self._rerun.told

    @property
    def position(self) -> int:
        """How many cycles of the file are behind."""
        return self._next

    @property
    def t_s(self) -> float:
        """The time of the last cycle that is behind, after the first one."""
        return self._index.times_s[max(0, self._next - 1)]

    def time_of(self, position: int) -> float:
        """Return the time of the last cycle that is behind once so many are."""
        return self._index.times_s[min(max(0, position - 1), self.cycles - 1)]

    def position_at(self, s: float) -> int:
        """Return how many cycles are behind at a time; the first one always is."""
        return max(1, bisect_right(self._index.times_s, s))

    def on(self) -> Shown | None:
        """Run the next cycle that can be; None at the end."""
        self._replayed.clear()
        for chunk_at, entry in self._entries:
            self._rerun.take(entry)
            if entry.topic == CYCLE:
                self._next += 1
                if self._replayed:
                    self._keep(chunk_at)
                    return self._replayed[0]
        return None

    def to(self, position: int) -> Iterator[Shown]:
        """Go to where so many cycles are behind; yields each cycle on the way, the last of which is there."""
        position = min(max(1, position), self.cycles)
        base = self._nearest(position)
        if not base <= self._next < position:
            self._begin_at(base)
        while self._next < position and (shown := self.on()) is not None:
            yield shown

    def _survey(self) -> None:
        """Note what is where."""
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
        """Return how many cycles are behind at the last known state that is far enough before `position`."""
        latest = position - LOOK_BACK
        known = [at for at, _, _ in self._index.keyframes if at <= latest]
        known += [at for at in self._kept if at <= latest]
        return max(known, default=0)

    def _begin_at(self, position: int) -> None:
        """Go to a place whose state is known, or to the beginning."""
        place = self._kept.get(position)
        frame = next((frame for frame in self._index.keyframes if frame[0] == position), None)
        self._rerun = Replayer(self._recording, self._take, begun=False)
        self._next = position
        self.jumps += 1
        if place is not None:
            self._kept.move_to_end(position)
            self._rerun.go_on(place.told, place.left, place.memory)
            self._entries = self._after(place.chunk_at, self._index.numbers[position - 1])
        elif frame is not None:
            _, chunk_at, told = frame
            self._entries = self._from_keyframe(chunk_at, told)
        else:
            self._rerun = Replayer(self._recording, self._take, begun=True)
            self._entries = self._since(BEGIN)

    def _since(self, begin_at: int) -> Iterator[tuple[int, RawMessage]]:
        for chunk_at, entries in self._recording.chunks(begin_at):
            for entry in entries:
                yield chunk_at, entry

    def _after(self, chunk_at: int, number: int) -> Iterator[tuple[int, RawMessage]]:
        """Yield what comes after a cycle."""
        rest = self._since(chunk_at)
        for _, entry in rest:
            if entry.topic == CYCLE and _number(entry) == number:
                break
        yield from rest

    def _from_keyframe(self, begin_at: int, told: dict[str, Any]) -> Iterator[tuple[int, RawMessage]]:
        """Put the keyframe's state in force and yield what comes after it."""
        rest = self._since(begin_at)
        skipped = self._next - bisect_left(self._index.chunks_at, begin_at)
        for _, entry in rest:
            skipped -= entry.topic == CYCLE
            if entry.topic == KEYFRAME and skipped == 0:
                frame = decode(Keyframe, entry.data)
                left = {name: getattr(frame.left, name) for name in type(frame.left).model_fields}
                self._rerun.go_on(told, left, memory_in(frame))
                break
        yield from rest

    def _take(self, record: CycleRecord, state: State) -> None:
        self._replayed.append(Shown(record, state))

    def _keep(self, chunk_at: int) -> None:
        """Keep the state now and then, for the way back."""
        if self._next % KEPT_EVERY or self._next in self._kept or self._rerun.state is None:
            return
        state = self._rerun.state
        place = _Place(chunk_at, self._rerun.told, carried_state(state), state.perception.snapshot())
        self._kept[self._next] = place
        self._kept_bytes += _size(place)
        while self._kept_bytes > KEPT_BYTES and len(self._kept) > 1:
            self._kept_bytes -= _size(self._kept.popitem(last=False)[1])


def _size(place: _Place) -> int:
    return sum(array.nbytes for array in place.memory.values())


def _number(entry: RawMessage) -> int:
    """Return a cycle's number, which its record begins with: to read all of it takes long."""
    found = NUMBER.match(entry.data)
    return decode(Cycle, entry.data).record.cycle if found is None else int(found[1])
