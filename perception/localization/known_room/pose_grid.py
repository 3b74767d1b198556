"""Search of the whole room: how well readings fit at every cell of a grid and every heading.

The expected range of each cell and direction is computed once, coarsely. A search then compares readings of a short
drive with this table, shifted and turned. It yields starts for a finer fit: places that a tree of segments would miss
where maps are large, walls short and echoes few. Both go on quantum by quantum. The table follows from the room, so
it belongs to no snapshot: after a snapshot was restored, what is missing of it is computed again.
"""

from __future__ import annotations

import math
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from perception.bounds import CONSTANT, COUNT, PLACE, SHARE, Bound, bounds, up_to
from perception.kernel import Floats, kernel
from perception.localization.known_room.mirror_points import expect_specular
from perception.localization.known_room.mixed_reflection import LATE_M, WILD_HEARD
from perception.localization.known_room.particle_update import COLUMNS
from perception.localization.known_room.pose_starts import PROFILES_MAX, STARTS_MAX, Starts, offer
from perception.localization.known_room.surroundings import Surroundings, expect_cone, look_around
from perception.localization.room.range_likelihood import HEARD_PRIOR
from perception.localization.room.room import Room
from perception.records import Record, Records, records, zeros
from perception.shared_numbers import NO_INDEX

GRID_CELL_M: Final = 0.2
"""Edge of a cell of the grid of places."""
GRID_DIRECTIONS: Final = 60
"""Headings that are compared at each place, 6° apart."""
GRID_STEP_RAD: Final = math.tau / GRID_DIRECTIONS
"""Angle between two of these headings."""
OPEN_M: Final = 3.0
"""The grid reaches so far beyond the surfaces of a room without walls."""
CELLS_PER_QUANTUM: Final = 4
"""Cells of the table that one quantum computes."""
BLOCK: Final = 16
"""Cells of a block's side: a quantum of a search compares one block at one heading."""
GRID_READINGS_MAX: Final = 108
"""Readings that are compared."""
SIGMA_M: Final = 0.12
"""Standard deviation of a range from the table: that of half a cell."""
SIGMA_SHARE: Final = 0.03
"""Part of that standard deviation that is a share of the range."""
GRID_DROPOUT: Final = 0.2
"""Share of the expected echoes that are not heard."""
WILD_MIN: Final = 0.2
"""Least share of the readings that are anything: the grid is coarse."""
OUTSIDE: Final = 0.125
"""Likelihood ratio of a reading that would be taken outside the table."""
FACTORS: Final = 24
"""Ratios that are multiplied before their logarithm is taken: neither too small nor too large for a float."""
RANGE_STEPS: Final = 254
"""Steps of a range in the table, up to the window."""
SILENT_CODE: Final = RANGE_STEPS + 1
"""Code of silence in the table."""
START_LOG: Final = 40.0
"""A start less likely than the best one by more than this, nat, is not the place."""
COMPLETE_LOG: Final = 20.0
"""Where the worst of so many starts is less likely than the best by this, nat, the place is among them."""

Bytes = NDArray[np.uint8]


class ScoreScratch(Record):
    """Overwritten before each use: of the cells of a block, row by row."""

    product: Annotated[Floats, BLOCK * BLOCK]
    score: Annotated[Floats, BLOCK * BLOCK]


@kernel
def fill_cell(s: Surroundings, table: Bytes, free: Bytes, i: int, j: int, x: float, y: float, clear_m: float) -> None:
    """Write the expected ranges of one cell into the table, and whether the ring may be there.

    Parameters
    ----------
    s : Surroundings
        `near` is overwritten.
    table : (2, DIRECTIONS, n, m) uint8
        Codes of the ranges by `cone` and by `specular`, with mirrors that are a little beside the beam: the headings
        are coarse, and such mirrors often answer.
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
    per_m = RANGE_STEPS / window_m
    is_free = near.wall_count == 0 or near.wall_m[0] > clear_m
    free[i, j] = 1 if is_free and (near.circle_count == 0 or near.circle_m[0] > clear_m) else 0
    for d in range(GRID_DIRECTIONS):
        cos, sin = math.cos(GRID_STEP_RAD * d), math.sin(GRID_STEP_RAD * d)
        cone_m, _, _ = expect_cone(s, x, y, cos, sin)
        inside, beside = expect_specular(s, x, y, cos, sin, s.sensor[0].cos_fringe)
        specular_m = min(inside[0], beside[0])
        table[0, d, i, j] = int(cone_m * per_m + 0.5) if cone_m <= window_m else SILENT_CODE
        table[1, d, i, j] = int(specular_m * per_m + 0.5) if specular_m <= window_m else SILENT_CODE


@kernel
def score_block(
    table: Bytes,
    free: Bytes,
    likely: Floats,
    readings: Floats,
    count: int,
    direction: int,
    begin_i: int,
    begin_j: int,
    scratch: Records[ScoreScratch],
) -> None:
    """Sum the log ratios of the readings at each cell of a block with one heading; -inf where the ring cannot be.

    Parameters
    ----------
    table, free : uint8
        As of `fill_cell`.
    likely : (n, 3, 256) float
        Each reading's likelihood ratio by cause at each code, as `PoseGrid` computes it.
    readings : (n, 5) float
        As of `perception.localization.known_room.particle_update`.
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
    cos, sin = math.cos(GRID_STEP_RAD * direction), math.sin(GRID_STEP_RAD * direction)
    product[:] = 1.0
    score[:] = 0.0
    for n in range(count):
        x, y, c, s, _ = readings[n]
        shift_i = math.floor((cos * x - sin * y) / GRID_CELL_M + 0.5)
        shift_j = math.floor((sin * x + cos * y) / GRID_CELL_M + 0.5)
        d = math.floor((GRID_STEP_RAD * direction + math.atan2(s, c)) / GRID_STEP_RAD + 0.5) % GRID_DIRECTIONS
        for a in range(BLOCK):
            i = begin_i + a + shift_i
            for b in range(BLOCK):
                j = begin_j + b + shift_j
                ratio = OUTSIDE
                if 0 <= i < rows and 0 <= j < columns:
                    cone, specular = table[0, d, i, j], table[1, d, i, j]
                    ratio = likely[n, 0, cone] + likely[n, 1, specular]
                    if specular == SILENT_CODE:
                        ratio += likely[n, 2, cone]
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
    to: Records[Starts], scratch: Records[ScoreScratch], x: float, y: float, heading: float, profile: int
) -> None:
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
    profile : int
        By which guess of the causes.
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
                offer(to, x + GRID_CELL_M * a, y + GRID_CELL_M * b, heading, here, profile)


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
    """

    SCRATCH: Final = ("_origin", "_table", "_free", "_filled", "_scratch", "_likely", "_likely_search", "starts")
    """What follows from the room, what is overwritten before each use, and a view of other memory."""
    BOUNDS: Final = bounds(
        _clear_m=CONSTANT,
        _due=COUNT,
        _found=Starts.BOUNDS,
        _readings=PLACE._replace(infinite=True),
        _count=up_to(GRID_READINGS_MAX),
        _searches=COUNT,
        _profiles=Bound(1, PROFILES_MAX),
        _shares=SHARE,
        _quantum=Bound(NO_INDEX, COUNT.high),
    )

    def __init__(self, room: Room, surroundings: Surroundings, clear_m: float) -> None:
        self._surroundings, self._clear_m = surroundings, clear_m
        low, high = room.bounds
        if not len(room.walls):
            low, high = low - OPEN_M, high + OPEN_M
        self.shape = tuple(max(1, math.ceil(side / GRID_CELL_M)) for side in (high - low).tolist())
        # Symmetric about the room's middle: the answers of a symmetric room are then exactly alike.
        self._origin = 0.5 * (low + high) - 0.5 * GRID_CELL_M * (np.array(self.shape) - 1.0)
        self._table = np.full((2, GRID_DIRECTIONS, *self.shape), SILENT_CODE, dtype=np.uint8)
        self._free = np.zeros(self.shape, dtype=np.uint8)
        self._filled = 0
        """Cells whose part of the table is filled."""
        self._due = 0
        """Cells whose part is needed: quanta count on this, not on what memory holds after a restored snapshot."""
        self._found = zeros(Starts, 1)
        self._found["least"] = -math.inf
        self.starts = records(Starts, self._found)
        """(1,): what the last search found."""
        self._scratch = records(ScoreScratch, zeros(ScoreScratch, 1))
        self._readings = np.zeros((GRID_READINGS_MAX, COLUMNS))
        self._count = self._searches = 0
        self._profiles = 1
        self._shares = np.zeros((PROFILES_MAX, 3))
        self._quantum = NO_INDEX
        self._likely = np.zeros((PROFILES_MAX, GRID_READINGS_MAX, 3, SILENT_CODE + 1))
        self._likely_search = 0
        """Number of the search that the likelihoods are of."""

    @property
    def is_searching(self) -> bool:
        """Whether a search has work left."""
        return self._quantum != NO_INDEX

    def begin(self, readings: Floats, profiles: Floats) -> None:
        """Begin a search.

        Parameters
        ----------
        readings : (n, 5) float
            Of a short drive, in one frame, as of `perception.localization.known_room.particle_update`; at most
            `GRID_READINGS_MAX`.
        profiles : (n, 3) float
            How often a reading is from a smooth surface, over a second one, and anything, as in `Shares`; where that
            is not known, several guesses, at most `PROFILES_MAX`: each is tried.
        """
        self._count, self._profiles = len(readings), len(profiles)
        self._readings[: self._count] = readings
        self._shares[: self._profiles] = profiles
        self._searches += 1
        self._quantum = 0
        self._found["count"], self._found["least"] = 0, -math.inf

    def cancel(self) -> None:
        """End a search without an answer."""
        self._quantum = NO_INDEX

    def refine(self) -> None:
        """Do one quantum of a search: part of the table if it is not complete, otherwise a block at one heading."""
        cells = self.shape[0] * self.shape[1]
        if self._due < cells:
            self._due = min(cells, self._due + CELLS_PER_QUANTUM)
            self._fill()
            return
        if self._likely_search != self._searches:
            self._fill()
            for profile in range(self._profiles):
                self._likely[profile, : self._count] = self._likelihoods(profile)
            self._likely_search = self._searches
        blocks_i, blocks_j = (math.ceil(side / BLOCK) for side in self.shape)
        profile, part = divmod(self._quantum, GRID_DIRECTIONS * blocks_i * blocks_j)
        direction, block = divmod(part, blocks_i * blocks_j)
        i, j = BLOCK * (block // blocks_j), BLOCK * (block % blocks_j)
        score_block(
            self._table, self._free, self._likely[profile], self._readings, self._count, direction, i, j,
            self._scratch,
        )  # fmt: skip
        x, y = (self._origin + GRID_CELL_M * np.array([i, j])).tolist()
        offer_peaks(self.starts, self._scratch, x, y, direction * GRID_STEP_RAD, profile)
        self._quantum += 1
        if self._quantum >= self._profiles * GRID_DIRECTIONS * blocks_i * blocks_j:
            self._quantum = NO_INDEX

    def best_starts(self, most: int) -> Floats:
        """Return the poses that fit best, the best first, without those that fit much worse.

        Parameters
        ----------
        most : int
            So many at most.

        Returns
        -------
        (n, 3) float
            x, y (m), heading (rad).
        """
        found = self._found["starts"][0, : len(self)]
        order = np.argsort(-found["score"], kind="stable")[:most]
        order = order[found["score"][order] >= found["score"][order[:1]] - START_LOG]
        return np.column_stack([found[name][order] for name in ("x", "y", "heading")])

    def __len__(self) -> int:
        """Return how many starts the last search has found."""
        return int(self._found["count"][0])

    @property
    def best_profile(self) -> int:
        """By which guess of the causes the readings fit best; there must be a start."""
        found = self._found["starts"][0, : len(self)]
        return int(found["profile"][found["score"].argmax()])

    @property
    def is_complete(self) -> bool:
        """Whether all places but the offered ones fit much worse than the best one."""
        scores = np.sort(self._found["starts"]["score"][0, : len(self)])
        return len(self) < STARTS_MAX or bool(scores[-1] - scores[0] > COMPLETE_LOG)

    def drop_caches(self) -> None:
        """Discard what was computed for a search, after another state was restored."""
        self._likely_search = 0

    def drop_table(self) -> None:
        """Let searches compute the whole table again, quantum by quantum."""
        self._due = 0
        self.drop_caches()

    @property
    def _window_m(self) -> float:
        return float(self._surroundings.sensor[0].window_m)

    def _fill(self) -> None:
        """Compute the cells that are needed and missing."""
        origin_x, origin_y = self._origin.tolist()
        while self._filled < min(self._due, self.shape[0] * self.shape[1]):
            i, j = divmod(self._filled, self.shape[1])
            x, y = origin_x + GRID_CELL_M * i, origin_y + GRID_CELL_M * j
            fill_cell(self._surroundings, self._table, self._free, i, j, x, y, self._clear_m)
            self._filled += 1

    def _likelihoods(self, profile: int) -> Floats:
        """Return each reading's likelihood ratio by cause at each code of the table, shape (n, 3, 256).

        That of `perception.localization.known_room.mixed_reflection`, as coarse as the table: a rough surface, or
        anything, at each code of `cone`; a smooth one at each of `specular`; an echo over a second surface at each of
        `cone`, where `specular` is silent.
        """
        measured = self._readings[: self._count, 4:5]
        expected = np.append(np.arange(SILENT_CODE) * (self._window_m / RANGE_STEPS), np.inf)
        answers, heard = np.isfinite(expected), np.isfinite(measured)
        specular, late, wild = self._shares[profile].tolist()
        wild = max(WILD_MIN, wild)
        sigma = np.hypot(SIGMA_M, SIGMA_SHARE * np.minimum(expected, self._window_m))
        with np.errstate(invalid="ignore"):
            after = np.where(heard, measured, 0.0) - expected
            echo = np.exp(-0.5 * (after / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))
        echo = np.where(
            heard, np.where(answers, (1.0 - GRID_DROPOUT) * echo, 0.0), np.where(answers, GRID_DROPOUT, 1.0)
        )
        turned_away = np.where(heard, 0.0, 1.0 - late) * ~answers
        anything = np.where(heard, WILD_HEARD / self._window_m, 1.0 - WILD_HEARD)
        second = heard & answers & (after > 0.0) & (after <= LATE_M)
        causes = (
            (1.0 - wild) * (1.0 - specular) * echo + wild * anything,
            (1.0 - wild) * specular * np.where(answers, echo, turned_away),
            (1.0 - wild) * specular * late / LATE_M * second,
        )
        anywhere = np.where(heard, HEARD_PRIOR / self._window_m, 1.0 - HEARD_PRIOR)
        return np.stack([cause / anywhere for cause in causes], axis=1)
