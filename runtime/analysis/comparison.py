"""The same echoes with other settings: what would have been seen, and where the robot would have stopped.

The robot's way is as it was recorded; only what the program makes of the echoes, and what it would have commanded,
is new.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from config.settings import Settings
from config.world import WorldConfig
from drivers.messages import Pose
from perception.pipeline import DetectedObject
from runtime.cycle.modes import Mode
from runtime.cycle.step import Command, CycleRecord, State, apply_settings, step
from runtime.cycle.summary import ObjectRow, object_row
from runtime.recording.channels import CYCLE, SETTINGS, RawMessage, decode
from runtime.recording.reader import Recording, RecordingError, parse_settings
from runtime.recording.replayer import fresh_state, replay_cycle
from runtime.recording.schema import Cycle, SettingsChange
from runtime.simulation.evaluation import match_drums
from runtime.timing.refinement_budget import within_quanta_per_cycle


@dataclass(slots=True)
class RunOutcome:
    """One telling of a run."""

    objects: list[ObjectRow] = field(default_factory=list)
    errors_m: list[float | None] | None = None
    """Of each drum, None where it was not seen; no list where the world is not known."""
    false: int = 0
    stops: list[tuple[float, str]] = field(default_factory=list)
    """When, in seconds after the first cycle, and why."""


@dataclass(slots=True)
class Comparison:
    """A run as it was, and as it would have been."""

    was: RunOutcome = field(default_factory=RunOutcome)
    would_be: RunOutcome = field(default_factory=RunOutcome)
    cycles: int = 0
    other_commands: int = 0
    first_other_s: float | None = None


def compare_runs(
    recording: Recording, settings: Settings, on_message: Callable[[RawMessage], None] | None = None
) -> Comparison:
    """Run the step over a recording with its own settings and with others, side by side.

    Raises
    ------
    RecordingError
        The other settings are of another ring.
    """
    mine, others = recording.settings, len(settings.ring.mounts)
    if others != len(mine.ring.mounts):
        raise RecordingError(
            f"{recording.path}: was made with a ring of {len(mine.ring.mounts)} sensors, and these settings are of "
            f"one of {others}: name settings of the same robot"
        )
    told, was, would_be = Comparison(), fresh_state(mine), fresh_state(settings)
    begun_s = None
    for entry in recording.messages():
        if on_message is not None:
            on_message(entry)
        if entry.topic == SETTINGS:
            mine = parse_settings(decode(SettingsChange, entry.data).settings)
            apply_settings(was, mine)
        if entry.topic != CYCLE:
            continue
        record = decode(Cycle, entry.data).record
        begun_s = record.inputs.run_s if begun_s is None else begun_s
        at_s = record.inputs.run_s - begun_s
        first = replay_cycle(was, record, mine)
        second = step(would_be, record.inputs, settings, _ignore, within_quanta_per_cycle)
        told.cycles += 1
        _note_stop(told.was, first, at_s)
        _note_stop(told.would_be, second, at_s)
        if first.command != second.command:
            told.other_commands += 1
            told.first_other_s = at_s if told.first_other_s is None else told.first_other_s
    _sum_up(told.was, was, recording.world)
    _sum_up(told.would_be, would_be, recording.world)
    return told


def _ignore(command: Command) -> None:
    """Carry nothing out."""


def _note_stop(story: RunOutcome, record: CycleRecord, at_s: float) -> None:
    if record.mode.mode is Mode.SAFE_STOP and record.mode.entered_run_s == record.inputs.run_s:
        story.stops.append((at_s, record.mode.reason or ""))


def _sum_up(story: RunOutcome, state: State, world: WorldConfig | None) -> None:
    seen: tuple[DetectedObject, ...] = state.perception.objects()
    story.objects = [object_row(one) for one in seen]
    if world is None or not world.drum:
        return
    start = Pose(world.start.x_m, world.start.y_m, math.radians(world.start.heading_deg))
    places = [start.compose(Pose(one.x, one.y, one.theta)) for one in seen]
    rows, story.false = match_drums(world, [(p.x, p.y) for p in places])
    story.errors_m = [row["error"] for row in rows]
