"""A user's edits of the memory: pinning, placing, confirming, rejecting, and the reasons of refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.elements import HISTORY
from perception.bayes.memory.parameters import REJECTED_MAX_NAT
from perception.bayes.memory.scratch import POLYGON
from perception.bayes.memory.state import CONFIRMED, ESTABLISHED, FREE, PLACED, Memory
from perception.bayes.segments.pinned_segments import Pins
from perception.bayes.tracks.map_edits import edit_memory, forget_hits, row_of
from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    MemoryEdit,
    MoveObject,
    PinSegments,
    PlaceModel,
    RemoveObject,
)
from perception.shared_numbers import FAR
from tests.perception.bayes import box_readings
from tests.perception.bayes.random_tracks import (
    RADII,
    SENSORS,
    TRACKS,
    P,
    add_segment,
    around,
    history,
    new_memory,
)


def edit(memory: Memory, change: MemoryEdit, pins: Pins | None = None) -> str | None:
    """Apply an edit with the drum and the box as models."""
    settings = box_readings.P
    return edit_memory(memory, settings, pins or Pins(), ["semicircle"], ["box"], change)


def test_the_last_places_of_a_bucket_cannot_be_pinned_and_the_user_is_warned() -> None:
    memory, pins = Memory(4, TRACKS), Pins()
    for number in range(1, 9):
        add_segment(memory, np.array([0.1, 0.1, 1.0, 0.0]), number)
    refused = edit_memory(memory, P, pins, (), (), PinSegments(tuple(range(1, 9)), pinned=True))
    assert refused is not None
    assert refused.startswith("2 of 8 segments could not be pinned")
    assert pins.count == 6


def test_placed_moved_confirmed_and_rejected_objects_are_found_by_their_number() -> None:
    memory = new_memory()
    assert edit(memory, PlaceModel("semicircle", 1.0, 0.0, 0.0)) is None
    assert edit(memory, PlaceModel("box", -1.0, 0.0, 0.2)) is None
    assert (row_of(memory, 1), row_of(memory, 2), row_of(memory, 3)) == (0, TRACKS, None)
    assert edit(memory, MoveObject(1, 1.1, 0.1, 0.0)) is None
    assert edit(memory, MoveObject(2, -1.1, 0.1, 0.3)) is None
    circle, box = memory.tracks[0], memory.s[0].polygons[0]
    assert (circle.x, circle.y) == (1.1, 0.1)
    assert (box.x, box.y, box.heading) == (-1.1, 0.1, 0.3)
    for number, track in ((1, circle), (2, box)):
        assert edit(memory, ConfirmObject(number)) is None
        assert track.marks == CONFIRMED | PLACED
        assert edit(memory, RemoveObject(number)) is None
        assert (track.status, track.marks) == (FREE, 0)
        assert row_of(memory, number) is None
    rejected = memory.state["rejections"][0, :2]
    assert memory.state["rejection_count"][0] == 2
    assert rejected["what"].tolist() == [0, POLYGON]
    assert rejected["x"].tolist() == [1.1, -1.1]


@pytest.mark.parametrize(("evidence_nat", "kept_nat"), [(3.0, 10.0), (25.0, 25.0), (500.0, REJECTED_MAX_NAT)])
def test_a_rejection_keeps_the_evidence_within_bounds(evidence_nat: float, kept_nat: float) -> None:
    memory = new_memory()
    track = memory.tracks[0]
    track.status, track.number, track.radius, track.log_likelihood_ratio = ESTABLISHED, 1, RADII[0], evidence_nat
    assert edit(memory, RemoveObject(1)) is None
    assert memory.state["rejections"][0, 0].item()[2:] == (max(RADII[0], P[0].merge_m), 0, kept_nat)


def test_what_cannot_be_edited_is_refused_with_a_reason() -> None:
    memory = new_memory()
    refused: dict[str, MemoryEdit] = {
        "no model is called keg": PlaceModel("keg", 0.0, 0.0, 0.0),
        "7": RemoveObject(7),
        "9": DeleteSegments((9,)),
        "8": PinSegments((8,), pinned=True),
        "5": PinSegments((5,), pinned=False),
    }
    for reason, change in refused.items():
        assert reason in (edit(memory, change) or "")
    track = memory.tracks[0]
    track.status, track.kind, track.number = ESTABLISHED, int(P[0].model_count), 1
    for change in (ConfirmObject(1), MoveObject(1, 1.0, 0.0, 0.0)):  # marked, it would be reported as a model
        assert (edit(memory, change) or "").startswith("object 1 matches no model")
    memory.circles["status"], memory.circles["marks"] = ESTABLISHED, CONFIRMED
    assert (edit(memory, PlaceModel("semicircle", 0.0, 0.0, 0.0)) or "").startswith("no room for another object")


def test_a_cleared_map_has_no_segments_objects_or_pins() -> None:
    memory, pins = new_memory(), Pins()
    add_segment(memory, np.array([0.1, 0.1, 1.0, 0.0]), 1)
    assert edit(memory, PinSegments((1,), pinned=True), pins) is None
    assert edit(memory, PlaceModel("semicircle", 1.0, 0.0, 0.0), pins) is None
    assert edit(memory, ClearMap(), pins) is None
    assert (pins.count, int(memory.state["buckets"]["count"].sum())) == (0, 0)
    assert not memory.circles["status"].any()
    assert memory.state["objects_numbered"][0] == 1, "numbers are never reused"


def test_readings_that_ended_at_a_rejected_object_are_forgotten_and_others_keep_their_order() -> None:
    rng, memory = np.random.default_rng(6), Memory(SENSORS, TRACKS)
    inner, outer, gate = 0.2, 0.3, float(P[0].gate_m)
    forgotten = 0
    for i in range(SENSORS):
        count = int(rng.integers(0, 2 * HISTORY))
        memory.s[0].sensors[i].kept = count
        rows = history(memory, i)
        rows[...] = around(rng, HISTORY, np.array([0.5, 0.0]), 0.25)
        memory.state["sensors"]["times_s"][0, i] = np.arange(HISTORY)
        held = min(count, HISTORY)
        order = [(count - held + j) % HISTORY for j in range(held)]
        kept = []
        for j in order:
            x, y, ux, uy, r = rows[j].tolist()
            to = complex(0.5 - x, -y)
            along, across = (to * complex(ux, -uy)).real, abs((to * complex(ux, -uy)).imag)
            is_heard = along > 0.0 and across < math.sin(P[0].half_angle_rad) * abs(to) + outer
            if not (is_heard and abs(to) - outer - gate < r < abs(to) - inner + gate and r < FAR):
                kept.append((*rows[j].tolist(), float(j)))
        forget_hits(memory, P, 0.5, 0.0, inner, outer)
        sensor = memory.state["sensors"][0, i]
        assert sensor["kept"] == len(kept)
        mine = np.column_stack([history(memory, i), sensor["times_s"]])[: len(kept)]
        assert mine.tolist() == [list(row) for row in kept]
        forgotten += held - len(kept)
    assert forgotten > SENSORS
