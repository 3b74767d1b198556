"""The replayer: an iterator over a recording that runs the step again on the recorded inputs.

The same inputs and the same refinement decisions give the same records, bit for bit. A run limits
refinement by a clock, a replay by a count: it continues until as many quanta are done as in the run. Verification,
comparison, the timeline and the console's playback all consume this iterator.
"""

from __future__ import annotations

import contextlib
import re
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from pydantic import ValidationError

from config.reload import MAP, differences
from config.settings import Settings
from perception.snapshot import Snapshot, bounds_of
from runtime.cycle.preparation import fresh_state
from runtime.cycle.step import CycleRecord, State, apply_settings, step
from runtime.recording import channels
from runtime.recording.channels import CYCLE, KEYFRAME, RUN_INFO, SETTINGS, RawMessage, decode
from runtime.recording.reader import Recording, RecordingError, cycle_head, first_error, parse_settings
from runtime.recording.schema import (
    Keyframe,
    RunInfo,
    SettingsChange,
    StateFields,
    carried_state,
    perception_snapshot,
    state_fields,
)
from runtime.recording.snapshot_bounds import check_snapshot

KEYFRAME_HEAD: Final = re.compile(rb'\{"run_s":[^,]+,"cycle":(\d{1,15}),')
"""The start of a keyframe's message, with its cycle's number."""
GAP_MAX_S: Final = 3.0
"""Longest time between two cycles, s of the run, that a replay shown at a speed waits for. A cycle takes 1 s at most
(`config.settings.CycleConfig.rate_hz`), so a longer one is a gap in the recording, of any length."""


class KeyframeError(RecordingError):
    """A state cannot be taken over from a keyframe; the rest of the recording can be replayed without it."""


class KeyframePosition(NamedTuple):
    """Where a keyframe is in a file."""

    cycle: int
    """The cycle that left its state."""
    chunk_offset: int
    settings: dict[str, Any]
    """The settings in force."""


@dataclass(frozen=True, slots=True, eq=False)
class Checkpoint:
    """The whole state of a replay after a cycle, from which another replay can continue."""

    cycle: int
    chunk_offset: int
    """Where the chunk with that cycle starts in the file."""
    settings: dict[str, Any]
    """The settings in force."""
    state: StateFields
    snapshot: Snapshot

    @property
    def nbytes(self) -> int:
        """Size of perception's arrays, bytes."""
        return sum(array.nbytes for array in self.snapshot.values())


class ReplayStep(NamedTuple):
    """One message of a recording, after it has taken effect."""

    message: RawMessage
    recorded: CycleRecord | None = None
    """If the message is a cycle: its record in the recording."""
    replayed: CycleRecord | None = None
    """If the message is a cycle: its record now. None if the state before it is unknown, or if it is skimmed."""
    elapsed_s: float = 0.0
    """What the replayed step took."""
    keyframe: Keyframe | None = None
    """If the message is a keyframe of the state that the replay has reached: that keyframe, to compare."""
    skimmed: bool = False
    """Whether the message is a cycle that was only read, as was asked for."""
    refused: str | None = None
    """If the message is a keyframe whose state cannot be taken over: which one, and why."""


def _recognises(arrays: Iterable[str]) -> bool:
    """Return whether perception recognised when these arrays, by their names, were its state."""
    return any(name.startswith("method.") for name in arrays)


def adopt(frame: Keyframe, settings: Settings) -> State:
    """Return the state in a keyframe, after every number in it was checked: compiled kernels check none.

    Raises
    ------
    ValueError, ArithmeticError, LookupError
        It is of other settings, a number in it is out of its bound, or its objects cannot be listed.
    """
    state = fresh_state(settings, recognises=_recognises(array.name for array in frame.arrays))
    perception = state.perception
    fresh = perception.snapshot()
    snapshot = perception_snapshot(frame, fresh)
    check_snapshot(snapshot, fresh, bounds_of(perception))
    restore(state, state_fields(frame), snapshot)
    perception.labelled_objects()
    perception.archived_objects()
    perception.polylines()
    return state


def restore(state: State, fields: StateFields, snapshot: Snapshot) -> None:
    """Give a fresh state another content."""
    state.perception.restore(snapshot)
    for name, value in fields.items():
        setattr(state, name, value)


def replay_cycle(state: State, record: CycleRecord, settings: Settings) -> CycleRecord:
    """Run the step over the inputs of a record, with its refinement decisions, and return the new record.

    `state`, which the cycle before has left, is updated. `settings` were in force in the recorded cycle.
    """
    return step(state, record.inputs, settings, lambda _command: None, lambda done: done < record.quanta)


class Replayer:
    """An iterator over a recording's messages that runs the step at every cycle.

    Cycles that follow a gap are skipped until the next keyframe, whose state is then taken over unless it is refused.

    Parameters
    ----------
    recording : Recording
        Open as long as the iterator is used.
    start : KeyframePosition or Checkpoint, optional
        Start after this cycle, not at the beginning of the file. The whole file must have been read once before.
    skimmed : range
        Cycles that are read without being replayed, between two keyframes: among them the state is known at keyframes
        only. So a long recording is read in a small part of the time.

    Raises
    ------
    KeyframeError
        There is no such keyframe as `start`, or its state is refused.
    """

    def __init__(
        self, recording: Recording, start: KeyframePosition | Checkpoint | None = None, skimmed: range = range(0)
    ) -> None:
        self._recording = recording
        self._skimmed = skimmed
        self._settings = recording.settings
        self.settings_data = recording.info.settings
        """The settings in force, as the recording holds them. A new object with every change."""
        self.state: State | None = None
        """As the last cycle left it; None in a gap."""
        self._chunk_offset = 0
        """Where the chunk of the last message starts in the file."""
        if start is None:
            self.state = fresh_state(self._settings)
            self._messages = self._since(None)
        elif isinstance(start, Checkpoint):
            self._apply_settings(start.settings)
            self.state = fresh_state(self._settings, recognises=_recognises(start.snapshot))
            restore(self.state, start.state, start.snapshot)
            self._messages = self._after_cycle(start)
        else:
            self._apply_settings(start.settings)
            self._messages = self._after_keyframe(start)

    def __iter__(self) -> Iterator[ReplayStep]:
        return self

    def __next__(self) -> ReplayStep:
        """Return the next message once it has taken effect on the state, or on the settings in force."""
        message = next(self._messages)
        match message.topic:
            case channels.CYCLE:
                return self._cycle(message)
            case channels.KEYFRAME:
                return self._keyframe(message)
            case channels.SETTINGS:
                self._apply_settings(decode(SettingsChange, message.data).settings)
            case channels.RUN_INFO:  # written before every keyframe, with the settings in force there
                self._apply_settings(decode(RunInfo, message.data).settings)
        return ReplayStep(message)

    def checkpoint(self) -> Checkpoint | None:
        """Return the state after the last cycle; None in a gap."""
        state = self.state
        if state is None:
            return None
        snapshot = state.perception.snapshot()
        return Checkpoint(state.cycle, self._chunk_offset, self.settings_data, carried_state(state), snapshot)

    def _since(self, chunk_offset: int | None) -> Iterator[RawMessage]:
        """Yield the messages from a chunk on; `_chunk_offset` follows them."""
        for offset, chunk in self._recording.chunks(chunk_offset):
            self._chunk_offset = offset
            yield from chunk

    def _after_cycle(self, start: Checkpoint) -> Iterator[RawMessage]:
        """Yield the messages after the cycle of a checkpoint."""
        messages = self._since(start.chunk_offset)
        for message in messages:
            if message.topic == CYCLE and cycle_head(message)[0] == start.cycle:
                break
        yield from messages

    def _after_keyframe(self, start: KeyframePosition) -> Iterator[RawMessage]:
        """Take over the state of a keyframe, and return the messages after it.

        Raises
        ------
        KeyframeError
            It is not there, or its state is refused.
        """
        messages = self._since(start.chunk_offset)
        for message in messages:
            if message.topic == KEYFRAME and keyframe_cycle(message) == start.cycle:
                refused = self._keyframe(message).refused
                if refused is not None:
                    raise KeyframeError(refused)
                return messages
        raise KeyframeError(f"the keyframe of cycle {start.cycle} cannot be read")

    def _apply_settings(self, data: dict[str, Any]) -> None:
        """Put other settings in force, as the run did at this point.

        Raises
        ------
        RecordingError
            They are not those that a run may change.
        """
        if data == self.settings_data:
            return
        settings = parse_settings(data)
        # An emulator's port is known only after the start. It has no effect on a replay.
        changed = (d for d in differences(self._settings, settings) if not d.path.startswith("link."))
        fixed = next((d for d in changed if not (d.live or d.is_of(MAP))), None)
        if fixed is not None:
            raise RecordingError(
                f"{self._recording.path}: the settings change during the run, which no run can: {fixed}"
            )
        self.settings_data, self._settings = data, settings
        if self.state is not None:
            with self._refusing(self.state.cycle + 1):
                apply_settings(self.state, self._settings)

    def _cycle(self, message: RawMessage) -> ReplayStep:
        """Run a cycle on the recorded inputs. In a gap, or where it is only skimmed, the state is not known then.

        Raises
        ------
        RecordingError
            The cycle cannot be computed.
        """
        record = self._recording.decode_cycle(message)
        if record.cycle in self._skimmed:
            self.state = None
            return ReplayStep(message, record, skimmed=True)
        if self.state is None or record.cycle != self.state.cycle + 1:
            self.state = None
            return ReplayStep(message, record)
        started_s = time.perf_counter()
        with self._refusing(record.cycle):
            replayed = replay_cycle(self.state, record, self._settings)
        return ReplayStep(message, record, replayed, time.perf_counter() - started_s)

    @contextlib.contextmanager
    def _refusing(self, cycle: int) -> Iterator[None]:
        """Refuse the recording where a cycle's computation fails.

        Raises
        ------
        RecordingError
            It fails.
        """
        try:
            yield
        except (ArithmeticError, LookupError, ValueError) as error:
            raise RecordingError(
                f"{self._recording.path}: cycle {cycle} cannot be replayed: its inputs or the state before it "
                f"are impossible ({type(error).__name__}: {error})"
            ) from error

    def _keyframe(self, message: RawMessage) -> ReplayStep:
        """Return a keyframe to compare if the state is known there; else adopt its state, unless that is refused."""
        cycle = keyframe_cycle(message)
        try:
            frame = decode(Keyframe, message.data)
            if self.state is not None and self.state.cycle == frame.cycle:
                return ReplayStep(message, keyframe=frame)
            self.state = adopt(frame, self._settings)
        except (ArithmeticError, LookupError, ValueError) as error:
            why = first_error(error) if isinstance(error, ValidationError) else error
            which = "a keyframe" if cycle is None else f"the keyframe of cycle {cycle}"
            return ReplayStep(message, refused=f"{which} is refused: {why}")
        return ReplayStep(message)


def replay_from(
    recording: Recording,
    starts: Iterable[KeyframePosition | Checkpoint],
    on_refused: Callable[[KeyframePosition | Checkpoint, KeyframeError], None],
) -> Replayer:
    """Return a replayer from the first of some starts that is not refused, else from the beginning of the file.

    `starts` come best first; `on_refused` gets each that is refused, and why. The file has been read once before.
    """
    for start in starts:
        try:
            return Replayer(recording, start)
        except KeyframeError as error:
            on_refused(start, error)
    return Replayer(recording)


def keyframe_cycle(message: RawMessage) -> int | None:
    """Return the cycle of a keyframe's message without decoding all of it; None if it cannot be decoded."""
    found = KEYFRAME_HEAD.match(message.data)
    if found is not None:
        return int(found[1])
    with contextlib.suppress(ValidationError):
        return decode(Keyframe, message.data).cycle
    return None


class KeyframeFinder:
    """Collects the positions of keyframes from a recording's messages."""

    def __init__(self, recording: Recording) -> None:
        self._settings = recording.info.settings
        self._info = b""

    def find(self, chunk_offset: int, message: RawMessage) -> KeyframePosition | None:
        """Return the position of a keyframe if the message is a valid one; give every message, in file order.

        `chunk_offset` is where the chunk of the message starts in the file.
        """
        if message.topic == KEYFRAME:
            cycle = keyframe_cycle(message)
            return None if cycle is None else KeyframePosition(cycle, chunk_offset, self._settings)
        if message.topic == SETTINGS:
            self._settings = decode(SettingsChange, message.data).settings
        elif message.topic == RUN_INFO and message.data != self._info:
            self._info = message.data
            self._settings = decode(RunInfo, message.data).settings
        return None
