"""Traces from recordings, by a replay, and from ring logs, by perception over them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from config.errors import WRONG_CALL, UserError
from config.load import load_settings, load_world
from config.settings import Settings
from drivers.messages import Firing
from drivers.registry import make_driver
from perception.pipeline import Perception
from runtime.analysis.timeline import BookmarkEntry, LogEntry, ModeEntry, Timeline
from runtime.analysis.timeline_builder import TimelineBuilder
from runtime.cycle.step import CycleRecord, State
from runtime.recording.channels import BOOKMARK, LOG, SERIAL, SUMMARY, RawMessage, decode
from runtime.recording.reader import Recording, RecordingError, is_recording, open_recording
from runtime.recording.replayer import verify_recording
from runtime.recording.ring_log import read_ring_log
from runtime.recording.ring_log_replay import replay_firings
from runtime.recording.schema import Bookmark, LogLine, RunEnd, SerialBytes

Told = Callable[[], None]
SAID_MAX: Final = 1000


@dataclass(frozen=True, slots=True)
class TimelineSource:
    """Which file, and what a ring log does not say of itself."""

    file: str
    sets: Sequence[str] = ()
    robot: str | None = None
    models: Sequence[str] = ()
    world: str | None = None
    """What stood there, instead of what a recording knows; coordinates as if the log began at the world's start."""


def load_timeline(
    source: TimelineSource, ready: Callable[[Settings], None], on_step: Told = lambda: None
) -> Timeline:
    """Return the timeline of a recording or a ring log.

    Parameters
    ----------
    source : TimelineSource
        The file, and what goes with it.
    ready : callable
        Gets the settings before perception begins: compiles kernels.
    on_step : callable
        Called now and then, for a progress bar.

    Raises
    ------
    UserError
        The file is none that can be read, or holds nothing to show.
    """
    path = Path(source.file)
    if not is_recording(path):
        return _of_ring_log(path, source, ready, on_step)
    if source.sets or source.robot is not None or source.models:
        raise UserError(
            f"{path}: is a recording and knows its settings; --set, --robot and --model are for ring logs",
            WRONG_CALL,
        )
    with open_recording(path) as recording:
        ready(recording.settings)
        return _of_recording(recording, source, on_step)


def _of_recording(recording: Recording, source: TimelineSource, on_step: Told) -> Timeline:
    world = recording.world if source.world is None else load_world(source.world)
    about = recording.info
    timeline = Timeline(recording.path, recording.settings, world, versions=about.versions, started=about.started)
    listener = _Listener(recording, timeline, on_step)
    result = verify_recording(recording, on_cycle=listener.on_cycle, on_message=listener.on_message)
    if result.cycles == 0:
        raise RecordingError(f"{recording.path}: holds no cycle, or none that can be replayed: nothing to show")
    listener.finish()
    timeline.cycles, timeline.stops = result.cycles, dict(result.refinement_stops)
    timeline.notes += [f"cycles {first} to {last} are missing" for first, last in result.missing]
    timeline.notes += [f"at byte {damage.at}: {damage.what}" for damage in recording.damage]
    if result.first_difference is not None:
        timeline.notes.append(f"the replay differs from the run, first in {result.first_difference}")
    return timeline


class _Listener:
    """Sits in on the replay of a recording."""

    def __init__(self, recording: Recording, timeline: Timeline, on_step: Told) -> None:
        self._recording = recording
        self._timeline = timeline
        self._on_step = on_step
        self._gathering = TimelineBuilder(timeline)
        self._driver = make_driver(recording.settings)
        self._driver.line_opened(0.0)
        self._has_bytes = False
        self._begun_s: float | None = None
        self._before_s = math.nan
        self._perception: Perception | None = None
        self._said: list[tuple[float, LogLine]] = []

    def on_message(self, entry: RawMessage) -> None:
        """Take a message."""
        self._on_step()
        if entry.topic == SERIAL["in"]:
            self._has_bytes = True
            for t_s, data in decode(SerialBytes, entry.data).pieces():
                self._driver.receive(data, t_s)
            self._driver.take_received()
        elif entry.topic == LOG and len(self._said) < SAID_MAX:
            self._said.append((self._recording.host_s(entry.log_ns), decode(LogLine, entry.data)))
        elif entry.topic == BOOKMARK:
            host_s = self._recording.host_s(entry.log_ns)
            t_s = 0.0 if self._begun_s is None else max(0.0, host_s - self._begun_s)
            self._timeline.bookmarks.append(
                BookmarkEntry(t_s, decode(Bookmark, entry.data).text, self._gathering.pose)
            )
        elif entry.topic == SUMMARY:
            self._timeline.summary = decode(RunEnd, entry.data).summary

    def on_cycle(self, record: CycleRecord, state: State) -> None:
        """Take a cycle, replayed."""
        run_s = record.inputs.run_s
        if self._begun_s is None:
            self._begun_s = run_s
            self._timeline.start_unix_ns = self._recording.info.unix_minus_host_ns + round(1e9 * run_s)
        else:
            self._timeline.gaps_s.append(run_s - self._before_s)
        t_s, self._before_s = run_s - self._begun_s, run_s
        if record.inputs.received.rebooted:
            self._gathering.begin_anew(t_s)
        for firing in record.inputs.received.firings:
            self._gathering.hear(t_s, firing)
        if state.odometry is not None:
            self._gathering.move(t_s, state.odometry)
        modes, mode = self._timeline.modes, record.mode
        if not modes or (modes[-1].mode, modes[-1].reason) != (mode.mode.value, mode.reason):
            modes.append(ModeEntry(t_s, mode.mode.value, mode.reason))
        self._perception = state.perception
        self._gathering.pass_by(t_s, state.perception)

    def finish(self) -> None:
        """Close the timeline."""
        self._gathering.end(self._perception)
        begun_s = self._begun_s or 0.0
        for host_s, line in self._said:
            more = ", ".join(f"{name} {value}" for name, value in line.fields.items() if name != "settings")
            self._timeline.log.append(
                LogEntry(host_s - begun_s, line.level, f"{line.event}: {more}" if more else line.event)
            )
        if self._has_bytes:
            self._timeline.counts = self._driver.counts


def _of_ring_log(path: Path, source: TimelineSource, ready: Callable[[Settings], None], on_step: Told) -> Timeline:
    settings = load_settings(None, source.sets, robot=source.robot, models=source.models)
    firings = read_ring_log(path, sensors=len(settings.ring.mounts))
    first = next(firings)  # complains about a wrong file before anybody waits for kernels
    ready(settings)
    timeline = Timeline(path, settings, None if source.world is None else load_world(source.world))
    gathering = TimelineBuilder(timeline)
    begun_s: list[float] = []
    kept: list[Perception] = []

    def on_firing(firing: Firing, perception: Perception) -> None:
        on_step()
        if not begun_s:
            begun_s.append(firing.robot_s)
            kept.append(perception)
        elif timeline.cycles:
            timeline.gaps_s.append(firing.robot_s - begun_s[0] - timeline.seconds)
        t_s = firing.robot_s - begun_s[0]
        gathering.hear(t_s, firing)
        gathering.pass_by(t_s, perception)
        timeline.cycles += 1

    replay_firings(settings, itertools.chain((first,), firings), on_firing)
    gathering.end(kept[0] if kept else None)
    return timeline
