"""The paper's method: outline segments, clusters of them, and a model relaxed onto each cluster.

`observe` takes in one firing: segments, ageing, contradictions, clusters (paper §3.1 to §3.3). `refine` relaxes one
candidate by one quantum (§3.4). `edit` does what a person says.
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
from perception.detected_object import DetectedObject, MapCounts
from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    Edit,
    Evidence,
    Line,
    MoveObject,
    PinSegments,
    PlaceModel,
    RejectObject,
    Segments,
    no_such_object,
    no_such_segments,
)
from perception.kernel import Floats, Ints
from perception.object_model import ObjectModel
from perception.paper.candidates import Candidates
from perception.paper.clusters import Clusters
from perception.paper.manual_placement import (
    CONFIRMED,
    MODEL,
    NUMBER,
    ROOM,
    Names,
    Placements,
    Rejections,
    facing_from,
)
from perception.paper.outline_map import OutlineMap
from perception.paper.recognition import goodness_of_fit
from perception.paper.segments import SegmentExtractor
from perception.sensor_mounts import mounts_array


class PaperPerception:
    """Echoes to objects, by the paper's method.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    models : sequence of ModelConfig
        What is looked for.
    config : PerceptionConfig
        The constants of each step.
    """

    SCRATCH: Final = ("_scratch",)
    """Only for reporting, and no memory."""
    LATER: Final = ("_names", "placements", "_rejections", "_by_hand")
    """What recordings of older programs do not hold."""

    def __init__(self, ring: RingConfig, models: Sequence[ModelConfig], config: PerceptionConfig) -> None:
        mounts = mounts_array(ring.mounts)
        self._config = config
        self._models = tuple(ObjectModel.from_config(m) for m in models)
        self._scratch = np.zeros(max(len(m.sides) for m in self._models), dtype=np.int64)
        self._extractor = SegmentExtractor(ring, config.segments)
        self.outline = OutlineMap(config.map, mounts, math.radians(ring.beam_half_angle_deg))
        self.clusters = Clusters(config.clusters, config.map.capacity)
        self._names = Names()
        self.candidates = Candidates(
            self._models, config.relaxation, config.clusters.clusters_max,
            config.clusters.segments_min, config.clusters.threshold_m, self._names,
        )  # fmt: skip
        self.placements = Placements(self._models, config.relaxation, config.clusters.threshold_m)
        self._rejections = Rejections()
        self._by_hand = False

    @property
    def can_refine(self) -> bool:
        """Whether `refine` has anything to improve now."""
        return self.placements.pending or self.candidates.pending

    @property
    def converged(self) -> bool:
        """Whether nothing is left to improve, now or with the next firing."""
        return not self.can_refine

    def observe(self, firing: Firing) -> int:
        """Take in one firing and return how many outline segments it completed."""
        segments = self._extractor.extract(firing)
        erased = self.outline.contradict(firing)
        aged = self.outline.age(firing.robot_s)
        self.outline.add(segments, firing.robot_s)
        if erased > 0 or len(segments) > 0 or aged:
            self._follow()
        return len(segments)

    def refine(self) -> int:
        """Do one quantum of refinement and return its iterations, zero where nothing is left to improve."""
        self._by_hand = self.placements.pending and not (self._by_hand and self.candidates.pending)
        if self._by_hand:
            return self.placements.refine(self.outline)
        return self.candidates.refine(self.clusters, self.outline)

    @property
    def counts(self) -> MapCounts:
        """How many segments and clusters there are."""
        return MapCounts(self.outline.living, self.outline.total, self.clusters.count)

    def segment_geometry(self) -> Floats:
        """Return the outline segments in the map: ends x, y, x, y (m) and normal (rad), shape (n, 5), a copy."""
        return self.outline.listed().geometry

    def segments(self) -> Segments:
        """Return the outline segments in the map with all that is known of them."""
        return self.outline.listed()

    def objects(self) -> tuple[DetectedObject, ...]:
        """Return what is recognised now, best first.

        Candidates that rest on one another explain one object, and the best of them stays: a cluster that Table 1
        split gives two candidates of one model, and a cluster gives a candidate for each model. What a person placed
        or confirmed stays in any case.
        """
        many = range(len(self._models))
        judged = [s for j in range(self.clusters.count) for m in many if (s := self._judge(j, m)) is not None]
        seen = [self._judge_placement(k) for k in range(self.placements.count)]
        for candidate in sorted(judged, key=lambda s: s.score, reverse=True):
            apart = self._config.recognition.separation_m
            if all(math.hypot(candidate.x - s.x, candidate.y - s.y) >= apart for s in seen):
                seen.append(candidate)
        return tuple(sorted(seen, key=lambda s: s.score, reverse=True))

    def labelled_objects(self) -> tuple[DetectedObject, ...]:
        """Return everything that has a name: here the objects."""
        return self.objects()

    def reset(self) -> None:
        """Begin anew, as after the odometry did."""
        self._extractor.reset()
        self.outline.clear()
        self.clusters.update(self.outline)
        self.candidates.clear()
        self.placements.clear()
        self._rejections.clear()

    def apply_settings(self, config: PerceptionConfig) -> None:
        """Go on with other constants; what sizes an array stays."""
        relaxation, segments_min = self._config.relaxation, self._config.clusters.segments_min
        self._config = config
        self._extractor.apply_settings(config.segments)
        self.outline.adopt(config.map)
        others = self.clusters.adopt(config.clusters) or segments_min != config.clusters.segments_min
        self.candidates.adopt(config.relaxation, config.clusters.segments_min, config.clusters.threshold_m)
        self.placements.adopt(self._models, config.relaxation, config.clusters.threshold_m)
        if config.relaxation != relaxation:
            self.placements.wake_all()
        if others:
            self._follow()

    def set_models(self, models: Sequence[ModelConfig]) -> None:
        """Look for further models as well, which come after those from before."""
        self._models = tuple(ObjectModel.from_config(m) for m in models)
        self._scratch = np.zeros(max(len(m.sides) for m in self._models), dtype=np.int64)
        self.candidates.extend(self._models, self.clusters, self.outline)
        self.placements.adopt(self._models, self._config.relaxation, self._config.clusters.threshold_m)

    def drop_caches(self) -> None:
        """Make good what the snapshot of an older program does not hold."""
        self.outline.restored()
        self.candidates.restored()

    def edit(self, edit: Edit) -> str | None:
        """Do what a person says; return None, or why it cannot be done."""
        match edit:
            case DeleteSegments(numbers):
                missing = self.outline.delete(numbers)
            case PinSegments(numbers, pinned):
                refused = self.outline.pin(numbers, pinned=pinned)
                if refused is None:
                    return "no more segments can be pinned: they would fill half the map"
                missing = refused
            case PlaceModel(model, x, y, theta):
                m = next((m for m, known in enumerate(self._models) if known.name == model), None)
                if m is None:
                    return f"no model is called {model}: load it first"
                return self._put(self._names.last + 1, m, (x, y, theta), confirmed=False)
            case MoveObject(number, x, y, theta):
                return self._say(number, (x, y, theta), confirmed=None)
            case ConfirmObject(number):
                return self._say(number, None, confirmed=True)
            case RejectObject(number):
                return self._reject(number)
            case ClearMap():
                self.reset()
                return None
        self._follow()
        return no_such_segments(missing) if missing else None

    def evidence(self, number: int) -> Evidence | None:
        """Return the segments around an object, and which of them lie on it."""
        k = self.placements.find(number)
        found = self.candidates.find(number)
        if k >= 0:
            m, pose = int(self.placements.rows[k, MODEL]), self.placements.poses[k]
            slots = self.placements.members(k, self.outline)
        elif found is not None:
            m, pose, slots = found[1], self.candidates.poses[found], self.clusters.members(found[0])
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

    def _follow(self) -> None:
        """Cluster the map as it is now, and let candidates and placements follow."""
        self.clusters.update(self.outline)
        self.candidates.follow(self.clusters, self.outline)
        self.placements.wake(self.outline)

    def _put(self, number: int, m: int, pose: tuple[float, float, float], *, confirmed: bool) -> str | None:
        """Have a placement stand at a pose; return why not."""
        if self.placements.find(number) < 0 and self.placements.count == ROOM:
            return f"{ROOM} objects stand by hand already: reject one first"
        self._names.last = max(self._names.last, number)
        self.placements.put(number, m, pose, confirmed=confirmed)
        return None

    def _say(self, number: int, pose: tuple[float, float, float] | None, *, confirmed: bool | None) -> str | None:
        """Make an object a placement, at a pose or where it rests; return why not."""
        k = self.placements.find(number)
        if k >= 0:
            was = bool(self.placements.rows[k, CONFIRMED])
            at = facing_from(self.placements.poses[k]) if pose is None else pose
            return self._put(
                number, int(self.placements.rows[k, MODEL]), at, confirmed=was if confirmed is None else confirmed
            )
        found = self.candidates.find(number)
        if found is None:
            return no_such_object(number)
        at = facing_from(self.candidates.poses[found]) if pose is None else pose
        refused = self._put(number, found[1], at, confirmed=bool(confirmed))
        if refused is None:
            self.candidates.rename(*found)
        return refused

    def _reject(self, number: int) -> str | None:
        k = self.placements.find(number)
        found = self.candidates.find(number)
        if k >= 0:
            m, (x, y, _) = int(self.placements.rows[k, MODEL]), facing_from(self.placements.poses[k])
            self.placements.take_away(k)
        elif found is not None:
            m, (x, y, _) = found[1], facing_from(self.candidates.poses[found])
            self.candidates.rename(*found)
        else:
            return no_such_object(number)
        self._rejections.add(x, y, self._config.recognition.separation_m, m, self.outline.total)
        return None

    def _fit(self, m: int, slots: Ints, pose: Floats) -> tuple[int, float, float]:
        """Return how many of the segments lie on a model, how far off they are, and how much of it they cover."""
        limits = self._config.recognition
        x, y, theta = (float(v) for v in pose)
        return goodness_of_fit(
            self._models[m].sides, self.outline.segments, slots, x, y, theta,
            limits.tolerance_m, math.radians(limits.tolerance_deg), self._scratch,
        )  # fmt: skip

    def _judge(self, cluster: int, m: int) -> DetectedObject | None:
        """Return the candidate as an object if it fits well enough."""
        if not self.candidates.rested[cluster, m]:
            return None
        limits, slots = self._config.recognition, self.clusters.members(cluster)
        x, y, theta = facing_from(self.candidates.poses[cluster, m])
        newest = self._rejections.since(x, y, m)
        if newest > 0:
            slots = slots[self.outline.numbers[slots] > newest]
            if len(slots) < self._config.clusters.segments_min:
                return None
        support, residual, coverage = self._fit(m, slots, self.candidates.poses[cluster, m])
        share = support / len(slots)
        if share < limits.support_min or coverage < limits.coverage_min:
            return None
        return DetectedObject(
            self._models[m].name, x, y, theta, residual / math.sqrt(support), support, share * coverage,
            number=int(self.candidates.numbers[cluster, m]),
        )  # fmt: skip

    def _judge_placement(self, k: int) -> DetectedObject:
        """Return a placement as an object, however well it fits."""
        row, slots = self.placements.rows[k], self.placements.members(k, self.outline)
        x, y, theta = facing_from(self.placements.poses[k])
        support, residual, coverage = self._fit(int(row[MODEL]), slots, self.placements.poses[k])
        sigma = residual / math.sqrt(support) if support else self._config.clusters.threshold_m
        return DetectedObject(
            self._models[row[MODEL]].name, x, y, theta, sigma, support, support / max(1, len(slots)) * coverage,
            number=int(row[NUMBER]), confirmed=bool(row[CONFIRMED]), placed=not row[CONFIRMED],
        )  # fmt: skip
