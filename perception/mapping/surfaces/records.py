"""Memory of a local map of surfaces: its readings, its occupied cells, and the straight pieces in them.

Places are offsets from the map's centre, m.
"""

from __future__ import annotations

from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from config.robot import SENSORS_MAX
from config.settings import QUANTA_MAX
from perception.bounds import FLAG, PLACE, Bound, Count, Finite, Place, up_to
from perception.kernel import Floats, Ints
from perception.mapping.surfaces.parameters import (
    CELLS,
    DIRECTIONS,
    PIECES_MAX,
    READINGS_MAX,
    SAMPLES,
    SHARE_BITS,
    SHARES_A_WORD,
    SURFACE_CELLS_MAX,
)
from perception.records import Record, Records

WORDS: Final = SAMPLES // SHARES_A_WORD
PACKED_SHARES: Final = Bound(0, 2 ** (SHARES_A_WORD * SHARE_BITS) - 1)
"""Of shares packed into a word; a further one would belong to no place on the arc."""
Narrow = NDArray[np.int32]
"""Counts of all readings fit, and twice as many of them fit into the processor's caches."""
RIM: Final = 2
"""Cells at the map's rim that are not used, so that each cell has neighbours."""
BLOCK: Final = 16
"""Cells along the edge of a block: where nothing was heard, none of its cells is looked at."""
CHAIN_MAX: Final = 64
"""Points of one polyline, at most."""
NODES_MAX: Final = 4096
"""Points of all polylines, at most."""
ANGLES: Final = 36
"""Directions that are tried through a seed: 5° apart, and the fit does the rest."""
DIGITS: Final = 256
"""Values of each of two digits by which cells are put in order."""
NODE, FREE = range(-2, 0)
"""Owners of a cell that are no piece: a polyline, and none yet."""


class KeptReading(Record):
    """A reading of a sensor that had moved."""

    x: Place
    """Where the sensor was."""
    y: Place
    axis: Place
    """Its direction, rad."""
    range_m: Finite
    """10⁶ for silence."""
    submap: Count
    """Number of the map of the way in which it was heard."""
    shares: Annotated[Ints, WORDS, PACKED_SHARES]
    """Shares of the echo of the places on its arc, `SHARES_A_WORD` in each number."""


class SurfaceCell(Record):
    """An occupied cell, while pieces are sought."""

    i: Annotated[int, up_to(CELLS - 1 - RIM)]
    """Row and column; 0 of one that is over."""
    j: Annotated[int, up_to(CELLS - 1 - RIM)]
    strength: Finite
    """Echoes that speak for it."""
    owner: Annotated[int, Bound(NODE, PIECES_MAX - 1)]
    """The piece that took it; `FREE` before, or `NODE` where it is a point of a polyline."""


class Piece(Record):
    """A straight piece of surface."""

    x: Place
    """A point of its line, the middle of its cells."""
    y: Place
    ux: Place
    """The line's direction, a unit vector."""
    uy: Place
    low: Place
    """Its ends along the line, from that point."""
    high: Place
    echoes: Finite
    """Echoes that came from it."""
    variance_across: Finite
    """Of the line at the point, m²."""
    variance_turn: Finite
    """Of its direction, rad²."""
    evidence: Finite
    """Log odds of a straight surface against a round one of the models, nat."""


class EchoPoint(Record):
    """Where an echo came from, if from a piece."""

    x: Place
    y: Place
    piece: Annotated[int, Bound(FREE, PIECES_MAX - 1)]


class LocalMap(Record):
    """What is remembered of a local map."""

    centre_x: Place
    centre_y: Place
    count: Annotated[int, up_to(READINGS_MAX)]
    """Readings that it has."""
    entered: Annotated[int, up_to(READINGS_MAX)]
    """How many of its readings are in the cells."""
    revisited: Annotated[int, up_to(READINGS_MAX)]
    """The next reading that is shared again."""
    owed: Count
    """How many readings are to be shared again."""
    carried: Annotated[int, up_to(READINGS_MAX)]
    """Of its readings, the first ones, so many were shared in the last map and keep what they said there."""
    swept: Annotated[int, up_to(READINGS_MAX)]
    """Readings that were entered when pieces were sought last."""
    submap: Count
    """Number of the map of the way that goes on."""
    is_left: Annotated[int, FLAG]
    """Whether the robot needs another map, once this one was searched with the last readings."""
    phase: Annotated[int, up_to(7)]
    """The step of the search for pieces; see `quantum`."""
    at: Count
    """How far that step is."""
    left: Annotated[int, up_to(QUANTA_MAX)]
    """Quanta that are left after the last firing."""
    heard: Finite
    """Echoes from the cells of the pieces."""
    passed: Finite
    """Ranges that passed those cells in the directions that hear them."""
    cell_count: Annotated[int, up_to(SURFACE_CELLS_MAX)]
    piece_count: Annotated[int, up_to(PIECES_MAX)]
    kept_x: Annotated[Floats, SENSORS_MAX, PLACE]
    """Where each sensor was at its last kept reading, in odometry's frame."""
    kept_y: Annotated[Floats, SENSORS_MAX, PLACE]
    kept_axis: Annotated[Floats, SENSORS_MAX, PLACE]
    is_kept: Annotated[Ints, SENSORS_MAX, FLAG]
    readings: Annotated[Records[KeptReading], READINGS_MAX]
    cells: Annotated[Records[SurfaceCell], SURFACE_CELLS_MAX]
    pieces: Annotated[Records[Piece], PIECES_MAX]
    points: Annotated[Records[EchoPoint], READINGS_MAX]
    chained: Annotated[int, up_to(NODES_MAX)]
    """Numbers in `chains`."""
    chains: Annotated[Ints, NODES_MAX, up_to(SURFACE_CELLS_MAX)]
    """The cells of each polyline in order, one more than the cell's number, and 0 at its end."""


class ArcPlace(Record):
    """A place on the arc of an echo."""

    x: float
    y: float
    i: int
    """Row and column of its cell; a row below 0 outside the map."""
    j: int
    b: int
    """The looking direction."""


class CellCounts(Record):
    """The cells, made from the readings and their shares; and scratch."""

    hits: Annotated[Narrow, DIRECTIONS, CELLS, CELLS]
    """Echoes from each cell by looking direction, in parts of `WHOLE`."""
    all_hits: Annotated[Narrow, CELLS, CELLS]
    """The same for all directions together."""
    block_hits: Annotated[Narrow, CELLS // BLOCK, CELLS // BLOCK]
    """The same for all directions and blocks of cells."""
    passes: Annotated[Narrow, DIRECTIONS, CELLS // 2, CELLS // 2]
    """Ranges that went on, in parts of `WHOLE_PASS`."""
    all_passes: Annotated[Narrow, CELLS // 2, CELLS // 2]
    index: Annotated[NDArray[np.int16], CELLS, CELLS]
    """One more than the number of the occupied cell at each place, 0 where there is none."""
    marks: Annotated[Ints, SURFACE_CELLS_MAX]
    """The last walk that met each occupied cell."""
    walks: int
    """Walks so far."""
    steps: int
    """Steps of the walks of a quantum."""
    order: Annotated[Ints, SURFACE_CELLS_MAX]
    """The occupied cells, the strongest first."""
    unsorted: Annotated[Ints, SURFACE_CELLS_MAX]
    digits: Annotated[Ints, DIGITS + 1]
    arc: Annotated[Records[ArcPlace], SAMPLES]
    likelihoods: Annotated[Floats, SAMPLES]
    near: Annotated[Ints, 441]
    ux: Annotated[Floats, ANGLES]
    uy: Annotated[Floats, ANGLES]
    scores: Annotated[Floats, ANGLES]
    begins: Annotated[Ints, PIECES_MAX + 2]
    """Where the echoes of each piece begin in `grouped`."""
    grouped: Annotated[Ints, READINGS_MAX]
    """Numbers of readings, in the order of their pieces."""
    sums: Annotated[Floats, 12]
    chain: Annotated[Ints, CHAIN_MAX]
    """The cells of a polyline."""
