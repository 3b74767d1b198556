"""Comparison of a run with a replay of its echoes under other settings: objects recognised, places of stops.

The robot's path is the recorded one. Only the results of perception and the commands are computed anew.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from config.settings import Settings
from config.world import WorldConfig
from drivers.messages import Pose
from runtime.cycle.modes import Mode
from runtime.cycle.preparation import fresh_state
from runtime.cycle.step import Command, CycleRecord, State, step
from runtime.cycle.summary import ObjectRow, object_row
from runtime.recording.channels import CYCLE
from runtime.recording.reader import Recording, RecordingError
from runtime.recording.replayer import Replayer
from runtime.simulation.evaluation import DrumRow, match_drums
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.refinement_budget import within_quanta_per_cycle


@dataclass(slots=True)
class RunOutcome:
    """The outcome of a run: what was recognised and where the robot stopped."""

    objects: list[ObjectRow] = field(default_factory=list)
    errors_m: list[float | None] | None = None
    """Error of each drum, None if it was not found; no list if the world is not known."""
    false: int = 0
    """Objects that match no drum."""
    stops: list[tuple[float, str]] = field(default_factory=list)
    """Time in s after the first cycle, and the reason."""


@dataclass(slots=True)
class Comparison:
    """A run with the recorded settings and with others."""

    recorded: RunOutcome = field(default_factory=RunOutcome)
    other: RunOutcome = field(default_factory=RunOutcome)
    cycles: int = 0
    changed_commands: int = 0
    first_change_s: float | None = None
    """Time of the first command that differs, s after the first cycle."""
    refused: list[str] = field(default_factory=list)
    """Keyframes whose state was needed and refused, with the reason."""


def compare_runs(
    recording: Recording, settings: Settings, on_message: Callable[[], None] = lambda: None
) -> Comparison:
    """Replay a recording with its own settings and with others, cycle by cycle, and return both outcomes.

    `on_message` is called after each message, for a progress bar.

    Raises
    ------
    RecordingError
        The other settings are for another ring.
    """
    own, others = len(recording.settings.ring.mounts), len(settings.ring.mounts)
    if others != own:
        raise RecordingError(
            f"{recording.path}: was made with a ring of {own} sensors, and these settings are for one of {others}: "
            f"name settings of the same robot"
        )
    comparison, replayer, other = Comparison(), Replayer(recording), fresh_state(settings)
    first_run_s = None
    for found in replayer:
        on_message()
        if found.refused is not None:
            comparison.refused.append(found.refused)
        if found.recorded is None:
            continue
        inputs = found.recorded.inputs
        first_run_s = inputs.run_s if first_run_s is None else first_run_s
        at_s = inputs.run_s - first_run_s
        changed = step(other, inputs, settings, _ignore, within_quanta_per_cycle)
        comparison.cycles += 1
        _note_stop(comparison.other, changed, at_s)
        if found.replayed is None:
            continue
        _note_stop(comparison.recorded, found.replayed, at_s)
        if found.replayed.command != changed.command:
            comparison.changed_commands += 1
            comparison.first_change_s = at_s if comparison.first_change_s is None else comparison.first_change_s
    if replayer.state is not None:
        _sum_up(comparison.recorded, replayer.state, recording.world)
    _sum_up(comparison.other, other, recording.world)
    return comparison


def run_under(recording: Recording, settings: Settings) -> tuple[RunOutcome, CycleStats]:
    """Replay a recording with other settings only; return the outcome and what its cycles took.

    The settings are of the same robot.
    """
    outcome, state, cycle_stats = RunOutcome(), fresh_state(settings), CycleStats(late_after_s=math.inf)
    first_run_s = None
    for message in recording.messages():
        if message.topic != CYCLE:
            continue
        inputs = recording.decode_cycle(message).inputs
        first_run_s = inputs.run_s if first_run_s is None else first_run_s
        started_s = time.perf_counter()
        record = step(state, inputs, settings, _ignore, within_quanta_per_cycle)
        cycle_stats.add_cycle(time.perf_counter() - started_s)
        _note_stop(outcome, record, inputs.run_s - first_run_s)
    _sum_up(outcome, state, recording.world)
    return outcome, cycle_stats


def _ignore(command: Command) -> None:
    """Send nothing."""


def _note_stop(outcome: RunOutcome, record: CycleRecord, at_s: float) -> None:
    """Add a stop to the outcome if the mode changed to it in this cycle."""
    if record.mode.mode is Mode.SAFE_STOP and record.mode.entered_run_s == record.inputs.run_s:
        outcome.stops.append((at_s, record.mode.reason or ""))


def _sum_up(outcome: RunOutcome, state: State, world: WorldConfig | None) -> None:
    """Write to the outcome the objects at its end and, of a world with drums, their errors."""
    outcome.objects = [object_row(seen) for seen in state.perception.objects()]
    if world is None or not world.drum:
        return
    rows, outcome.false = match_to_world(outcome.objects, world)
    outcome.errors_m = [row["error"] for row in rows]


def match_to_world(objects: Sequence[ObjectRow], world: WorldConfig) -> tuple[list[DrumRow], int]:
    """Match objects in the odometry's frame, which begins at the world's start, with drums; as `match_drums`."""
    start = Pose(world.start.x_m, world.start.y_m, math.radians(world.start.heading_deg))
    places = [start.compose(Pose(seen["x"], seen["y"], seen["theta"])) for seen in objects]
    return match_drums(world, [(p.x, p.y) for p in places])
