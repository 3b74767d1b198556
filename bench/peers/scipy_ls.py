"""scipy's least_squares on all ranges of a track so far, started from the last solution."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.optimize import least_squares

from bench.association import Evidence
from bench.estimator import Peer, Tracks
from bench.front_end import RADIUS_M
from bench.noise import RANGE_SIGMA_M
from drivers.messages import Floats

RANGES_MIN: Final = 4


def residuals(centre: Floats, rows: Floats) -> Floats:
    """Return expected less measured range, m, shape (n,), for rows (n, 3) of sensor x, y and range, m."""
    off: Floats = np.hypot(centre[0] - rows[:, 0], centre[1] - rows[:, 1]) - RADIUS_M - rows[:, 2]
    return off


def jacobian(centre: Floats, rows: Floats) -> Floats:
    """Return the derivative of `residuals` by the centre, shape (ranges, 2)."""
    apart = centre - rows[:, :2]
    derivative: Floats = apart / np.hypot(apart[:, 0], apart[:, 1])[:, None]
    return derivative


class LeastSquares(Tracks):
    """Keeps all ranges; solves again for each track that got one."""

    def __init__(self) -> None:
        super().__init__()
        self._rows: dict[int, list[tuple[float, float, float]]] = {}

    def update(self, evidence: Evidence) -> None:
        """Solve for the tracks that got ranges."""
        for track, place in evidence.initiated.items():
            self.places[track] = place
            self._rows[track] = []
        for hit in evidence.ranges:
            if hit.track in self._rows:
                self._rows[hit.track].append((hit.x, hit.y, hit.range_m))
        for track in {hit.track for hit in evidence.ranges} & self._rows.keys():
            if len(self._rows[track]) < RANGES_MIN:
                continue
            solved = least_squares(
                residuals,
                np.array(self.places[track]),
                jac=jacobian,
                args=(np.array(self._rows[track]),),
                loss="soft_l1",
                f_scale=2.0 * RANGE_SIGMA_M,
            )
            self.places[track] = (float(solved.x[0]), float(solved.x[1]))


PEER: Final = Peer("scipy least_squares, warm", "scipy", LeastSquares)
