"""Timelines from recordings, by a replay, and from ring logs, by running perception over them."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from config.errors import WRONG_CALL, UserError
from config.load import load_settings, load_world
from config.settings import Settings
from drivers.messages import Flags, Odometry, Twist
from drivers.registry import make_driver
from runtime.analysis.timeline import BookmarkEntry, LogEntry, ModeEntry, Timeline
from runtime.analysis.timeline_builder import FIRST_INTERVAL_S, TimelineBuilder
from runtime.cycle.step import CycleRecord, State
from runtime.recording.channels import (
    BOOKMARK,
    BOOKMARK_WITHDRAWN,
    KEYFRAME,
    LOG,
    SERIAL,
    SUMMARY,
    RawMessage,
    decode,
)
from runtime.recording.conventions.options import AUTO, RingLogOptions
from runtime.recording.conventions.reading import open_ring_log
from runtime.recording.reader import Recording, RecordingError, is_recording, open_recording
from runtime.recording.replayer import KeyframeError, Replayer, ReplayStep, keyframe_cycle
from runtime.recording.ring_log_replay import FiringReplayer
from runtime.recording.schema import Bookmark, LogLine, RunEnd, SerialBytes
from runtime.recording.verification import Verifier, refused_lines

Progress = Callable[[], None]
UNKNOWN_TWIST: Final = Twist(math.nan, math.nan)
LOG_LINES_MAX: Final = 1000
"""Log lines kept."""
SKIMMED_KEYFRAMES_MIN: Final = 12
"""A recording with fewer keyframes is replayed whole: they would be too few for a history of the run."""
SKIMMED_INTERVAL_S: Final = 2.0
"""Time between two snapshots before the first keyframe and after the last one, of a recording that is skimmed."""


@dataclass(frozen=True, slots=True)
class TimelineSource:
    """A file, and what a ring log does not contain."""

    file: str
    sets: Sequence[str] = ()
    """Overridden settings."""
    robot: str | None = None
    models: Sequence[str] = ()
    world: str | None = None
    """The true world, instead of the one in a recording; the start of a log is then at the world's start."""
    log: RingLogOptions = AUTO
    """The conventions of a ring log."""

    @property
    def inputs(self) -> tuple[str | None, ...]:
        """The file and those that it is read with, as the user named them."""
        return (self.file, self.robot, self.world, *self.models)


def load_timeline(
    source: TimelineSource,
    prepare: Callable[[Settings], None],
    on_step: Progress = lambda: None,
    *,
    skim: bool = False,
) -> Timeline:
    """Return the timeline of a recording or a ring log.

    `prepare` is called with the settings before perception starts: it compiles kernels. `on_step` is called after
    each message or firing, for a progress bar. `skim`: what perception knew is taken from the keyframes of a long
    recording, and only what follows the last one is replayed; what lies between them is read, but neither perceived
    nor compared again.

    Raises
    ------
    UserError
        The file cannot be read, or holds nothing to show.
    """
    path = Path(source.file)
    if not is_recording(path):
        return _of_ring_log(path, source, prepare, on_step)
    if source.sets or source.robot is not None or source.models:
        raise UserError(
            f"{path}: is a recording and contains its settings; --set, --robot and --model are for ring logs",
            WRONG_CALL,
        )
    source.log.refuse_for(source.file)
    with open_recording(path) as recording:
        prepare(recording.settings)
        skimmed = between_keyframes(recording) if skim else range(0)
        with contextlib.suppress(*((RecordingError,) if skimmed else ())):
            return _of_recording(recording, source, on_step, skimmed)
        # A keyframe is damaged or of another version; the cycles may all be there.
        return _of_recording(recording, source, on_step)


def between_keyframes(recording: Recording) -> range:
    """Return the cycles between the first and the last keyframe; none of a recording that has only few keyframes."""
    found = (keyframe_cycle(message) for message in recording.messages() if message.topic == KEYFRAME)
    cycles = [cycle for cycle in found if cycle is not None]
    return range(min(cycles) + 1, max(cycles) + 1) if len(cycles) >= SKIMMED_KEYFRAMES_MIN else range(0)


def _of_recording(
    recording: Recording, source: TimelineSource, on_step: Progress, skimmed: range = range(0)
) -> Timeline:
    """Return the timeline of a recording; cycles of `skimmed` are not replayed.

    Raises
    ------
    RecordingError
        It has no cycle that can be replayed.
    KeyframeError
        A keyframe is refused, and cycles were to be skimmed.
    """
    world = recording.world if source.world is None else load_world(source.world)
    info = recording.info
    timeline = Timeline(recording.path, recording.settings, world, versions=info.versions, started=info.started)
    interval_s = SKIMMED_INTERVAL_S if skimmed else FIRST_INTERVAL_S
    collector, verifier = _Collector(timeline, interval_s), Verifier()
    replayer = Replayer(recording, skimmed=skimmed)
    for found in replayer:
        if skimmed and found.refused is not None:
            raise KeyframeError(found.refused)
        verifier.check(found, replayer)
        collector.add(found, replayer.state)
        on_step()
    result = verifier.result
    if result.cycles == 0:
        raise RecordingError(f"{recording.path}: holds no cycle, or none that can be replayed: nothing to show")
    collector.finish()
    timeline.cycles, timeline.refinement_stops = result.cycles, dict(result.refinement_stops)
    timeline.notes += [f"cycles {first} to {last} are missing" for first, last in result.missing]
    timeline.notes += refused_lines(result.refused)
    timeline.notes += [str(region) for region in recording.corrupt_regions]
    if result.first_difference is not None:
        timeline.notes.append(f"the replay differs from the run, first in {result.first_difference}")
    return timeline


class _Collector:
    """Fills a timeline from the steps of a replay; cycles that are skimmed have no state, but the keyframes do."""

    def __init__(self, timeline: Timeline, interval_s: float) -> None:
        self._timeline = timeline
        self._builder = TimelineBuilder(timeline, interval_s)
        self._driver = make_driver(timeline.settings)
        """Counts frames: the record of a cycle has what was in them."""
        self._driver.line_opened(0.0)
        self._has_bytes = False
        """Whether the recording has bytes of the line."""
        self._first_run_s: float | None = None
        """Run's time of the first cycle; None before."""
        self._last_run_s = 0.0
        """Of the last cycle."""
        self._state: State | None = None
        """After the last cycle whose state is known."""
        self._log: list[LogLine] = []
        """Lines of the log; added at the end, when the time of the first cycle is known."""

    def add(self, found: ReplayStep, state: State | None) -> None:
        """Add one step of the replay, and the state it left."""
        message = found.message
        if found.replayed is not None and state is not None:
            self._add_cycle(found.replayed, message.log_ns, state.odometry)
            self._end_cycle(state)
        elif found.skimmed and found.recorded is not None:
            self._add_cycle(found.recorded, message.log_ns, found.recorded.inputs.received.odometry)
        elif message.topic == KEYFRAME and found.keyframe is None and state is not None:
            self._end_cycle(state)  # the state after the last cycle, which was skimmed
        elif message.topic == SERIAL["in"]:
            self._add_bytes(message)
        elif message.topic == LOG and len(self._log) < LOG_LINES_MAX:
            self._log.append(decode(LogLine, message.data))
        elif message.topic == BOOKMARK:
            mark = decode(Bookmark, message.data)
            t_s = 0.0 if self._first_run_s is None else max(0.0, mark.run_s - self._first_run_s)
            self._timeline.bookmarks.append(BookmarkEntry(t_s, mark.text, self._builder.pose))
        elif message.topic == BOOKMARK_WITHDRAWN:
            del self._timeline.bookmarks[-1:]
        elif message.topic == SUMMARY:
            self._timeline.summary = decode(RunEnd, message.data).summary

    def _add_bytes(self, message: RawMessage) -> None:
        """Let a driver receive the bytes of the line, for its counts."""
        self._has_bytes = True
        for run_s, data in decode(SerialBytes, message.data).pieces():
            self._driver.receive(data, run_s)
        self._driver.take_received()

    def _add_cycle(self, record: CycleRecord, log_ns: int, odometry: Odometry | None) -> None:
        """Add what a cycle received, its mode, and the time since the one before."""
        timeline, builder, run_s = self._timeline, self._builder, record.inputs.run_s
        if self._first_run_s is None:
            self._first_run_s = run_s
        else:
            timeline.cycle_gaps_s.append(run_s - self._last_run_s)
        t_s, self._last_run_s = run_s - self._first_run_s, run_s
        timeline.cycle_unix.append((t_s, log_ns))
        if record.inputs.received.rebooted:
            builder.restart(t_s)
        for firing in record.inputs.received.firings:
            builder.add_firing(t_s, firing)
        if odometry is not None:
            builder.add_odometry(t_s, odometry)
        modes, mode = timeline.modes, record.mode
        if not modes or (modes[-1].mode, modes[-1].reason) != (mode.mode.value, mode.reason):
            modes.append(ModeEntry(t_s, mode.mode.value, mode.reason))
        timeline.seconds = t_s

    def _end_cycle(self, state: State) -> None:
        self._state = state
        self._builder.end_cycle(self._timeline.seconds, state.perception)

    def finish(self) -> None:
        """Complete the timeline."""
        self._builder.finish(None if self._state is None else self._state.perception)
        first_run_s = self._first_run_s or 0.0
        for line in self._log:
            fields = ", ".join(f"{name} {value}" for name, value in line.fields.items() if name != "settings")
            text = f"{line.event}: {fields}" if fields else line.event
            self._timeline.log.append(LogEntry(line.run_s - first_run_s, line.level, text))
        if self._has_bytes:
            self._timeline.counts = self._driver.counts


def _of_ring_log(
    path: Path, source: TimelineSource, prepare: Callable[[Settings], None], on_step: Progress
) -> Timeline:
    """Return the timeline of a ring log: each firing is a cycle. `prepare` gets the settings before the first one."""
    settings = load_settings(None, source.sets, robot=source.robot, models=source.models).of_log()
    found: list[str] = []
    firings = open_ring_log(path, settings, source.log, found.append)
    first = next(firings)  # reports an invalid file before kernels are compiled
    prepare(settings)
    timeline = Timeline(path, settings, None if source.world is None else load_world(source.world))
    timeline.notes += found
    builder = TimelineBuilder(timeline)
    replayer = FiringReplayer(settings, itertools.chain((first,), firings))
    for firing in replayer:
        t_s = firing.robot_s - first.robot_s
        if timeline.cycles:
            timeline.cycle_gaps_s.append(t_s - timeline.seconds)
        builder.add_firing(t_s, firing)
        # The poses of a ring log are its odometry; it does not say how fast the wheels were.
        at = Odometry(firing.robot_s, firing.pose, firing.ring_yaw, UNKNOWN_TWIST, Flags.NONE, 0)
        builder.add_odometry(t_s, at)
        builder.end_cycle(t_s, replayer.perception)
        timeline.cycles += 1
        on_step()
    builder.finish(replayer.perception)
    return timeline
