"""scikit-image's circular Hough transform of known radius, on an image of all segments so far.

It needs no association: a circle with enough of its pixels set is a drum.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np
from skimage.draw import line
from skimage.transform import hough_circle, hough_circle_peaks

from bench.association import Evidence
from bench.estimator import Peer
from bench.front_end import RADIUS_M, Place
from config.units import FOOT_M
from runtime.simulation.scenes import FROM_FT, TO_FT

PIXEL_M: Final = 0.05 * FOOT_M
LEFT_M: Final = (FROM_FT - 2.0) * FOOT_M - 0.37 * PIXEL_M
RIGHT_M: Final = (TO_FT + 4.0) * FOOT_M
SIDE_M: Final = 9.0 * FOOT_M + 0.41 * PIXEL_M
"""The fractions of a pixel keep the scenes' round coordinates off the grid, where they would be exact by luck."""
SHARE_MIN: Final = 0.25
"""Share of a circle's pixels that must be set; a drum shows about half of itself to the hall."""


class Hough:
    """Keeps one image of the hall; transforms it after each reading that adds to it."""

    def __init__(self) -> None:
        self._image = np.zeros((math.ceil(2.0 * SIDE_M / PIXEL_M), math.ceil((RIGHT_M - LEFT_M) / PIXEL_M)), np.bool_)
        self._radius = round(RADIUS_M / PIXEL_M)
        self._drums: list[Place] = []

    def take(self, evidence: Evidence) -> None:
        """Draw the segments and look for circles."""
        if not evidence.segments:
            return
        for _, segment in evidence.segments:
            (x1, y1), (x2, y2) = segment.ends
            rows, columns = line(*self._pixel(x1, y1), *self._pixel(x2, y2))
            inside = (rows >= 0) & (rows < self._image.shape[0]) & (columns >= 0) & (columns < self._image.shape[1])
            self._image[rows[inside], columns[inside]] = True
        votes = hough_circle(self._image, [self._radius])
        _, columns, rows, _ = hough_circle_peaks(
            votes, [self._radius], min_xdistance=2 * self._radius, min_ydistance=2 * self._radius, threshold=SHARE_MIN
        )
        places = zip(columns.tolist(), rows.tolist(), strict=True)
        self._drums = [(LEFT_M + PIXEL_M * column, PIXEL_M * row - SIDE_M) for column, row in places]

    @staticmethod
    def _pixel(x: float, y: float) -> tuple[int, int]:
        return round((y + SIDE_M) / PIXEL_M), round((x - LEFT_M) / PIXEL_M)

    def estimates(self) -> Mapping[int, Place]:
        """Return no estimates: the transform has no tracks."""
        return {}

    def drums(self) -> list[Place]:
        """Return the circles found."""
        return self._drums


PEER: Final = Peer("scikit-image hough_circle", "scikit-image", Hough)
