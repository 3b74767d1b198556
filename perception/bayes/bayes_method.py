"""The Bayesian method's interface to perception: firings in, objects out.

The kernels hold the memory and the computation; this module decides when to call them. Each call does a bounded
amount of work: a firing takes a bounded number of quanta, a quantum refines one object.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter
from typing import Final

import numpy as np

from config.model import ModelConfig
from config.robot import RingConfig
from config.settings import QUANTA_MAX, BayesConfig, PerceptionConfig
from drivers.messages import Firing
from perception.bayes.inference.kernel_settings import (
    apply_config,
    apply_library,
    circle_models,
    copied,
    make_settings,
)
from perception.bayes.memory.elements import MAX_POLYGONS, round_label
from perception.bayes.memory.job_records import NO_JOB, REFINEMENT
from perception.bayes.memory.polygon_parameters import POLYGON_PROBABILITY
from perception.bayes.memory.state import ESTABLISHED, FREE, Memory
from perception.bayes.memory.state_migration import migrate
from perception.bayes.polygons.association import associate_polygons
from perception.bayes.reports.echo_sources import locate_echoes
from perception.bayes.reports.evidence import evidence_of
from perception.bayes.reports.object_report import (
    alternative_labels,
    archived_models,
    circle_object,
    other_circles,
    other_objects,
    polygon_object,
)
from perception.bayes.segments.pinned_segments import Pins
from perception.bayes.segments.segment_list import count_again, count_map, drawn, mapped_segments
from perception.bayes.tracks.kept_tracks import kept_track, kept_walls, restore_track, restore_walls
from perception.bayes.tracks.map_edits import edit_memory, row_of
from perception.bayes.tracks.naming import Reported, report_circles, sure_polygons
from perception.bayes.tracks.observe import associate, hear_crosses, observe
from perception.bayes.tracks.polygon_tracks import polygon_quantum
from perception.bayes.tracks.refine import quantum
from perception.bayes.tracks.track_archive import TrackArchive
from perception.bayes.walls.standing import keep_while_standing
from perception.bayes.walls.wall_map import update_walls
from perception.bounds import CONSTANT, Bound, bounds, index_of, up_to
from perception.detected_object import DetectedObject, MapCounts
from perception.edits import (
    ClearMap,
    ConfirmObject,
    Evidence,
    MapEdit,
    MoveObject,
    ObjectRow,
    PlaceModel,
    RemoveObject,
    RestoreObjects,
    Segments,
    WithdrawConfirmation,
    WithdrawPlacement,
)
from perception.kernel import Floats
from perception.map_moves import MapMoves
from perception.records import records, zeros
from perception.sensor_mounts import mounts_array, mounts_at, ring_pose
from perception.snapshot import bounds_of


def _polygon_model(owner: BayesPerception) -> Bound:
    """Return the bound of the index of a polygon model."""
    return index_of(len(owner._outlines))


class BayesPerception:
    """Detection of objects from echoes by comparing all explanations on the raw ranges.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    models : sequence of ModelConfig
        The models to detect: circles by their radius, open and closed polygons by their outline.
    config : BayesConfig
        The settings that a user may change.
    """

    SCRATCH: Final = ("_sure", "_last_reported", "_reported", "_readings")
    """Attributes that are derived from the rest; they are not in a snapshot."""
    BOUNDS: Final = bounds(
        {
            "memory.state.polygons.model": _polygon_model,
            "memory.state.polygons.status": lambda self: up_to(ESTABLISHED if self._outlines else FREE),
            "memory.state.requests.model": _polygon_model,
            "memory.state.job.model": _polygon_model,
            "memory.state.job.kind": lambda self: up_to(REFINEMENT if self._outlines else NO_JOB),
            "_archive.polygons.archived_rows.model": _polygon_model,
        },
        _mounts=CONSTANT,
        _left=up_to(QUANTA_MAX),
        _polygons_left=up_to(QUANTA_MAX),
    )

    def __init__(self, ring: RingConfig, models: Sequence[ModelConfig], config: BayesConfig) -> None:
        self._mounts, self._turning = mounts_array(ring.mounts), ring.turning
        self._config = config
        self.settings = make_settings(ring, models, config)
        """The settings that kernels read."""
        self.memory = Memory(len(self._mounts), config.tracks_max)
        """The memory that kernels read and write."""
        self._archive = TrackArchive()
        self._pins = Pins()
        self._name_models(models)
        self._sure = np.zeros(max(config.tracks_max, MAX_POLYGONS), np.int64)
        self._last_reported = zeros(Reported, config.tracks_max)
        self._reported = records(Reported, self._last_reported)
        self._forget_derived()
        self._circles: dict[int, DetectedObject] = {}
        self._objects: tuple[DetectedObject, ...] | None = None
        self._archived: tuple[DetectedObject, ...] | None = None
        self._archived_labels: tuple[DetectedObject, ...] | None = None
        self._readings = 0
        """Readings of the last firing that were not redundant."""
        self._left = 0
        self._polygons_left = 0
        self._circles_pending = False
        self._polygons_pending = False
        self._polygons_turn = False

    @property
    def can_refine(self) -> bool:
        """Whether `refine` can improve anything before the next firing."""
        return (self._circles_pending and self._left > 0) or (self._polygons_pending and self._polygons_left > 0)

    @property
    def converged(self) -> bool:
        """Whether nothing is left to improve, now or with the next firing."""
        return not (self._circles_pending or self._polygons_pending)

    @property
    def counts(self) -> MapCounts:
        """The numbers of segments and tracks, tentative tracks included."""
        held, made, tracks = count_map(self.memory.s, self.memory.tracks)
        archive = self._archive
        return MapCounts(held, made, tracks, archive.circles.count + archive.polygons.count, archive.waiting)

    def observe(self, firing: Firing) -> int:
        """Process one firing; return the number of outline segments that it completed."""
        s, tracks, settings = self.memory.s, self.memory.tracks, self.settings
        pose, time_s = ring_pose(firing), float(firing.robot_s)
        mounts = mounts_at(firing, self._mounts, self._turning)
        keep_while_standing(self.memory, pose)
        readings = associate(
            s,
            tracks,
            settings,
            mounts,
            pose,
            time_s,
            firing.ranges_m,
        )
        self._readings = readings
        heard = firing.cross_paths
        if heard is not None:
            # Not in the kernel: where no sensor listens, it need not be compiled.
            hear_crosses(
                s,
                tracks,
                settings,
                mounts,
                pose,
                readings,
                heard.transmitters,
                heard.listeners,
                heard.half_paths_m,
            )
        if len(self._outlines) > 0:
            # Not in the kernel: where all models are round, it need not be compiled.
            associate_polygons(s, tracks, settings, readings)
        made, self._circles_pending = observe(s, tracks, settings, readings, time_s, self._config.fresh_share)
        update_walls(self.memory, settings, readings)
        # Polygons come after the circles, unless the time ran out before.
        self._polygons_turn = self._polygons_pending and self._polygons_left > 0 and not self._polygons_turn
        self._left = self._config.quanta_per_firing
        self._polygons_left = self._config.polygon_quanta_per_firing
        self._polygons_pending = len(self._outlines) > 0
        if self._pins.count > 0:
            self._pins.renew(self.memory)
        if self._archive.update(self.memory, self.settings, self._sure_polygon):
            self._objects = self._archived = self._archived_labels = None
        return made

    def refine(self) -> int:
        """Refine one object; return 1, or 0 where nothing is left to improve."""
        polygons = self._polygons_pending and self._polygons_left > 0
        if self._circles_pending and self._left > 0 and not (polygons and self._polygons_turn):
            self._left -= 1
            self._objects = None
            self._circles_pending = quantum(
                self.memory.s, self.memory.tracks, self.settings, self._config.fresh_share
            )
            return 1
        if polygons:
            self._polygons_left -= 1
            self._objects = None
            self._polygons_pending = polygon_quantum(
                self.memory.s, self.memory.tracks, self.settings, self._config.fresh_share
            )
            return int(self._polygons_pending)
        return 0

    def objects(self) -> tuple[DetectedObject, ...]:
        """Return the models that are reported: those near the robot, best first, then those left behind."""
        if self._archived is None:
            self._archived = tuple(archived_models(self._archive, self.settings, self._round, self._outlines))
        near = self.near_objects()
        return (*near, *self._archived) if self._archived else near

    def near_objects(self) -> tuple[DetectedObject, ...]:
        """Return the models near the robot that are reported, best first."""
        if self._objects is None:
            self._objects = self._sure_objects()
        return self._objects

    @property
    def _sure_polygon(self) -> float:
        """Least probability with which a polygon is reported."""
        return min(self._config.report_probability, POLYGON_PROBABILITY)

    def _sure_objects(self) -> tuple[DetectedObject, ...]:
        """Return the models that are reported, best first; an unchanged circle is the same object as before."""
        memory = self.memory
        n = report_circles(memory.tracks, self.settings, self._reported, self._sure)
        seen = [self._circles[t] if t >= 0 else self._report_circle(~t) for t in self._sure[:n].tolist()]
        if self._outlines:
            n = sure_polygons(memory.s, self._sure_polygon, self._sure)
            polygons = memory.s[0].polygons
            seen += [
                polygon_object(track, self.settings, self._outlines[track.model], float(track.probability))
                for track in (polygons[t] for t in self._sure[:n].tolist())
            ]
        return tuple(sorted(seen, key=attrgetter("score"), reverse=True))

    def _report_circle(self, t: int) -> DetectedObject:
        """Return a changed circle as an object, from the values that `report_circles` has written."""
        x, y, xx, xy, yy, hits, probability, kind, number, marks = self._last_reported[t].item()
        seen = circle_object((x, y, xx, xy, yy, hits, number, marks), self._round[int(kind)], probability)
        self._circles[t] = seen
        return seen

    def labelled_objects(self) -> tuple[DetectedObject, ...]:
        """Return the reported models near the robot, then all other objects there that have a label."""
        named = self.near_objects()
        return (*named, *other_objects(self.memory, self.settings, self._config.report_probability, named))

    def archived_objects(self) -> tuple[DetectedObject, ...]:
        """Return all objects left behind that have a label; the same tuple until they change."""
        if self._archived_labels is None:
            models = archived_models(self._archive, self.settings, self._round, self._outlines)
            others, least = self._archive.circles.held(), self._config.report_probability
            others = others[others["is_reported"] == 0]
            self._archived_labels = (*models, *other_circles(others, self.memory, self.settings, least, ()))
        return self._archived_labels

    def locate_echoes(self, bearings: Floats) -> int:
        """Write where in its beam each echo of the last firing came from; see `Method.locate_echoes`."""
        sure = self._config.report_probability
        return locate_echoes(self.memory.s, self.memory.tracks, self.settings, self._readings, sure, bearings)

    def segment_geometry(self) -> Floats:
        """Return the mapped segments: ends x, y, x, y (m) and normal (rad), shape (n, 5), a copy."""
        return drawn(mapped_segments(self.memory))

    def segments(self) -> Segments:
        """Return the outline segments in the map with all their attributes."""
        mapped = mapped_segments(self.memory)
        numbers, times = mapped["number"].copy(), mapped["time_s"].copy()
        pinned = np.isin(numbers, self._pins.numbers) if self._pins.count else np.zeros(len(numbers))
        return Segments(numbers, drawn(mapped), times, pinned.astype(np.int64))

    def edit(self, edit: MapEdit) -> str | None:
        """Apply a user's edit; return None, or the reason why it cannot be done."""
        self._objects = self._archived = self._archived_labels = None
        match edit:
            case RestoreObjects(rows, walls):
                refusals = [self._restore(row) for row in rows]
                if walls:
                    refusals.append(restore_walls(self.memory, walls, bounds_of(self)))
                return next((refused for refused in refusals if refused is not None), None)
            case (
                MoveObject(number)
                | ConfirmObject(number)
                | WithdrawConfirmation(number)
                | WithdrawPlacement(number)
                | RemoveObject(number)
            ):
                self._archive.take_up(self.memory, self.settings, self._sure_polygon, number)
            case PlaceModel(name) if name in {*self._round, *self._outlines}:
                self._archive.make_room(self.memory, self.settings, self._sure_polygon)
            case ClearMap():
                self._archive.clear()
        refused = edit_memory(self.memory, self.settings, self._pins, self._round, self._outlines, edit)
        count_again(self.memory)
        return refused

    def _restore(self, row: ObjectRow) -> str | None:
        self._archive.take_up(self.memory, self.settings, self._sure_polygon, row.number)
        if row_of(self.memory, row.number) is None:
            self._archive.make_room(self.memory, self.settings, self._sure_polygon)
        return restore_track(self.memory, row, bounds_of(self))

    def kept(self, number: int) -> str | None:
        """Return an object's track as text; None for an unknown number."""
        with self._archive.borrowed(self.memory, self.settings, number):
            row = row_of(self.memory, number)
            return None if row is None else kept_track(self.memory, row)

    def kept_walls(self) -> str:
        """Return walls and corners, and the readings by which they are reviewed, as text."""
        return kept_walls(self.memory)

    def evidence(self, number: int) -> Evidence | None:
        """Return the evidence of each reading kept for an object; None for an unknown number."""
        memory, p = self.memory, self.settings
        with self._archive.borrowed(memory, p, number):
            row = row_of(memory, number)
            if row is None:
                return None
            t = row - len(memory.circles)
            if t >= 0:
                name = self._outlines[memory.polygons["model"][t]]
            else:
                radius, kind = (memory.circles[field][row].item() for field in ("radius", "kind"))
                name = self._round[kind] if kind < p[0].model_count else round_label(radius)
            return evidence_of(memory, p, row, number, name, alternative_labels(p, self._round))

    def shift_object(self, number: int, dx: float, dy: float) -> None:
        """Move a round object and the readings kept for it by a vector (m); nothing moves if it has gone."""
        circles = self.memory.circles
        kept = circles["bins"]["readings"]
        for row in np.flatnonzero((circles["number"] == number) & (circles["status"] != FREE)):
            circles["x"][row] += dx
            circles["y"][row] += dy
            kept["x"][row] += dx
            kept["y"][row] += dy
        self._objects = None

    def follow_maps(self, submap: int, moves: MapMoves | None) -> None:
        """Note the number of the map of the way that goes on, and move what the robot left behind in each."""
        if moves is not None and moves.is_first:
            self.memory.clear_walls()  # summed over a way that odometry had wrong, and soon heard again
        if self._archive.follow_maps(submap, moves):
            self._objects = self._archived = self._archived_labels = None

    def reset(self) -> None:
        """Clear the memory, as after a reset of the odometry."""
        self.memory.clear()
        self._pins.clear()
        self._archive.clear()
        self._forget_derived()
        self._left = 0
        self._polygons_left = 0
        self._circles_pending = self._polygons_pending = self._polygons_turn = False

    def apply_settings(self, config: PerceptionConfig) -> None:
        """Replace the constants of a running process; the number of tracks does not change."""
        self._config = config.bayes
        apply_config(self.settings, config.bayes)
        self._objects = None

    def set_models(self, models: Sequence[ModelConfig]) -> None:
        """Add models to the library, after the present ones."""
        before, self.settings = self.settings, copied(self.settings)
        apply_library(self.settings, models)
        migrate(self.memory, self._archive.circles.archived_rows, before, self.settings)
        self._name_models(models)
        self._forget_derived()

    def drop_caches(self) -> None:
        """Drop what was derived from the memory, after the memory was restored from a snapshot."""
        self._archive.drop_caches()
        self._forget_derived()
        count_again(self.memory)

    def _forget_derived(self) -> None:
        self._last_reported["x"] = np.nan
        self._objects = self._archived = self._archived_labels = None

    def _name_models(self, models: Sequence[ModelConfig]) -> None:
        _, self._round = circle_models(models)
        self._outlines = [m.name for m in models if m.arc_radius_m is None]
