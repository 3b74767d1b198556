"""Candidate matches: a model placed at each cluster, kept from cycle to cycle so that each starts warm (paper §3.4).

Clusters are made anew whenever the map changes, and a cluster may get another number when an older one disappears.
A candidate therefore follows its cluster by place, and keeps the pose at which it last rested.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from config.settings import RelaxationConfig
from perception.kernel import Floats, Ints, owning_kernel
from perception.object_model import ObjectModel
from perception.paper.clusters import Clusters
from perception.paper.manual_placement import Names
from perception.paper.outline_map import OutlineMap
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
    names : Names
        Where candidates get their numbers from.
    """

    LATER: Final = ("numbers", "_numbers_before", "_names")
    """What recordings of older programs do not hold."""

    def __init__(
        self,
        models: tuple[ObjectModel, ...],
        config: RelaxationConfig,
        clusters_max: int,
        segments_min: int,
        reach_m: float,
        names: Names,
    ) -> None:
        self._models = models
        self._names = names
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
        self.numbers = np.zeros(shape, dtype=np.int64)
        """(clusters, models): by which each candidate is known; 0 where the cluster has too few segments for any."""
        self._numbers_before = np.zeros_like(self.numbers)
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
        self._numbers_before[:] = self.numbers
        known = self._known[:before].copy()
        for j in range(clusters.count):
            now = (clusters.centres[j, 0], clusters.centres[j, 1], float(clusters.sizes[j]))
            i = int(self._heir[j])
            if clusters.sizes[j] < self._segments_min:
                self._left[j] = 0
                self.rested[j] = 0
                self.numbers[j] = 0
            elif i >= 0 and self._numbers_before[i, 0] > 0:
                self.poses[j] = self._poses_before[i]
                self.rested[j] = self._rested_before[i]
                self.numbers[j] = self._numbers_before[i]
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

    def adopt(self, config: RelaxationConfig, segments_min: int, reach_m: float) -> None:
        """Go on with other constants; what rested relaxes again where those of relaxation are others."""
        self._segments_min, self._reach_m = segments_min, reach_m
        if config != self._config:
            self._config = config
            self._left[: self._count][self.numbers[: self._count] > 0] = config.iterations_max

    def extend(self, models: tuple[ObjectModel, ...], clusters: Clusters, outline: OutlineMap) -> None:
        """Try further models, which come after those from before, at the clusters as they are."""
        before, self._models = len(self._models), models
        more = len(models) - before
        for name in ("poses", "_poses_before", "_left", "_left_before", "rested", "_rested_before", "numbers",
                     "_numbers_before"):  # fmt: skip
            array = getattr(self, name)
            added = np.zeros((array.shape[0], more, *array.shape[2:]), array.dtype)
            setattr(self, name, np.ascontiguousarray(np.concatenate([array, added], axis=1)))
        for j in range(self._count):
            if self.numbers[j, 0] > 0:
                self._place(j, clusters, outline, before)

    def find(self, number: int) -> tuple[int, int] | None:
        """Return cluster and model of the candidate of this number, None where there is none."""
        found = np.argwhere(self.numbers[: self._count] == number)
        return (int(found[0, 0]), int(found[0, 1])) if len(found) else None

    def rename(self, j: int, m: int) -> None:
        """Give a candidate another number: its own has gone to something else."""
        self.numbers[j, m] = self._names.next()

    def clear(self) -> None:
        """Forget every candidate."""
        self._count = 0
        self._left[:] = 0
        self.numbers[:] = 0

    def restored(self) -> None:
        """Give numbers to the candidates of a recording that has none."""
        if self._names.last == 0:
            for j in range(self._count):
                if self._known[j, 2] >= self._segments_min:
                    self.numbers[j] = [self._names.next() for _ in self._models]

    def _place(self, j: int, clusters: Clusters, outline: OutlineMap, first: int = 0) -> None:
        """Put each model at a cluster: its outline's middle on the cluster's centre, bulging towards the sensors.

        Models before `first` stay where they are.
        """
        normals = outline.segments[clusters.members(j), 4]
        towards_sensors = math.atan2(-np.sin(normals).sum(), -np.cos(normals).sum())
        along_sides = 0.5 * math.atan2(np.sin(2.0 * normals).sum(), np.cos(2.0 * normals).sum())
        for m, model in list(enumerate(self._models))[first:]:
            theta = along_sides if model.facing is None else towards_sensors - model.facing
            c, s = math.cos(theta), math.sin(theta)
            cx, cy = model.centroid
            self.poses[j, m] = (
                clusters.centres[j, 0] - c * cx + s * cy,
                clusters.centres[j, 1] - s * cx - c * cy,
                theta,
            )
            self.numbers[j, m] = self._names.next()
        self._left[j, first:] = self._config.iterations_max
        self.rested[j, first:] = 0
