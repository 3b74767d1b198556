"""Clusters of the segments in the map (paper Table 1) for display; the Bayesian method has none of its own."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.settings import PerceptionConfig
from drivers.messages import Floats
from perception.paper.clusters import cluster_segments

DECIMALS: Final = 3
"""Rows are rounded to millimetres."""


class ClusterView:
    """Clusters segments as the paper's method does.

    Parameters
    ----------
    config : PerceptionConfig
        The threshold T, the least segments of a cluster, and the largest number of clusters.
    """

    def __init__(self, config: PerceptionConfig) -> None:
        self._config = config.clusters
        self._centres = np.zeros((config.clusters.clusters_max, 2))
        self._sizes = np.zeros(config.clusters.clusters_max, dtype=np.int64)

    def rows(self, segments: Floats) -> list[list[float]]:
        """Return one row for each cluster: its bounding rectangle, the number of its segments, and its centre.

        A row holds the rectangle's middle x, y, its width along x and y, its angle, which is 0, the number of
        segments, and the centre x, y of the cluster (m).

        Parameters
        ----------
        segments : (n, 5) float
            End points x1, y1, x2, y2 (m), direction of the normal (rad).
        """
        n = len(segments)
        if n == 0:
            return []
        labels = np.full(n, -1, dtype=np.int64)
        segments = np.ascontiguousarray(segments, dtype=np.float64)
        count = cluster_segments(
            segments, np.ones(n, dtype=np.int64), 0, n, self._config.threshold_m, labels, self._centres, self._sizes
        )
        low = np.full((count, 2), np.inf)
        high = np.full((count, 2), -np.inf)
        inside = labels >= 0
        for end_points in (segments[inside, 0:2], segments[inside, 2:4]):
            np.minimum.at(low, labels[inside], end_points)
            np.maximum.at(high, labels[inside], end_points)
        sizes = self._sizes[:count]
        table = np.column_stack(
            [0.5 * (low + high), high - low, np.zeros(count), sizes, self._centres[:count]]
        )[sizes >= self._config.segments_min]  # fmt: skip
        rows: list[list[float]] = np.round(table, DECIMALS).tolist()
        return rows
