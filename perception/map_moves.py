"""How what is remembered moves when the poses of a way are corrected: each part with its map of the way."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from perception.kernel import Floats, Ints


class MapMoves(NamedTuple):
    """The motions of what is remembered of the maps of a few metres of way, by their numbers."""

    motions: Floats
    """x, y (m) and turn (rad) about the origin, shape (n, 3)."""
    middles: Floats
    """x, y of the middle of each map's way before it, m, shape (n, 2)."""

    is_first: bool = False
    """Whether all before was remembered where odometry had it, which is refuted now."""

    def of(self, submaps: Ints) -> Floats:
        """Return the motions of maps, shape (k, 3); the one that goes on moves with the last that has ended."""
        return np.asarray(self.motions[np.minimum(submaps, len(self.motions) - 1)])

    def nearest(self, x: Floats, y: Floats) -> Ints:
        """Return the map whose way is nearest to each place (m), shape (k,)."""
        away = np.hypot(x[:, None] - self.middles[:, 0], y[:, None] - self.middles[:, 1])
        return np.asarray(away.argmin(axis=1))

    def moved(self, submaps: Ints, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        """Return where places x, y (m) of maps come, and by how much directions there turn (rad), shape (k,) each."""
        to_x, to_y, turn = self.of(submaps).T
        c, s = np.cos(turn), np.sin(turn)
        return to_x + c * x - s * y, to_y + s * x + c * y, turn


class FollowsMaps(Protocol):
    """A memory whose parts move with the maps of the way."""

    def follow_maps(self, submap: int, moves: MapMoves | None) -> None:
        """Note the number of the map of the way that goes on, and move what is remembered of each."""
        ...
