"""Perception over a ring log, firing by firing, as in a live run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from config.settings import LocalizationConfig, Settings
from drivers.messages import Firing, Pose
from perception.detected_object import DetectedObject
from perception.localization.localized_pose import LocalizedPose
from perception.pipeline import Perception
from runtime.cycle.summary import perceived_rows, pose_row
from runtime.recording.replay_summary import ReplaySummary
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.refinement_budget import within_quanta_per_cycle


class FiringReplayer:
    """An iterator over firings, in order of time, that runs perception on each of them before it yields it."""

    def __init__(self, settings: Settings, firings: Iterable[Firing]) -> None:
        self.perception = Perception(settings.ring, settings.models, settings.perception)
        """With everything perceived so far."""
        self.perception.canyon_map.is_wanted = True
        self.perception.echo_lag = None  # found as the log was opened
        self._firings = firings
        self._cycle_stats = CycleStats(late_after_s=float("inf"))

    def __iter__(self) -> Iterator[Firing]:
        """Yield each firing after perception has taken it in, and refined as a cycle would.

        The map frame comes before and takes none of a cycle's quanta, as a log has time for all that can be known: so
        a log without drift gives the same with and without its correction.
        """
        perception = self.perception
        for firing in self._firings:
            started_s = time.perf_counter()
            perception.observe(firing)
            while perception.map_frame.can_refine:
                perception.map_frame.refine()
            quanta = 0
            while perception.can_refine and within_quanta_per_cycle(quanta):
                perception.refine()
                quanta += 1
            self._cycle_stats.add_cycle(time.perf_counter() - started_s)
            yield firing
        perception.surfaces.finish()

    def summary(self, to: Pose | None = None, objects: Iterable[DetectedObject] | None = None) -> ReplaySummary:
        """Return the results of perception so far, and the time they took.

        `to` is the pose of odometry's frame in that of the results, by default the same; `objects` are the models',
        where they are known better than by `perception`.
        """
        perceived = perceived_rows(self.perception, to, objects)
        counts = self.perception.counts
        return {
            "objects": perceived["objects"],
            "walls": perceived["walls"],
            "corners": perceived["corners"],
            "canyons": perceived["canyons"],
            "polylines": perceived["polylines"],
            "segments": counts.segments_total,
            "clusters": counts.hypotheses,
            "cycles": self._cycle_stats.cycles,
            "cycle_us": self._cycle_stats.cycle_us(),
        }


def replay_localized(
    settings: Settings,
    firings: Iterable[Firing],
    on_pose: Callable[[float, LocalizedPose], None],
    on_path: Callable[[float, LocalizedPose], None] | None = None,
) -> ReplaySummary:
    """Run perception over firings, correct drift by what it recognises, and return what it perceived.

    Where maps of the way have corrected the path, everything is recognised anew from the poses as known at the end.

    Parameters
    ----------
    settings : Settings
        Ring, models and constants.
    firings : iterable of Firing
        In order of time.
    on_pose : callable
        Called after each firing with its time (s) and the robot's pose as known then.
    on_path : callable, optional
        Called at the end for each firing with its time and the robot's pose as known at the end.
    """
    replayer = FiringReplayer(_localizing(settings, LocalizationConfig(correct_drift=True)), firings)
    perception = replayer.perception
    frame, taken = perception.map_frame, []
    for firing in replayer:
        here = perception.localized()
        if here is not None:
            on_pose(firing.robot_s, here)
            taken.append((firing, here, frame.moment()))
    path = [(firing, frame.as_known_now(then, moment)) for firing, then, moment in taken]
    if on_path is not None:
        for firing, at in path:
            on_path(firing.robot_s, at)
    if frame.corrects_path:
        placed = (replace(firing, pose=at.pose, ring_yaw=at.ring_yaw) for firing, at in path)
        summary = replay_firings(_localizing(settings, LocalizationConfig()), placed)
    else:
        summary = replayer.summary(perception.odometry_from_map().inverse(), perception.mapped_objects())
    summary["frame"] = "map"
    here = perception.localized()
    if here is not None:
        summary["pose"] = pose_row(here)
    return summary


def _localizing(settings: Settings, localization: LocalizationConfig) -> Settings:
    perception = settings.perception.model_copy(update={"localization": localization})
    return settings.model_copy(update={"perception": perception})


def replay_in_known_room(
    settings: Settings, firings: Iterable[Firing], on_pose: Callable[[float, LocalizedPose], None]
) -> ReplaySummary:
    """Run perception over firings, find the robot in a known room, and return what was perceived.

    The objects are in the map frame if the robot's place is known at the end, otherwise in odometry's.

    `on_pose` gets the time (s) of each firing and the robot's pose as known then.

    Raises
    ------
    ValueError
        The settings name no known room.
    """
    replayer = FiringReplayer(settings, firings)
    known_room = replayer.perception.known_room
    if known_room is None:
        raise ValueError("the settings name no known room")
    for firing in replayer:
        while known_room.can_refine:  # a log has time for a whole search
            known_room.refine()
        on_pose(firing.robot_s, known_room.localized())
    here = known_room.localized()
    is_known = here.status == "tracking"
    summary = replayer.summary(known_room.odometry_from_map().inverse()) if is_known else replayer.summary()
    summary["pose"] = pose_row(here)
    if is_known:
        summary["frame"] = "map"
    return summary


def replay_firings(settings: Settings, firings: Iterable[Firing]) -> ReplaySummary:
    """Run perception over firings, in order of time, and return what it perceived."""
    replayer = FiringReplayer(settings, firings)
    for _ in replayer:
        pass
    return replayer.summary()
