"""Verification of a recording: every replayed cycle, and every state at a keyframe, must equal the recorded one."""

from __future__ import annotations

import itertools
import math
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import orjson

from runtime.cycle.step import CycleRecord, State
from runtime.recording.channels import CYCLE, encode
from runtime.recording.reader import Recording, cycle_head
from runtime.recording.replayer import KeyframeFinder, KeyframePosition, Replayer, ReplayStep, replay_from
from runtime.recording.schema import (
    CarriedState,
    Cycle,
    Keyframe,
    carried_state,
    layout_difference,
    perception_snapshot,
)
from runtime.timing.cycle_stats import CycleStats

GAPS_MAX: Final = 1000
"""Gaps that are listed, and refused keyframes."""
ABSENT: Final = "nothing"
OnStep = Callable[[ReplayStep, Replayer], None]


@dataclass(frozen=True, slots=True)
class Difference:
    """A place where replay and recording differ."""

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
    """The first cycle that was replayed."""
    keyframes: int = 0
    """Compared with the replayed state."""
    skipped: int = 0
    """Cycles not replayed: something before them is missing, and no keyframe has followed yet."""
    missing: list[tuple[int, int]] = field(default_factory=list)
    """First and last cycle of each gap in the recording, of the first `GAPS_MAX`."""
    refused: list[str] = field(default_factory=list)
    """Keyframes whose state was needed and refused, with the reason, of the first `GAPS_MAX`."""
    refinement_stops: Counter[str] = field(default_factory=Counter)
    """How often refinement ended for which cause."""
    recorded_s: float = 0.0
    """Time of the run that was replayed, by the run's clock."""
    elapsed_s: float = 0.0
    """What the replay took."""
    state: State | None = None
    """At the end of the replay."""
    cycle_stats: CycleStats = field(default_factory=lambda: CycleStats(late_after_s=float("inf")))
    """What the steps took."""

    def add_gap(self, first: int, last: int) -> None:
        """Note a gap from one cycle to another; a small file can have millions of them."""
        if len(self.missing) < GAPS_MAX:
            self.missing.append((first, last))

    def add_refused(self, text: str) -> None:
        """Note a keyframe that was refused; it may be met at the start and again on the way."""
        if len(self.refused) < GAPS_MAX and text not in self.refused:
            self.refused.append(text)

    @property
    def times_real_time(self) -> float:
        """How much faster the replay was than the run."""
        return self.recorded_s / self.elapsed_s if self.elapsed_s else 0.0


def verify_recording(
    recording: Recording, *, since_s: float = 0.0, until_s: float = float("inf"), on_step: OnStep | None = None
) -> ReplayResult:
    """Replay a recording, compare every cycle and keyframe with it, and return what was found.

    Parameters
    ----------
    recording : Recording
        May be damaged: after a gap the replay continues at the next keyframe.
    since_s, until_s : float
        Which part to replay, in s of the run's clock after the first cycle; it starts at the last keyframe
        before whose state is not refused, else at the beginning.
    on_step : callable, optional
        Called with every step and the replayer.
    """
    starts, first_run_s = _keyframes_before(recording, since_s)
    verifier = Verifier()
    replayer = replay_from(recording, reversed(starts), lambda _, error: verifier.result.add_refused(str(error)))
    started_s = time.perf_counter()
    for found in replayer:
        if found.recorded is not None and found.recorded.inputs.run_s - first_run_s > until_s:
            break
        verifier.check(found, replayer)
        if on_step is not None:
            on_step(found, replayer)
    verifier.result.elapsed_s = time.perf_counter() - started_s
    verifier.result.state = replayer.state
    return verifier.result


def _keyframes_before(recording: Recording, since_s: float) -> tuple[list[KeyframePosition], float]:
    """Return the keyframes up to `since_s` after the first cycle, in file order, and the time of that cycle, s."""
    first_run_s, starts, finder = math.inf, list[KeyframePosition](), KeyframeFinder(recording)
    is_before = True
    for offset, chunk in recording.chunks():
        for message in chunk:
            frame = finder.find(offset, message)
            if message.topic == CYCLE:
                _, run_s = cycle_head(message)
                first_run_s = min(first_run_s, run_s)
                is_before = run_s - first_run_s <= since_s
                if not since_s:
                    return [], first_run_s
            elif frame is not None and is_before and first_run_s < math.inf:
                starts.append(frame)
    return starts, first_run_s


def refused_lines(refused: Sequence[str]) -> list[str]:
    """Return what to tell the user about refused keyframes: one line at most."""
    others = f", and {len(refused) - 1} more" if len(refused) > 1 else ""
    return [f"{refused[0]}{others}; the replay goes on from an earlier or a later state" for _ in refused[:1]]


class Verifier:
    """Compares the steps of a replay with the recording."""

    def __init__(self) -> None:
        self.result = ReplayResult()
        """What was found so far."""
        self._last: CycleRecord | None = None

    def check(self, found: ReplayStep, replayer: Replayer) -> None:
        """Compare a step with the recording; `replayer` has just given it."""
        if found.recorded is not None:
            self._check_cycle(found, found.recorded)
        elif found.keyframe is not None and replayer.state is not None:
            self.result.keyframes += 1
            difference = _keyframe_difference(found.keyframe, replayer.state)
            self._count(found.keyframe.cycle, difference)
        elif found.refused is not None:
            self.result.add_refused(found.refused)

    def _check_cycle(self, found: ReplayStep, recorded: CycleRecord) -> None:
        """Count a cycle as compared, skimmed or skipped, and compare its replay with its recorded bytes."""
        result, last, self._last = self.result, self._last, recorded
        if last is not None and recorded.cycle != last.cycle + 1:
            result.add_gap(last.cycle + 1, recorded.cycle - 1)
        if found.skimmed:
            result.cycles += 1
            result.refinement_stops[recorded.refinement] += 1
            return
        if found.replayed is None:
            if last is None:
                result.add_gap(1, recorded.cycle - 1)
            result.skipped += 1
            return
        result.cycle_stats.add_cycle(found.elapsed_s)
        result.cycles += 1
        result.refinement_stops[recorded.refinement] += 1
        if result.first_cycle is None:
            result.first_cycle = recorded.cycle
        if last is not None:
            result.recorded_s += recorded.inputs.run_s - last.inputs.run_s
        replayed = encode(Cycle.model_construct(record=found.replayed))
        if replayed != found.message.data:
            before, now = orjson.loads(found.message.data)["record"], orjson.loads(replayed)["record"]
            # Read back, the record has its fields' defaults as well: a version that knew fewer fields recorded fewer.
            known = orjson.loads(encode(Cycle.model_construct(record=recorded)))["record"]
            self._count(recorded.cycle, find_difference(before, without_later(now, before, known)))

    def _count(self, cycle: int, difference: tuple[str, object, object] | None) -> None:
        """Count a difference, if there is one, and keep the first."""
        if difference is None:
            return
        self.result.differences += 1
        if self.result.first_difference is None:
            self.result.first_difference = Difference(cycle, *difference)


def _keyframe_difference(frame: Keyframe, state: State) -> tuple[str, object, object] | None:
    """Return where a keyframe differs from a state, and both values; None if they are equal."""
    arrays = state.perception.snapshot()
    if (layout := layout_difference(frame, arrays)) is not None:
        return f"perception {layout}", "one layout", "another"
    try:
        recorded = perception_snapshot(frame, arrays)
    except ValueError as error:
        return "perception", f"damaged ({error})", "whole"
    for name, array in recorded.items():
        if array.tobytes() != arrays[name].tobytes():
            where = str(np.argwhere(np.atleast_1d(arrays[name] != array)).tolist()[:1])
            return f"perception {name}{where}", "one value", "another"
    known = {name: value for name, value in carried_state(state).items() if name in frame.state.model_fields_set}
    replayed = encode(CarriedState.model_construct(**known))
    return find_difference(orjson.loads(encode(frame.state)), orjson.loads(replayed), "state.")


def without_later(replayed: object, recorded: object, known: object) -> object:
    """Return a replayed JSON tree without the fields that the version which recorded it did not know.

    `known` is the recorded tree as this version reads it, in which every field that was not recorded has its default.
    """
    if isinstance(replayed, dict) and isinstance(recorded, dict) and isinstance(known, dict):
        kept = ((name, value) for name, value in replayed.items() if name in recorded or name not in known)
        return {name: without_later(value, recorded.get(name), known.get(name)) for name, value in kept}
    if isinstance(replayed, list) and isinstance(recorded, list) and isinstance(known, list):
        pairs = itertools.zip_longest(replayed, recorded, known)
        return [without_later(*pair) for pair in itertools.islice(pairs, len(replayed))]
    return replayed


def find_difference(recorded: object, replayed: object, path: str = "") -> tuple[str, object, object] | None:
    """Return the first place where two JSON trees differ in any bit, and both values; None if they are equal.

    The place is given by dotted names from the root, after the prefix `path`.
    """
    if isinstance(recorded, dict) and isinstance(replayed, dict):
        names = [*recorded, *(name for name in replayed if name not in recorded)]
        pairs = [(name, recorded.get(name, ABSENT), replayed.get(name, ABSENT)) for name in names]
    elif isinstance(recorded, list) and isinstance(replayed, list) and len(recorded) == len(replayed):
        pairs = [(str(i), a, b) for i, (a, b) in enumerate(zip(recorded, replayed, strict=True))]
    else:
        is_same = type(recorded) is type(replayed) and repr(recorded) == repr(replayed)
        return None if is_same else (path.rstrip("."), recorded, replayed)
    return next((found for name, a, b in pairs if (found := find_difference(a, b, f"{path}{name}."))), None)
