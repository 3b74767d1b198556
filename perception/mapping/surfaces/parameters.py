"""The numbers of the map of surfaces, each with its unit and source.

"Drives" are real drives whose ranges were cut from a laser's, with the truth of every echo: an office of tables and
shelves, and a corridor with rooms, each with surfaces that answer at any angle and with mirrors. Explained is the
share of their echoes that lie within 0.1 m of an occupied cell; false is the share of the occupied cells with
nothing within 0.15 m.
"""

from __future__ import annotations

from typing import Final

CELL_M: Final = 0.05
"""Edge of a cell: half of the distance within which a surface explains an echo."""
CELLS: Final = 640
"""Cells along an edge of a local map: 32 m. Even, as passes are counted in cells of twice the size."""
LEFT_M: Final = 9.7
"""A robot so far from a local map's centre begins another one once this one was searched."""
LEFT_MAX_M: Final = 10.4
"""A robot so far from a local map's centre begins another one in any case."""
REACH_M: Final = 5.5
"""An echo from farther away is as good as silence: its arc is longer than objects are."""
DIRECTIONS: Final = 12
"""Looking directions for which a cell counts apart: a mirror answers to one and is silent to the next."""
SAMPLES: Final = 24
"""Places on an arc among which an echo is shared: 1° of a beam of ±12°."""
WHOLE: Final = 127
"""Share of a whole echo; shares are whole numbers, so that adding and taking away are exact in any order."""
SHARES_A_WORD: Final = 8
"""Shares of an echo that are kept in one number."""
SHARE_BITS: Final = 7
"""Bits of each share in such a number."""
WHOLE_PASS: Final = 16
"""A pass along the beam's axis; at the beam's edge it counts half."""
NEARER_M: Final = 0.1
"""A range passed through what is nearer by this. Drives: 0.06 and 0.15 lose 1 to 2 % at the same false share."""
PRIOR_READINGS: Final = 1.0
"""Readings of one direction for which the other directions of a cell stand. Drives: 0.1 to 1 within 1 %."""
REVISITS: Final = 3
"""Times that an earlier echo is shared again for each new reading. Drives: 2 as good, none 2 to 4 % more false."""
LAST_REVISITS: Final = 3
"""Times that all echoes are shared again before a local map is left."""
SPACING_RAD: Final = 0.02
"""A sensor that has moved by less than `SPACING_M`, and turned by less than this, says the same again."""
READINGS_MAX: Final = 12288
"""Readings of a local map, at most."""
READINGS_KEPT: Final = 6144
"""Readings with which the next local map begins, at most."""

STRENGTH_MIN: Final = 0.9
"""Echoes by which a cell is occupied: each direction counts one at most, and a tenth of the rest; less where few are
its own and not its neighbours'."""
WEAK_MIN: Final = 0.6
"""Echoes by which a cell may be a point of a polyline, but starts and extends no piece. Drives: 0.9 explains 0.5 %
less where as much is false."""
STRENGTH_SHARE: Final = 0.1
"""Share of an echo by which those beyond the first of a direction strengthen a cell."""
ANSWER_MIN: Final = 0.05
"""Least probability of an answer of an occupied cell, to the direction to which it answers most."""
TAIL_SHARE: Final = 0.03
"""A cell with less than this share of the hits of one within `TAIL_CELLS` has got them by that one's noise."""
TAIL_CELLS: Final = 3
"""Distance of these cells."""
OWN_HITS_MIN: Final = 0.05
"""Least echoes of the cell itself, without its neighbours."""
SURFACE_CELLS_MAX: Final = 12288
"""Occupied cells of a local map, at most."""
PIECES_MAX: Final = 384
"""Straight pieces of a local map, at most."""
OFF_LINE_M: Final = 0.06
"""A cell belongs to a straight piece within this, and starts no other one."""
GAP_M: Final = 0.15
"""Greatest gap in a piece; 0.2 adds false length, 0.1 loses walls between mirrors."""
PIECE_MIN_M: Final = 0.25
"""Length of the shortest line of cells that is a piece."""
PIECE_KEPT_M: Final = 3.0 * CELL_M
"""Least length of a piece between ends that are strong. With `PIECE_MIN_M` for both, a cell decides which pieces
stay: drives have .1 to 1.9 % less, at the same false share."""
COVERED_MIN: Final = 0.6
"""Least share of a piece's length with occupied cells."""
END_STRENGTH: Final = 1.5
"""A piece ends at its outermost cell of this strength. Drives: false length 4.0 to 1.7 % in the office."""
NODE_CELLS: Final = 2
"""Cells around a point of a polyline whose echoes it is given: up to 0.1 m away."""
NODE_STRENGTH: Final = 2.5
"""It has two whole echoes from each of two directions, or as much, and a little more. Drives: with 2.4 polylines
explain 0.2 % more and 1.2 instead of 0.8 % of them are false, in other buildings 8.1 instead of 7.3 %; with 2.2
0.2 % more again, and false by 1.9 and 9.6 %."""
POINT_ECHO_NAT: Final = 1.5
"""Log odds of a point of a polyline by an echo; a pass has those of a surface like the map's pieces. Other buildings
where everything echoes: 6.9 to 3.1 % of the polylines are false, and as much is explained; 1.0 leaves 2.1 %, but
explains 0.4 % less of the drives, 1.25 0.1 % less."""
NODE_M: Final = 0.1
"""Least distance between the points of a polyline."""
LINK_M: Final = 0.2
"""Greatest distance between the points of a polyline: twice as much, as there may be no cell for a point between
them."""
AGREES_M: Final = 0.1
"""Two surfaces within this are one: the distance within which a surface explains an echo."""
KNOWN_NAT: Final = 40.0
"""Log odds against a piece as a wall where all that was heard lies along what the method knows, before the piece's
own evidence."""
KNOWN_SHARE: Final = 0.7
"""The odds are even where this share of it does: half-way between generated rooms and drives."""
UNKNOWN_M: Final = 10.0
"""So many metres count as known before anything is heard."""
