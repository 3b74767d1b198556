"""User edits of the Bayesian method's memory.

Edits are rare and come one at a time. What needs no kernel is done here in plain arrays; the processing of a firing
does not depend on it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from perception.bayes.memory.elements import HISTORY, REJECTIONS_MAX
from perception.bayes.memory.parameters import CIRCLE_EVIDENCE_MIN_NAT, REJECTED_MAX_NAT
from perception.bayes.memory.scratch import POLYGON
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import CONFIRMED, FREE, Memory
from perception.bayes.segments.pinned_segments import Pins, delete, restore
from perception.bayes.tracks.manual_tracks import leave_job, move_circle, move_polygon, place_circle, place_polygon
from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    MemoryEdit,
    MoveObject,
    ObjectEdit,
    PinSegments,
    PlaceModel,
    RemoveObject,
    RestoreSegments,
    WithdrawConfirmation,
    WithdrawPlacement,
    no_such_object,
    no_such_segments,
)


def row_of(memory: Memory, number: int) -> int | None:
    """Return the row of an object, circles first, then polygons; None for an unknown number."""
    status, numbers = (np.concatenate([memory.circles[f], memory.polygons[f]]) for f in ("status", "number"))
    found = np.flatnonzero((status != FREE) & (numbers == number))
    return int(found[0]) if len(found) else None


def edit_memory(
    memory: Memory, p: SettingsRecord, pins: Pins, rounds: Sequence[str], outlines: Sequence[str], edit: MemoryEdit
) -> str | None:
    """Apply a user's edit; return None, or the reason why it cannot be done.

    Parameters
    ----------
    memory, p, pins
        Memory, updated, and settings.
    rounds, outlines : sequence of str
        Names of the round models and of the polygons, in the order of their numbers.
    edit : MemoryEdit
        The edit.
    """
    match edit:
        case DeleteSegments(numbers):
            missing = delete(memory, pins, numbers)
            return no_such_segments(missing) if missing else None
        case RestoreSegments(rows):
            return restore(memory, pins, rows)
        case PinSegments(numbers, pinned):
            return _pin(memory, pins, numbers, pinned=pinned)
        case PlaceModel():
            return _place(memory, p, rounds, outlines, edit)
        case ClearMap():
            memory.clear()
            pins.clear()
            return None
    row = row_of(memory, edit.object)
    return no_such_object(edit.object) if row is None else _edit_object(memory, p, row, edit)


def _edit_object(memory: Memory, p: SettingsRecord, row: int, edit: ObjectEdit) -> str | None:
    """Apply an edit of the object in a row, circles first, then polygons; return why it cannot be done, or None."""
    t = row - len(memory.circles)
    if isinstance(edit, MoveObject | ConfirmObject) and t < 0 and memory.circles["kind"][row] >= p[0].model_count:
        return f"object {edit.object} matches no model: place the right model there instead"
    match edit:
        case MoveObject(_, x, y, theta):
            if t < 0:
                move_circle(memory.s, memory.tracks, p, row, x, y)
            else:
                move_polygon(memory.s, p, t, x, y, theta)
        case ConfirmObject():
            (memory.circles if t < 0 else memory.polygons)["marks"][t if t >= 0 else row] |= CONFIRMED
        case WithdrawConfirmation():
            (memory.circles if t < 0 else memory.polygons)["marks"][t if t >= 0 else row] &= ~CONFIRMED
        case RemoveObject():
            _reject(memory, p, row)
        case WithdrawPlacement():
            if t >= 0:
                leave_job(memory.s, t)
            for field in ("status", "marks"):
                (memory.circles if t < 0 else memory.polygons)[field][row if t < 0 else t] = 0
    return None


def _pin(memory: Memory, pins: Pins, numbers: Sequence[int], *, pinned: bool) -> str | None:
    """Pin or unpin segments; of several, what can be done is done. Return why the rest cannot be, or None."""
    if not pinned:
        missing = pins.remove(numbers)
        return no_such_segments(missing) if missing else None
    missing, full = pins.add(memory, numbers)
    if full:
        return (
            f"{len(full)} of {len(numbers)} segments could not be pinned: too many are pinned already, in that place "
            "or in the whole map; unpin some first"
        )
    return no_such_segments(missing) if missing else None


def _place(
    memory: Memory, p: SettingsRecord, rounds: Sequence[str], outlines: Sequence[str], edit: PlaceModel
) -> str | None:  # fmt: skip
    """Start a track of a model where the user places it; return why that is impossible, or None."""
    if edit.model in outlines:
        t = place_polygon(memory.s, p, outlines.index(edit.model), edit.x, edit.y, edit.theta)
    elif edit.model in rounds:
        t = place_circle(memory.s, memory.tracks, p, rounds.index(edit.model), edit.x, edit.y)
    else:
        return f"no model is called {edit.model}: load it first"
    return None if t >= 0 else "no room for another object: reject one first"


def _reject(memory: Memory, p: SettingsRecord, row: int) -> None:
    """Free a track, forget the readings that ended at it, and prevent a like one from starting in its place."""
    t = row - len(memory.circles)
    track = memory.tracks[row] if t < 0 else memory.s[0].polygons[t]
    x, y, evidence = float(track.x), float(track.y), float(track.log_likelihood_ratio)
    if t < 0:
        what, radius = int(memory.tracks[row].kind), float(memory.tracks[row].radius)
        forget_hits(memory, p, x, y, radius, radius)
        radius = max(radius, float(p[0].merge_m))
    else:
        leave_job(memory.s, t)
        model = int(memory.s[0].polygons[t].model)
        outline = p[0].polygons[model]
        what, radius = POLYGON + model, float(outline.inner_radius_m)
        forget_hits(memory, p, x, y, radius, float(outline.outer_radius_m))
    track.status = FREE
    track.marks = 0
    state = memory.state
    rejection = memory.s[0].rejections[int(state["rejection_count"][0]) % REJECTIONS_MAX]
    rejection.x, rejection.y, rejection.radius, rejection.what = x, y, radius, what
    rejection.evidence_nat = min(max(evidence, CIRCLE_EVIDENCE_MIN_NAT), REJECTED_MAX_NAT)
    state["rejection_count"] += 1


def forget_hits(memory: Memory, p: SettingsRecord, x: float, y: float, inner: float, outer: float) -> None:
    """Delete the remembered readings that ended between two circles about (x, y), or near either circle.

    Parameters
    ----------
    memory, p
        Memory, updated, and settings.
    x, y : float
        Centre, m.
    inner, outer : float
        Radii of the circles, m.
    """
    half_angle, gate = float(p[0].half_angle_rad), float(p[0].gate_m)
    sensors = memory.state["sensors"][0]
    for i in range(int(memory.state["sensor_count"][0])):
        kept = int(sensors["kept"][i])
        held = min(kept, HISTORY)
        order = (kept - held + np.arange(held)) % HISTORY
        rows, times = sensors["history"][i, order], sensors["times_s"][i, order]
        dx, dy = x - rows["x"], y - rows["y"]
        axis_x, axis_y, r = rows["axis_x"], rows["axis_y"], rows["range_m"]
        d = np.hypot(dx, dy)
        slack = math.sin(half_angle) * d + outer
        in_beam = (dx * axis_x + dy * axis_y > 0.0) & (np.abs(dx * axis_y - dy * axis_x) < slack)
        left = ~(in_beam & (r > d - outer - gate) & (r < d - inner + gate))
        count = int(np.count_nonzero(left))
        sensors["history"][i, :count] = rows[left]
        sensors["times_s"][i, :count] = times[left]
        sensors["kept"][i] = count
