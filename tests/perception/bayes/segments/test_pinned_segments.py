"""Pinned segments and deletion of segments against a plain dictionary of the map's contents."""

from __future__ import annotations

import numpy as np

from perception.bayes.inference.outline_map import bucket_index
from perception.bayes.memory.elements import BUCKET_CAPACITY, BUCKETS
from perception.bayes.memory.parameters import OUTLINE_CELL_M
from perception.bayes.memory.state import Memory
from perception.bayes.segments.pinned_segments import Pins, delete, places_of, restore
from perception.bayes.segments.segment_list import drawn, mapped_segments
from tests.perception.bayes.random_tracks import TRACKS, add_segment, examples


def listed(memory: Memory) -> dict[int, tuple[float, ...]]:
    """Return the mapped segments' middles and normals by number."""
    return {row[4]: row[:4] for row in mapped_segments(memory).tolist()}


def cells_of_eight_buckets() -> np.ndarray:
    """Return cells of the map that share eight buckets, shape (n, 2)."""
    cells = np.stack(np.meshgrid(np.arange(-200, 200), np.arange(-200, 200)), axis=-1).reshape(-1, 2)
    buckets = [bucket_index(x, y, BUCKETS) for x, y in cells.tolist()]
    return cells[np.array(buckets) < 8]


@examples(150, 2000)
def test_a_bucket_drops_its_oldest_segment_first_and_pinned_segments_are_restored(examples: int) -> None:
    rng, memory, pins, added = np.random.default_rng(5), Memory(4, TRACKS), Pins(), 0
    buckets = memory.state["buckets"][0]
    kept: dict[int, tuple[float, ...]] = {}
    cells = cells_of_eight_buckets()[rng.permutation(300)[:49]]  # so that cells take buckets from one another
    for _ in range(examples):
        turn = rng.random()
        present = list(listed(memory))
        assert len(set(present)) == len(mapped_segments(memory))
        some = tuple(int(n) for n in rng.choice(present, min(2, len(present)), replace=False)) if present else ()
        if turn < 0.7:
            added += 1
            place = (cells[rng.integers(len(cells))] + rng.uniform(0.1, 0.9, 2)) * OUTLINE_CELL_M
            add_segment(memory, np.array([*place, 1.0, 0.0]), added)
            pins.renew(memory)
        elif turn < 0.8:
            assert delete(memory, pins, (*some, 10**6)) == {10**6}
            assert set(listed(memory)) == set(present) - set(some)
            kept = {n: row for n, row in kept.items() if n not in some}
        elif turn < 0.9:
            missing, full = pins.add(memory, (*some, 10**6))
            assert missing == {10**6}
            for n in set(some) - full:
                ((k, j),) = places_of(memory, (n,)).tolist()
                kept[n] = buckets["segments"][k, j].item()[:4]
        elif kept:
            n = int(rng.choice(list(kept)))
            assert pins.remove((n, 10**6)) == {10**6}
            del kept[n]
        assert set(pins.numbers.tolist()) == set(kept)
        there = listed(memory)
        for n, row in kept.items():
            assert there[n] == row, "a pinned segment is in the map, unchanged"
        for k in np.flatnonzero(buckets["count"]).tolist():
            count = int(buckets["count"][k])
            held = min(count, BUCKET_CAPACITY)
            order = (count - held + np.arange(held)) % BUCKET_CAPACITY
            fresh = [n for n in buckets["segments"]["number"][k, order].tolist() if n not in kept]
            assert fresh == sorted(fresh), "a bucket drops its oldest segment first"
    assert added > 0.5 * examples
    assert np.count_nonzero(buckets["count"]) <= 8
    pins.clear()
    assert pins.count == 0


def test_deleted_segments_are_put_back_with_their_numbers_and_pins() -> None:
    memory, pins = Memory(4, TRACKS), Pins()
    places = np.random.default_rng(3).uniform(-20.0, 20.0, (60, 2))
    for n, (x, y) in enumerate(places, start=1):
        add_segment(memory, np.array([x, y, 0.6, 0.8]), n)
    memory.state["segments_numbered"] = len(places)
    assert pins.add(memory, (4, 9)) == (set(), set())
    before, held = listed(memory), mapped_segments(memory)
    rows = [
        (float(one["number"]), *ends, float(one["time_s"]), float(one["number"] in (4, 9)))
        for one, ends in zip(held, drawn(held).tolist(), strict=True)
    ]
    assert delete(memory, pins, range(1, 31)) == set()
    assert restore(memory, pins, rows) is None
    after = listed(memory)
    assert after.keys() == before.keys()
    assert all(np.allclose(after[n], before[n]) for n in before)
    assert sorted(pins.numbers.tolist()) == [4, 9]
    assert restore(memory, pins, rows) is None
    assert len(mapped_segments(memory)) == len(before), "none is there twice"
    assert "no segment ever had" in str(restore(memory, pins, [(61.0, *rows[0][1:])]))
