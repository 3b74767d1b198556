"""Clusters of outline segments: the paper's third step (§3.3, Table 1), minimum-distance clustering.

A cluster shows where an object may be; relaxation starts a model at its centre.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from config.settings import ClustersConfig
from perception.bounds import COUNT, PLACE, Bound, bounds, index_of, up_to
from perception.kernel import Floats, Ints, kernel
from perception.paper.outline_map import OutlineMap


@kernel
def cluster_segments(
    segments: Floats,
    status: Ints,
    start: int,
    count: int,
    threshold: float,
    labels: Ints,
    centres: Floats,
    sizes: Ints,
) -> int:
    """Assign each segment, oldest first, to the nearest cluster or to a new one (Table 1); return their number.

    Parameters
    ----------
    segments : (capacity, 5) float
        End points x1, y1, x2, y2 (m), direction of the normal (rad).
    status : (capacity,) int
        0 for an empty slot.
    start, count : int
        Oldest slot and number of slots in use, circular.
    threshold : float
        T: a segment whose centre is farther than this from every cluster's centre starts a new one, m.
    labels : (capacity,) int
        Out: the cluster of each slot, −1 for none.
    centres : (c, 2) float
        Out: mean of each cluster's segment centres, m.
    sizes : (c,) int
        Out: number of segments in each cluster.

    Returns
    -------
    int
        Number of clusters. If there is no room for another one, a distant segment belongs to none.
    """
    capacity = segments.shape[0]
    clusters = 0
    for k in range(count):
        slot = (start + k) % capacity
        labels[slot] = -1
        if status[slot] == 0:
            continue
        x = 0.5 * (segments[slot, 0] + segments[slot, 2])
        y = 0.5 * (segments[slot, 1] + segments[slot, 3])
        nearest = -1
        best = math.inf
        for j in range(clusters):
            distance = math.hypot(centres[j, 0] - x, centres[j, 1] - y)
            if distance < best:
                best = distance
                nearest = j
        if best > threshold:
            if clusters == centres.shape[0]:
                continue
            nearest = clusters
            clusters += 1
            centres[nearest, 0] = x
            centres[nearest, 1] = y
            sizes[nearest] = 1
        else:
            sizes[nearest] += 1
            centres[nearest, 0] += (x - centres[nearest, 0]) / sizes[nearest]
            centres[nearest, 1] += (y - centres[nearest, 1]) / sizes[nearest]
        labels[slot] = nearest
    return clusters


@kernel
def group_by_cluster(
    labels: Ints, start: int, count: int, sizes: Ints, clusters: int, offsets: Ints, members: Ints
) -> None:
    """List the slots of each cluster, oldest first, one cluster after the other.

    Parameters
    ----------
    labels : (capacity,) int
        The cluster of each slot, −1 for none.
    start, count : int
        Oldest slot and number of slots in use, circular.
    sizes : (c,) int
        Segments in each cluster.
    clusters : int
        Number of clusters.
    offsets : (c + 1,) int
        Out: cluster j's members are ``members[offsets[j]:offsets[j + 1]]``.
    members : (capacity,) int
        Out: slots.
    """
    capacity = labels.shape[0]
    offsets[0] = 0
    for j in range(clusters):
        offsets[j + 1] = offsets[j] + sizes[j]
    for k in range(count):
        slot = (start + k) % capacity
        j = labels[slot]
        if j >= 0:
            members[offsets[j + 1] - sizes[j]] = slot
            sizes[j] -= 1
    for j in range(clusters):
        sizes[j] = offsets[j + 1] - offsets[j]


class Clusters:
    """The clusters of an outline map, computed again after each change of the map.

    Parameters
    ----------
    config : ClustersConfig
        The threshold T and the largest number of clusters.
    capacity : int
        Capacity of the map.
    """

    BOUNDS: Final = bounds(
        _labels=lambda self: Bound(-1, len(self.sizes) - 1),
        _members=lambda self: index_of(len(self._members)),
        _offsets=lambda self: up_to(len(self._members)),
        centres=PLACE,
        sizes=COUNT,
        count=lambda self: up_to(len(self.sizes)),
    )

    def __init__(self, config: ClustersConfig, capacity: int) -> None:
        self._config = config
        self._labels = np.full(capacity, -1, dtype=np.int64)
        self._members = np.zeros(capacity, dtype=np.int64)
        self._offsets = np.zeros(config.clusters_max + 1, dtype=np.int64)
        self.centres = np.zeros((config.clusters_max, 2))
        """(clusters_max, 2): m; the first `count` are valid."""
        self.sizes = np.zeros(config.clusters_max, dtype=np.int64)
        """(clusters_max,): segments in each cluster."""
        self.count = 0
        """Number of clusters."""

    def apply_settings(self, config: ClustersConfig) -> bool:
        """Use another threshold T; return whether it changed. The largest number of clusters stays."""
        before, self._config = self._config, config
        return before.threshold_m != config.threshold_m

    def update(self, outline: OutlineMap) -> None:
        """Cluster the segments of `outline`."""
        self.count = cluster_segments(
            outline.segments,
            outline.status,
            outline.start,
            outline.count,
            self._config.threshold_m,
            self._labels,
            self.centres,
            self.sizes,
        )
        group_by_cluster(
            self._labels, outline.start, outline.count, self.sizes, self.count, self._offsets, self._members
        )

    def members(self, cluster: int) -> Ints:
        """Return the slots of one cluster's segments, oldest first: a view, valid until the next update."""
        return self._members[self._offsets[cluster] : self._offsets[cluster + 1]]
