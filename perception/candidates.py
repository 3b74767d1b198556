"""Candidate matches: a model placed at each cluster, kept from cycle to cycle so that each starts warm (paper §3.4).

Clusters are made anew whenever the map changes, and a cluster may get another number when an older one disappears.
A candidate therefore follows its cluster by place, and keeps the pose at which it last rested.
"""

from __future__ import annotations

import math

import numpy as np

from config.settings import RelaxationConfig
from perception.clusters import Clusters
from perception.kernel import Floats, Ints, owning_kernel
from perception.model import ObjectModel
from perception.outline_map import OutlineMap
from perception.relaxation import relax


@owning_kernel
def follow_clusters(old: Floats, new: Floats, reach: float, heir: Ints) -> None:
    """Say which old cluster each new one continues: the nearest, each at most once, the nearest pairs first.

    Parameters
    ----------
    old, new : (c, 2), (d, 2) float
        Centres, m.
    reach : float
        No farther than this, m.
    heir : (d,) int
        Out: number of the old cluster, −1 where there is none.
    """
    for j in range(new.shape[0]):
        heir[j] = -1
    taken = np.zeros(old.shape[0], dtype=np.int64)
    for _ in range(min(old.shape[0], new.shape[0])):
        best = reach
        best_old = -1
        best_new = -1
        for j in range(new.shape[0]):
            if heir[j] >= 0:
                continue
            for i in range(old.shape[0]):
                if taken[i] != 0:
                    continue
                distance = math.hypot(new[j, 0] - old[i, 0], new[j, 1] - old[i, 1])
                if distance < best:
                    best = distance
                    best_old = i
                    best_new = j
        if best_new < 0:
            return
        heir[best_new] = best_old
        taken[best_old] = 1


class Candidates:
    """One candidate for each cluster and model: where the model rests, or how far it has come.

    Parameters
    ----------
    models : tuple of ObjectModel
        What is looked for.
    config : RelaxationConfig
        The paper's constants and the bound on the work.
    clusters_max, segments_min : int
        Room for clusters; a cluster of fewer segments gets no candidate.
    reach_m : float
        How far a cluster's centre may move at once and still be the same cluster.
    """

    def __init__(
        self,
        models: tuple[ObjectModel, ...],
        config: RelaxationConfig,
        clusters_max: int,
        segments_min: int,
        reach_m: float,
    ) -> None:
        self._models = models
        self._config = config
        self._segments_min = segments_min
        self._reach_m = reach_m
        shape = (clusters_max, len(models))
        self.poses = np.zeros((*shape, 3))
        """(clusters, models, 3): x, y (m), theta (rad) of each candidate."""
        self._poses_before = np.zeros_like(self.poses)
        self._left = np.zeros(shape, dtype=np.int64)
        self._left_before = np.zeros_like(self._left)
        self.rested = np.zeros(shape, dtype=np.int64)
        """(clusters, models): 1 once the candidate has rested since it was placed."""
        self._rested_before = np.zeros_like(self.rested)
        self._known = np.zeros((clusters_max, 3))
        self._heir = np.zeros(clusters_max, dtype=np.int64)
        self._count = 0
        self._turn = 0

    @property
    def awake(self) -> int:
        """How many candidates have not come to rest."""
        return int(np.count_nonzero(self._left[: self._count]))

    @property
    def pending(self) -> bool:
        """Whether a candidate has not come to rest."""
        return self.awake > 0

    def follow(self, clusters: Clusters, outline: OutlineMap) -> None:
        """Carry candidates over to the clusters as they are now; wake those whose cluster changed; place new ones."""
        before = self._count
        follow_clusters(
            self._known[:before, :2], clusters.centres[: clusters.count], self._reach_m, self._heir[: clusters.count]
        )
        self._poses_before[:] = self.poses
        self._left_before[:] = self._left
        self._rested_before[:] = self.rested
        known = self._known[:before].copy()
        for j in range(clusters.count):
            now = (clusters.centres[j, 0], clusters.centres[j, 1], float(clusters.sizes[j]))
            i = int(self._heir[j])
            if clusters.sizes[j] < self._segments_min:
                self._left[j] = 0
                self.rested[j] = 0
            elif i >= 0 and known[i, 2] >= self._segments_min:
                self.poses[j] = self._poses_before[i]
                self.rested[j] = self._rested_before[i]
                unchanged = tuple(known[i]) == now
                self._left[j] = self._left_before[i] if unchanged else self._config.iterations_max
            else:
                self._place(j, clusters, outline)
            self._known[j] = now
        self._count = clusters.count

    def refine(self, clusters: Clusters, outline: OutlineMap) -> int:
        """Relax one candidate that has not come to rest, by one quantum; return the increments applied.

        Candidates take turns, so that none waits for another to finish.
        """
        config = self._config
        many = self._count * len(self._models)
        for k in range(many):
            j, m = divmod((self._turn + k) % many, len(self._models))
            if self._left[j, m] > 0:
                self._turn = (self._turn + k + 1) % many
                allowed = min(config.iterations_per_quantum, int(self._left[j, m]))
                done, rests = relax(
                    self._models[m].sides, outline.segments, clusters.members(j), config.gamma,
                    config.negligible_m, config.negligible_rad, allowed, self.poses[j, m],
                )  # fmt: skip
                self._left[j, m] = 0 if rests else self._left[j, m] - done
                if self._left[j, m] == 0:
                    self.rested[j, m] = 1
                return done
        return 0

    def clear(self) -> None:
        """Forget every candidate."""
        self._count = 0
        self._left[:] = 0

    def _place(self, j: int, clusters: Clusters, outline: OutlineMap) -> None:
        """Put each model at a cluster: its outline's middle on the cluster's centre, bulging towards the sensors."""
        normals = outline.segments[clusters.members(j), 4]
        towards_sensors = math.atan2(-np.sin(normals).sum(), -np.cos(normals).sum())
        along_sides = 0.5 * math.atan2(np.sin(2.0 * normals).sum(), np.cos(2.0 * normals).sum())
        for m, model in enumerate(self._models):
            theta = along_sides if model.facing is None else towards_sensors - model.facing
            c, s = math.cos(theta), math.sin(theta)
            cx, cy = model.centroid
            self.poses[j, m] = (
                clusters.centres[j, 0] - c * cx + s * cy,
                clusters.centres[j, 1] - s * cx - c * cy,
                theta,
            )
        self._left[j] = self._config.iterations_max
        self.rested[j] = 0
