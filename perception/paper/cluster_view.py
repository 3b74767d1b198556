"""Clusters of the map's segments for display (paper Table 1), because the Bayesian method forms none itself."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from config.settings import PerceptionConfig
from drivers.messages import Floats
from perception.paper.clusters import cluster_segments

DECIMALS: Final = 3
"""Decimals of coordinates: millimetres."""


class ClusterBox(NamedTuple):
    """A cluster and the rectangle around it, m, in the odometry frame."""

    x: float
    """Middle of the rectangle."""
    y: float
    length: float
    """Side along x."""
    width: float
    """Side along y."""
    angle: float
    """Of the rectangle: always 0."""
    segments: int
    """Number of segments in the cluster."""
    centre_x: float
    """Mean of the segments' centres."""
    centre_y: float


class ClusterView:
    """Groups segments as the paper's method does.

    Parameters
    ----------
    config : PerceptionConfig
        The threshold T, the least number of segments of a cluster, and the greatest number of clusters.
    """

    def __init__(self, config: PerceptionConfig) -> None:
        self._config = config.clusters
        self._centres = np.zeros((config.clusters.clusters_max, 2))
        self._sizes = np.zeros(config.clusters.clusters_max, dtype=np.int64)

    def boxes(self, segments: Floats) -> list[ClusterBox]:
        """Return the clusters of these segments.

        Parameters
        ----------
        segments : (n, 5) float
            End points x1, y1, x2, y2 (m), direction of the normal (rad).
        """
        n = len(segments)
        if n == 0:
            return []
        labels = np.full(n, -1, dtype=np.int64)
        contiguous = np.ascontiguousarray(segments, dtype=np.float64)
        count = cluster_segments(
            contiguous, np.ones(n, dtype=np.int64), 0, n, self._config.threshold_m, labels, self._centres, self._sizes
        )
        if count == 0:
            return []
        # Sorted by cluster, each one's segments are neighbours: ten times as fast as `np.minimum.at`.
        order = np.argsort(labels, kind="stable")[np.count_nonzero(labels < 0) :]
        first = np.searchsorted(labels[order], np.arange(count))
        ends = contiguous[order, :4]
        low, high = np.minimum.reduceat(ends, first), np.maximum.reduceat(ends, first)
        low, high = np.minimum(low[:, :2], low[:, 2:]), np.maximum(high[:, :2], high[:, 2:])
        middles = np.round(0.5 * (low + high), DECIMALS).tolist()
        sides = np.round(high - low, DECIMALS).tolist()
        centres = np.round(self._centres[:count], DECIMALS).tolist()
        rows = zip(middles, sides, self._sizes[:count].tolist(), centres, strict=True)
        return [
            ClusterBox(x, y, length, width, 0.0, size, centre_x, centre_y)
            for (x, y), (length, width), size, (centre_x, centre_y) in rows
            if size >= self._config.segments_min
        ]
