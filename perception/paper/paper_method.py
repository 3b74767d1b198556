"""The paper's method: outline segments, clusters of them, and a model relaxed onto each cluster.

`observe` enters one firing: segments, ageing, contradictions, clusters (paper §3.1 to §3.3). `refine` relaxes one
candidate by one quantum (§3.4). `edit` applies an operator's edit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from config.model import ModelConfig
from config.robot import RingConfig
from config.settings import PerceptionConfig
from drivers.messages import Firing
from perception.bounds import bounds, index_of
from perception.detected_object import DetectedObject, MapCounts
from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    Evidence,
    Line,
    MapEdit,
    MoveObject,
    ObjectRow,
    PinSegments,
    PlaceModel,
    RemoveObject,
    RestoreObjects,
    RestoreSegments,
    Segments,
    WithdrawConfirmation,
    WithdrawPlacement,
    no_such_object,
    no_such_segments,
    not_restorable,
)
from perception.kernel import Floats, Ints
from perception.map_moves import MapMoves
from perception.object_model import ObjectModel
from perception.paper.candidates import Candidates
from perception.paper.clusters import Clusters
from perception.paper.manual_placement import NumberSource, Placements, Rejections, wrapped_pose
from perception.paper.outline_map import OutlineMap
from perception.paper.parameters import PLACEMENTS_MAX
from perception.paper.recognition import goodness_of_fit
from perception.paper.segments import SegmentExtractor
from perception.sensor_mounts import mounts_array

PLACEMENT: Final = "placement"
CANDIDATE: Final = "candidate"
"""What an object is, as text that is kept of it."""


class PaperPerception:
    """Echoes to objects, by the paper's method.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    models : sequence of ModelConfig
        The objects to recognise.
    config : PerceptionConfig
        The settings of each step.
    """

    SCRATCH: Final = ("_scratch",)
    """Not part of a snapshot: overwritten before each use."""
    BOUNDS: Final = bounds({"_rejections.rows.model": lambda self: index_of(len(self._models))})

    def __init__(self, ring: RingConfig, models: Sequence[ModelConfig], config: PerceptionConfig) -> None:
        mounts = mounts_array(ring.mounts)
        self._config = config
        self._models = tuple(ObjectModel.from_config(m) for m in models)
        self._scratch = np.zeros(max(len(m.sides) for m in self._models), dtype=np.int64)
        self._extractor = SegmentExtractor(ring, config.segments)
        self.outline = OutlineMap(config.map, mounts, math.radians(ring.beam_half_angle_deg), ring.turning)
        self.clusters = Clusters(config.clusters, config.map.capacity)
        self._numbers = NumberSource()
        self.candidates = Candidates(
            self._models,
            config.relaxation,
            config.clusters.clusters_max,
            config.clusters.segments_min,
            config.clusters.threshold_m,
            self._numbers,
        )
        self.placements = Placements(self._models, config.relaxation, config.clusters.threshold_m)
        self._rejections = Rejections()
        self._placement_was_last = False

    @property
    def can_refine(self) -> bool:
        """Whether `refine` has anything to improve now."""
        return self.placements.pending or self.candidates.pending > 0

    @property
    def converged(self) -> bool:
        """Whether nothing is left to improve, now or with the next firing."""
        return not self.can_refine

    def observe(self, firing: Firing) -> int:
        """Enter one firing and return how many outline segments it completed."""
        segments = self._extractor.extract(firing)
        removed = self.outline.remove_contradicted(firing)
        aged = self.outline.age(firing.robot_s)
        self.outline.add(segments, firing.robot_s)
        if removed > 0 or len(segments) > 0 or aged:
            self._follow_map()
        return len(segments)

    def refine(self) -> int:
        """Do one quantum of refinement and return its iterations, zero if nothing is left to improve."""
        placements_turn = not (self._placement_was_last and self.candidates.pending)
        self._placement_was_last = self.placements.pending and placements_turn
        if self._placement_was_last:
            return self.placements.refine(self.outline)
        return self.candidates.refine(self.clusters, self.outline)

    @property
    def counts(self) -> MapCounts:
        """The numbers of segments and clusters."""
        return MapCounts(self.outline.size, self.outline.total, self.clusters.count)

    def locate_echoes(self, bearings: Floats) -> int:
        """Write NaN for each sensor, return 0: this method does not associate echoes with objects."""
        bearings[:] = np.nan
        return 0

    def segment_geometry(self) -> Floats:
        """Return a copy of the outline segments: end points x1, y1, x2, y2 (m) and normal (rad), shape (n, 5)."""
        return self.outline.listed().geometry

    def segments(self) -> Segments:
        """Return the outline segments with their numbers, times and pins."""
        return self.outline.listed()

    def objects(self) -> tuple[DetectedObject, ...]:
        """Return the objects recognised now, best first.

        Of candidates that rest near one another only the best is reported: Table 1 may split an object into two
        clusters, and a cluster has a candidate for each model. Objects that an operator placed or confirmed are
        always reported.
        """
        models = range(len(self._models))
        fitting = [o for j in range(self.clusters.count) for m in models if (o := self._candidate(j, m)) is not None]
        detected = [self._placement(k) for k in range(self.placements.count)]
        for candidate in sorted(fitting, key=lambda o: o.score, reverse=True):
            apart = self._config.recognition.separation_m
            if all(math.hypot(candidate.x - o.x, candidate.y - o.y) >= apart for o in detected):
                detected.append(candidate)
        return tuple(sorted(detected, key=lambda o: o.score, reverse=True))

    def near_objects(self) -> tuple[DetectedObject, ...]:
        """Return the objects: this method archives none."""
        return self.objects()

    def labelled_objects(self) -> tuple[DetectedObject, ...]:
        """Return the objects: this method has no other labels."""
        return self.objects()

    def archived_objects(self) -> tuple[DetectedObject, ...]:
        """Return nothing: this method archives none."""
        return ()

    def shift_object(self, number: int, dx: float, dy: float) -> None:
        """Move nothing: this method's objects are no landmarks, because they have no covariance."""

    def follow_maps(self, submap: int, moves: MapMoves | None) -> None:
        """Move nothing: segments that the robot has left behind are forgotten."""

    def reset(self) -> None:
        """Start again with an empty map, as after a reset of the odometry."""
        self._extractor.reset()
        self.outline.clear()
        self.clusters.update(self.outline)
        self.candidates.clear()
        self.placements.clear()
        self._rejections.clear()

    def apply_settings(self, config: PerceptionConfig) -> None:
        """Use other settings; those that size an array stay."""
        relaxation, segments_min = self._config.relaxation, self._config.clusters.segments_min
        self._config = config
        self._extractor.apply_settings(config.segments)
        self.outline.apply_settings(config.map)
        regroup = self.clusters.apply_settings(config.clusters) or segments_min != config.clusters.segments_min
        self.candidates.apply_settings(config.relaxation, config.clusters.segments_min, config.clusters.threshold_m)
        self.placements.apply_settings(self._models, config.relaxation, config.clusters.threshold_m)
        if config.relaxation != relaxation:
            self.placements.restart_all()
        if regroup:
            self._follow_map()

    def set_models(self, models: Sequence[ModelConfig]) -> None:
        """Recognise further models, which follow the present ones in `models`."""
        self._models = tuple(ObjectModel.from_config(m) for m in models)
        self._scratch = np.zeros(max(len(m.sides) for m in self._models), dtype=np.int64)
        self.candidates.extend(self._models, self.clusters, self.outline)
        self.placements.apply_settings(self._models, self._config.relaxation, self._config.clusters.threshold_m)

    def drop_caches(self) -> None:
        """Do nothing: this method caches no results."""

    def edit(self, edit: MapEdit) -> str | None:
        """Apply an operator's edit; return None, or why it cannot be applied."""
        match edit:
            case DeleteSegments(numbers):
                missing = self.outline.delete(numbers)
            case PinSegments(numbers, pinned):
                not_pinned = self.outline.pin(numbers, pinned=pinned)
                if not_pinned is None:
                    return "too many pinned segments: they would fill half of the map; unpin some first"
                missing = not_pinned
            case RestoreSegments(rows):
                refused = self.outline.restore(rows)
                if refused is not None:
                    return refused
                missing = set()
            case PlaceModel():
                return self._place(edit)
            case MoveObject(number, x, y, theta):
                return self._make_placement(number, (x, y, theta), confirmed=None)
            case ConfirmObject(number):
                return self._make_placement(number, None, confirmed=True)
            case WithdrawConfirmation(number):
                return self._make_placement(number, None, confirmed=False)
            case RemoveObject(number):
                return self._reject(number)
            case WithdrawPlacement(number):
                k = self.placements.find(number)
                if k is None:
                    return no_such_object(number)
                self.placements.remove(k)
                return None
            case RestoreObjects(rows):
                return next(filter(None, [self._restore(row) for row in rows]), None)
            case ClearMap():
                self.reset()
                return None
        self._follow_map()
        return no_such_segments(missing) if missing else None

    def _place(self, edit: PlaceModel) -> str | None:
        """Place an object of a model; return why it cannot be done, or None."""
        m = next((m for m, known in enumerate(self._models) if known.name == edit.model), None)
        if m is None:
            return f"no model is called {edit.model}: load it first"
        return self._put(self._numbers.last + 1, m, (edit.x, edit.y, edit.theta), confirmed=False)

    def kept(self, number: int) -> str | None:
        """Return whether an object is a placement or a candidate, and its model; None for an unknown number."""
        k = self.placements.find(number)
        if k is not None:
            return f"{PLACEMENT}:{self.placements.rows['model'][k]}"
        found = self.candidates.find(number)
        return None if found is None else f"{CANDIDATE}:{found[1]}"

    def kept_walls(self) -> str:
        """Return the empty text: this method finds no walls."""
        return ""

    def _restore(self, row: ObjectRow) -> str | None:
        """Make an object again what it was, where it was."""
        kind, _, model = row.kept.partition(":")
        m = int(model) if model.isdecimal() and len(model) < 5 else len(self._models)
        if kind not in {PLACEMENT, CANDIDATE} or m >= len(self._models) or row.number > self._numbers.last:
            return not_restorable(row.number)
        pose = (row.x, row.y, row.theta)
        if kind == PLACEMENT:
            return self._put(row.number, m, pose, confirmed=row.confirmed)
        k = self.placements.find(row.number)
        if k is not None:
            self.placements.remove(k)
        is_back = self.candidates.restore(row.number, m, pose)
        return None if is_back else f"no segments are left on which object {row.number} was recognised"

    def evidence(self, number: int) -> Evidence | None:
        """Return the segments around an object and which of them lie on it, None if no object has this number."""
        k = self.placements.find(number)
        found = self.candidates.find(number)
        if k is not None:
            row = self.placements.rows[k]
            m, pose, slots = int(row["model"]), row["pose"], self.placements.members(k, self.outline)
        elif found is not None:
            m, pose, slots = found[1], self.candidates.rows["pose"][found], self.clusters.members(found[0])
        else:
            return None
        lines = []
        for i, slot in enumerate(slots):
            x1, y1, x2, y2 = self.outline.segments[slot, :4].tolist()
            supports = self._fit(m, slots[i : i + 1], pose)[0] > 0
            lines.append(Line(int(self.outline.numbers[slot]), x1, y1, x2, y2, supports))
        support = sum(line.supports for line in lines)
        name = self._models[m].name
        return Evidence(number, name, lines=tuple(lines), supporting=support, opposing=support - len(lines))

    def _follow_map(self) -> None:
        """Cluster the present map; let candidates and placements follow."""
        self.clusters.update(self.outline)
        self.candidates.follow(self.clusters, self.outline)
        self.placements.restart_changed(self.outline)

    def _put(self, number: int, m: int, pose: tuple[float, float, float], *, confirmed: bool) -> str | None:
        """Put a placement at a pose; return None, or why there is no room for it."""
        if self.placements.find(number) is None and self.placements.count == PLACEMENTS_MAX:
            return f"{PLACEMENTS_MAX} objects are placed already, the most there is room for: reject one first"
        self._numbers.last = max(self._numbers.last, number)
        self.placements.put(number, m, pose, confirmed=confirmed)
        return None

    def _make_placement(
        self, number: int, pose: tuple[float, float, float] | None, *, confirmed: bool | None
    ) -> str | None:
        """Turn an object into a placement, at a pose or where it is; return None, or why that is impossible."""
        k = self.placements.find(number)
        if k is not None:
            row = self.placements.rows[k]
            at = wrapped_pose(row["pose"]) if pose is None else pose
            stays = bool(row["is_confirmed"]) if confirmed is None else confirmed
            return self._put(number, int(row["model"]), at, confirmed=stays)
        found = self.candidates.find(number)
        if found is None:
            return no_such_object(number)
        at = wrapped_pose(self.candidates.rows["pose"][found]) if pose is None else pose
        refused = self._put(number, found[1], at, confirmed=bool(confirmed))
        if refused is None:
            self.candidates.renumber(*found)
        return refused

    def _reject(self, number: int) -> str | None:
        """Remove an object; only segments that come later can bring one like it back. Return why not, or None."""
        k = self.placements.find(number)
        found = self.candidates.find(number)
        if k is not None:
            row = self.placements.rows[k]
            m, (x, y, _) = int(row["model"]), wrapped_pose(row["pose"])
            self.placements.remove(k)
        elif found is not None:
            m, (x, y, _) = found[1], wrapped_pose(self.candidates.rows["pose"][found])
            self.candidates.renumber(*found)
        else:
            return no_such_object(number)
        self._rejections.add(x, y, self._config.recognition.separation_m, m, self.outline.total)
        return None

    def _fit(self, m: int, slots: Ints, pose: Floats) -> tuple[int, float, float]:
        """Return support, residual (m) and coverage of a model at a pose; see `goodness_of_fit`."""
        limits = self._config.recognition
        x, y, theta = (float(v) for v in pose)
        return goodness_of_fit(
            self._models[m].sides,
            self.outline.segments,
            slots,
            x,
            y,
            theta,
            limits.tolerance_m,
            math.radians(limits.tolerance_deg),
            self._scratch,
        )

    def _candidate(self, cluster: int, m: int) -> DetectedObject | None:
        """Return a candidate as an object, None if it does not fit well enough."""
        row = self.candidates.rows[cluster, m]
        if not row["has_rested"]:
            return None
        limits, slots = self._config.recognition, self.clusters.members(cluster)
        x, y, theta = wrapped_pose(row["pose"])
        excluded = self._rejections.newest_excluded(x, y, m)
        if excluded > 0:
            slots = slots[self.outline.numbers[slots] > excluded]
            if len(slots) < self._config.clusters.segments_min:
                return None
        support, residual, coverage = self._fit(m, slots, row["pose"])
        share = support / len(slots)
        if share < limits.support_min or coverage < limits.coverage_min:
            return None
        sigma = residual / math.sqrt(support)
        return DetectedObject(
            self._models[m].name, x, y, theta, sigma, support, share * coverage,
            number=int(row["number"]), sigma_theta=self._models[m].sigma_theta(sigma),
        )  # fmt: skip

    def _placement(self, k: int) -> DetectedObject:
        """Return a placement as an object, however well it fits."""
        row, slots = self.placements.rows[k], self.placements.members(k, self.outline)
        (x, y, theta), model = wrapped_pose(row["pose"]), self._models[row["model"]]
        support, residual, coverage = self._fit(int(row["model"]), slots, row["pose"])
        sigma = residual / math.sqrt(support) if support else self._config.clusters.threshold_m
        return DetectedObject(
            model.name, x, y, theta, sigma, support, support / max(1, len(slots)) * coverage,
            number=int(row["number"]), confirmed=bool(row["is_confirmed"]), placed=not row["is_confirmed"],
            sigma_theta=model.sigma_theta(sigma) if support else None,
        )  # fmt: skip
