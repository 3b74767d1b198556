"""The step run again over a recording: the same inputs and the same refinement decisions must give the same records.

Refinement is bounded by a clock in a run and by a count here: it may go on while fewer quanta are done than were.
What differs is told by cycle and field. At every keyframe on the way the whole memory is compared as well.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import orjson

from config.settings import Settings
from perception.pipeline import Perception
from perception.snapshot import Snapshot
from runtime.cycle.step import CycleRecord, State, apply_settings, step
from runtime.recording.channels import CYCLE, KEYFRAME, RUN_INFO, SETTINGS, RawMessage, decode, encode
from runtime.recording.reader import NS_PER_S, Recording, parse_settings
from runtime.recording.schema import (
    CarriedState,
    Cycle,
    Keyframe,
    RunInfo,
    SettingsChange,
    StateFields,
    carried_state,
    perception_snapshot,
    restore_state,
)
from runtime.timing.cycle_stats import CycleStats

OnCycle = Callable[[CycleRecord, State], None]
ABSENT: Final = "nothing"


@dataclass(frozen=True, slots=True)
class Difference:
    """Where a replay and its recording part."""

    cycle: int
    field: str
    recorded: object
    replayed: object

    def __str__(self) -> str:
        return f"cycle {self.cycle}: {self.field} was {self.recorded} and is {self.replayed} now"


@dataclass(slots=True)
class ReplayResult:
    """What a replay found."""

    cycles: int = 0
    """Replayed and compared."""
    differences: int = 0
    first_difference: Difference | None = None
    first_cycle: int | None = None
    """Where the replay began."""
    keyframes: int = 0
    """Compared on the way."""
    skipped: int = 0
    """Cycles that could not be replayed: what went before is missing, and no keyframe had followed yet."""
    missing: list[tuple[int, int]] = field(default_factory=list)
    """First and last cycle of each stretch that is not in the recording."""
    refinement_stops: Counter[str] = field(default_factory=Counter)
    """How often refinement ended for which cause."""
    recorded_s: float = 0.0
    elapsed_s: float = 0.0
    state: State | None = None
    """As it was left."""
    cycle_stats: CycleStats = field(default_factory=lambda: CycleStats(late_after_s=float("inf")))
    """What the steps took."""

    @property
    def times_real_time(self) -> float:
        """How much faster the replay was than the run."""
        return self.recorded_s / self.elapsed_s if self.elapsed_s else 0.0


def fresh_state(settings: Settings) -> State:
    """Return the state in which a run begins."""
    return State(Perception(settings.ring, settings.models, settings.perception))


def replay_cycle(state: State, record: CycleRecord, settings: Settings) -> CycleRecord:
    """Run the step over the inputs of a record, with its refinement decisions."""
    return step(state, record.inputs, settings, lambda _command: None, lambda done: done < record.quanta)


def keyframe_before(recording: Recording, since_s: float) -> int | None:
    """Return the log time of the last keyframe not later than `since_s` after the first cycle, None without one."""
    first_ns, found = None, None
    for entry in recording.messages():
        if entry.topic == CYCLE and first_ns is None:
            first_ns = entry.log_ns
        elif entry.topic == KEYFRAME and first_ns is not None:
            if entry.log_ns - first_ns > since_s * NS_PER_S:
                break
            found = entry.log_ns
    return found


def verify_recording(
    recording: Recording,
    *,
    since_s: float = 0.0,
    until_s: float = float("inf"),
    on_cycle: OnCycle | None = None,
    on_message: Callable[[RawMessage], None] | None = None,
) -> ReplayResult:
    """Run the step over a recording and compare every record with the one in it.

    Parameters
    ----------
    recording : Recording
        Whole or not: over what is missing the next keyframe helps.
    since_s, until_s : float
        The part of it, in seconds after its first cycle; begun at the last keyframe before.
    on_cycle : callable, optional
        Gets each replayed record and the state it left.
    on_message : callable, optional
        Gets every message on the way.
    """
    begin_ns = keyframe_before(recording, since_s) if since_s > 0.0 else None
    run = Replayer(recording, on_cycle, begun=begin_ns is None)
    first_ns = None
    began_s = time.perf_counter()
    for entry in recording.messages():
        if entry.topic == CYCLE:
            first_ns = entry.log_ns if first_ns is None else first_ns
            if entry.log_ns - first_ns > until_s * NS_PER_S:
                break
        if begin_ns is not None and entry.log_ns < begin_ns:
            continue
        if on_message is not None:
            on_message(entry)
        run.take(entry)
    run.result.elapsed_s = time.perf_counter() - began_s
    run.result.state = run.state
    return run.result


class Replayer:
    """A replay under way.

    Parameters
    ----------
    recording : Recording
        Of the messages.
    on_cycle : callable, optional
        Gets each replayed record and the state it left.
    begun : bool
        Whether the first message is the run's; else nothing is replayed before a keyframe or `go_on`.
    """

    def __init__(self, recording: Recording, on_cycle: OnCycle | None, *, begun: bool) -> None:
        self.result = ReplayResult()
        self._settings = recording.settings
        self._told = recording.info.settings
        self.state: State | None = fresh_state(self._settings) if begun else None
        self._on_cycle = on_cycle
        self._last: tuple[int, float] | None = None

    def take(self, entry: RawMessage) -> None:
        """Take the next message."""
        if entry.topic == CYCLE:
            self._cycle(decode(Cycle, entry.data).record, entry.data)
        elif entry.topic == KEYFRAME:
            self._keyframe(decode(Keyframe, entry.data))
        elif entry.topic == SETTINGS:
            self._adopt(decode(SettingsChange, entry.data).settings)
        elif entry.topic == RUN_INFO:  # stands before every keyframe, with what is in force there
            self._adopt(decode(RunInfo, entry.data).settings)

    @property
    def told(self) -> dict[str, Any]:
        """The settings in force, as the recording tells them."""
        return self._told

    def go_on(self, told: dict[str, Any], left: StateFields, memory: Snapshot) -> None:
        """Go on from what a cycle left under these settings: the next message is the one after that cycle's."""
        self._adopt(told)
        self.state = fresh_state(self._settings)
        self.state.perception.restore(memory)
        for name, value in left.items():
            setattr(self.state, name, value)

    def _adopt(self, told: dict[str, Any]) -> None:
        """Go on with other settings, as the process did at this place."""
        if told == self._told:
            return
        self._told, self._settings = told, parse_settings(told)
        if self.state is not None:
            apply_settings(self.state, self._settings)

    def _cycle(self, record: CycleRecord, data: bytes) -> None:
        result, before = self.result, self._last
        if before is not None and record.cycle != before[0] + 1:
            result.missing.append((before[0] + 1, record.cycle - 1))
        self._last = (record.cycle, record.inputs.run_s)
        if self.state is None or record.cycle != self.state.cycle + 1:
            if before is None and self.state is not None:
                result.missing.append((1, record.cycle - 1))
            self.state = None
            result.skipped += 1
            return
        began_s = time.perf_counter()
        replayed = replay_cycle(self.state, record, self._settings)
        result.cycle_stats.add_cycle(time.perf_counter() - began_s)
        result.cycles += 1
        result.refinement_stops[record.refinement] += 1
        if result.first_cycle is None:
            result.first_cycle = record.cycle
        if before is not None:
            result.recorded_s += record.inputs.run_s - before[1]
        written = encode(Cycle.model_construct(record=replayed))
        # What an older program did not write yet is what it is where nobody says anything.
        if written != data and written != (recorded := encode(Cycle.model_construct(record=record))):
            self._note(
                record.cycle, find_difference(orjson.loads(recorded)["record"], orjson.loads(written)["record"])
            )
        if self._on_cycle is not None:
            self._on_cycle(replayed, self.state)

    def _keyframe(self, frame: Keyframe) -> None:
        if self.state is None or self.state.cycle != frame.cycle:
            self.state = fresh_state(self._settings)
            restore_state(self.state, frame)
            return
        self.result.keyframes += 1
        mine = self.state.perception.snapshot()
        for name, array in perception_snapshot(frame).items():
            if name not in mine or array.tobytes() != mine[name].tobytes():
                now = mine.get(name)
                where = "" if now is None else str(np.argwhere(np.atleast_1d(now != array)).tolist()[:1])
                self._note(frame.cycle, (f"memory {name}{where}", "one", "another"))
                return
        told = frame.left.model_fields_set
        left = encode(
            CarriedState.model_construct(**{k: v for k, v in carried_state(self.state).items() if k in told})
        )
        self._note(frame.cycle, find_difference(orjson.loads(encode(frame.left)), orjson.loads(left), "state."))

    def _note(self, cycle: int, found: tuple[str, object, object] | None) -> None:
        if found is None:
            return
        self.result.differences += 1
        if self.result.first_difference is None:
            self.result.first_difference = Difference(cycle, *found)


def find_difference(recorded: Any, replayed: Any, path: str = "") -> tuple[str, object, object] | None:  # noqa: ANN401
    """Return path and values of the first place where two JSON trees differ, to the bit; None where none does."""
    if isinstance(recorded, dict) and isinstance(replayed, dict):
        names = [*recorded, *(name for name in replayed if name not in recorded)]
        pairs = [(name, recorded.get(name, ABSENT), replayed.get(name, ABSENT)) for name in names]
    elif isinstance(recorded, list) and isinstance(replayed, list) and len(recorded) == len(replayed):
        pairs = [(str(i), a, b) for i, (a, b) in enumerate(zip(recorded, replayed, strict=True))]
    else:
        same = type(recorded) is type(replayed) and repr(recorded) == repr(replayed)
        return None if same else (path.rstrip("."), recorded, replayed)
    return next((found for name, a, b in pairs if (found := find_difference(a, b, f"{path}{name}."))), None)
