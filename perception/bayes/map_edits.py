"""What a person does to the Bayesian method's memory.

Edits are rare and come one by one: what needs no kernel is done here in plain arrays, once, and nothing of it is on
the way of an echo.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from perception.bayes.manual_tracks import leave_job, move_circle, move_polygon, place_circle, place_polygon
from perception.bayes.pinned_segments import Pins, delete
from perception.bayes.state import (
    BARRED,
    BARS,
    CONFIRMED,
    FREE,
    HK,
    KIND,
    LLR,
    MARK,
    MODEL,
    NUMBER,
    PLLR,
    PX,
    PY,
    ST,
    TRHO,
    TX,
    TY,
    Settings,
    State,
    clear,
)
from perception.bayes.track_initiation import EVIDENCE_MIN
from perception.bayes.track_labels import POLYGON
from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    Edit,
    MoveObject,
    PinSegments,
    PlaceModel,
    RejectObject,
    no_such_object,
    no_such_segments,
)

REJECTED_MAX: Final = 40.0
"""So much new evidence brings back whatever was rejected, nat: some ten good echoes, four times a birth's."""


def row_of(s: State, number: int) -> int | None:
    """Return the row of `State.names` of an object, None where there is none."""
    living = np.concatenate([s.ti[:, ST], s.pi[:, ST]]) != FREE
    found = np.flatnonzero(living & (s.names[:, NUMBER] == number))
    return int(found[0]) if len(found) else None


def edit_memory(
    s: State, p: Settings, pins: Pins, rounds: Sequence[str], outlines: Sequence[str], edit: Edit
) -> str | None:
    """Do what a person says; return None, or why it cannot be done.

    Parameters
    ----------
    s, p, pins
        Memory, updated, and settings.
    rounds, outlines : sequence of str
        Names of the round models and of the polygons, in the order of their numbers.
    edit : Edit
        What is to be done.
    """
    match edit:
        case DeleteSegments(numbers):
            missing = delete(s, pins, numbers)
            return no_such_segments(missing) if missing else None
        case PinSegments(numbers, pinned):
            return _pin(s, pins, numbers, pinned=pinned)
        case PlaceModel():
            return _place(s, p, rounds, outlines, edit)
        case ClearMap():
            clear(s)
            pins.clear()
            return None
    row = row_of(s, edit.object)
    if row is None:
        return no_such_object(edit.object)
    match edit:
        case MoveObject(_, x, y, theta):
            if row < len(s.ti):
                move_circle(s, p, row, x, y, heard_last(s))
            else:
                move_polygon(s, p, row - len(s.ti), x, y, theta)
        case ConfirmObject(number):
            if row < len(s.ti) and s.ti[row, KIND] >= p.models:
                return f"object {number} looks like none of the models: place the one that it is there"
            s.names[row, MARK] |= CONFIRMED
        case RejectObject():
            _reject(s, p, row)
    return None


def heard_last(s: State) -> float:
    """Return the time of the newest reading, s."""
    return float(s.hist[:, :, 5].max())


def _pin(s: State, pins: Pins, numbers: Sequence[int], *, pinned: bool) -> str | None:
    if not pinned:
        missing = pins.remove(numbers)
        return no_such_segments(missing) if missing else None
    missing, full = pins.add(s, numbers)
    if full:
        return f"{len(full)} of these segments cannot be pinned: too many are, there or altogether; the others are"
    return no_such_segments(missing) if missing else None


def _place(
    s: State, p: Settings, rounds: Sequence[str], outlines: Sequence[str], edit: PlaceModel
) -> str | None:  # fmt: skip
    if edit.model in outlines:
        t = place_polygon(s, p, outlines.index(edit.model), edit.x, edit.y, edit.theta)
    elif edit.model in rounds:
        t = place_circle(s, p, rounds.index(edit.model), edit.x, edit.y, heard_last(s))
    else:
        return f"no model is called {edit.model}: load it first"
    return None if t >= 0 else "as many objects are known as there is room for: reject one first"


def _reject(s: State, p: Settings, row: int) -> None:
    """Let a track go, forget the readings that ended at it, and bar its place to the like of it."""
    t = row - len(s.ti)
    if t < 0:
        x, y, reach = float(s.tf[row, TX]), float(s.tf[row, TY]), float(s.tf[row, TRHO])
        what, said = int(s.ti[row, KIND]), float(s.tf[row, LLR])
        forget_hits(s, p, x, y, reach, reach)
        reach = max(reach, p.merge)
        s.ti[row, ST] = FREE
    else:
        leave_job(s, t)
        model = int(s.pi[t, MODEL])
        x, y, reach = float(s.pf[t, PX]), float(s.pf[t, PY]), float(p.inner[model])
        what, said = POLYGON + model, float(s.pf[t, PLLR])
        forget_hits(s, p, x, y, reach, float(p.bound[model]))
        s.pi[t, ST] = FREE
    s.names[row, MARK] = 0
    s.barred[s.tally[BARS] % BARRED] = (x, y, reach, what, min(max(said, EVIDENCE_MIN), REJECTED_MAX))
    s.tally[BARS] += 1


def forget_hits(s: State, p: Settings, x: float, y: float, inner: float, outer: float) -> None:
    """Take the readings out of the sensors' memory that ended between two circles about (x, y), or near either."""
    for i in range(len(s.hist)):
        held = min(int(s.hn[i]), HK)
        rows = s.hist[i, (int(s.hn[i]) - held + np.arange(held)) % HK]
        dx, dy = x - rows[:, 0], y - rows[:, 1]
        d = np.hypot(dx, dy)
        slack = math.sin(p.half_angle) * d + outer
        in_beam = (dx * rows[:, 2] + dy * rows[:, 3] > 0.0) & (np.abs(dx * rows[:, 3] - dy * rows[:, 2]) < slack)
        hit = in_beam & (rows[:, 4] > d - outer - p.gate) & (rows[:, 4] < d - inner + p.gate)
        left = rows[~hit]
        s.hist[i, : len(left)] = left
        s.hn[i] = len(left)
