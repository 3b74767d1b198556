"""Candidates: a model placed at each cluster, kept from cycle to cycle so that relaxation starts warm (paper §3.4).

Clusters are computed again whenever the map changes, and a cluster's index may change. A candidate therefore follows
its cluster by position and keeps the pose it has reached.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from config.settings import ITERATIONS_MAX, RelaxationConfig
from perception.bounds import CONSTANT, COUNT, FLAG, PLACE, Bound, bounds, up_to
from perception.kernel import Floats, Ints, owning_kernel
from perception.object_model import ObjectModel
from perception.paper.clusters import Clusters
from perception.paper.manual_placement import NumberSource
from perception.paper.outline_map import OutlineMap
from perception.relaxation import relax

CANDIDATE: Final = np.dtype(
    [("pose", np.float64, 3), ("iterations_left", np.int64), ("has_rested", np.int64), ("number", np.int64)]
)
"""A candidate: x, y (m), theta (rad); the iterations that it may still take, 0 at rest; 1 once it has come to rest
since it was placed; the number it is known by, 0 if its cluster has too few segments."""


@owning_kernel
def follow_clusters(old: Floats, new: Floats, reach: float, predecessor: Ints) -> None:
    """Find the old cluster that each new one continues: the nearest, each at most once, nearest pairs first.

    Parameters
    ----------
    old, new : (c, 2), (d, 2) float
        Centres, m.
    reach : float
        Largest distance, m.
    predecessor : (d,) int
        Out: index of the old cluster, −1 for none.
    """
    for j in range(new.shape[0]):
        predecessor[j] = -1
    taken = np.zeros(old.shape[0], dtype=np.int64)
    for _ in range(min(old.shape[0], new.shape[0])):
        best = reach
        best_old = -1
        best_new = -1
        for j in range(new.shape[0]):
            if predecessor[j] >= 0:
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
        predecessor[best_new] = best_old
        taken[best_old] = 1


class Candidates:
    """One candidate for each cluster and model.

    Parameters
    ----------
    models : tuple of ObjectModel
        The objects to recognise.
    config : RelaxationConfig
        The paper's constants and the bound on the work.
    clusters_max, segments_min : int
        Largest number of clusters; a cluster of fewer segments gets no candidate.
    reach_m : float
        How far a cluster's centre may move at once and still be the same cluster.
    numbers : NumberSource
        Gives candidates their numbers.
    """

    BOUNDS: Final = bounds(
        _segments_min=CONSTANT,
        _reach_m=CONSTANT,
        rows={"pose": PLACE, "iterations_left": up_to(ITERATIONS_MAX), "has_rested": FLAG, "number": COUNT},
        _centres=PLACE,
        _sizes=COUNT,
        _predecessor=lambda self: Bound(-1, len(self._sizes) - 1),
        _count=lambda self: up_to(len(self._sizes)),
        _turn=COUNT,
    )

    def __init__(
        self,
        models: tuple[ObjectModel, ...],
        config: RelaxationConfig,
        clusters_max: int,
        segments_min: int,
        reach_m: float,
        numbers: NumberSource,
    ) -> None:
        self._models = models
        self._numbers = numbers
        self._config = config
        self._segments_min = segments_min
        self._reach_m = reach_m
        self.rows = np.zeros((clusters_max, len(models)), CANDIDATE)
        """(clusters_max, models): the candidates by cluster and model."""
        self._centres = np.zeros((clusters_max, 2))
        """Centres of the clusters that the candidates follow, m."""
        self._sizes = np.zeros(clusters_max, dtype=np.int64)
        self._predecessor = np.zeros(clusters_max, dtype=np.int64)
        self._count = 0
        self._turn = 0

    @property
    def pending(self) -> int:
        """The number of candidates that are not at rest."""
        return int(np.count_nonzero(self.rows["iterations_left"][: self._count]))

    def follow(self, clusters: Clusters, outline: OutlineMap) -> None:
        """Move candidates to the present clusters; restart those whose cluster changed; place new ones."""
        follow_clusters(
            self._centres[: self._count],
            clusters.centres[: clusters.count],
            self._reach_m,
            self._predecessor[: clusters.count],
        )
        before = self.rows.copy()
        centres, sizes = self._centres.copy(), self._sizes.copy()
        self._count = clusters.count
        self._centres[: self._count] = clusters.centres[: self._count]
        self._sizes[: self._count] = clusters.sizes[: self._count]
        for j in range(self._count):
            i = int(self._predecessor[j])
            if self._sizes[j] < self._segments_min:
                self.rows[["iterations_left", "has_rested", "number"]][j] = 0
            elif i >= 0 and before["number"][i, 0] > 0:
                self.rows[j] = before[i]
                if self._sizes[j] != sizes[i] or not np.array_equal(self._centres[j], centres[i]):
                    self.rows["iterations_left"][j] = self._config.iterations_max
            else:
                self._place(j, clusters, outline)

    def refine(self, clusters: Clusters, outline: OutlineMap) -> int:
        """Relax one candidate that is not at rest by one quantum; return the iterations done.

        Candidates take turns, so that none waits for another to finish.
        """
        config = self._config
        many = self._count * len(self._models)
        for k in range(many):
            j, m = divmod((self._turn + k) % many, len(self._models))
            left = int(self.rows["iterations_left"][j, m])
            if left > 0:
                self._turn = (self._turn + k + 1) % many
                done, rests = relax(
                    self._models[m].sides,
                    outline.segments,
                    clusters.members(j),
                    config.gamma,
                    config.negligible_m,
                    config.negligible_rad,
                    min(config.iterations_per_quantum, left),
                    self.rows["pose"][j, m],
                )
                left = 0 if rests else left - done
                self.rows["iterations_left"][j, m] = left
                if left == 0:
                    self.rows["has_rested"][j, m] = 1
                return done
        return 0

    def apply_settings(self, config: RelaxationConfig, segments_min: int, reach_m: float) -> None:
        """Use other settings; if those of relaxation changed, all candidates relax again.

        Parameters
        ----------
        config, segments_min, reach_m
            As for the class.
        """
        self._segments_min, self._reach_m = segments_min, reach_m
        if config != self._config:
            self._config = config
            used = self.rows[: self._count]
            used["iterations_left"][used["number"] > 0] = config.iterations_max

    def extend(self, models: tuple[ObjectModel, ...], clusters: Clusters, outline: OutlineMap) -> None:
        """Try further models, which follow the present ones in `models`, at the present clusters.

        Parameters
        ----------
        models : tuple of ObjectModel
            The present models and the further ones.
        clusters : Clusters
            The present clusters.
        outline : OutlineMap
            Their segments.
        """
        before, self._models = len(self._models), models
        added = np.zeros((len(self.rows), len(models) - before), CANDIDATE)
        self.rows = np.ascontiguousarray(np.concatenate([self.rows, added], axis=1))
        for j in range(self._count):
            if self.rows["number"][j, 0] > 0:
                self._place(j, clusters, outline, before)

    def find(self, number: int) -> tuple[int, int] | None:
        """Return cluster and model of the candidate with this number, None if it does not exist."""
        found = np.argwhere(self.rows["number"][: self._count] == number)
        return (int(found[0, 0]), int(found[0, 1])) if len(found) else None

    def renumber(self, j: int, m: int) -> None:
        """Give a candidate a new number: another object has taken over its own."""
        self.rows["number"][j, m] = self._numbers.next()

    def restore(self, number: int, m: int, pose: tuple[float, float, float]) -> bool:
        """Give the candidate nearest to a pose (m, rad) that pose and a number; return whether there is one.

        Parameters
        ----------
        number, m
            The object's number and the index of its model.
        pose : (float, float, float)
            Where it had come to rest.
        """
        used = np.flatnonzero(self.rows["number"][: self._count, m] > 0)
        if not len(used):
            return False
        off = np.hypot(*(self.rows["pose"][used, m, :2] - pose[:2]).T)
        self.rows[used[off.argmin()], m] = (pose, 0, 1, number)
        return True

    def clear(self) -> None:
        """Remove every candidate."""
        self._count = 0
        self.rows["iterations_left"] = 0
        self.rows["number"] = 0

    def _place(self, j: int, clusters: Clusters, outline: OutlineMap, first: int = 0) -> None:
        """Overwrite the candidates of cluster `j`, of the models from index `first` on, with new ones.

        The centroid is at the cluster's centre; an open outline bulges towards the sensors, a closed one lies along
        the segments. Each gets a new number and all its iterations.
        """
        normals = outline.segments[clusters.members(j), 4]  # directions away from the sensors
        towards_sensors = math.atan2(-np.sin(normals).sum(), -np.cos(normals).sum())
        along_sides = 0.5 * math.atan2(np.sin(2.0 * normals).sum(), np.cos(2.0 * normals).sum())
        for m, model in list(enumerate(self._models))[first:]:
            theta = along_sides if model.facing is None else towards_sensors - model.facing
            c, s = math.cos(theta), math.sin(theta)
            cx, cy = model.centroid
            pose = (clusters.centres[j, 0] - c * cx + s * cy, clusters.centres[j, 1] - s * cx - c * cy, theta)
            self.rows[j, m] = (pose, self._config.iterations_max, 0, self._numbers.next())
