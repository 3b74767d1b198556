"""The memory under other circumstances: with further models, or from a recording that knew less.

Further models are further explanations. What is remembered of raw readings, walls and places stays as it is; what is
indexed by explanation moves to where the explanation is now, and asks the new ones in its turn.
"""

from __future__ import annotations

import numpy as np

from perception.bayes.state import (
    CYC,
    DIRTY,
    FREE,
    KIND,
    NUMBER,
    NUMBERED,
    REFS,
    ST,
    STAMP,
    STAMP_S,
    STAMPED,
    TRHO,
    Settings,
    State,
)
from perception.bayes.track_labels import POLYGON

SAME_M = 1e-9
NEWS = 4
"""A track whose radius has become a model's own counts so many readings as unseen, so that it is looked at."""


def inherit(s: State, before: Settings, after: Settings) -> State:
    """Return the memory for settings with further models; its arrays are those of `s` but for one.

    Parameters
    ----------
    s : State
        Updated: radii have other numbers.
    before, after : Settings
        Of the models in `after` the polygons of `before` are the first.
    """
    heir = np.abs(after.radii[None] - before.radii[:, None]).argmin(axis=1)
    circles = len(after.radii)
    comp = np.zeros((len(s.comp), circles + 2))
    for k, to in enumerate(heir.tolist()):
        comp[:, to] = s.comp[:, k]
    comp[:, circles:] = s.comp[:, -2:]
    taken_over = np.abs(after.radii[heir] - before.radii) > SAME_M
    for t in np.flatnonzero(s.ti[:, ST] != FREE).tolist():
        kind = int(s.ti[t, KIND])
        s.ti[t, KIND], s.ti[t, CYC] = heir[kind], 0
        if taken_over[kind]:  # a rival as near as this to a model is that model
            s.tf[t, TRHO] = after.radii[heir[kind]]
            s.ti[t, REFS], s.ti[t, DIRTY] = 0, s.ti[t, DIRTY] + NEWS
        comp[t, heir[kind]] = 0.0
    round_bars = s.barred[:, 3] < POLYGON
    s.barred[round_bars, 3] = heir[s.barred[round_bars, 3].astype(np.int64)]
    return s._replace(comp=comp)


def number_heirs(s: State) -> None:
    """Give numbers to what a recording of an older program had without: in the order in which it lies there."""
    if s.tally[NUMBERED] == 0:
        rows = np.flatnonzero(np.concatenate([s.ti[:, ST], s.pi[:, ST]]) != FREE)
        s.names[rows, NUMBER] = 1 + np.arange(len(rows))
        s.tally[NUMBERED] = len(rows)
    if s.tally[STAMPED] == 0:
        used = np.argwhere(np.arange(s.store.shape[1]) < s.fill[:, None])
        s.stamps[used[:, 0], used[:, 1], STAMP] = 1 + np.arange(len(used))
        s.stamps[used[:, 0], used[:, 1], STAMP_S] = np.nan
        s.tally[STAMPED] = len(used)
