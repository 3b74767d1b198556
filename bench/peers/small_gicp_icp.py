"""small_gicp's point-to-point ICP: aligns the segment ends of a track with a drum's outline, warm-started."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import small_gicp

from bench.association import Evidence
from bench.estimator import Peer, Tracks
from bench.front_end import RADIUS_M

OUTLINE_POINTS: Final = 720
CORRESPONDENCE_MAX_M: Final = 0.3
POINTS_MIN: Final = 12
"""The library warns below this."""


class Icp(Tracks):
    """Keeps all points; aligns them again for each track that got some."""

    def __init__(self) -> None:
        super().__init__()
        angles = np.linspace(0.0, 2.0 * np.pi, OUTLINE_POINTS, endpoint=False)
        outline = np.column_stack([RADIUS_M * np.cos(angles), RADIUS_M * np.sin(angles), np.zeros(OUTLINE_POINTS)])
        self._drum = small_gicp.PointCloud(outline)
        self._tree: Any = small_gicp.KdTree(self._drum)
        self._points: dict[int, list[tuple[float, float, float]]] = {}

    def update(self, evidence: Evidence) -> None:
        """Align the tracks that got segments."""
        self.places.update(evidence.initiated)
        for track, segment in evidence.segments:
            self._points.setdefault(track, []).extend((x, y, 0.0) for x, y in segment.ends)
        for track in {track for track, _ in evidence.segments} & self.places.keys():
            points = np.array(self._points[track])
            if len(points) < POINTS_MIN:
                continue
            guess = np.eye(4)
            guess[:2, 3] = -np.array(self.places[track])
            aligned = small_gicp.align(
                self._drum,
                small_gicp.PointCloud(points),
                self._tree,
                guess,
                registration_type="ICP",
                max_correspondence_distance=CORRESPONDENCE_MAX_M,
                translation_epsilon=1e-4,
            )
            centre = np.linalg.inv(aligned.T_target_source)[:2, 3]
            self.places[track] = (float(centre[0]), float(centre[1]))


PEER: Final = Peer("small_gicp ICP on segments", "small-gicp", Icp)
