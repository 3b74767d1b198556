"""Search of the whole room: how well readings fit at every cell of a grid and every heading.

The expected range of each cell and direction is computed once, coarsely. A search then compares readings of a short
drive with this table, shifted and turned. It yields starts for a finer fit: places that a tree of segments would miss
where maps are large, walls short and echoes few. Both go on quantum by quantum. The table follows from the room, so
it belongs to no snapshot: after a snapshot was restored, what is missing of it is computed again.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.kernel import Floats, kernel
from perception.localization.expected_ranges import Reflection
from perception.localization.range_likelihood import HEARD_SHARE
from perception.localization.room import Room
from perception.localization.surroundings import Surroundings, expect_cone, expect_specular, look_around
from perception.records import Record, Records, records, zeros

CELL_M: Final = 0.2
DIRECTIONS: Final = 60
STEP_RAD: Final = 2.0 * math.pi / DIRECTIONS
OPEN_M: Final = 3.0
"""The grid reaches so far beyond the surfaces of a room without walls."""
CELLS_PER_QUANTUM: Final = 4
"""Cells of the table that one quantum computes."""
BLOCK: Final = 16
"""Cells of a block's side: a quantum of a search compares one block at one heading."""
READINGS_MAX: Final = 72
"""Readings that are compared."""
SIGMA_M: Final = 0.12
SIGMA_SHARE: Final = 0.03
"""Standard deviation of a range from the table: of half a cell, and a share of the range."""
DROPOUT: Final = 0.3
OUTLIERS: Final = 0.2
"""Shares of expected echoes that are not heard, and of readings that are anything: the table knows no more."""
OUTSIDE: Final = 0.125
"""Likelihood ratio of a reading that would be taken outside the table."""
FACTORS: Final = 24
"""Ratios that are multiplied before their logarithm is taken: neither too small nor too large for a float."""
SILENT: Final = 255
"""Code of silence in the table; a range is a share of 254 of the window."""
STARTS_MAX: Final = 200
APART_M: Final = 1.5 * CELL_M
APART_RAD: Final = 1.5 * STEP_RAD
"""Starts nearer to each other than this, on each axis, are one."""
NONE: Final = -1

Bytes = NDArray[np.uint8]


class Start(Record):
    """A pose (m, rad) and how well the readings fit there, nat."""

    x: float
    y: float
    heading: float
    score: float


class Starts(Record):
    """The best poses found so far, in any order."""

    count: int
    starts: Annotated[Records[Start], STARTS_MAX]


class ScoreScratch(Record):
    """Overwritten before each use: of the cells of a block, row by row."""

    product: Annotated[Floats, BLOCK * BLOCK]
    score: Annotated[Floats, BLOCK * BLOCK]


@kernel
def fill_cell(
    s: Surroundings, table: Bytes, free: Bytes, i: int, j: int, x: float, y: float, clear_m: float
) -> None:  # fmt: skip
    """Write the expected ranges of one cell into the table, and whether the ring may be there.

    Parameters
    ----------
    s : Surroundings
        `near` is overwritten.
    table : (2, DIRECTIONS, n, m) uint8
        Codes of the ranges by `cone` and by `specular`.
    free : (n, m) uint8
        1 where the ring's centre may be.
    i, j : int
        The cell.
    x, y : float
        Its middle, m.
    clear_m : float
        The ring's centre is farther than this from any surface, m.
    """
    look_around(s, x, y, 0.0)
    near, window_m = s.near[0], s.sensor[0].window_m
    is_free = near.wall_count == 0 or near.wall_m[0] > clear_m
    free[i, j] = 1 if is_free and (near.circle_count == 0 or near.circle_m[0] > clear_m) else 0
    for d in range(DIRECTIONS):
        cos, sin = math.cos(STEP_RAD * d), math.sin(STEP_RAD * d)
        cone_m, _, _ = expect_cone(s, x, y, cos, sin)
        specular_m, _, _ = expect_specular(s, x, y, cos, sin)
        table[0, d, i, j] = int(cone_m * (254.0 / window_m) + 0.5) if cone_m <= window_m else SILENT
        table[1, d, i, j] = int(specular_m * (254.0 / window_m) + 0.5) if specular_m <= window_m else SILENT


@kernel
def offer(to: Records[Starts], x: float, y: float, heading: float, score: float) -> None:
    """Add a start, unless a better one is near it or all are better; it replaces a worse one near it.

    Parameters
    ----------
    to : (1,) Starts
        Updated.
    x, y, heading, score : float
        As of `Start`.
    """
    starts, worst = to[0].starts, 0
    for k in range(to[0].count):
        other = starts[k]
        turn = abs((heading - other.heading + math.pi) % (2.0 * math.pi) - math.pi)
        if abs(x - other.x) < APART_M and abs(y - other.y) < APART_M and turn < APART_RAD:
            if score > other.score:
                other.x, other.y, other.heading, other.score = x, y, heading, score
            return
        if other.score < starts[worst].score:
            worst = k
    if to[0].count < STARTS_MAX:
        worst = to[0].count
        to[0].count += 1
    elif starts[worst].score >= score:
        return
    at = starts[worst]
    at.x, at.y, at.heading, at.score = x, y, heading, score


@kernel
def score_block(
    table: Bytes, free: Bytes, likely: Floats, readings: Floats, count: int, direction: int, begin_i: int,
    begin_j: int, scratch: Records[ScoreScratch],
) -> None:  # fmt: skip
    """Sum the log ratios of the readings at each cell of a block with one heading; -inf where the ring cannot be.

    Parameters
    ----------
    table, free : uint8
        As of `fill_cell`.
    likely : (n, 2, 256) float
        Each reading's likelihood ratio at each code of either model's table.
    readings : (n, 5) float
        As of `perception.localization.particle_update`.
    count : int
        How many of them.
    direction : int
        The heading, in steps.
    begin_i, begin_j : int
        First cell of the block.
    scratch : (1,) ScoreScratch
        Gets the scores.
    """
    product, score = scratch[0].product, scratch[0].score
    rows, columns = len(free), len(free[0])
    cos, sin = math.cos(STEP_RAD * direction), math.sin(STEP_RAD * direction)
    product[:] = 1.0
    score[:] = 0.0
    for n in range(count):
        x, y, c, s, _ = readings[n]
        shift_i = math.floor((cos * x - sin * y) / CELL_M + 0.5)
        shift_j = math.floor((sin * x + cos * y) / CELL_M + 0.5)
        d = math.floor((STEP_RAD * direction + math.atan2(s, c)) / STEP_RAD + 0.5) % DIRECTIONS
        for a in range(BLOCK):
            i = begin_i + a + shift_i
            for b in range(BLOCK):
                j = begin_j + b + shift_j
                ratio = OUTSIDE
                if 0 <= i < rows and 0 <= j < columns:
                    ratio = likely[n, 0, table[0, d, i, j]] + likely[n, 1, table[1, d, i, j]]
                product[BLOCK * a + b] *= ratio
        if n % FACTORS == FACTORS - 1 or n == count - 1:
            for k in range(BLOCK * BLOCK):
                score[k] += math.log(product[k])
                product[k] = 1.0
    for a in range(BLOCK):
        for b in range(BLOCK):
            i, j = begin_i + a, begin_j + b
            if i >= rows or j >= columns or not free[i, j]:
                score[BLOCK * a + b] = -math.inf


@kernel
def offer_peaks(
    to: Records[Starts], scratch: Records[ScoreScratch], x: float, y: float, heading: float
) -> None:  # fmt: skip
    """Offer the cells of a block that fit at least as well as all their neighbours in it.

    Parameters
    ----------
    to : (1,) Starts
        Updated.
    scratch : (1,) ScoreScratch
        From `score_block`.
    x, y : float
        Middle of the block's first cell, m.
    heading : float
        rad
    """
    score = scratch[0].score
    for a in range(BLOCK):
        for b in range(BLOCK):
            here = score[BLOCK * a + b]
            is_peak = here > -math.inf
            for i in range(max(0, a - 1), min(BLOCK, a + 2)):
                for j in range(max(0, b - 1), min(BLOCK, b + 2)):
                    is_peak = is_peak and here >= score[BLOCK * i + j]
            if is_peak:
                offer(to, x + CELL_M * a, y + CELL_M * b, heading, here)


class PoseGrid:
    """The table of one room, and a search in it.

    Parameters
    ----------
    room : Room
        The surfaces.
    surroundings : Surroundings
        Of this room.
    clear_m : float
        The ring's centre is farther than this from any surface, m.

    Attributes
    ----------
    starts : (1,) Starts
        What the last search found.
    """

    SCRATCH: Final = ("_origin", "_table", "_free", "_filled", "_scratch", "_likely", "_likely_search", "starts")
    """What follows from the room, what is overwritten before each use, and a view of other memory."""

    def __init__(self, room: Room, surroundings: Surroundings, clear_m: float) -> None:
        self._surroundings, self._clear_m = surroundings, clear_m
        low, high = room.bounds
        if not len(room.walls):
            low, high = low - OPEN_M, high + OPEN_M
        self.shape = tuple(max(1, math.ceil(side / CELL_M)) for side in (high - low).tolist())
        # Symmetric about the room's middle: the answers of a symmetric room are then exactly alike.
        self._origin = 0.5 * (low + high) - 0.5 * CELL_M * (np.array(self.shape) - 1.0)
        self._table = np.full((2, DIRECTIONS, *self.shape), SILENT, dtype=np.uint8)
        self._free = np.zeros(self.shape, dtype=np.uint8)
        self._filled = 0
        """Cells whose part of the table is filled."""
        self._due = 0
        """Cells whose part is needed: quanta count on this, not on what memory holds after a restored snapshot."""
        self._found = zeros(Starts, 1)
        self.starts = records(Starts, self._found)
        self._scratch = records(ScoreScratch, zeros(ScoreScratch, 1))
        self._readings = np.zeros((READINGS_MAX, 5))
        self._count = self._searches = 0
        self._specular_share = 0.5
        self._quantum = NONE
        """Of the search; `NONE` without one."""
        self._likely = np.zeros((READINGS_MAX, 2, SILENT + 1))
        self._likely_search = 0
        """Number of the search that the likelihoods are of."""

    @property
    def is_searching(self) -> bool:
        """Whether a search has work left."""
        return self._quantum != NONE

    def begin(self, readings: Floats, specular_share: float) -> None:
        """Begin a search.

        Parameters
        ----------
        readings : (n, 5) float
            Of a short drive, in one frame, as of `perception.localization.particle_update`; at most `READINGS_MAX`.
        specular_share : float
            Probability that a reading is from the specular model.
        """
        self._count = len(readings)
        self._readings[: self._count] = readings
        self._specular_share = specular_share
        self._searches += 1
        self._quantum = 0
        self._found["count"] = 0

    def cancel(self) -> None:
        """End a search without an answer."""
        self._quantum = NONE

    def refine(self) -> None:
        """Do one quantum of a search: part of the table if it is not complete, otherwise a block at one heading."""
        cells = self.shape[0] * self.shape[1]
        if self._due < cells:
            self._due = min(cells, self._due + CELLS_PER_QUANTUM)
            self._fill()
            return
        if self._likely_search != self._searches:
            self._fill()
            self._likely[: self._count] = self._likelihoods()
            self._likely_search = self._searches
        blocks_i, blocks_j = (math.ceil(side / BLOCK) for side in self.shape)
        direction, block = divmod(self._quantum, blocks_i * blocks_j)
        i, j = BLOCK * (block // blocks_j), BLOCK * (block % blocks_j)
        score_block(
            self._table, self._free, self._likely, self._readings, self._count, direction, i, j, self._scratch
        )
        x, y = (self._origin + CELL_M * np.array([i, j])).tolist()
        offer_peaks(self.starts, self._scratch, x, y, direction * STEP_RAD)
        self._quantum += 1
        if self._quantum >= DIRECTIONS * blocks_i * blocks_j:
            self._quantum = NONE

    def best_starts(self, most: int) -> Floats:
        """Return the poses that fit best: x, y (m), heading (rad), shape (n, 3), the best first."""
        found = self._found["starts"][0, : int(self._found["count"][0])]
        order = np.argsort(-found["score"], kind="stable")[:most]
        return np.column_stack([found[name][order] for name in ("x", "y", "heading")])

    def drop_caches(self) -> None:
        """Discard what was computed for a search, after another state was restored."""
        self._likely_search = 0

    def expected(self, reflection: Reflection) -> Floats:
        """Return the ranges of one model's table, m; inf for silence, shape (directions, cells, cells)."""
        self._due = self.shape[0] * self.shape[1]
        self._fill()
        codes = self._table[("cone", "specular").index(reflection)]
        return np.where(codes == SILENT, np.inf, codes * (self._window_m / 254.0))

    def places(self, i: NDArray[Any], j: NDArray[Any]) -> Floats:
        """Return the middles of cells, m, shape (n, 2)."""
        return np.asarray(self._origin + CELL_M * np.column_stack([i, j]))

    @property
    def _window_m(self) -> float:
        return float(self._surroundings.sensor[0].window_m)

    def _fill(self) -> None:
        """Compute the cells that are needed and missing."""
        origin_x, origin_y = self._origin.tolist()
        while self._filled < min(self._due, self.shape[0] * self.shape[1]):
            i, j = divmod(self._filled, self.shape[1])
            x, y = origin_x + CELL_M * i, origin_y + CELL_M * j
            fill_cell(self._surroundings, self._table, self._free, i, j, x, y, self._clear_m)
            self._filled += 1

    def _likelihoods(self) -> Floats:
        """Return each reading's likelihood ratio at each code of either model's table, shape (n, 2, 256)."""
        measured = self._readings[: self._count, 4]
        expected = np.append(np.arange(SILENT) * (self._window_m / 254.0), np.inf)
        sigma = np.hypot(SIGMA_M, SIGMA_SHARE * np.minimum(expected, self._window_m))
        heard = np.isfinite(measured)[:, None]
        with np.errstate(invalid="ignore"):
            error = (np.where(heard, measured[:, None], 0.0) - expected) / sigma
        echo = (1.0 - DROPOUT - OUTLIERS) / (sigma * math.sqrt(2.0 * math.pi)) * np.exp(-0.5 * error**2)
        echo = np.where(np.isfinite(expected), echo, 0.0) + OUTLIERS / self._window_m
        silent = np.where(np.isfinite(expected), DROPOUT, 1.0 - OUTLIERS)
        ratio = np.where(heard, echo / (HEARD_SHARE / self._window_m), silent / (1.0 - HEARD_SHARE))
        share = self._specular_share
        return np.stack([(1.0 - share) * ratio, share * ratio], axis=1)
