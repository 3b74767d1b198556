"""Tracks as text: what was kept comes back whole, and no text that a file may hold reaches the memory unchecked."""

from __future__ import annotations

import base64
import zlib

import numpy as np
import pytest

from perception.bayes.memory.state import ESTABLISHED, FREE, Memory
from perception.bayes.tracks.kept_tracks import kept_track, restore_track
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
