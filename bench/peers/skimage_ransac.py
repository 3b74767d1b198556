"""scikit-image's ransac with CircleModel on the segment ends of each track; fits with a wrong radius are rejected."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from skimage.measure import CircleModel, ransac

from bench.association import Evidence
from bench.estimator import Peer, Tracks
from bench.front_end import RADIUS_M, Place
from config.units import FOOT_M
from drivers.messages import Floats

POINTS_MIN: Final = 8
INLIER_M: Final = 0.1 * FOOT_M
RADIUS_TOLERANCE_M: Final = 0.3 * FOOT_M
TRIALS: Final = 50


class Ransac(Tracks):
    """Keeps all points; fits a circle again for each track that got some."""

    def __init__(self) -> None:
        super().__init__()
        self._rng = np.random.default_rng(0)
        self._points: dict[int, list[tuple[float, float]]] = {}

    def update(self, evidence: Evidence) -> None:
        """Fit the tracks that got segments."""
        self.places.update(evidence.initiated)
        for track, segment in evidence.segments:
            self._points.setdefault(track, []).extend(segment.ends)
        for track in {track for track, _ in evidence.segments} & self.places.keys():
            points = np.array(self._points[track])
            if len(points) >= POINTS_MIN and (centre := self._fit(points)) is not None:
                self.places[track] = centre

    def estimates(self) -> Mapping[int, Place]:
        """Return no estimates: a circle through few points may lie anywhere and would mislead the association."""
        return {}

    def _fit(self, points: Floats) -> Place | None:
        def has_the_radius(model: Any, *_: Any) -> bool:
            return bool(model) and abs(float(model.radius) - RADIUS_M) <= RADIUS_TOLERANCE_M

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # on collinear points, for example
            model, _ = ransac(
                points, CircleModel, min_samples=3, residual_threshold=INLIER_M, is_model_valid=has_the_radius,
                max_trials=TRIALS, rng=self._rng,
            )  # fmt: skip
        return (float(model.center[0]), float(model.center[1])) if model else None


PEER: Final = Peer("scikit-image ransac CircleModel", "scikit-image", Ransac, slow=True)
