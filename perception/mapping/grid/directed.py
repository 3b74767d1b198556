"""The directed evidence grid: every cell remembers its evidence apart for each of eight looking directions.

A smooth wall answers a beam that is square to it and no other. A grid with one number a cell takes the silence of the
slanting beams as proof that there is no wall (Howard and Kitchen's response grid, 1996, Konolige's MURIEL, 1997, and
Lim and Cho, 1992, are the remedies this grid builds on). Here:

- one echo is one unit of evidence, shared over its arc by what the cells already hold (Moravec and Elfes, 1985); an
  echo whose bearing is known, because a recognised object or wall gave it, marks its contact only;
- what a beam has passed is free, for its looking direction only;
- several readings of a cell from one place and direction count as the strongest of them: repeats do not multiply;
- evidence fades with the robot's way and not with time.

Beside the eight there is a ninth, undirected evidence, in which every reading counts against every other, as in a
classic grid: where all surfaces answer at any angle that uses more of what was heard. How often a cell that was heard
from one direction also answers from another shows which kind of place this is; the two are mixed by it.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Firing
from perception.bounds import Bound, bounds, index_of
from perception.kernel import Floats, Ints, kernel
from perception.mapping.grid.cell_evidence import (
    CERTAIN,
    NAT,
    PASSAGE,
    PLACE_NUMBERS,
    UNDIRECTED,
    Cells,
    Flags,
    enter_hits,
    fill_probability,
    fill_sure,
    is_sure_elsewhere,
    make_draws,
    renew,
)
from perception.mapping.grid.elfes import ARC_SIGMAS
from perception.mapping.grid.window import (
    OCTANTS,
    SPREAD_CELLS,
    SPREAD_RELATIVE,
    Beams,
    Raster,
    Ring,
    Window,
    beams_of,
    columns_of_beam,
    octant,
    rows_within,
    set_edges,
)
from perception.sensor_mounts import sensor_pose
from perception.shared_numbers import PASSED_M

DIRECTED_ARC_SIGMAS: Final = 1.5
"""Half the thickness of an echo's arc in a looking direction."""
PASSED: Final = 1.2 * NAT
"""Evidence of a passage through the middle of a beam; towards the edge it vanishes."""
SILENT_NAT: Final = 1.8 * NAT
"""That of a beam without an echo, which neither a chance echo nor crosstalk has cut short; in the undirected
evidence, in which the passages of all directions count, of a passage, too."""
DIRECTED_UNIT: Final = 1.0
"""An echo's unit of evidence: log odds by ½ + .49 times its share."""
MIRRORS_PASSED: Final = 0.6
"""Share by which a passage proves less among mirrors: a beam of 24° and a looking direction of 45° are wide beside
the few degrees in which a mirror answers."""
MIRRORS_SILENT: Final = 0.8
"""Share by which silence proves less among mirrors."""
MIRRORS_UNIT: Final = 2.0
"""What an echo proves more among mirrors, in units."""
MIDDLE: Final = 0.75
"""A cell of so much evidence from other directions should answer in the middle of a beam (see `inside`)."""
PRIOR_ANSWERED: Final = 4.0
"""Answers that are assumed at the start."""
PRIOR_PASSED: Final = 1.0
"""Passages that are assumed at the start."""
ANSWERS_MAX: Final = 1000.0
"""When so many were counted, both are halved."""
DIFFUSE_SHARE: Final = 0.3
"""Share of passages from which on the undirected evidence counts less."""
MIRROR_SHARE: Final = 0.5
"""Share of passages from which on the undirected evidence does not count."""


class Scratch(NamedTuple):
    """What is overwritten at each firing, and how much a cell draws."""

    arc: Ints
    """(k, 4): the cells of all arcs, y and x, their looking directions, and the sensors."""
    shares: Floats
    """(k, 2): the share of its echo that each draws, in a looking direction and in the undirected evidence."""
    draws: Floats
    """(2 CERTAIN + 1,): how much a cell draws by its evidence, from −`CERTAIN`; see `make_draws`. Constant."""
    edges: Floats
    """(4,): the edges of a beam, as of `set_edges`."""


@kernel
def sweep_beam(
    planes: Cells,
    maybe_sure: Flags,
    raster: Raster,
    place: int,
    beam: tuple[float, float, float, float],
    heard: tuple[float, float, float, float, bool],
    weights: tuple[float, float],
    entry: tuple[int, int],
    scratch: Scratch,
) -> tuple[int, float]:
    """Enter what a beam has passed, and gather the cells of its arc.

    Parameters
    ----------
    planes, maybe_sure, raster, place
        As of `enter_readings`. Updated.
    beam : (float, float, float, float)
        Place (m) and direction (rad) of the sensor, and half the beam's width, rad.
    heard : (float, float, float, float, bool)
        Its range and that range's standard deviation, how far the beam has passed, how far it goes (m), and whether
        the cells around the range are gathered as an arc.
    weights : (float, float)
        Evidence of a passage, in a looking direction and in the undirected evidence.
    entry : (int, int)
        The number of the sensor, and of the cells gathered before.
    scratch : Scratch
        Updated; its edges are those of this beam.

    Returns
    -------
    (int, float)
        The number of cells gathered by now, and the distance to the nearest cell in the middle of the beam that
        something was heard in from elsewhere, m; infinite without one.
    """
    arc, shares, _, edges = scratch
    _, cell_m = raster
    sx, sy, axis, half_angle = beam
    r, sigma, passed, end, has_arc = heard
    weight, weight_both = weights
    i, m = entry
    mask = planes.shape[1] - 1
    ux = math.cos(axis)
    uy = math.sin(axis)
    nearest = math.inf
    # Cells so near are passed, and in no arc: what is done there needs no root of the square of the distance.
    square_sine = math.sin(half_angle) ** 2
    deep = 0.999 * max(0.0, min(passed, end - 2.0 * ARC_SIGMAS * sigma)) ** 2
    one = octant(edges[0], edges[1])
    other = octant(edges[2], edges[3])
    low_y, high_y = rows_within(raster, sy, end, mask)
    for iy in range(low_y, high_y + 1):
        dy = (iy + 0.5) * cell_m - sy
        jy = iy & mask
        low_x, high_x = columns_of_beam(raster, sx, dy, end, edges, mask)
        for ix in range(low_x, high_x + 1):
            dx = (ix + 0.5) * cell_m - sx
            square = dx * dx + dy * dy
            across = ux * dy - uy * dx
            inside = 1.0 - across * across / (square * square_sine) if square > 0.0 else 0.0
            if inside <= 0.0:
                continue
            k = one if one == other else octant(dx, dy)
            jx = ix & mask
            if square >= deep or maybe_sure[jy, jx]:
                d = math.sqrt(square)
                if has_arc and abs(d - r) <= ARC_SIGMAS * sigma and m < arc.shape[0]:
                    arc[m, 0] = jy
                    arc[m, 1] = jx
                    arc[m, 2] = k if abs(d - r) <= DIRECTED_ARC_SIGMAS * sigma else UNDIRECTED
                    arc[m, 3] = i
                    shares[m, 0] = inside * math.exp(-0.5 * ((d - r) / sigma) ** 2)
                    m += 1
                if d < nearest and inside >= MIDDLE and is_sure_elsewhere(planes, maybe_sure, jy, jx, k, place):
                    nearest = d
                if d >= passed:
                    continue
            own = planes[k, jy, jx]
            renew(own, place)
            own[PASSAGE] = min(int(own[PASSAGE]), -int(weight * inside))
            both = planes[UNDIRECTED, jy, jx]
            renew(both, place)
            both[PASSAGE] = min(int(both[PASSAGE]), -int(weight_both * inside))
    return m, nearest


@kernel
def enter_readings(
    planes: Cells,
    maybe_sure: Flags,
    raster: Raster,
    place: int,
    beams: Beams,
    known: tuple[float, float, float],
    answers: Floats,
    scratch: Scratch,
) -> None:
    """Enter the readings of a firing: first what they passed, then their hits, so that their order does not matter.

    Parameters
    ----------
    planes : (9, n, n, 4) int16
        The torus, direction by direction, n a power of two; of a cell what `cell_evidence` says. Updated.
    maybe_sure : (n, n) bool
        As of `is_sure_elsewhere`: False where a cell is surely sure in no direction. Updated.
    raster : Raster
        Where the cells are.
    place : int
        Number of the robot's place on its way, from 1 on; the same for all readings of a firing.
    beams : Beams
        The beams of the firing.
    known : (float, float, float)
        Standard deviation of a range by its rounding (m), distance to which a beam without an echo shows free space
        (m), and how far this is a place of mirrors, 0 to 1.
    answers : (2,) float
        How often a cell that was heard from other directions answered, and how often not. Updated.
    scratch : Scratch
        Updated.
    """
    corner, cell_m = raster
    ranges, mounts, bearings, half_angle = beams.ranges, beams.mounts, beams.bearings, beams.half_angle
    rounding_m, silence_m, mirrors = known
    arc, shares, draws, edges = scratch
    mask = planes.shape[1] - 1
    m = 0
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if math.isnan(r):
            continue
        is_echo = math.isfinite(r)
        sx, sy, axis = sensor_pose(mounts, i, beams.pose)
        set_edges(axis, half_angle, edges)
        sigma = max(SPREAD_CELLS * cell_m, rounding_m, SPREAD_RELATIVE * r) if is_echo else 0.0
        passed = r - sigma if is_echo else silence_m
        end = r + ARC_SIGMAS * sigma if is_echo else silence_m
        is_located = is_echo and not math.isnan(bearings[i])
        has_arc = is_echo and not is_located
        weight = PASSED * (1.0 - MIRRORS_PASSED * mirrors)
        if not is_echo:
            weight = SILENT_NAT * (1.0 - MIRRORS_SILENT * mirrors)
        heard = (r, sigma, passed, end, has_arc)
        m, nearest = sweep_beam(
            planes,
            maybe_sure,
            raster,
            place,
            (sx, sy, axis, half_angle),
            heard,
            (weight, SILENT_NAT),
            (i, m),
            scratch,
        )
        if is_located and m < arc.shape[0]:
            px = r * math.cos(axis + bearings[i])
            py = r * math.sin(axis + bearings[i])
            ix = math.floor((sx + px) / cell_m)
            iy = math.floor((sy + py) / cell_m)
            if 0 <= ix - corner[0] <= mask and 0 <= iy - corner[1] <= mask:
                arc[m, 0] = iy & mask
                arc[m, 1] = ix & mask
                arc[m, 2] = octant(px, py)
                arc[m, 3] = i
                shares[m, 0] = 1.0
                m += 1
        if nearest < math.inf:
            if is_echo and abs(r - nearest) <= 2.0 * sigma + cell_m:
                answers[0] += 1.0
            elif nearest < passed - PASSED_M:
                answers[1] += 1.0
    enter_hits(planes, maybe_sure, place, DIRECTED_UNIT + MIRRORS_UNIT * mirrors, arc[:m], shares, draws)


class DirectedGrid:
    """The grid's memory.

    Parameters
    ----------
    window : Window
        Where its cells are.
    ring : Ring
        The sensors.
    """

    SCRATCH: Final = (
        "window",
        "_ring",
        "_rounding_m",
        "_arc",
        "_shares",
        "_draws",
        "_scratch",
        "_odds",
        "_planes",
        "_maybe_sure",
        "_sure",
    )
    BOUNDS: Final = bounds(
        cells=Bound(-PLACE_NUMBERS, PLACE_NUMBERS - 1), _answers=Bound(0, ANSWERS_MAX), _place=index_of(PLACE_NUMBERS)
    )

    def __init__(self, window: Window, ring: Ring) -> None:
        self.window = window
        self._ring = ring
        self._rounding_m = ring.rounding_m
        # A beam's cells are neighbours and share a direction, so those of one direction lie together in memory.
        self._planes: Cells = np.zeros((OCTANTS + 1, window.cells, window.cells, 4), np.int16)
        self.cells: Cells = np.moveaxis(self._planes, 0, 2)
        self._maybe_sure: Flags = np.zeros((window.cells, window.cells), np.bool_)
        self._sure: Flags = np.zeros((window.cells, window.cells), np.bool_)
        self._answers = np.zeros(2)
        self._place = 0
        room = len(ring.mounts) * arc_cells_max(window, ring)
        self._arc = np.zeros((room, 4), np.int64)
        self._shares = np.zeros((room, 2))
        self._draws = make_draws()
        self._scratch = Scratch(self._arc, self._shares, self._draws, np.zeros(4))
        self._odds = (1.0 / (1.0 + np.exp(np.arange(CERTAIN, -CERTAIN - 1, -1) / NAT))).astype(np.float32)

    @property
    def mirrors(self) -> float:
        """How far cells answer in the direction only from which they were heard, 0 to 1."""
        answered, passed = self._answers.tolist()
        share = (passed + PRIOR_PASSED) / (answered + passed + PRIOR_ANSWERED + PRIOR_PASSED)
        return min(1.0, max(0.0, (share - DIFFUSE_SHARE) / (MIRROR_SHARE - DIFFUSE_SHARE)))

    def observe(self, firing: Firing, bearings: Floats, place: int, silence_m: float) -> None:
        """Enter a firing; see `EvidenceGrid.observe`."""
        if not self.window.follow(firing.pose, (self.cells, self._maybe_sure)):
            return
        self._place = 1 + place % (PLACE_NUMBERS - 1)  # never NO_NUMBER
        enter_readings(
            self._planes,
            self._maybe_sure,
            self.window.raster,
            self._place,
            beams_of(firing, self._ring, bearings),
            (self._rounding_m, silence_m, self.mirrors),
            self._answers,
            self._scratch,
        )
        if self._answers.sum() > ANSWERS_MAX:
            self._answers *= 0.5

    def probability(self, seen_from: tuple[float, float] | None) -> NDArray[np.float32]:
        """Return the probability of each cell; see `EvidenceGrid.occupancy`."""
        out = np.empty(self.cells.shape[:2], np.float32)
        x, y = (math.nan, math.nan) if seen_from is None else seen_from
        fill_probability(
            self._planes, self.window.corner, self.window.cell_m, self._place, self.mirrors, x, y, self._odds, out
        )
        return out

    def holding(self) -> Flags:
        """Return which cells of the torus are sure in some direction, shape (n, n); see `SURE`."""
        fill_sure(self._planes, self._maybe_sure, self._place, self._sure)
        return self._sure

    def drop_caches(self) -> None:
        """Derive anew what depends on the cells, after they were overwritten."""
        self._maybe_sure[:] = True

    def clear(self) -> None:
        """Forget everything."""
        self.window.clear()
        self.cells[:] = 0
        self._answers[:] = 0.0


def arc_cells_max(window: Window, ring: Ring) -> int:
    """Return how many cells the arc of one echo has at most."""
    reach = min(ring.reach_m, math.sqrt(2.0) * window.cells * window.cell_m) / window.cell_m
    thickness = 2.0 * ARC_SIGMAS * max(SPREAD_CELLS, ring.rounding_m / window.cell_m, SPREAD_RELATIVE * reach)
    return int((2.0 * ring.half_angle * (reach + thickness) + 4.0) * (thickness + 2.0))
