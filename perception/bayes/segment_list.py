"""The outline map as others get to see it: in the order of its buckets, copies all of it."""

from __future__ import annotations

from typing import Final

import numpy as np

from perception.bayes.state import STAMP, STAMP_S, State
from perception.kernel import Floats, Ints

DRAWN_M: Final = 0.1
"""Length at which a mapped segment is shown; the map keeps its middle and normal."""


def listed(s: State) -> tuple[Ints, Floats, Floats]:
    """Return the numbers, times (s), and middles and normals (n, 4) of the segments in the map."""
    # Of thousands of buckets a hundred are in use, and this is asked for between two cycles.
    buckets = np.flatnonzero(s.fill)
    used = np.arange(s.store.shape[1]) < s.fill[buckets, None]
    stamps = s.stamps[buckets][used]
    return stamps[:, STAMP].astype(np.int64), stamps[:, STAMP_S], s.store[buckets][used]


def drawn(rows: Floats) -> Floats:
    """Return ends x, y, x, y (m) and normal (rad), shape (n, 5), of middles and normals, shape (n, 4)."""
    ends = np.empty((len(rows), 5))
    along_x, along_y = -0.5 * DRAWN_M * rows[:, 3], 0.5 * DRAWN_M * rows[:, 2]
    ends[:, 0], ends[:, 1] = rows[:, 0] - along_x, rows[:, 1] - along_y
    ends[:, 2], ends[:, 3] = rows[:, 0] + along_x, rows[:, 1] + along_y
    np.arctan2(rows[:, 3], rows[:, 2], out=ends[:, 4])
    return ends
