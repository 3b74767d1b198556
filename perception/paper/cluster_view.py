"""Clusters of the segments in the map (paper Table 1), for whoever looks on: the Bayesian method has none of its own."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.settings import PerceptionConfig
from drivers.messages import Floats
from perception.paper.clusters import cluster_segments

PLACES: Final = 3


class ClusterView:
    """Groups segments as the paper's method does.

    Parameters
    ----------
    config : PerceptionConfig
        The threshold T, how many segments a cluster needs, and how many clusters there may be.
    """

    def __init__(self, config: PerceptionConfig) -> None:
        self._config = config.clusters
        self._centres = np.zeros((config.clusters.clusters_max, 2))
        self._sizes = np.zeros(config.clusters.clusters_max, dtype=np.int64)

    def rows(self, segments: Floats) -> list[list[float]]:
        """Return a row a cluster.

        In it are the middle x, y of the rectangle around the cluster, its sides along x and y, its angle, which is 0,
        how many segments there are, and the centre x, y of the cluster itself.

        Parameters
        ----------
        segments : (n, 5) float
            Ends x, y, x, y (m), normal (rad).
        """
        n = len(segments)
        if n == 0:
            return []
        labels = np.full(n, -1, dtype=np.int64)
        whole = np.ascontiguousarray(segments, dtype=np.float64)
        count = cluster_segments(
            whole, np.ones(n, dtype=np.int64), 0, n, self._config.threshold_m, labels, self._centres, self._sizes
        )
        left = np.full((count, 2), np.inf)
        right = np.full((count, 2), -np.inf)
        inside = labels >= 0
        for ends in (whole[inside, 0:2], whole[inside, 2:4]):
            np.minimum.at(left, labels[inside], ends)
            np.maximum.at(right, labels[inside], ends)
        sizes = self._sizes[:count]
        told = np.column_stack(
            [0.5 * (left + right), right - left, np.zeros(count), sizes, self._centres[:count]]
        )[sizes >= self._config.segments_min]  # fmt: skip
        rows: list[list[float]] = np.round(told, PLACES).tolist()
        return rows
