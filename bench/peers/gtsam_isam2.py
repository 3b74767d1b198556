"""GTSAM's iSAM2: the ring's poses and the drums' centres as variables, ranges as factors between them.

A range to a surface is the range to the centre less one radius. The poses are exact, hence their tight prior.
"""

from __future__ import annotations

from typing import Final

import gtsam

from bench.association import Evidence
from bench.estimator import Peer, Tracks
from bench.front_end import RADIUS_M
from bench.noise import INITIAL_SIGMA_M, RANGE_SIGMA_M

POSE_SIGMA: Final = 1e-5
HUBER: Final = 1.345
RELINEARIZE_SKIP: Final = 1
RELINEARIZE_THRESHOLD_M: Final = 0.001


class Isam2(Tracks):
    """One factor graph for the whole hall, updated with each reading."""

    def __init__(self) -> None:
        super().__init__()
        parameters = gtsam.ISAM2Params()
        parameters.relinearizeSkip = RELINEARIZE_SKIP
        parameters.setRelinearizeThreshold(RELINEARIZE_THRESHOLD_M)
        self._isam = gtsam.ISAM2(parameters)
        self._poses: set[int] = set()
        self._pose_noise = gtsam.noiseModel.Isotropic.Sigma(3, POSE_SIGMA)
        self._initial_noise = gtsam.noiseModel.Isotropic.Sigma(2, INITIAL_SIGMA_M)
        self._noise = gtsam.noiseModel.Robust.Create(
            gtsam.noiseModel.mEstimator.Huber.Create(HUBER), gtsam.noiseModel.Isotropic.Sigma(1, RANGE_SIGMA_M)
        )

    def update(self, evidence: Evidence) -> None:
        """Add a pose and its ranges, let iSAM2 update, and read the drums that were ranged."""
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        for track, (x, y) in evidence.initiated.items():
            key = gtsam.symbol("l", track)
            values.insert(key, gtsam.Point2(x, y))
            graph.add(gtsam.PriorFactorPoint2(key, gtsam.Point2(x, y), self._initial_noise))
            self.places[track] = (x, y)
        hits = [hit for hit in evidence.ranges if hit.track in self.places]
        for hit in hits:
            ring_key = gtsam.symbol("x", hit.reading)
            if hit.reading not in self._poses:
                self._poses.add(hit.reading)
                pose = gtsam.Pose2(*hit.ring)
                values.insert(ring_key, pose)
                graph.add(gtsam.PriorFactorPose2(ring_key, pose, self._pose_noise))
            mount = gtsam.Pose2(*hit.mount, 0.0)
            key = gtsam.symbol("l", hit.track)
            graph.add(gtsam.RangeFactorWithTransform2D(ring_key, key, hit.range_m + RADIUS_M, self._noise, mount))
        if graph.size() == 0:
            return
        self._isam.update(graph, values)
        for track in {hit.track for hit in hits}:
            x, y = self._isam.calculateEstimatePoint2(gtsam.symbol("l", track))
            self.places[track] = (float(x), float(y))


PEER: Final = Peer("gtsam iSAM2", "gtsam", Isam2)
