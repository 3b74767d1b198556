"""Tracks as text: what was kept comes back whole, and no text that a file may hold reaches the memory unchecked."""

from __future__ import annotations

import base64
import zlib

import numpy as np
import pytest

from perception.bayes.memory.state import ESTABLISHED, FREE, TENTATIVE, Memory
from perception.bayes.tracks.kept_tracks import kept_track, kept_walls, restore_track, restore_walls
from perception.edits import ObjectRow
from perception.snapshot import bounds_of


class Owner:
    """Stands for the method, which has the memory under this name."""

    def __init__(self, memory: Memory) -> None:
        self.memory = memory


def row(kept: str, number: int = 3) -> ObjectRow:
    return ObjectRow(number, 0.0, 0.0, 0.0, confirmed=False, kept=kept)


@pytest.fixture
def memory() -> Memory:
    made = Memory(4, 8)
    made.state["objects_numbered"] = 5
    for field, value in {"status": ESTABLISHED, "number": 3, "x": 1.25, "hits": 40.0, "radius": 0.3}.items():
        made.circles[field][2] = value
    return made


@pytest.mark.parametrize("is_there", [True, False])
def test_a_track_comes_back_whole(memory: Memory, *, is_there: bool) -> None:
    before = memory.circles.copy()
    kept = kept_track(memory, 2)
    memory.circles["x"][2] = 9.0
    if not is_there:
        memory.circles["status"][2] = FREE
    assert restore_track(memory, row(kept), bounds_of(Owner(memory))) is None
    place = 2 if is_there else 0
    assert memory.circles[place] == before[2]


def test_of_two_maps_full_of_tracks_that_of_hypotheses_has_room(memory: Memory) -> None:
    kept, circles = kept_track(memory, 2), memory.circles
    circles["status"], circles["number"], circles["log_likelihood_ratio"] = ESTABLISHED, 4, np.arange(8)
    assert "no room to put object 3 back" in str(restore_track(memory, row(kept), bounds_of(Owner(memory))))
    circles["status"] = TENTATIVE
    assert restore_track(memory, row(kept), bounds_of(Owner(memory))) is None
    assert circles["number"].tolist() == [3, *7 * [4]], "in place of the one of the least evidence"


@pytest.mark.parametrize("field", ["kind", "status", "x", "hits", "radius"])
def test_a_number_out_of_its_bound_is_refused(memory: Memory, field: str) -> None:
    track = memory.circles[2:3].copy()
    track[field] = 10_000_000 if track[field].dtype.kind == "i" else np.nan
    text = f"circle:{base64.b64encode(zlib.compress(track.tobytes())).decode()}"
    before = memory.circles.copy()
    assert "cannot be put back" in str(restore_track(memory, row(text), bounds_of(Owner(memory))))
    assert (memory.circles == before).all()


def test_a_number_that_was_never_given_is_refused(memory: Memory) -> None:
    kept = kept_track(memory, 2)
    assert "cannot be put back" in str(restore_track(memory, row(kept, 4), bounds_of(Owner(memory))))
    memory.state["objects_numbered"] = 2
    assert "cannot be put back" in str(restore_track(memory, row(kept), bounds_of(Owner(memory))))


def with_wall(memory: Memory) -> Memory:
    wall = memory.state["room"]["walls"][0, 3]
    wall["weight"], wall["normal_x"], wall["spans"][0]["number"] = 12.5, 1.0, 4
    memory.state["room"]["remembered"]["x"][0, :50] = 2.0
    return memory


def test_walls_come_back_whole(memory: Memory) -> None:
    assert kept_walls(memory) == "", "there are none"
    room = with_wall(memory).state["room"].copy()
    kept = kept_walls(memory)
    memory.clear()
    assert restore_walls(memory, kept, bounds_of(Owner(memory))) is None
    assert (memory.state["room"] == room).all()


@pytest.mark.covered
@pytest.mark.parametrize(("field", "value"), [("weight", np.nan), ("span_count", 99), ("number", 6)])
def test_walls_with_a_number_out_of_its_bound_are_refused(memory: Memory, field: str, value: float) -> None:
    room = with_wall(memory).state["room"][0].copy()
    wall = room["walls"][3]
    (wall["spans"][1] if field == "number" else wall)[field] = value
    before = memory.state.copy()
    text = base64.b64encode(zlib.compress(room.tobytes())).decode()
    for bad in (text, text[:40], "!"):
        assert "cannot be put back" in str(restore_walls(memory, bad, bounds_of(Owner(memory))))
    assert memory.state.tobytes() == before.tobytes()
