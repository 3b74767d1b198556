"""Moments of a run: its state, which a test may change, and the cycles that follow, which are replayed from there."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from config.settings import Settings
from perception.bayes.bayes_method import BayesPerception
from perception.bounds import Bound
from perception.pipeline import Perception
from perception.snapshot import Snapshot, bounds_of, numbers_of
from runtime.cycle.preparation import fresh_state
from runtime.cycle.step import CycleRecord
from runtime.recording.reader import open_recording, parse_settings
from runtime.recording.replayer import Replayer, replay_cycle
from runtime.recording.schema import StateFields, carried_state

FOLLOWING = 7
"""Cycles that are replayed from a poisoned state."""
POISONED_CYCLE = 314
"""Objects, pins, placements and a rejection exist by then; an edit follows 6 cycles later."""
OUT_OF_BOUNDS = "index is out of bounds"
"""What a compiled kernel raises where bounds are checked; numpy's own text goes on."""


class Moment(NamedTuple):
    """A state of a run, and the cycles that follow it."""

    cycle: int
    settings: Settings
    fields: StateFields
    snapshot: Snapshot
    following: list[CycleRecord]

    def perception(self) -> Perception:
        """Return perception as a run with these settings starts."""
        return fresh_state(self.settings).perception

    def bounds(self) -> dict[str, Bound]:
        """Return the bounds of its state."""
        return bounds_of(self.perception())


def moments_of(path: Path) -> Iterator[Moment]:
    """Yield a run's state after `POISONED_CYCLE`, and before it one for each stage of a job on polygons."""
    with open_recording(path) as recording:
        records = [record for record in recording.cycle_records() if record.cycle < 345]
        replayer, stages = Replayer(recording), set[tuple[int, int]]()
        for step in replayer:
            state = replayer.state
            if step.replayed is None or state is None or step.replayed.cycle > POISONED_CYCLE:
                continue
            at, snapshot = step.replayed.cycle, state.perception.snapshot()
            job = snapshot["method.memory.state"]["job"][0] if "method.memory.state" in snapshot else None
            stage = (0, 0) if job is None else (int(job["kind"]), int(job["stage"]))
            if at == POISONED_CYCLE or (stage[0] and stage not in stages):
                stages.add(stage)
                settings = parse_settings(replayer.settings_data)
                yield Moment(at, settings, carried_state(state), snapshot, records[at : at + FOLLOWING])


def ends_in_error(moment: Moment, snapshot: Snapshot, scratch: float | None = None) -> bool:
    """Restore a state, its scratch full of a number, and replay what follows; return whether that is refused."""
    state = fresh_state(moment.settings)
    try:
        state.perception.restore(snapshot)
        if scratch is not None:
            fill_scratch(state.perception, scratch)
        for name, value in moment.fields.items():
            setattr(state, name, value)
        state.perception.labelled_objects()
        for record in moment.following:
            replay_cycle(state, record, moment.settings)
            state.perception.labelled_objects()
            state.perception.segments()
    except (ArithmeticError, LookupError, ValueError) as error:
        if str(error) == OUT_OF_BOUNDS:
            raise
        return True
    return False


def fill_scratch(perception: Perception, number: float) -> None:
    """Write a number into all scratch of the Bayesian method, −1 where it does not fit; the paper's has none here."""
    if isinstance(perception.method, BayesPerception):
        for name, values in numbers_of({"scratch": perception.method.memory.state["scratch"]}):
            if name != "scratch.attracting_rows":  # written once
                values[...] = number if values.dtype.kind == "f" or isinstance(number, int) else -1


def changed(moment: Moment, array: str, *changes: tuple[str, float]) -> Snapshot:
    """Return a copy of a moment's state with other values of fields; "" stands for the array itself."""
    snapshot = {name: values.copy() for name, values in moment.snapshot.items()}
    for fields, value in changes:
        at: Any = snapshot[array]
        for field in filter(None, fields.split(".")):
            at = at[field]
        at[...] = value
    return snapshot
