"""The directed evidence grid again, slow and plain: a dictionary of cells, angles by trigonometry, no torus.

See `perception.mapping.grid.directed`.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, field

from drivers.messages import Floats
from perception.mapping.grid import cell_evidence
from perception.mapping.grid import directed as d
from perception.mapping.grid.cell_evidence import CERTAIN, FADING_PLACES, NAT, UNDIRECTED
from perception.mapping.grid.elfes import ARC_SIGMAS
from perception.mapping.grid.window import SPREAD_CELLS, SPREAD_RELATIVE


@dataclass
class Evidence:
    """The evidence of a cell in one direction."""

    base: int = 0
    hit: int = 0
    free: int = 0
    stamp: int = 0

    def now(self, place: int) -> int:
        """Return it as it has faded."""
        value = max(-CERTAIN, min(CERTAIN, self.base + self.hit + self.free))
        return int(math.copysign(max(0, abs(value) - (place - self.stamp) // FADING_PLACES), value))

    def renew(self, place: int) -> None:
        """Begin a new place."""
        if place != self.stamp:
            self.base, self.hit, self.free, self.stamp = self.now(place), 0, 0, place

    def prior(self) -> float:
        """Return the square of the probability without this place's hits."""
        value = max(-CERTAIN, min(CERTAIN, self.base + self.free))
        return (1.0 + math.exp(-value / NAT)) ** -2


@dataclass
class NaiveGrid:
    """Cells by their number in x and y, each with nine evidences."""

    half_angle: float
    rounding_m: float
    cell_m: float
    cells: dict[tuple[int, int], list[Evidence]] = field(
        default_factory=lambda: defaultdict(lambda: [Evidence() for _ in range(9)])
    )

    def enter(self, sensors: list[tuple[float, float, float]], ranges: Floats, bearings: Floats, place: int,
              silence_m: float, mirrors: float) -> None:  # fmt: skip
        """Enter a firing of sensors at x, y (m) that look in a direction (rad)."""
        beams = [
            (sensor, float(r), float(bearing))
            for sensor, r, bearing in zip(sensors, ranges, bearings, strict=True)
            if not math.isnan(r)
        ]
        for sensor, r, _ in beams:
            limit = r - self.sigma(r) if math.isfinite(r) else silence_m
            is_echo = math.isfinite(r)
            weight = (
                d.PASSED * (1.0 - d.MIRRORS_PASSED * mirrors)
                if is_echo
                else d.SILENT_NAT * (1.0 - d.MIRRORS_SILENT * mirrors)
            )
            weight_both = d.SILENT_NAT
            for cell, away, inside, k in self.beam(sensor, limit):
                if away < limit:
                    for index, most in ((k, weight), (UNDIRECTED, weight_both)):
                        evidence = self.cells[cell][index]
                        evidence.renew(place)
                        evidence.free = min(evidence.free, -int(most * inside))
        for sensor, r, bearing in beams:
            if math.isfinite(r):
                self.hit(sensor, r, bearing, place, mirrors)

    def hit(self, sensor: tuple[float, float, float], r: float, bearing: float, place: int, mirrors: float) -> None:
        """Enter an echo's arc, or its contact where its bearing is known."""
        sigma = self.sigma(r)
        beam = self.beam(sensor, r + ARC_SIGMAS * sigma)
        units = (
            (d.DIRECTED_UNIT + d.MIRRORS_UNIT * mirrors, d.DIRECTED_ARC_SIGMAS),
            (cell_evidence.UNDIRECTED_UNIT, ARC_SIGMAS),
        )
        for unit, sigmas in units:
            is_directed = sigmas == d.DIRECTED_ARC_SIGMAS
            arc = [
                (cell, k if is_directed else UNDIRECTED, inside * math.exp(-0.5 * ((away - r) / sigma) ** 2))
                for cell, away, inside, k in beam
                if abs(away - r) <= sigmas * sigma
            ]
            if not math.isnan(bearing):
                dx, dy = r * math.cos(sensor[2] + bearing), r * math.sin(sensor[2] + bearing)
                contact = (math.floor((sensor[0] + dx) / self.cell_m), math.floor((sensor[1] + dy) / self.cell_m))
                arc = [(contact, looking(dx, dy) if is_directed else UNDIRECTED, 1.0)]
            evidences = [self.cells[cell][k] for cell, k, _ in arc]
            for evidence in evidences:
                evidence.renew(place)
            drawn = [share * evidence.prior() for (_, _, share), evidence in zip(arc, evidences, strict=True)]
            for evidence, part in zip(evidences, drawn, strict=True):
                q = 0.5 + 0.49 * min(1.0, unit * part / sum(drawn))
                evidence.hit = max(evidence.hit, int(NAT * math.log(q / (1.0 - q))))

    def sigma(self, r: float) -> float:
        """Return the standard deviation of a range."""
        return max(SPREAD_CELLS * self.cell_m, self.rounding_m, SPREAD_RELATIVE * r)

    def beam(
        self, sensor: tuple[float, float, float], reach: float
    ) -> list[tuple[tuple[int, int], float, float, int]]:
        """Return number, distance, weight and looking direction of each cell in a beam."""
        x, y, axis = sensor
        found = []
        span = math.ceil(max(reach, 0.0) / self.cell_m) + 1
        for ix in range(math.floor(x / self.cell_m) - span, math.floor(x / self.cell_m) + span + 1):
            for iy in range(math.floor(y / self.cell_m) - span, math.floor(y / self.cell_m) + span + 1):
                dx, dy = (ix + 0.5) * self.cell_m - x, (iy + 0.5) * self.cell_m - y
                off = math.remainder(math.atan2(dy, dx) - axis, 2.0 * math.pi)
                if abs(off) < self.half_angle and math.hypot(dx, dy) <= reach:
                    inside = 1.0 - (math.sin(off) / math.sin(self.half_angle)) ** 2
                    found.append(((ix, iy), math.hypot(dx, dy), inside, looking(dx, dy)))
        return found


def looking(dx: float, dy: float) -> int:
    """Return the looking direction, 0 to 7."""
    return round(math.atan2(dy, dx) / (math.pi / 4.0)) % 8
