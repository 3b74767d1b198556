"""The paper's method: outline segments, clusters of them, and a model relaxed onto each cluster.

`observe` takes in one firing: segments, ageing, contradictions, clusters (paper §3.1 to §3.3). `refine` relaxes one
candidate by one quantum (§3.4).
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
from perception.candidates import Candidates
from perception.clusters import Clusters
from perception.kernel import Floats
from perception.model import ObjectModel
from perception.outline_map import OutlineMap
from perception.recognition import goodness_of_fit
from perception.seen import SeenObject, Tally
from perception.segments import SegmentExtractor, mounts_array


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

    def __init__(self, ring: RingConfig, models: Sequence[ModelConfig], config: PerceptionConfig) -> None:
        mounts = mounts_array(ring.mounts)
        self._config = config
        self._models = tuple(ObjectModel.from_config(m) for m in models)
        self._scratch = np.zeros(max(len(m.sides) for m in self._models), dtype=np.int64)
        self._extractor = SegmentExtractor(ring, config.segments)
        self.outline = OutlineMap(config.map, mounts, math.radians(ring.beam_half_angle_deg))
        self.clusters = Clusters(config.clusters, config.map.capacity)
        self.candidates = Candidates(
            self._models, config.relaxation, config.clusters.clusters_max,
            config.clusters.segments_min, config.clusters.threshold_m,
        )  # fmt: skip

    @property
    def pending(self) -> bool:
        """Whether refinement has anything left to improve."""
        return self.candidates.pending

    @property
    def waiting(self) -> bool:
        """The same: no candidate waits for a firing."""
        return self.pending

    def observe(self, firing: Firing) -> int:
        """Take in one firing and return how many outline segments it completed."""
        segments = self._extractor.extract(firing)
        living = self.outline.count
        erased = self.outline.contradict(firing)
        self.outline.age(firing.t_s)
        changed = erased > 0 or len(segments) > 0 or self.outline.count != living
        self.outline.add(segments, firing.t_s)
        if changed:
            self.clusters.update(self.outline)
            self.candidates.follow(self.clusters, self.outline)
        return len(segments)

    def refine(self) -> int:
        """Do one quantum of refinement and return its iterations, zero where nothing is left to improve."""
        return self.candidates.refine(self.clusters, self.outline)

    @property
    def tally(self) -> Tally:
        """How many segments and clusters there are."""
        return Tally(self.outline.living, self.outline.total, self.clusters.count)

    def segments_now(self) -> Floats:
        """Return the outline segments in the map: ends x, y, x, y (m) and normal (rad), shape (n, 5), a copy."""
        living: Floats = self.outline.segments[self.outline.alive == 1]
        return living

    def objects(self) -> tuple[SeenObject, ...]:
        """Return what is recognised now, best first.

        Candidates that rest on one another explain one object, and the best of them stays: a cluster that Table 1
        split gives two candidates of one model, and a cluster gives a candidate for each model.
        """
        many = range(len(self._models))
        judged = [s for j in range(self.clusters.count) for m in many if (s := self._judge(j, m)) is not None]
        seen: list[SeenObject] = []
        for candidate in sorted(judged, key=lambda s: s.score, reverse=True):
            apart = self._config.recognition.separation_m
            if all(math.hypot(candidate.x - s.x, candidate.y - s.y) >= apart for s in seen):
                seen.append(candidate)
        return tuple(seen)

    def things(self) -> tuple[SeenObject, ...]:
        """Return everything that has a name: here the objects."""
        return self.objects()

    def forget(self) -> None:
        """Begin anew, as after the odometry did."""
        self._extractor.forget()
        self.outline.clear()
        self.clusters.update(self.outline)
        self.candidates.clear()

    def adopt(self, config: PerceptionConfig) -> None:
        """Go on with other limits of recognition and ageing; what sizes an array stays."""
        self._config = config
        self.outline.adopt(config.map)

    def restored(self) -> None:
        """Drop what was worked out before the memory was put back from a snapshot: here nothing."""

    def _judge(self, cluster: int, m: int) -> SeenObject | None:
        """Return the candidate as an object if it fits well enough."""
        if not self.candidates.rested[cluster, m]:
            return None
        limits = self._config.recognition
        x, y, theta = (float(v) for v in self.candidates.poses[cluster, m])
        support, residual, coverage = goodness_of_fit(
            self._models[m].sides, self.outline.segments, self.clusters.members(cluster), x, y, theta,
            limits.tolerance_m, math.radians(limits.tolerance_deg), self._scratch,
        )  # fmt: skip
        share = support / int(self.clusters.sizes[cluster])
        if share < limits.support_min or coverage < limits.coverage_min:
            return None
        theta = (theta + math.pi) % (2.0 * math.pi) - math.pi
        return SeenObject(self._models[m].name, x, y, theta, residual / math.sqrt(support), support, share * coverage)
