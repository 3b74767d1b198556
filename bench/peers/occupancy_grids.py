"""The occupancy grids that others use, rebuilt from their sources: axis ray, MRPT, nav2's range layer, response grid.

Each is fed and asked as `perception.mapping.grid.evidence_grid.GridMethod`. They are slow, plain numpy.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Firing, Floats
from perception.mapping.grid.window import OCTANTS, Ring, Window, placed

Cells = tuple[NDArray[np.int64], NDArray[np.int64]]
LOG_ODDS_MAX: Final = 8.0


def logit(p: float) -> float:
    """Return the log odds of a probability."""
    return math.log(p / (1.0 - p))


class Peer(ABC):
    """A grid of log odds; a subclass enters one reading.

    Parameters
    ----------
    window : Window
        Where its cells are.
    ring : Ring
        The sensors.
    """

    planes = 1
    mirrors = 1.0
    """Not known, as of `perception.mapping.grid.evidence_grid.GridMethod`."""

    def __init__(self, window: Window, ring: Ring) -> None:
        self.window = window
        self.ring = ring
        self.log_odds: Floats = np.zeros((window.cells, window.cells, self.planes))

    def observe(self, firing: Firing, bearings: Floats, place: int, silence_m: float) -> None:
        """Enter a firing."""
        del bearings, place
        if self.window.follow(firing.pose, (self.log_odds,)):
            for sensor, r in zip(placed(firing, self.ring), firing.ranges_m.tolist(), strict=True):
                if not math.isnan(r):
                    self.enter(sensor, r, silence_m)

    def holding(self) -> NDArray[np.bool_]:
        """Return which cells of the torus are rather occupied, shape (n, n)."""
        return np.asarray((self.log_odds > 0.0).any(axis=2))

    @abstractmethod
    def enter(self, sensor: list[float], r: float, silence_m: float) -> None:
        """Enter the range `r` (m, inf without an echo) of a sensor at x, y (m) that looks in a direction (rad)."""

    def beam(self, sensor: list[float], reach: float, half: float) -> tuple[Cells, Floats, Floats, Floats]:
        """Return rows and columns, distance (m), angle off the axis and direction (rad) of the cells in a beam."""
        x, y, axis = sensor
        cell_m, n = self.window.cell_m, self.window.cells
        lows = [
            max(int(c), math.floor((at - reach) / cell_m)) for c, at in zip(self.window.corner, (x, y), strict=True)
        ]
        highs = [
            min(int(c) + n, math.ceil((at + reach) / cell_m) + 1)
            for c, at in zip(self.window.corner, (x, y), strict=True)
        ]
        iy, ix = np.meshgrid(np.arange(lows[1], highs[1]), np.arange(lows[0], highs[0]), indexing="ij")
        dx, dy = (ix + 0.5) * cell_m - x, (iy + 0.5) * cell_m - y
        d, direction = np.hypot(dx, dy), np.arctan2(dy, dx)
        off = np.mod(direction - axis + math.pi, 2.0 * math.pi) - math.pi
        ok = (d <= reach) & (np.abs(off) <= half)
        return (iy[ok] & (n - 1), ix[ok] & (n - 1)), d[ok], off[ok], direction[ok]

    def add(self, cells: Cells, values: Floats, plane: NDArray[np.int64] | int = 0) -> None:
        """Add log odds to cells, which stay within their limit."""
        at = (*cells, plane)
        self.log_odds[at] = np.clip(self.log_odds[at] + values, -LOG_ODDS_MAX, LOG_ODDS_MAX)

    def probability(self, seen_from: tuple[float, float] | None) -> NDArray[np.float32]:
        """Return the probability of each cell, row by row from the smallest y."""
        del seen_from
        most: Floats = self.window.unrolled(self.log_odds).max(axis=2)
        return np.asarray(1.0 / (1.0 + np.exp(-most)), np.float32)

    def drop_caches(self) -> None:  # noqa: B027 - a peer derives nothing
        """Do nothing: nothing depends on the cells."""

    def clear(self) -> None:
        """Forget everything."""
        self.window.clear()
        self.log_odds[:] = 0.0


class AxisRay(Peer):
    """The beam as a ray: its last cell +1.25, the cells before it −0.4, as is often taught."""

    def enter(self, sensor: list[float], r: float, silence_m: float) -> None:
        """See `Peer.enter`."""
        x, y, axis = sensor
        cell_m, mask = self.window.cell_m, self.window.cells - 1
        reach = min(r, silence_m) if math.isinf(r) else r
        along = np.arange(0.0, reach + 0.25 * cell_m, 0.5 * cell_m)
        cells = np.unique(
            np.floor(np.column_stack([y + along * math.sin(axis), x + along * math.cos(axis)]) / cell_m), axis=0
        ).astype(np.int64)
        last = np.floor(np.array([y + reach * math.sin(axis), x + reach * math.cos(axis)]) / cell_m).astype(np.int64)
        before = cells[(cells != last).any(axis=1)]
        self.add((before[:, 0] & mask, before[:, 1] & mask), np.full(len(before), -0.4))
        if math.isfinite(r):
            self.add((last[:1] & mask, last[1:] & mask), np.full(1, 1.25))


class Mrpt(Peer):
    """MRPT's COccupancyGridMap2D for a CObservationRange: the cone's triangle free, its far chord occupied.

    Defaults: certainty 0.65, the chord three times as much, invalid ranges free up to half of the last valid range.
    """

    STEP: Final = logit(0.65)

    def __init__(self, window: Window, ring: Ring) -> None:
        super().__init__(window, ring)
        self._last_m = 0.0

    def enter(self, sensor: list[float], r: float, silence_m: float) -> None:
        """See `Peer.enter`."""
        del silence_m
        half, cell_m = self.ring.half_angle, self.window.cell_m
        is_echo = math.isfinite(r)
        free = r if is_echo else 0.5 * self._last_m
        self._last_m = r if is_echo else self._last_m
        cells, d, off, _ = self.beam(sensor, (free + 2.0 * cell_m) / math.cos(half), half)
        along = d * np.cos(off)
        far = free * math.cos(half)
        values = np.where(along <= far - cell_m, -self.STEP, 0.0)
        if is_echo:
            values = np.where(np.abs(along - far - cell_m) <= 0.5 * cell_m, 3.0 * self.STEP, values)
        self.add(cells, values)


class RangeLayer(Peer):
    """nav2's RangeSensorLayer with its defaults (phi 1.2 m); a cell counts from `mark_threshold` 0.8 on."""

    PHI_M: Final = 1.2
    MARKED: Final = 233.0 / 254.0

    def enter(self, sensor: list[float], r: float, silence_m: float) -> None:
        """See `Peer.enter`; a silent beam is dropped, as the layer drops what is out of range."""
        del silence_m
        if math.isinf(r):
            return
        relative = self.window.cell_m  # the layer takes the resolution as a share of the range
        cells, d, off, _ = self.beam(sensor, r * (1.0 + relative), self.ring.half_angle)
        gamma = 1.0 - (off / self.ring.half_angle) ** 2
        weight = gamma * (1.0 - 0.5 * (1.0 + np.tanh(2.0 * (d - self.PHI_M))))
        rise = (d - (r - 2.0 * relative * r)) / (relative * r)
        peak = (r - d) / (relative * r)
        s = np.where(
            d < r - 2.0 * relative * r, 0.5 * (1.0 - weight),
            np.where(
                d < r - relative * r, 0.5 * weight * rise**2 + 0.5 * (1.0 - weight),
                weight * (0.5 - 0.5 * peak**2) + 0.5,
            ),
        )  # fmt: skip
        s = np.clip(s, 1e-6, 1.0 - 1e-6)
        self.add(cells, np.log(s / (1.0 - s)))
        x, y, axis = sensor
        mask = self.window.cells - 1
        at = np.floor(np.array([y + r * math.sin(axis), x + r * math.cos(axis)]) / self.window.cell_m).astype(
            np.int64
        )
        self.log_odds[at[0] & mask, at[1] & mask, 0] = logit(self.MARKED)

    def probability(self, seen_from: tuple[float, float] | None) -> NDArray[np.float32]:
        """Return ½ for what is not marked and the probability for what is."""
        found = super().probability(seen_from)
        return np.where(found >= 0.8, found, np.minimum(found, np.float32(0.5)))


class ResponseGrid(Peer):
    """Howard and Kitchen's response grid: log odds of a response for each of eight looking directions."""

    planes = OCTANTS
    FREE: Final = 0.4
    UNIT: Final = 4.0

    def enter(self, sensor: list[float], r: float, silence_m: float) -> None:
        """See `Peer.enter`."""
        is_echo, half = math.isfinite(r), self.ring.half_angle
        sigma = max(0.5 * self.window.cell_m, self.ring.rounding_m, 0.01 * r) if is_echo else 0.0
        free = r if is_echo else silence_m
        cells, d, off, direction = self.beam(sensor, free + 3.0 * sigma, half)
        plane = np.round(direction / (2.0 * math.pi / OCTANTS)).astype(np.int64) % OCTANTS
        gamma = 1.0 - (off / half) ** 2
        values = np.where(d < free - 2.0 * sigma, -self.FREE * gamma, 0.0)
        if is_echo:
            own = 1.0 / (1.0 + np.exp(-self.log_odds[(*cells, plane)]))
            mass = gamma * np.exp(-0.5 * ((d - r) / sigma) ** 2) * own
            q = 0.5 + 0.49 * np.minimum(1.0, self.UNIT * mass / max(1e-12, float(mass.sum())))
            values += np.log(q / (1.0 - q))
        self.add(cells, values, plane)

    def probability(self, seen_from: tuple[float, float] | None) -> NDArray[np.float32]:
        """Return the probability of a response in any direction, or towards a place."""
        if seen_from is None:
            return super().probability(None)
        n, cell_m = self.window.cells, self.window.cell_m
        x, y = ((self.window.corner[k] + np.arange(n) + 0.5) * cell_m - seen_from[k] for k in range(2))
        plane = np.round(np.arctan2(y[:, None], x[None]) / (2.0 * math.pi / OCTANTS)).astype(np.int64) % OCTANTS
        held = np.take_along_axis(self.window.unrolled(self.log_odds), plane[..., None], axis=2)[..., 0]
        return (1.0 / (1.0 + np.exp(-held))).astype(np.float32)


PEERS: Final[dict[str, Callable[[Window, Ring], Peer]]] = {
    "axis ray": AxisRay, "MRPT": Mrpt, "nav2 range layer": RangeLayer, "response grid": ResponseGrid,
}  # fmt: skip
